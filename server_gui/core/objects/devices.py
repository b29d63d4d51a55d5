"""The devices of a robot that may have an object dictionary, node by node."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from gateway.wire.robot import Description

KINDS: Final = ("joint", "device")  # what a gateway has an EDS of


@dataclass(frozen=True, slots=True)
class Device:
    """One node; it is asked for by `component`: of several axes the first, whose EDS is that of all."""

    component: str
    components: tuple[str, ...]
    node_id: int | None = None  # None: the gateway does not tell
    bus: str = ""
    problem: str | None = None  # as the robot describes it

    @property
    def title(self) -> str:
        names = " + ".join(self.components).replace("_", " ")
        return names if self.node_id is None else f"{names} · node {self.node_id}"


def devices(description: Description) -> Sequence[Device]:
    """Return them in the robot's order; where an older gateway tells no nodes, a component each."""
    known = {one.name: one for one in description.components if one.kind in KINDS}
    found: dict[str, Device] = {}
    for bus in description.buses:
        for node in bus.nodes:
            names = tuple(name for name in node.components if name in known)
            for name in names:
                found[name] = Device(names[0], names, node.node_id, bus.name, known[names[0]].problem)
    alone = (found.get(name) or Device(name, (name,), problem=one.problem) for name, one in known.items())
    return tuple(dict.fromkeys(alone))


def device_of(found: Sequence[Device], component: str) -> Device | None:
    """Return the one that a component lives on."""
    return next((one for one in found if component in one.components), None)
