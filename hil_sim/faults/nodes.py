"""Faults of one CANopen device as a whole: power, boot, NMT, heartbeat, EMCY, PDOs, its CAN controller."""

from collections.abc import Iterator
from contextlib import contextmanager

from hil_sim.bus.can_bus import Disturbance, Frame
from hil_sim.clock import SECOND_NS
from hil_sim.faults.fault import Fault, FaultRefused, FaultTarget, Form, Number, Site
from hil_sim.faults.frames import disturbed_by, disturbing
from hil_sim.node.nmt import HEARTBEAT_BASE, NMT_COB_ID, NmtService
from hil_sim.node.node import BOOT_TIME_NS, Node

_RECOVERED_FROM_BUS_OFF = 0x8140  # CiA 301 table 26
_TRANSMIT_ERROR, _BUS_OFF = 8, 256  # ISO 11898-1: the transmit error counter, and where it ends


def _switch_off(site: Site) -> None:
    if not site.node.powered:
        raise FaultRefused(f"{site.device} is switched off by another fault; clear that one first")
    site.node.power_off()
    site.robot.bus.withdraw(site.node)


@contextmanager
def _lost(site: Site) -> Iterator[None]:
    _switch_off(site)
    yield
    site.node.power_on()


@contextmanager
def _reboot(site: Site) -> Iterator[None]:
    _switch_off(site)
    site.node.power_on(BOOT_TIME_NS)
    yield


@contextmanager
def _late_boot(site: Site) -> Iterator[None]:
    _switch_off(site)
    site.node.power_on(round(site.number("boot_s") * SECOND_NS))
    yield


@contextmanager
def _stopped(site: Site) -> Iterator[None]:
    def command(service: NmtService) -> None:
        site.robot.bus.send(Frame(NMT_COB_ID, bytes([service, site.node.node_id])), site)

    command(NmtService.STOP)
    yield
    command(NmtService.START)


@contextmanager
def _emcy(site: Site) -> Iterator[None]:
    site.node.emergency(site.whole("code"))
    yield
    site.node.emergency_over()


class _Silent(Disturbance):
    """Frames of one node that it should send and does not."""

    def __init__(self, node: Node, cob_ids: frozenset[int]) -> None:
        self._node = node
        self._cob_ids = cob_ids

    def leaves(self, frame: Frame, sender: object, /) -> bool:
        return sender is not self._node or frame.cob_id not in self._cob_ids


def _heartbeat_missing(site: Site) -> _Silent:
    return _Silent(site.node, frozenset({HEARTBEAT_BASE + site.node.node_id}))


def _tpdo_silent(site: Site) -> _Silent:
    return _Silent(site.node, site.node.tpdo_cob_ids())


class _BusOff(Disturbance):
    """A transmitter whose every frame is destroyed until its controller leaves the bus."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._transmit_errors = 0
        self.is_off = False

    def leaves(self, _frame: Frame, sender: object, /) -> bool:
        return not (self.is_off and sender is self._site.node)

    def survives(self, _frame: Frame, sender: object, /) -> bool:
        if sender is not self._site.node:
            return True
        self._transmit_errors += _TRANSMIT_ERROR
        if self._transmit_errors >= _BUS_OFF and not self.is_off:
            self.is_off = True
            self._site.robot.clock.at(self._site.robot.clock.now_ns, self._go_off)
        return False

    def arrives(self, _frame: Frame, _sender: object, receiver: object, /) -> bool:
        return not (self.is_off and receiver is self._site.node)

    def _go_off(self) -> None:
        self._site.robot.bus.withdraw(self._site.node)
        self._site.node.bus_off()


@contextmanager
def _bus_off(site: Site) -> Iterator[None]:
    disturbance = _BusOff(site)
    with disturbing(site, disturbance):
        yield
    if disturbance.is_off:
        site.node.emergency(_RECOVERED_FROM_BUS_OFF)
        site.node.emergency_over()


FAULTS = {
    "node_lost": Fault(
        FaultTarget.NODE,
        _lost,
        "No frame of the node any more; at the end it boots, and shows its boot-up message 700h+id `00`.",
    ),
    "reboot": Fault(
        FaultTarget.NODE,
        _reboot,
        "The node is silent until its boot-up message 50 ms later; what was not stored (1010h) is gone.",
        momentary=True,
    ),
    "late_boot": Fault(
        FaultTarget.NODE,
        _late_boot,
        "The node is silent until its boot-up message comes, long after everybody else's.",
        {"boot_s": Number(3.0, 0.1, 600.0, "s", "how long it takes to boot")},
        momentary=True,
    ),
    "node_stopped": Fault(
        FaultTarget.NODE,
        _stopped,
        "NMT stop comes by (000h `02 id`): the heartbeat says `04`, no SDO, no PDO; NMT start ends it.",
    ),
    "emcy": Fault(
        FaultTarget.NODE,
        _emcy,
        "An EMCY message on 80h+id with the code and 1001h; at the end one with the code 0000h.",
        {"code": Number(0x1000, 0x0001, 0xFFFF, "", "error code of CiA 301 or the profile", Form.CODE)},
    ),
    "heartbeat_missing": Fault(
        FaultTarget.NODE,
        disturbed_by(_heartbeat_missing),
        "No frame on 700h+id, while SDO and PDOs of the node work as before.",
    ),
    "tpdo_silent": Fault(
        FaultTarget.NODE,
        disturbed_by(_tpdo_silent),
        "No PDO of the node, while its heartbeat says operational and SDO works.",
    ),
    "bus_off": Fault(
        FaultTarget.NODE,
        _bus_off,
        "32 error frames, then nothing of it; at the end EMCY 8140h, no boot-up, heartbeat `7F` (1029h = 0).",
    ),
}
