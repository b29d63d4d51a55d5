"""The preconditions of configuring a bus: nothing on it is at work, and it has no other master."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from drivers.bus.bus import CanBus
from drivers.bus.frames import STANDARD_IDS
from drivers.bus.nmt import NmtState
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import SDO_REQUEST, SDO_RESPONSE
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError, NotPermitted
from drivers.lss.master import Identity
from drivers.scan.identification import TIMEOUT_S, sweep
from drivers.scan.traffic import Traffic


@dataclass(frozen=True, slots=True)
class BusSurvey:
    """Observations of a bus over `seconds`."""

    bus: str
    seconds: float
    traffic: Traffic

    @property
    def nodes(self) -> tuple[int, ...]:
        """Node ids that were heard."""
        return tuple(sorted(self.traffic.nodes()))

    def objections(self) -> Iterator[str]:
        """Yield why nothing is to be configured now."""
        at_work = {node for node, state in self.traffic.states.items() if state is NmtState.OPERATIONAL}
        at_work |= {node for node in self.traffic.nodes() if self.traffic.sends(node)}
        if at_work:
            yield f"operational: node {', '.join(map(str, sorted(at_work)))}"
        if leads := ", ".join(self.traffic.master()):
            yield f"somebody leads this bus: {leads}"

    def refuse(self) -> None:
        """Raise `NotPermitted` where somebody is at work."""
        if found := "; ".join(self.objections()):
            raise NotPermitted(
                f"{self.bus}: {found}. Stop that first (the gateway and the controller too), or say --anyway "
                "where you know that nobody is in the machine. Nothing was sent"
            )


def listen(bus: CanBus, seconds: float, wait: Callable[[float], object]) -> BusSurvey:
    """Hear who is there, without a word."""
    traffic = Traffic()

    def taking(can_id: int) -> Callable[[int, bytes], None]:
        return lambda stamp_ns, data: traffic.take(stamp_ns, can_id, data)

    handlers = {can_id: taking(can_id) for can_id in range(STANDARD_IDS + 1)}
    for can_id, handler in handlers.items():
        bus.subscribe(can_id, handler)
    wait(seconds)
    for can_id, handler in handlers.items():
        bus.unsubscribe(can_id, handler)
    return BusSurvey(bus.name, seconds, traffic)


def is_taken(bus: CanBus, node_id: int, heard: BusSurvey, wait: Callable[[float], object]) -> bool:
    """Return whether a device has this node id: it was heard, or answers an SDO."""
    return node_id in heard.nodes or bool(sweep(bus, [node_id], wait))


def identity_of(bus: CanBus, node_id: int) -> Identity:
    """Read the identity of a node by SDO (1018h).

    Raises:
        DriverError: it does not answer, or does not say all four numbers.

    """
    label = f"node {node_id} on {bus.name}"
    channel = SdoChannel(label, Requests(bus, SDO_REQUEST + node_id), TIMEOUT_S)
    bus.subscribe(SDO_RESPONSE + node_id, channel.on_response)
    try:
        return Identity(*(unsigned(channel.upload(0x1018, part)) for part in range(1, 5)))
    except DeviceAbort as error:
        raise DriverError(
            f"{label}: its 1018h lacks a number ({error}), so LSS cannot pick it out: take all other devices "
            "off the bus, and say --only"
        ) from error
    finally:
        bus.unsubscribe(SDO_RESPONSE + node_id, channel.on_response)
