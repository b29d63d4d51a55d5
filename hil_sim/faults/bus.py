"""Faults of the bus as a whole: losses, error frames, load, the gateway's own cable."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

from hil_sim.bus.can_bus import BUS_OFF, RESTARTED, Disturbance, Frame
from hil_sim.clock import MILLISECOND_NS, SECOND_NS
from hil_sim.faults.fault import Fault, FaultTarget, Form, Number, Site
from hil_sim.faults.frames import disturbed_by, disturbing
from hil_sim.node import cob_id, sync
from hil_sim.node.node import Node

_LOAD_TICK_NS = MILLISECOND_NS
_ROOM = 4  # frames of one identifier that a node's controller holds until the bus is free


class _Loss(Disturbance):
    def __init__(self, site: Site) -> None:
        self._share = site.number("percent") / 100.0
        self._random = site.random

    def arrives(self, _frame: Frame, _sender: object, _receiver: object, /) -> bool:
        return self._random.random() >= self._share


class _Errors(Disturbance):
    def __init__(self, site: Site) -> None:
        self._share = site.number("percent") / 100.0
        self._random = site.random

    def survives(self, _frame: Frame, _sender: object, /) -> bool:
        return self._random.random() >= self._share


class _Cut(Disturbance):
    """Only the robot's own devices hear each other."""

    def __init__(self, _site: Site) -> None:
        pass

    def arrives(self, _frame: Frame, sender: object, receiver: object, /) -> bool:
        return isinstance(sender, Node) and isinstance(receiver, Node)


class _NoSync(Disturbance):
    """Its producer's SYNC never leaves, or only some of it."""

    def __init__(self, site: Site) -> None:
        self._sync = site.robot.controller.dictionary.number(sync.COB_ID) & cob_id.IDENTIFIER
        self._share = site.number("percent") / 100.0
        self._random = site.random

    def leaves(self, frame: Frame, _sender: object, /) -> bool:
        return frame.cob_id != self._sync or self._random.random() >= self._share


@contextmanager
def _gateway_bus_off(site: Site) -> Iterator[None]:
    with disturbing(site, _Cut(site)):
        site.robot.bus.tell_error(BUS_OFF)
        yield
    site.robot.bus.tell_error(RESTARTED)


class _Load(Disturbance):
    """A participant that fills the bus up to a share of its time, whatever the others leave of it.

    Meanwhile the others' controllers hold as many frames as they have room for and lose the rest.
    """

    def __init__(self, site: Site) -> None:
        self._bus = site.robot.bus
        self._share = site.number("percent") / 100.0
        self._frame = Frame(site.whole("cob_id"), bytes(8))
        self._frame_ns = self._frame.bits() * SECOND_NS / self._bus.bitrate
        self._began_ns, self._busy_ns = self._bus.clock.now_ns, self._bus.busy_ns

    def leaves(self, frame: Frame, sender: object, /) -> bool:
        return sender is self or self._bus.pending_of(sender, frame.cob_id) < _ROOM

    def fill(self) -> None:
        """Send what is missing until the next tick."""
        bus = self._bus
        wanted_ns = self._share * (bus.clock.now_ns - self._began_ns + _LOAD_TICK_NS)
        waiting_ns = bus.pending_of(self, self._frame.cob_id) * self._frame_ns
        missing_ns = wanted_ns - (bus.busy_ns - self._busy_ns) - waiting_ns
        for _ in range(math.ceil(missing_ns / self._frame_ns)):
            bus.send(self._frame, self)


@contextmanager
def _load(site: Site) -> Iterator[None]:
    load = _Load(site)
    filling = site.robot.clock.every(_LOAD_TICK_NS, load.fill)
    with disturbing(site, load):
        yield
    filling.cancel()
    site.robot.bus.withdraw(load)


FAULTS = {
    "frame_loss": Fault(
        FaultTarget.BUS,
        disturbed_by(_Loss),
        "Each receiver misses a share of the frames, each another: counters jump, SDO answers stay away.",
        {"percent": Number(5.0, 0.0, 100.0, "%", "share of the frames that a receiver misses")},
    ),
    "error_frames": Fault(
        FaultTarget.BUS,
        disturbed_by(_Errors),
        "Error frames; each frame that one has destroyed is sent again and comes late, and none is missing.",
        {"percent": Number(10.0, 0.0, 90.0, "%", "share of the attempts to send that fail")},
    ),
    "bus_load": Fault(
        FaultTarget.BUS,
        _load,
        "Frames of one identifier fill the bus; what has a higher identifier comes late, at 100 % never.",
        {
            "percent": Number(90.0, 1.0, 100.0, "%", "of the bus's time, the robot's own frames included"),
            "cob_id": Number(
                0x7FF, 0x001, 0x7FF, "", "identifier: the lower, the more it holds up", Form.CODE
            ),
        },
    ),
    "bus_cut": Fault(
        FaultTarget.BUS,
        disturbed_by(_Cut),
        "The gateway's cable is out: no frame comes, none is answered, and the robot walks on.",
    ),
    "gateway_bus_off": Fault(
        FaultTarget.BUS,
        _gateway_bus_off,
        "The gateway's own CAN controller is bus off: it says so (error class 40h), and no frame passes it.",
    ),
    "sync_lost": Fault(
        FaultTarget.BUS,
        disturbed_by(_NoSync),
        "No SYNC, so no synchronous PDO; heartbeats and SDO answers come, set-points take no effect.",
        {"percent": Number(100.0, 1.0, 100.0, "%", "share of the SYNCs that are not sent")},
    ),
}
