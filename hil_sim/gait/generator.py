"""The motion of the wearer from moment to moment: what is being done, and smooth ways to what is wanted."""

import math
import random

from hil_sim.gait import posture
from hil_sim.gait.activity import Activity, Label
from hil_sim.gait.curves import Leg
from hil_sim.gait.gaits import GAITS, LEFT, RIGHT
from hil_sim.gait.posture import LYING, SITTING, STANDING
from hil_sim.gait.profiles import Ramp, mix
from hil_sim.gait.rhythm import Lag, Rhythm
from hil_sim.gait.stumble_and_fall import TRIP_PHASE, Fall, FallState, Stumble, side_of_fall
from hil_sim.gait.subject import NOMINAL, WearerSettings
from hil_sim.gait.walk import Shape, lifted, stance_share, swing

_WALK_RAMP_S = 1.5
_SIT_RAMP_S = 2.5
_CHANGE_S = 1.2  # from one gait to another
_TURN_SWING = 0.4  # how much quicker one turns when both feet change
_LAG_S = 0.2  # a changed parameter, or wearer, is taken over in about three of these

_FALLEN = {FallState.FALLING: Label.FALL, FallState.LYING: Label.LYING, FallState.RISING: Label.GET_UP}


class Generator:
    """The present motion of one wearer; `step` moves it on, the rest says what it is.

    Without a `source` of random numbers every stride is like the other. Any activity can follow any other;
    where one has to stand or get up in between, that is done first.
    """

    def __init__(
        self, shape: Shape, wearer: WearerSettings = NOMINAL, source: random.Random | None = None
    ) -> None:
        self.wearer = wearer
        self.walk = wearer.walk
        self._standing = (
            (STANDING, STANDING) if self.walk is None else tuple(limb.standing for limb in self.walk.limbs)
        )
        self._half_way = 0.5 if self.walk is None else 0.5 - self.walk.late  # from the left strike's phase
        self.heading = 0.0  # yaw of the way (rad, to the left); goes on over full turns
        self.moment = 0  # another number after each step
        self._source = source
        self.reset(shape)

    def reset(self, shape: Shape) -> None:
        """Stand, with this shape for the steps to come."""
        self.stumble, self.fall = Stumble(), Fall()
        self._rhythm = Rhythm(self.wearer.variability, self._source)
        self._lag = Lag(_LAG_S, self._targets(shape))
        self._walk, self._sit, self._change = Ramp(_WALK_RAMP_S), Ramp(_SIT_RAMP_S), Ramp(_CHANGE_S)
        self._from = self._to = Activity.WALK
        self._activity = Activity.STAND
        self._mishap: Activity | None = None
        self._show()

    def trip(self, side: int) -> None:
        """Begin a stumble of this leg, wherever in its stride it is."""
        self.stumble.start(side, self.shape.cycle_time)

    # -- moving on ---------------------------------------------------------------------------------------

    def step(self, dt: float, activity: Activity, wanted: Shape) -> None:
        """Move on by `dt` seconds towards `activity` and `wanted`."""
        self._notice(activity)
        base = self._base(activity)
        self._lag.step(dt, self._targets(wanted))
        self.heading += dt * self.yaw_rate
        self.stumble.step(dt)
        self.fall.step(dt, get_up=activity is not Activity.FALL)
        self._step_gait(dt, base)
        self._walk.step(dt, base in GAITS and self._sit.share == 0.0)
        self._sit.step(dt, base is Activity.SIT and self._walk.share == 0.0)
        self._step_phase(dt)
        self._show()

    def _show(self) -> None:
        """Cache values that follow from the present state."""
        left, right, cycle_time, toe_height, trunk_angle, self.asymmetry, *impairment = self._lag.values
        self.shape = Shape((left + right) / 2.0, cycle_time, toe_height, trunk_angle)
        self.impairment = tuple(impairment)  # of left and right leg
        self.walking = self._walk.smooth  # 0 standing … 1 moving in a gait
        self.sitting = posture.bent(self._sit.share)  # 0 upright … 1 legs bent as one sits
        share = self._change.smooth
        parts = ((self._from, 1.0 - share), (self._to, share))
        self.gaits = tuple((GAITS[gait], part) for gait, part in parts if part > 0.0)  # each with its share
        self._legs: tuple[Leg, Leg] | None = None
        self.moment += 1

    def _notice(self, activity: Activity) -> None:
        """Schedule a newly requested stumble or fall for the next occasion, once."""
        if activity is not self._activity:
            self._activity = activity
            self._mishap = activity if activity in (Activity.STUMBLE, Activity.FALL) else None
        if self._mishap is Activity.FALL and self._sit.share == 0.0 and self.fall.state is FallState.UPRIGHT:
            self._mishap = None
            self.fall.start(side_of_fall(0.5 if self._source is None else self._source.random()))

    def _base(self, activity: Activity) -> Activity:
        """Return the body's activity apart from stumble and fall."""
        if self.fall.state is not FallState.UPRIGHT or activity is Activity.FALL:
            return Activity.STAND
        return Activity.WALK if activity is Activity.STUMBLE else activity

    def _step_gait(self, dt: float, base: Activity) -> None:
        if self._change.share == 1.0:
            self._from, self._change = self._to, Ramp(_CHANGE_S)
        if base in GAITS and not self._change.moving:
            self._to = base
            if self._walk.share == 0.0:
                self._from = base
        self._change.step(dt, self._from is not self._to)

    def _step_phase(self, dt: float) -> None:
        if self._walk.share == 0.0:
            self._rhythm.rest()
            return
        before = [self.leg_phase(side) for side in (LEFT, RIGHT)]
        self._rhythm.step(dt, self.shape.cycle_time)
        if self._mishap is Activity.STUMBLE and self._steady(Activity.WALK):
            for side in (LEFT, RIGHT):
                if before[side] < TRIP_PHASE <= self.leg_phase(side):
                    self._mishap = None
                    self.stumble.start(side, self.shape.cycle_time)

    def _steady(self, gait: Activity) -> bool:
        return self._walk.share == 1.0 and self._from is self._to is gait

    def _targets(self, wanted: Shape) -> tuple[float, ...]:
        deviations = self._rhythm.deviations
        step = wanted.step_length
        return (
            step * deviations.left_step,
            step * deviations.right_step,
            wanted.cycle_time * deviations.cycle,
            wanted.toe_height * deviations.toe,
            wanted.trunk_angle,
            self.wearer.asymmetry,
            *self.wearer.impairment,
        )

    # -- what is being done ------------------------------------------------------------------------------

    @property
    def phase(self) -> float:
        """Phase of the left stride, 0 … 1, heel strike is 0."""
        return self._rhythm.phase

    @property
    def seating(self) -> float:
        """Share of the way from standing (0) to the seat (1)."""
        return self._sit.share

    @property
    def in_transition(self) -> bool:
        """Whether the motion is between two activities."""
        return self._walk.moving or self._sit.moving or self._change.moving

    @property
    def label(self) -> Label:
        """The present activity; between two gaits, the greater part."""
        if self.fall.state is not FallState.UPRIGHT:
            return _FALLEN[self.fall.state]
        if self.stumble.active:
            return Label.STUMBLE
        if self._sit.moving:
            return Label.STAND_TO_SIT if self._sit.rate > 0.0 else Label.SIT_TO_STAND
        if self._sit.share == 1.0:
            return Label.SIT
        if self._walk.share < 0.5:
            return Label.STAND
        return Label[(self._from if self._change.share < 0.5 else self._to).name]

    @property
    def at_rest(self) -> Activity:
        """Where one stays when the machine stops: on the seat, on the ground, else standing."""
        if self.fall.state in (FallState.FALLING, FallState.LYING):
            return Activity.FALL
        return Activity.SIT if self._sit.share == 1.0 else Activity.STAND

    def leg_phase(self, side: int) -> float:
        """Return the phase of one leg's own stride."""
        phase = self._rhythm.phase + (self._half_way if side == RIGHT else 0.0)
        if self.stumble.active and self.stumble.side == side:
            phase -= self.stumble.lag
        return phase % 1.0

    def stance_share(self, side: int) -> float:
        """Return the stance share of one leg's stride; an impaired leg hands some of it to the other."""
        impaired = self.impairment
        share = stance_share(self.shape.speed) + 0.03 * (impaired[1 - side] - impaired[side])
        return share if self.walk is None else self.walk.stance_share(side, share)

    @property
    def yaw_rate(self) -> float:
        """Yaw rate of the path (rad/s, to the left); a turn is made step by step."""
        turn = sum(share * gait.turn for gait, share in self.gaits)
        with_steps = 1.0 + _TURN_SWING * math.cos(2.0 * math.tau * self.phase)
        return turn * with_steps * self.walking * (1.0 - self.fall.share) / self.shape.cycle_time

    @property
    def trunk(self) -> float:
        """Forward lean of the trunk (rad)."""
        gait = self.walking * sum(share * gait.lean for gait, share in self.gaits)
        upright = (
            self.shape.trunk_angle + self.wearer.lean + gait + posture.lean(self.seating) + self.stumble.pitch
        )
        return upright + self.fall.share * (self.fall.pitch - upright)

    @property
    def acceleration(self) -> tuple[float, float]:
        """Acceleration of the trunk, forward and up (m/s²), without the gait's own forces."""
        forward, up = posture.acceleration(self.seating, self._sit.rate, self.wearer.leg_length)
        return (
            forward + self.stumble.acceleration + self.fall.acceleration,
            up + self.fall.height_acceleration,
        )

    # -- the legs ----------------------------------------------------------------------------------------

    def legs(self) -> tuple[Leg, Leg]:
        """Left and right leg."""
        if self._legs is None:
            self._legs = self._leg(LEFT), self._leg(RIGHT)
        return self._legs

    def _leg(self, side: int) -> Leg:
        walking, sitting, fallen = self.walking, self.sitting, self.fall.share
        standing = self._standing[side]
        pose = standing if walking == 0.0 else mix(standing, self._stepping(side), walking)
        pose = mix(pose, SITTING, sitting)
        pose = pose._replace(hip=pose.hip + self.trunk)
        if self.stumble.active and self.stumble.side == side:
            pose = pose._replace(hip=pose.hip + self.stumble.hip, knee=pose.knee + self.stumble.knee)
        return mix(pose, LYING, fallen)

    def _stepping(self, side: int) -> Leg:
        """One leg in the present gait, with the wearer's habits and impairment."""
        wearer, phase = self.wearer, self.leg_phase(side)
        impaired = self.impairment[side]
        asymmetry = 1.0 + (0.5 - side) * self.asymmetry
        step = self._lag.values[side] * asymmetry * (1.0 - 0.2 * impaired)
        limb = None if self.walk is None else self.walk.limbs[side]
        if limb is not None:
            step *= limb.step
        parts = [
            (gait.leg(phase, step * gait.steps[side], wearer.leg_length), share) for gait, share in self.gaits
        ]
        pose = parts[0][0] if len(parts) == 1 else mix(parts[0][0], parts[1][0], parts[1][1])
        swinging = swing(phase, self.stance_share(side))
        pose = lifted(pose, self.shape.toe_height, swinging)
        hip, knee, ankle = wearer.habits
        stepping = Leg(
            pose.hip + hip(phase),
            (pose.knee + knee(phase)) * (1.0 - 0.4 * impaired * swinging),
            pose.ankle + ankle(phase) - 0.2 * impaired * swinging,
        )
        return stepping if limb is None else limb.changed(stepping, phase, swinging)
