"""Conflicts of the robot's SDO channels (`sdo_cob_ids`) with other identifiers on their buses.

Else one node's answer would confirm what was asked of another one.
"""

from collections.abc import Iterator

from drivers.bus.settings import NodeTimes
from drivers.imu.settings import CanImuSettings
from gateway.config.robot import OnBus, RobotConfig
from gateway.tables.finding import Finding

REQUEST, RESPONSE = 0x600, 0x580  # of a node's default channel, plus its node id
# Identifiers that no configurable object may have (CiA 301 §7.3.5), and those whose meaning is fixed.
_TAKEN: tuple[tuple[range, str], ...] = (
    (range(0x001), "is NMT's"),
    (range(0x001, 0x080), "is reserved by CiA 301"),
    (range(0x080, 0x081), "is SYNC's"),
    (range(0x081, 0x100), "is one of emergency messages (EMCY)"),
    (range(0x100, 0x101), "is TIME's"),
    (range(0x101, 0x181), "is reserved by CiA 301"),
    (range(0x581, 0x600), "is the default SDO response of node {node}"),
    (range(0x601, 0x680), "is the default SDO request of node {node}"),
    (range(0x6E0, 0x700), "is reserved by CiA 301"),
    (range(0x701, 0x780), "is the heartbeat of node {node}"),
    (range(0x780, 0x800), "is reserved by CiA 301"),
)
_PDOS = {
    base: f"{kind}{number + 1}"
    for number in range(4)
    for kind, base in (("TPDO", 0x180 + 0x100 * number), ("RPDO", 0x200 + 0x100 * number))
}
_REMEDY = "take one that nobody uses on that bus, such as one from 0x680 to 0x6DF, and set it in the device"


def complaints(config: RobotConfig) -> Iterator[Finding]:
    """Everything that is wrong with a channel, by table and key."""
    for bus in config.can:
        yield from _Bus(config, bus).complaints()


class _Bus:
    """The tables of one bus by their headers."""

    def __init__(self, config: RobotConfig, name: str) -> None:
        self._tables: dict[str, OnBus] = {where: one for where, one in config.on_buses() if one.bus == name}
        self._nodes = {
            one.node_id: where for where, one in self._tables.items() if not isinstance(one, CanImuSettings)
        }
        self._users = {  # identifiers that are somebody's own, and whose they are
            one.can_id: where for where, one in self._tables.items() if isinstance(one, CanImuSettings)
        }
        loop = config.control_loop
        if loop is not None and loop.bus == name:
            self._users[loop.can_id] = "[control_loop]"

    def complaints(self) -> Iterator[Finding]:
        channels: dict[int, tuple[str, tuple[int, int] | None]] = {}  # by node: the first table counts
        for where, settings in self._tables.items():
            if isinstance(settings, CanImuSettings):
                continue
            given = settings.sdo_cob_ids if isinstance(settings, NodeTimes) else None
            node_id = settings.node_id
            other, known = channels.setdefault(node_id, (where, given))
            if known != given:
                text = f"node {node_id} has one for all its tables: say what {other} says"
                yield Finding(where, "sdo_cob_ids", text)
            elif given is not None and other == where:
                yield from self._about_channel(where, node_id, given)

    def _about_channel(self, where: str, node_id: int, channel: tuple[int, int]) -> Iterator[Finding]:
        request, response = channel
        if request == response:
            yield Finding(where, "sdo_cob_ids", f"request and response are both 0x{request:X}; {_REMEDY}")
        for word, cob_id, default in (("request", request, REQUEST), ("response", response, RESPONSE)):
            why = None if cob_id == default + node_id else self._why_not(cob_id)
            if why is not None:
                yield Finding(where, "sdo_cob_ids", f"the {word} 0x{cob_id:X} {why}; {_REMEDY}")
            self._users[cob_id] = where

    def _why_not(self, cob_id: int) -> str | None:
        """Return the present use of an identifier, in words."""
        user = self._users.get(cob_id)
        if user is not None:
            return f"is used by {user}"
        node, base = cob_id & 0x7F, cob_id & ~0x7F
        if base in _PDOS and node in self._nodes:
            return f"is {_PDOS[base]} of {self._nodes[node]}, as long as nothing else is set there"
        found = next((words for ids, words in _TAKEN if cob_id in ids), None)
        return None if found is None else found.format(node=node)
