"""Mistakes in what drives and controller hold, and in their sensors."""

from collections.abc import Callable

from hil_sim.drive import objects as od
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.mistakes.mistake import Mistake
from hil_sim.node.dictionary import Dictionary, Key, Value
from hil_sim.node.heartbeat import PRODUCER
from hil_sim.node.sync import CYCLE_PERIOD

_NEVER = 0xFFFF_FFFF
_UNSET = 0xFFFF
_VELOCITY = 0x606C_0020
_ROOM_FOR_A_MODE = 0x0005_0008  # a dummy: eight bits that mean nothing


def _hold(dictionary: Dictionary, key: Key, value: Value) -> None:
    """Hold it from the next start on, as if it had been stored."""
    entry = dictionary[key]
    entry.default = entry.value = value
    if entry.commissioned is not None:
        entry.commissioned = value


def _drive(joint: str, *values: tuple[Key, Value]) -> Callable[[Exoskeleton], None]:
    def act(robot: Exoskeleton) -> None:
        for key, value in values:
            _hold(robot.drives[joint].dictionary, key, value)

    return act


def _slow_sync(robot: Exoskeleton) -> None:
    _hold(robot.controller.dictionary, CYCLE_PERIOD, 40_000)


def _insole(robot: Exoskeleton) -> None:
    robot.sensors.insole_faults["left_insole"].scale = 0.1


def _imu_frozen(robot: Exoskeleton) -> None:
    robot.sensors.imu_faults.frozen = True


MISTAKES = {
    "heartbeat": Mistake("The right ankle sends no heartbeat.", act=_drive("right_ankle", (PRODUCER, 0))),
    "pdo_mapping": Mistake(
        "The right hip's TPDO brings its velocity instead of its position.",
        act=_drive("right_hip", ((0x1A00, 2), _VELOCITY)),
    ),
    "mode": Mistake(
        "The left knee starts in profile position mode, and its RPDO brings no other.",
        act=_drive("left_knee", (od.MODE, 1), ((0x1600, 2), _ROOM_FOR_A_MODE)),
    ),
    "current_limit": Mistake(
        "The left hip's current limit was never set.", act=_drive("left_hip", (od.MAX_CURRENT, _UNSET))
    ),
    "following_window": Mistake(
        "The right knee's following error is not watched.",
        act=_drive("right_knee", (od.FOLLOWING_ERROR_WINDOW, _NEVER)),
    ),
    "reaction": Mistake(
        "The left ankle goes on when its master dies.",
        act=_drive("left_ankle", (od.ABORT_CONNECTION_OPTION, 0)),
    ),
    "coasting": Mistake(
        "The right ankle coasts when it is stopped.", act=_drive("right_ankle", (od.QUICK_STOP_OPTION, 0))
    ),
    "sync_slow": Mistake("The controller's SYNC comes each 40 ms.", act=_slow_sync),
    "insole_scale": Mistake("The left insole reports a tenth of the load.", act=_insole),
    "imu_frozen": Mistake("The IMU repeats the same value.", act=_imu_frozen),
}
