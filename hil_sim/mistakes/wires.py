"""Mistakes on the bus: rate, termination, ids, and who else is on it."""

import random

from hil_sim.bus.can_bus import Disturbance, Frame
from hil_sim.clock import MILLISECOND_NS
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.mistakes.mistake import FileKey, Mistake
from hil_sim.node import cob_id, sync
from hil_sim.node.node import Node

_ERROR_EVERY_NS = 10 * MILLISECOND_NS
_DESTROYED = 0.1  # share of the frames
_TWIN_AFTER_NS = 330 * MILLISECOND_NS
_ASK_EVERY_NS = 20 * MILLISECOND_NS
_ASK_POSITION = bytes.fromhex("40 64 60 00 00 00 00 00")
_ASKED = 2
_FLOOD = Frame(0x7F0, bytes(8))
_FLOOD_EACH_MS = 6
_FLOOD_WAITING = 8


class _OtherRate(Disturbance):
    """The robot's own devices hear each other; nobody else understands a bit."""

    def arrives(self, _frame: Frame, sender: object, receiver: object, /) -> bool:
        return isinstance(sender, Node) and isinstance(receiver, Node)


class _Reflections(Disturbance):
    """Some frames are destroyed on the wire."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(f"{seed} reflections")

    def survives(self, _frame: Frame, _sender: object, /) -> bool:
        return self._random.random() >= _DESTROYED


class _NoSync(Disturbance):
    """The SYNC never leaves its producer."""

    def __init__(self, identifier: int) -> None:
        self._identifier = identifier

    def leaves(self, frame: Frame, _sender: object, /) -> bool:
        return frame.cob_id != self._identifier


def _other_rate(robot: Exoskeleton) -> None:
    robot.bus.disturbances.append(_OtherRate())
    robot.clock.every(_ERROR_EVERY_NS, robot.bus.tell_error)


def _reflections(robot: Exoskeleton) -> None:
    robot.bus.disturbances.append(_Reflections(robot.seed))


def _no_sync(robot: Exoskeleton) -> None:
    identifier = robot.controller.dictionary.number(sync.COB_ID) & cob_id.IDENTIFIER
    robot.bus.disturbances.append(_NoSync(identifier))


def _twin(robot: Exoskeleton) -> None:
    one = robot.drives["left_knee"]
    twin = JointDrive(
        robot.clock, robot.bus, "twin", one.node_id, one.description, Joint(JointConstants(), 0.0)
    )
    robot.clock.after(_TWIN_AFTER_NS, twin.power_on)


def _second_client(robot: Exoskeleton) -> None:
    frame, sender = Frame(0x600 + _ASKED, _ASK_POSITION), object()
    robot.clock.every(_ASK_EVERY_NS, lambda: robot.bus.send(frame, sender))


def _flood(robot: Exoskeleton) -> None:
    sender = object()

    def fill() -> None:
        if robot.bus.pending_of(sender, _FLOOD.cob_id) < _FLOOD_WAITING:
            for _ in range(_FLOOD_EACH_MS):
                robot.bus.send(_FLOOD, sender)

    robot.clock.every(MILLISECOND_NS, fill)


MISTAKES = {
    "bit_rate": Mistake(
        "The bus is read at half of its bit rate.", [FileKey("can.main", "bitrate", "500000")], _other_rate
    ),
    "terminator": Mistake("A terminator is missing: one frame in ten is destroyed.", act=_reflections),
    "double_node_id": Mistake("A second drive has the left knee's node id.", act=_twin),
    "second_sdo_client": Mistake("Another program asks the left knee by SDO.", act=_second_client),
    "bus_load": Mistake("A device fills the bus with frames that nobody needs.", act=_flood),
    "sync": Mistake("No SYNC comes.", act=_no_sync),
}
