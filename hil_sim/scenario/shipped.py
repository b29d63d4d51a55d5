"""Search for scenario files: as named, and among the shipped ones."""

from pathlib import Path
from typing import Final

from hil_sim.scenario.table import ScenarioError, meant

_INSTALLED: Final = Path(__file__).parents[1] / "scenarios"
_WORKING_COPY: Final = Path(__file__).parents[2] / "scenarios"


def shipped() -> tuple[str, ...]:
    """Return names of the scenarios that ship."""
    return tuple(sorted(file.stem for file in _folder().glob("*.toml")))


def locate(file: Path) -> Path:
    """Return the file, or the scenario that ships by this name.

    Raises `ScenarioError` where there is neither.
    """
    ours = _folder() / f"{file.stem}.toml"
    if file.exists():
        return file
    if str(file) in (ours.stem, ours.name) and ours.is_file():
        return ours
    names = shipped()
    raise ScenarioError(
        f"{file}: there is no such file, and no scenario of this name ships. "
        f"{meant(file.stem, names)}Those that ship are {', '.join(names)}"
    )


def _folder() -> Path:
    return _INSTALLED if _INSTALLED.is_dir() else _WORKING_COPY
