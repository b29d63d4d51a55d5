"""The EDS or DCF that each drive of the robot presents on the bus: its personality."""

from collections.abc import Collection, Iterable
from pathlib import Path

import eds
from eds.description import Description, EdsError
from eds.shipped import SHIPPED
from hil_sim.errors import SimulatorError


def choose(words: Iterable[str], joints: Collection[str], beside: Path | None) -> dict[str, Path]:
    """Return the file of each joint: `FILE` is for all of them, `JOINT=FILE` for one; later words count.

    Files are looked for beside `beside`, and among those that ship. Raises `SimulatorError`.
    """
    chosen: dict[str, Path] = {}
    for word in words:
        joint, equals, file = word.partition("=")
        if equals and joint not in joints:
            raise SimulatorError(
                f"drive {word!r}: there is no joint {joint!r}; there are {', '.join(joints)}"
            )
        try:
            path = eds.locate(file if equals else word, beside).resolve()
        except EdsError as error:
            raise SimulatorError(f"drive {word!r}: {error}") from error
        chosen |= dict.fromkeys([joint] if equals else joints, path)
    return chosen


def describe(path: Path, node_id: int) -> Description:
    """Return the device in the file; raises `SimulatorError`."""
    try:
        return eds.load(path, node_id)
    except EdsError as error:
        raise SimulatorError(f"drive of node {node_id}: {error}") from error


def name(description: Description) -> str:
    """Return the file's name in robot.toml: its name if it ships, else its whole path."""
    path = description.path
    return path.name if path.parent == SHIPPED else str(path)
