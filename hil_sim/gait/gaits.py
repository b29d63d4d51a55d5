"""The cyclic ways of moving, as a table: legs, ground, trunk and turning of each."""

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.gait import terrain, walk
from hil_sim.gait.activity import Activity
from hil_sim.gait.curves import Leg
from hil_sim.gait.ground import Humps, Path, level_humps

LEFT, RIGHT = 0, 1

HEEL_TO_TOE = Path(0.030, 0.205)


@dataclass(frozen=True, slots=True)
class Gait:
    """One cyclic way of moving.

    `leg` takes phase, step length and leg length (m). `lean` (rad) comes to the trunk's, `turn` is the yaw of
    one stride (rad, to the left), `steps` scale the left and the right step.
    """

    leg: Callable[[float, float, float], Leg] = walk.level
    humps: Callable[[float], Humps] = level_humps
    path: Path = HEEL_TO_TOE
    lean: float = 0.0
    turn: float = 0.0
    steps: tuple[float, float] = (1.0, 1.0)


def _up(speed: float) -> Humps:
    return level_humps(speed)._replace(second=1.2, strike=0.0)


def _down(speed: float) -> Humps:
    return Humps(first=1.3 + 0.2 * min(speed, 1.0), valley=0.85, second=0.95, strike=0.3)


def _ramp_up(speed: float) -> Humps:
    humps = level_humps(speed)
    return humps._replace(second=1.1 * humps.second)


def _ramp_down(speed: float) -> Humps:
    humps = level_humps(speed)
    return humps._replace(first=1.15 * humps.first)


_TURN = 1.2
_INNER, _OUTER = 0.70, 0.95

GAITS = {
    Activity.WALK: Gait(),
    Activity.STAIRS_UP: Gait(terrain.stairs_up, _up, Path(0.095, 0.205), lean=0.12),
    Activity.STAIRS_DOWN: Gait(terrain.stairs_down, _down, Path(0.175, 0.205, -0.07), lean=0.03),
    Activity.RAMP_UP: Gait(terrain.ramp_up, _ramp_up, lean=0.07),
    Activity.RAMP_DOWN: Gait(terrain.ramp_down, _ramp_down, lean=-0.03),
    Activity.TURN_LEFT: Gait(turn=_TURN, steps=(_INNER, _OUTER)),
    Activity.TURN_RIGHT: Gait(turn=-_TURN, steps=(_OUTER, _INNER)),
}
