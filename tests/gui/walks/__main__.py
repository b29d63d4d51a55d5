"""`python -m tests.gui.walks FOLDER [WALK …]`: walks, with a picture of each moment in FOLDER.

`python -m tests.gui.walks docs/pictures --docs` draws the pictures of the docs, in about three minutes.
"""

import argparse
import shutil
import sys
import tempfile
import traceback
from pathlib import Path

from tests.gui.walks.walk import Screen
from tests.gui.walks.walks import IN_DOCS, PICTURES, WALKS, Walk


def walk(chosen: Walk, screen: Screen, pictures: Path) -> list[str]:
    """What went wrong: moments that did not show what they must, and rules that a picture breaks."""
    found = []
    with (
        tempfile.TemporaryDirectory(prefix="gwrms-walk-") as folder,
        chosen.made(screen, Path(folder), pictures) as there,
    ):
        for moment in chosen.moments:
            try:
                moment(there)
            except (AssertionError, ConnectionError):
                found.append(f"{moment.__name__}: {traceback.format_exc(limit=-4)}")
                there.hand.keep(f"{moment.__name__}-failed")
        found += there.hand.wrong
    return found


def draw(folder: Path) -> list[str]:
    """Draw the pictures of the docs anew; what went wrong: then a picture stays as it was."""
    with tempfile.TemporaryDirectory(prefix="gwrms-pictures-") as kept:
        wrong = walk(IN_DOCS, Screen(1480, 900), Path(kept))
        for picture in sorted(Path(kept).glob("*.png")):
            if (name := PICTURES.get(picture.stem.partition("-")[2])) is not None:
                shutil.copy(picture, folder / f"window-{name}.png")
    return wrong


def main() -> int:
    """Walk, and say what was wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.gui.walks")
    parser.add_argument("folder", type=Path)
    parser.add_argument("walks", nargs="*", metavar="WALK", choices=(*WALKS, []), default=[])
    parser.add_argument("--screen", default="1366x768")
    parser.add_argument("--scale", type=int, default=100)
    parser.add_argument("--look", choices=("dark", "light"), default="dark")
    parser.add_argument("--docs", action="store_true", help="draw window-*.png of the docs into FOLDER")
    asked = parser.parse_args()
    width, _, height = asked.screen.partition("x")
    screen = Screen(int(width), int(height), asked.scale, asked.look)
    wrong = draw(asked.folder) if asked.docs else []
    for name in () if asked.docs else asked.walks or WALKS:
        wrong += [f"{name}: {one}" for one in walk(WALKS[name], screen, asked.folder / screen.name / name)]
    sys.stdout.write("\n".join((*wrong, f"{len(wrong)} wrong", "")))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
