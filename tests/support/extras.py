"""The extras of GWRMS: the packages that each brings, and what is imported of them."""

import functools
import importlib.metadata
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT: Final = Path(__file__).parents[2]
PROJECT: Final = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: Final[dict[str, list[str]]] = {
    name: wanted for name, wanted in PROJECT["optional-dependencies"].items() if name != "dev"
}
NEVER: Final = {"Shiboken", "_duckdb", "adbc_driver_duckdb"}  # they come along, and we do not import them


def names(requirements: Iterable[str]) -> set[str]:
    """The packages that are named."""
    return {canonicalize_name(Requirement(one).name) for one in requirements}


def own(extra: str) -> set[str]:
    """The packages that an extra names itself."""
    return names(EXTRAS[extra]) - {"gwrms"}


def brought(extra: str | None) -> set[str]:
    """Every package that comes with GWRMS and this extra, also by way of others."""
    return needed([*PROJECT["dependencies"], *(EXTRAS[extra] if extra is not None else ())])


def needed(requirements: Iterable[str]) -> set[str]:
    """Every package that these name, and those that they need."""
    wanted, found = list(requirements), set[str]()
    while wanted:
        one = Requirement(wanted.pop())
        name = canonicalize_name(one.name)
        if name == "gwrms":
            wanted += [each for named in one.extras for each in EXTRAS[named]]
        elif name not in found and (one.marker is None or one.marker.evaluate()):
            found.add(name)
            wanted += _required(name, one.extras)
    return found


def _required(name: str, extras: Iterable[str]) -> list[str]:
    said = importlib.metadata.requires(name) or []
    chosen = [{"extra": extra} for extra in (*extras, "")]
    parsed = [Requirement(one) for one in said]
    return [
        str(one) for one in parsed if one.marker is None or any(one.marker.evaluate(each) for each in chosen)
    ]


@functools.cache
def distributions() -> Mapping[str, list[str]]:
    """Of each name that can be imported, which packages bring it; to find out takes most of a second."""
    return importlib.metadata.packages_distributions()


def imported(packages: set[str]) -> set[str]:
    """The names by which we import what is in these packages."""
    found = distributions()
    return {name for name, of in found.items() if packages & set(map(canonicalize_name, of))} - NEVER
