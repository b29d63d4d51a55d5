"""Dangers: faults that end in harm, and what counts as harm in each, by the simulator's own truth.

Harm is defined by what the body and the machine really do, never by what a sensor says.
"""

import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.faults.fault import Value
from hil_sim.gait.activity import Activity
from hil_sim.gait.stumble_and_fall import FallState
from hil_sim.gait.timetable import Entry
from hil_sim.gait.wearer import Foot
from hil_sim.sensors.insoles import insole_cobs
from hil_sim.sensors.suite import FEET

ASTRAY_RAD: Final = math.radians(10.0)  # a joint so far from where the gait wants it moves the leg wrongly
LED_ASTRAY_RAD: Final = math.radians(25.0)  # likewise, where it is led there
TOLD_WRONG_RAD: Final = math.radians(10.0)  # a tilt that is told so wrongly
SHAKING_RAD_S: Final = 0.8  # RMS of a joint's trembling about its demand
SHAKEN_S: Final = 0.1  # over which the trembling is averaged
RESISTED_NM: Final = 50.0
DROPPED: Final = 0.85  # of what strength this wearer's leg had: its toes drag
BEARS_N: Final = 200.0  # a foot that bears less says little
HOT_C: Final = 100.0  # the drive switches itself off, and the leg gives way

Harmed = Callable[["DangerContext"], bool]
Params = Mapping[str, float]


@dataclass(slots=True)
class DangerContext:
    """The robot, where the danger is, and what has to be remembered from cycle to cycle."""

    robot: Exoskeleton
    on: str
    shaking: float = 0.0  # rad²/s², smoothed
    weak: float = 0.0  # of the left leg's strength is what this wearer has always lacked

    @property
    def joint(self) -> int:
        return list(JOINTS).index(self.on)

    @property
    def astray(self) -> float:
        """Deviation of the true joint from the gait (rad)."""
        left, right = self.robot.controller.generator.legs()
        return abs(self.robot.drives[self.on].joint.position - (*left, *right)[self.joint])


@dataclass(frozen=True, slots=True)
class Danger:
    """One way to come to harm: a fault, on what it may be, its severity at random, and what harm is."""

    fault: str
    on: tuple[str, ...]
    params: Mapping[str, tuple[float, float]]  # from, to
    harmed: Harmed
    harm: str
    doing: Activity = Activity.WALK
    sudden: bool = False  # nothing shows before: reported apart

    def drawn(self, source: random.Random) -> tuple[str, dict[str, Value]]:
        """Draw on what, and with which parameters, this time."""
        params: dict[str, Value] = {key: source.uniform(*span) for key, span in self.params.items()}
        return source.choice(self.on), params


def _astray(seen: DangerContext) -> bool:
    return seen.astray > ASTRAY_RAD


def _led_astray(seen: DangerContext) -> bool:
    joint = seen.robot.drives[seen.on].joint
    return seen.astray > LED_ASTRAY_RAD or joint.at_low_switch or joint.at_high_switch


def _on_ground(seen: DangerContext) -> bool:
    return seen.robot.controller.generator.fall.state is FallState.LYING


def _shaking(seen: DangerContext) -> bool:
    servo = seen.robot.drives[seen.on].servo
    square = (servo.joint.velocity - servo.reference.velocity) ** 2
    seen.shaking += 0.01 / SHAKEN_S * (square - seen.shaking)
    return math.sqrt(seen.shaking) > SHAKING_RAD_S


def _hot(seen: DangerContext) -> bool:
    return seen.robot.drives[seen.on].temperature_c > HOT_C


def _resisted(seen: DangerContext) -> bool:
    return abs(seen.robot.wearer.resists.get(seen.joint, 0.0)) > RESISTED_NM or seen.astray > ASTRAY_RAD


def _half_felt(seen: DangerContext) -> bool:
    side = FEET.index(seen.on)
    foot: Foot = seen.robot.wearer.feet(seen.robot.clock.now_s)[side]
    pressures = seen.robot.sensors.pressures[side].pascal
    felt = sum(pascal * cell.area for pascal, cell in zip(pressures, insole_cobs.CELLS, strict=True))
    return foot.force > BEARS_N and felt < 0.5 * foot.force


def _told_wrong(seen: DangerContext) -> bool:
    return abs(seen.robot.sensors.imu_faults.slipped) > TOLD_WRONG_RAD


def _dropped(seen: DangerContext) -> bool:
    has = 1.0 - seen.weak
    return has - (1.0 - seen.robot.controller.generator.impairment[0]) > DROPPED * has


KNEES: Final = ("left_knee", "right_knee")
HIPS_KNEES: Final = ("left_hip", "right_hip", *KNEES)
WEARER: Final = ("wearer",)
_OFF: Final = "the joint is 10° from where the gait wants it"
_IMPACT: Final = "the body meets the ground"

DANGERS: Final[Mapping[str, Danger]] = {
    "friction": Danger("friction_grows", KNEES, {"times_per_s": (0.15, 0.6)}, _astray, _OFF),
    "encoder_slip": Danger(
        "encoder_slips", HIPS_KNEES, {"degrees": (0.4, 1.0), "every_s": (0.3, 0.7)}, _astray, _OFF
    ),
    "torque_loss": Danger("torque_fades", KNEES, {"percent_per_s": (7.0, 20.0)}, _astray, _OFF),
    "oscillation": Danger(
        "oscillation", HIPS_KNEES, {"percent_per_s": (10.0, 25.0)}, _shaking,
        "the joint trembles by 0.8 rad/s (RMS over 0.1 s) about its demand",
    ),
    "overheating": Danger(
        "overtemperature", HIPS_KNEES, {"rate_c_per_s": (4.0, 9.0)}, _hot,
        "the motor has 100 °C: its drive switches off and the leg gives way",
    ),
    "runaway": Danger(
        "runaway", HIPS_KNEES, {"deg_per_s": (6.0, 25.0)}, _led_astray,
        "the joint is 25° from the gait, or at its end stop",
    ),
    "spasm": Danger(
        "wearer_resists", HIPS_KNEES, {"nm_per_s": (8.0, 20.0), "hertz": (3.0, 6.0)}, _resisted,
        "the wearer pulls with 50 N·m, or the joint is 10° off",
    ),
    "imu_slip": Danger(
        "imu_slips", ("trunk",), {"deg_per_s": (1.0, 3.0)}, _told_wrong, "the trunk's tilt is told 10° wrong"
    ),
    "insole_dying": Danger(
        "insole_cells_die", FEET, {"every_s": (0.4, 1.0)}, _half_felt,
        "a foot that bears 200 N tells less than half",
    ),
    "fatigue": Danger(
        "fatigue", WEARER, {"percent_per_s": (7.0, 14.0), "asymmetry": (0.15, 0.5)}, _dropped,
        "the left leg has lost 85 % of the strength that its swing had: its toes drag",
    ),
    "trip": Danger("trip_and_fall", WEARER, {"after_s": (0.25, 0.6)}, _on_ground, _IMPACT),
    "slip": Danger("foot_slips", WEARER, {}, _on_ground, _IMPACT),
    "sideways": Danger("fall_sideways", WEARER, {}, _on_ground, _IMPACT),
    "backward": Danger("fall_backward", WEARER, {}, _on_ground, _IMPACT, doing=Activity.STAND),
    "encoder_stuck": Danger("encoder_stuck", HIPS_KNEES, {}, _astray, _OFF, sudden=True),
    "torque_off": Danger("sto", KNEES, {}, _astray, _OFF, sudden=True),
}  # fmt: skip

LONGEST_S: Final = 25.0  # without harm a danger is ended, and counts as none


def healthy(source: random.Random, among: Sequence[Activity]) -> Iterator[Entry]:
    """Yield a wearer's own day on foot, without end: visits `among` these, each once a round."""
    while True:
        visits = [*among]
        source.shuffle(visits)
        for activity in visits:
            pace = source.uniform(0.30, 0.55), source.uniform(1.4, 2.4)
            yield Entry(activity, source.uniform(5.0, 11.0), pace)


LEVEL: Final = (*(Activity.WALK,) * 6, Activity.STAND, Activity.TURN_LEFT, Activity.TURN_RIGHT)
EVERYWHERE: Final = (
    *(Activity.WALK,) * 6,
    Activity.STAND,
    Activity.SIT,
    Activity.TURN_LEFT,
    Activity.TURN_RIGHT,
    Activity.RAMP_UP,
    Activity.RAMP_DOWN,
    Activity.STAIRS_UP,
    Activity.STAIRS_DOWN,
)
