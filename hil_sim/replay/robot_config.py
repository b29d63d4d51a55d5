"""A recording's robot.toml: the files of its devices, and where there is none, a beginning of one."""

import tomllib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import eds
from eds.description import Description, EdsError
from hil_sim.replay.can_log import ReplayError

_TEXT = """\
# A recording, described for a gateway:  gwrms gateway {path}
# The recording does not say what the robot is made of. Take its own robot.toml for that, with this bus and
# these ports in it, or describe it here: gwrms docs wire-a-joint and wire-a-sensor say how.

[robot]
name = "recording"

{bus}
# Nodes that were recorded: {nodes}.
# One with an `eds` in a [joint.NAME] or [device.NAME] also answers SDO.
# Serial ports that were recorded:{ports}
"""


def text(folder: Path, bus: str, nodes: Collection[int], ports: Collection[str]) -> str:
    """Return a robot.toml for a recording in `folder` (absolute)."""
    names = "".join(f'\n#   port = "{folder / name}"' for name in ports)
    numbers = ", ".join(str(node) for node in sorted(nodes))
    return _TEXT.format(path=folder / "robot.toml", bus=bus, nodes=numbers or "none", ports=names or " none")


def descriptions(config: Path) -> dict[int, Description]:
    """Return the devices of every table with `node_id` and `eds`, by node id; none where there is no file.

    Raises `ReplayError`.
    """
    try:
        content = tomllib.loads(config.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        raise ReplayError(f"{config} cannot be read: {error}") from error
    files: dict[int, str] = {}
    for where, table in _devices(content):
        node, file = table["node_id"], table["eds"]
        if files.setdefault(node, file) != file:
            raise ReplayError(f"{config}, [{where}]: node {node} has eds {files[node]!r} in another table")
    try:
        return {node: eds.load(eds.locate(file, config), node) for node, file in files.items()}
    except EdsError as error:
        raise ReplayError(f"{config}: {error}") from error


def _devices(content: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    tables = [
        (f"{kind}.{name}", table)
        for kind, named in content.items()
        if isinstance(named, dict)
        for name, table in named.items()
        if isinstance(table, dict)
    ]
    return [
        (where, table)
        for where, table in tables
        if isinstance(table.get("node_id"), int) and isinstance(table.get("eds"), str)
    ]
