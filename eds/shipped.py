"""Search for EDS files: beside the robot's file, and among the shipped ones."""

import difflib
from pathlib import Path

from eds.description import EdsError

SHIPPED = Path(__file__).parent / "files"


def shipped() -> tuple[str, ...]:
    """Return names of the files that ship."""
    return _files(SHIPPED)


def locate(name: str, beside: Path | None) -> Path:
    """Find the file `name`: absolute, relative to the folder of `beside`, or one that ships.

    Raises `EdsError` where it is nowhere; the message says where was looked, and what was likely meant.
    """
    places = [*([] if beside is None else [beside.parent]), SHIPPED]
    for folder in places:
        path = folder / name
        if path.is_file():
            return path
    looked = " and ".join(str(folder) for folder in places)
    close = difflib.get_close_matches(name, [each for folder in places for each in _files(folder)], n=1)
    meant = f": did you mean {close[0]!r}?" if close else ";"
    raise EdsError(
        f"there is no EDS file {name!r} in {looked}{meant} shipped are: {', '.join(shipped()) or 'none'}"
    )


def _files(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.name for path in folder.glob("*") if path.suffix.lower() in (".eds", ".dcf")))
