"""`gwrms check` of a scenario: its own tables, and its `[guard]` as a gateway reads it.

The simulator knows nothing of gateways, and is looked for only here, where somebody has a scenario.
"""

import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from gateway.config.reading import examined
from gateway.tables.finding import Severity, Told, told

_SCRIPT: Final = "hil_sim.scenario.script"
_SCHEMA: Final = "hil_sim.scenario.schema"


def findings(file: Path, tables: Mapping[str, Any], *, machine: bool) -> Iterator[Told]:
    """Yield all of that; the guard is looked at in the robot's file that a run would write."""
    found: list[Told] = list(import_module(_SCRIPT).findings(file, tables, machine=machine))
    yield from found
    if "guard" in tables and not any(severity == Severity.MISTAKE for severity, *_ in found):
        robot = tomllib.loads(import_module(_SCRIPT).robot_text(file, tables))
        guard = [one for one in examined(file, robot).findings if one.where.startswith("[guard")]
        yield from told(guard)


def schema() -> dict[str, Any]:
    """Return the scenario's, with the guard's of robot.toml."""
    from gateway.config.schema import guard  # needs what drivers need

    made: dict[str, Any] = import_module(_SCHEMA).schema()
    made["properties"]["guard"], made["$defs"] = guard()
    return made
