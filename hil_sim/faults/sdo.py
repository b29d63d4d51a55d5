"""Faults of one device's SDO server: answers that come twice, late, never, or as an abort."""

from hil_sim.bus.can_bus import Disturbance, Frame
from hil_sim.clock import MILLISECOND_NS
from hil_sim.faults.fault import Fault, FaultTarget, Form, Number, Site
from hil_sim.faults.frames import disturbed_by
from hil_sim.node.nmt import COMMUNICATING

_DOWNLOAD, _BLOCK_DOWNLOAD = 1, 6  # client command specifiers that begin a write (CiA 301 §7.2.4.3)
_BLOCK_SUBCOMMAND = 1


class _Answers(Disturbance):
    """Fault of the answers of one node's SDO servers; this one swallows them."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._node = site.node
        self._responses = frozenset(site.node.sdo_channels().values())

    def leaves(self, frame: Frame, sender: object, /) -> bool:
        return sender is not self._node or frame.cob_id not in self._responses or self._answer(frame)

    def _answer(self, frame: Frame) -> bool:  # noqa: ARG002 - what the others look at
        return False

    def _queue(self, frame: Frame) -> None:
        if self._node.powered:
            self._site.robot.bus.send_past(frame, self._node, self)


class _Twice(_Answers):
    def _answer(self, frame: Frame) -> bool:
        self._queue(frame)
        return True


class _Late(_Answers):
    def _answer(self, frame: Frame) -> bool:
        delay_ns = round(self._site.number("delay_ms") * MILLISECOND_NS)
        self._site.robot.clock.after(delay_ns, lambda: self._queue(frame))
        return False


class _Abort(Disturbance):
    """Refuses writes by their number, as a device does whose application says no."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._node = site.node
        self._channels = site.node.sdo_channels()
        self._writes = 0

    def arrives(self, frame: Frame, _sender: object, receiver: object, /) -> bool:
        if receiver is not self._node or not self._begins_write(frame):
            return True
        self._writes += 1
        if self._writes != self._site.whole("nth"):
            return True
        abort = b"\x80" + frame.data[1:4] + self._site.whole("code").to_bytes(4, "little")
        self._site.robot.bus.send(Frame(self._channels[frame.cob_id], abort), self._node)
        return False

    def _begins_write(self, frame: Frame) -> bool:
        if (
            frame.cob_id not in self._channels
            or len(frame.data) != 8
            or self._node.state not in COMMUNICATING
        ):
            return False
        command = frame.data[0] >> 5
        return command == _DOWNLOAD or (command == _BLOCK_DOWNLOAD and not frame.data[0] & _BLOCK_SUBCOMMAND)


FAULTS = {
    "sdo_duplicate": Fault(
        FaultTarget.NODE, disturbed_by(_Twice), "Each SDO answer of the node comes twice."
    ),
    "sdo_late": Fault(
        FaultTarget.NODE,
        disturbed_by(_Late),
        "Each SDO answer comes, but late: perhaps when the next request is already under way.",
        {"delay_ms": Number(800.0, 1.0, 60_000.0, "ms", "how much later")},
    ),
    "sdo_silent": Fault(
        FaultTarget.NODE, disturbed_by(_Answers), "No SDO answer, while heartbeat and PDOs of the node come."
    ),
    "sdo_abort": Fault(
        FaultTarget.NODE,
        disturbed_by(_Abort),
        "The n-th write is answered with an abort and not carried out; those before and after it work.",
        {
            "nth": Number(1, 1, 10_000, "", "which write, counted from the fault's beginning", Form.WHOLE),
            "code": Number(0x0800_0020, 0x0503_0000, 0x0FFF_FFFF, "", "SDO abort code", Form.CODE),
        },
    ),
}
