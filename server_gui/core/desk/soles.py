"""Where the cells of an insole are: a robot tells how many it has, the layouts that ship tell where."""

import tomllib
from functools import cache
from importlib import resources
from typing import Final

Cell = tuple[float, float]  # x forward from the heel, y left, m

SHIPPED: Final = "drivers.insole"  # its folder `layouts` is data, one TOML file a layout
NAMES: Final = {3: "insole-3", 8: "insole-8", 16: "insole-16", 18: "insole-18", 35: "insole-35"}


def cells_of(count: int, *, right: bool) -> tuple[Cell, ...] | None:
    """Where so many cells are on a left or right foot; None where no layout has as many."""
    left = _left_cells(count)
    if left is None:
        return None
    return tuple((x, -y) for x, y in left) if right else left


def layout_name(count: int) -> str | None:
    """The layout that is taken for so many cells."""
    return NAMES.get(count)


@cache
def _left_cells(count: int) -> tuple[Cell, ...] | None:
    name = NAMES.get(count)
    if name is None:
        return None
    file = resources.files(SHIPPED) / "layouts" / f"{name}.toml"
    layout = tomllib.loads(file.read_text(encoding="utf-8"))
    side = -1.0 if layout.get("foot") == "right" else 1.0
    return tuple((float(x), side * float(y)) for x, y, _ in layout["cells"])
