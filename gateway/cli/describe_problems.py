"""The last line of `gwrms describe`: how many problems there are above, and where."""

from collections.abc import Collection, Iterator
from typing import Final

from gateway.amounts import counted
from gateway.wire.bus import BusInfo
from gateway.wire.robot import Description

GOOD: Final = "ok"  # a component's state
NONE: Final = "no problem found"


def summary(robot: Description, held: Collection[str] = ()) -> str:
    """Return the places with a problem, each once; `held` are controllers that move nothing."""
    places = list(dict.fromkeys((*_of_components(robot), *_of_the_rest(robot), *held)))
    return f"{counted(len(places), 'problem')}: {', '.join(places)}\n" if places else f"{NONE}\n"


def _of_components(robot: Description) -> Iterator[str]:
    yield from (part.name for part in robot.components if part.state != GOOD or part.problem or part.findings)
    for bus in robot.buses:
        yield from _of_bus(bus)


def _of_bus(bus: BusInfo) -> Iterator[str]:
    if bus.problem or bus.findings or bus.strangers:
        yield f"bus {bus.name}"
    for node in bus.nodes:
        if node.findings:
            yield from node.components or (f"{bus.name} node {node.node_id}",)


def _of_the_rest(robot: Description) -> Iterator[str]:
    yield from (info.name for info in robot.parameters if info.problem and info.read_only is None)
    if robot.stop.held:
        yield "a stop is held"
    if robot.stop.problem or any(robot.stop.controllers.values()):
        yield "stop"
    if robot.guard.problem:
        yield "guard"
    yield from (f"guard rule {rule.name}" for rule in robot.guard.rules if rule.state in ("blind", "tripped"))
