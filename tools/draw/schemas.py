"""docs/reference/*.schema.json: what editors complete files by, as `gwrms check --schema` prints it."""

import json
from collections.abc import Callable, Mapping
from typing import Final

from gateway.cli.check_scenario import schema as scenario
from gateway.config.schema import schema as robot
from gateway.tables.schema import Schema
from server_gui.core.settings.schema import schema as server

SCHEMAS: Final[Mapping[str, Callable[[], Schema]]] = {
    "robot": robot,
    "server": server,
    "scenario": scenario,
}


def draw(kind: str) -> str:
    """Return the file."""
    return json.dumps(SCHEMAS[kind](), indent=2, ensure_ascii=False) + "\n"
