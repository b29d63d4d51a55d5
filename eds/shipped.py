"""Where EDS files are: beside the robot's file, or among those that ship with GWRMS."""

from pathlib import Path

from eds.description import EdsError

SHIPPED = Path(__file__).parent / "files"


def shipped() -> tuple[str, ...]:
    """Names of the files that ship."""
    return tuple(sorted(path.name for path in SHIPPED.glob("*") if path.suffix.lower() in (".eds", ".dcf")))


def locate(name: str, beside: Path | None) -> Path:
    """Find the file `name`: absolute, relative to the folder of `beside`, or one that ships.

    Raises `EdsError` where it is nowhere; the message says where was looked.
    """
    places = [] if beside is None else [beside.parent]
    for folder in [*places, SHIPPED]:
        path = folder / name
        if path.is_file():
            return path
    looked = " and ".join(str(folder) for folder in [*places, SHIPPED])
    raise EdsError(
        f"there is no EDS file {name!r} in {looked}; shipped are: {', '.join(shipped()) or 'none'}"
    )
