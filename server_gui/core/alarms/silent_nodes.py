"""Nodes that another one misses (CiA 301 §7.2.7.1): the silent node is the cause, whoever says so first.

A drive that watches another node's heartbeat, or waits for its PDOs, says so at once; the robot's own word
about the silent node comes with the next look at it, up to a second later.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Final

from server_gui.core.follow.robot import Robot

MISSED_CODES: Final = frozenset({0x8130, 0x8250})  # heartbeat or life guard, PDOs
NO_VALUES: Final = "nothing comes from it"


def said_of_missed(code: int | None, said: str) -> str:
    """Return what a node reports, in words for what that is: another one, which may be named elsewhere."""
    return f"a node that it listens to is silent ({said})" if code in MISSED_CODES else said


def silent_nodes(robot: Robot, reporters: Collection[str], bus_of: Callable[[str], str]) -> Iterator[str]:
    """Yield the nodes on a reporter's bus that the robot still calls ok, and of which no value comes now."""
    if not reporters or robot.is_stale() or robot.description is None:
        return
    buses = {bus_of(name) for name in reporters} - {""}
    channels: dict[str, list[str]] = {}
    for channel in robot.description.channels:
        channels.setdefault(channel.component, []).append(channel.name)
    for part in robot.parts.values():
        names = [name for name in channels.get(part.name, ()) if name in robot.values]
        is_asked = part.state == "ok" and part.name not in reporters and bus_of(part.name) in buses
        if is_asked and names and all(robot.values[name] is None for name in names):
            yield part.name
