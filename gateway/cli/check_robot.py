"""`gwrms check` of a robot's file: its tables, the files beside it, and this computer."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gateway.config.reading import examined
from gateway.config.usable_parts import remains
from gateway.tables.finding import Told, mistakes, told


def findings(file: Path, tables: Mapping[str, Any], *, machine: bool) -> Iterator[Told]:
    """Yield all of that; where tables have mistakes, as far as what is right can be looked at."""
    found = examined(file, tables)
    yield from told(found.findings)
    config = found.config or found.rest
    if config is None:
        return
    from gateway.prerequisites import beside, here  # needs what drives and EDS files need

    wrong = mistakes(found.findings)
    yield from told(beside(remains(config, wrong) if wrong else config))
    if machine:
        known = {(one.where, one.key) for one in wrong}
        yield from told(one for one in here(config) if (one.where, one.key) not in known)
