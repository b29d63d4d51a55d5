"""What `gwrms check` says of a robot's file: of its tables, of files beside it, and of this computer."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gateway.config.reading import examined
from gateway.tables.finding import Told, told


def findings(file: Path, tables: Mapping[str, Any], *, machine: bool) -> Iterator[Told]:
    """All of that; files and computer are looked at where the tables can be used."""
    found = examined(file, tables)
    yield from told(found.findings)
    if found.config is None:
        return
    from gateway.surroundings import beside, here  # needs what drives and EDS files need

    yield from told(beside(found.config))
    if machine:
        yield from told(here(found.config))
