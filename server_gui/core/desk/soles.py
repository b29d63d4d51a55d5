"""Where the cells of an insole are: as the robot describes them, or else by a shipped layout of as many."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Final

from gateway.wire.component import LayoutInfo
from server_gui.core.follow.robot import Robot

Cell = tuple[float, float]  # x forward from the heel, y left, m

SHIPPED: Final = "drivers.insole"  # its folder `layouts` is data, one TOML file a layout
NAMES: Final = {3: "insole-3", 8: "insole-8", 16: "insole-16", 18: "insole-18", 35: "insole-35"}
ORDER: Final = "in their order: the robot does not say where they are, and no layout that ships has so many"


SIDES: Final = ("left", "right")
LEAST_N: Final = 20.0  # of both feet: with less nobody stands on them


@dataclass(frozen=True, slots=True)
class Sole:
    """One foot: how many cells, where each is (None: nobody knows), and in words how that is known."""

    count: int = 0
    cells: tuple[Cell, ...] | None = None
    source: str = "no insole"


def sole(robot: Robot, side: str) -> Sole:
    """Return the cells of the insole of one side."""
    component = f"{side}_insole"
    count = 0
    while f"{component}.cell_{count}" in robot.values:
        count += 1
    if not count:
        return Sole()
    layout = _described(robot, component)
    if layout is not None and len(layout.cells) == count:
        return Sole(count, tuple((x, y) for x, y, _ in layout.cells), f"{count} cells, {layout.name}")
    cells = cells_of(count, right=side == "right")
    source = ORDER if cells is None else f"placed as {NAMES[count]}: the robot does not say where they are"
    return Sole(count, cells, f"{count} cells {source}")


@dataclass(frozen=True, slots=True)
class Load:
    """What one foot carries: N, its share of both (0–1), and in words why that is not known."""

    force: float | None
    share: float | None
    problem: str = ""


def loads(robot: Robot) -> dict[str, Load]:
    """Return what each foot carries; a share only where both are known, and something is carried."""
    forces = {side: robot.values.get(f"{side}_insole.force") for side in SIDES}
    known = [force for force in forces.values() if force is not None]
    total = sum(known) if len(known) == len(SIDES) else 0.0
    return {
        side: Load(
            force, force / total if force is not None and total >= LEAST_N else None, _problem(robot, side)
        )
        for side, force in forces.items()
    }


def _problem(robot: Robot, side: str) -> str:
    part = robot.parts.get(f"{side}_insole")
    if part is None:
        return "no insole"
    return "" if part.state == "ok" else f"insole {part.state}"


def cells_of(count: int, *, right: bool) -> tuple[Cell, ...] | None:
    """Return where so many cells are on a foot by the layouts that ship; None where none has as many."""
    left = _left_cells(count)
    if left is None:
        return None
    return tuple((x, -y) for x, y in left) if right else left


def _described(robot: Robot, component: str) -> LayoutInfo | None:
    parts = [] if robot.description is None else robot.description.components
    layouts = (part.layout for part in parts if part.name == component)
    return next((layout for layout in layouts if isinstance(layout, LayoutInfo)), None)


@cache
def _left_cells(count: int) -> tuple[Cell, ...] | None:
    name = NAMES.get(count)
    if name is None:
        return None
    file = resources.files(SHIPPED) / "layouts" / f"{name}.toml"
    layout = tomllib.loads(file.read_text(encoding="utf-8"))
    side = -1.0 if layout.get("foot") == "right" else 1.0
    return tuple((float(x), side * float(y)) for x, y, _ in layout["cells"])
