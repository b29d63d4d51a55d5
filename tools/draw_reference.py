"""Draws the reference, and what is packaged of it: `python -m tools.draw_reference [--check]`.

With `--check` nothing is written; exit status 1 names the files that are not what would be drawn.
"""

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

from tools.draw import commands, packaged, robot_file, schemas, server_file, wire

ROOT: Final = Path(__file__).parents[1]
FILES: Final[Mapping[str, Callable[[], str]]] = {
    **{f"docs/reference/{page.PAGE}": page.draw for page in (robot_file, server_file, wire, commands)},
    **{f"docs/reference/{kind}.schema.json": partial(schemas.draw, kind) for kind in schemas.SCHEMAS},
    **{f"gateway/drawn/{name}": draw for name, draw in packaged.PAGES.items()},
}


def stale() -> list[str]:
    """Return the files that are not what would be drawn."""
    return [name for name, draw in FILES.items() if _held(name) != draw()]


def write() -> list[str]:
    """Draw every file anew; which have changed."""
    changed = stale()
    for name in changed:
        (ROOT / name).write_text(FILES[name](), encoding="utf-8")
    return changed


def main(argv: list[str]) -> int:
    """Draw, or check."""
    check = argv == ["--check"]
    found = stale() if check else write()
    for name in found:
        said = "is not up to date; run ./dev docs" if check else "is regenerated"
        sys.stderr.write(f"{name} {said}\n")
    return int(check and bool(found))


def _held(name: str) -> str:
    page = ROOT / name
    return page.read_text(encoding="utf-8") if page.exists() else ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
