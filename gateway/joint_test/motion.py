"""Motion of each joint test: the target of each cycle, from the position in the one before.

Angles are rad of the joint, relative to where it stood; of a relay the targets are torques (N·m).
"""

import math
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

Motion = Generator[float, float, None]  # of targets; is sent the position that came of the last one

STEP_REST_S = 1.0  # before and after each step
SWEEP_REST_S = 0.5
RUN_REST_S = 0.3
RUN_RAMP_S = 0.25  # to reach the speed of a run
LEVELS = 5  # of speed, each half of the one before
RELAY_S = 5.0  # for one cycle of a relay, at most: then nothing oscillates
BIAS_GAIN = 0.5  # of the relay's torque, by which a lopsided cycle shifts its middle
MOST_SHARE = 0.25  # of the sample rate that a chirp may reach


class JointTestKind(StrEnum):
    """Kind of test."""

    STEP = "step"
    CHIRP = "chirp"
    FRICTION = "friction"
    RELAY = "relay"

    @property
    def by_torque(self) -> bool:
        """Whether the drive is led by torque, not by position."""
        return self is JointTestKind.RELAY


@dataclass(frozen=True, slots=True)
class Wish:
    """The requested test. `amplitude` is in rad; of a relay it is the allowed swing."""

    kind: JointTestKind
    amplitude: float
    speed: float  # rad/s, of the target at most
    repeat: int = 3  # steps there and back; cycles of a relay
    low_hz: float = 0.2
    high_hz: float = 15.0
    seconds: float = 30.0  # of a chirp
    torque: float = 0.0  # N·m, of a relay
    hysteresis: float = 0.0  # rad, of a relay


def motion(wish: Wish, period_s: float) -> Motion:
    """Return the targets of this test, one each `period_s`."""
    if wish.kind is JointTestKind.RELAY:
        return _relay(wish, period_s)
    return _ignoring(_MADE[wish.kind](wish, period_s))


def planned(wish: Wish, period_s: float) -> tuple[float, float, float, float]:
    """Return the lowest and highest target, the fastest change of it (rad, rad/s), and how long it takes (s).

    Of a relay they are what it may come to: it goes by what the joint does.
    """
    if wish.kind is JointTestKind.RELAY:
        return -wish.amplitude, wish.amplitude, wish.speed, RELAY_S * (wish.repeat + 2)
    targets = list(_MADE[wish.kind](wish, period_s))
    fastest = max(abs(after - before) for before, after in pairwise(targets)) / period_s
    return min(targets), max(targets), fastest, len(targets) * period_s


def _ignoring(targets: Iterator[float]) -> Motion:
    for target in targets:  # noqa: UP028 - what is sent is for nobody: a list takes none
        yield target


def _rest(seconds: float, at: float, period_s: float) -> Iterator[float]:
    yield from [at] * round(seconds / period_s)


def _step(wish: Wish, period_s: float) -> Iterator[float]:
    """Yield the way there and back, each as fast as the speed allows."""
    yield from _rest(STEP_REST_S, 0.0, period_s)
    for _ in range(wish.repeat):
        yield from _line(0.0, wish.amplitude, wish.speed, period_s)
        yield from _rest(STEP_REST_S, wish.amplitude, period_s)
        yield from _line(wish.amplitude, 0.0, wish.speed, period_s)
        yield from _rest(STEP_REST_S, 0.0, period_s)


def _line(start: float, end: float, speed: float, period_s: float) -> Iterator[float]:
    count = max(1, math.ceil(abs(end - start) / (speed * period_s) - 1e-9))
    yield from (start + (end - start) * step / count for step in range(1, count + 1))


def _chirp(wish: Wish, period_s: float) -> Iterator[float]:
    """Yield a sine whose frequency rises by equal factors in equal times, as wide as the speed allows."""
    yield from _rest(SWEEP_REST_S, 0.0, period_s)
    octaves = math.log(wish.high_hz / wish.low_hz)
    for cycle in range(round(wish.seconds / period_s)):
        at_s = cycle * period_s
        share = math.exp(octaves * at_s / wish.seconds)
        phase = math.tau * wish.low_hz * wish.seconds / octaves * (share - 1.0)
        wide = min(wish.amplitude, wish.speed / (math.tau * wish.low_hz * share))
        fade = min(1.0, (wish.seconds - at_s) / SWEEP_REST_S)
        yield wide * fade * math.sin(phase)
    yield from _rest(SWEEP_REST_S, 0.0, period_s)


def _friction(wish: Wish, period_s: float) -> Iterator[float]:
    """Yield the way at constant speeds there and back, the fastest first."""
    for level in range(LEVELS):
        speed = wish.speed / 2**level
        for start, end in ((0.0, wish.amplitude), (wish.amplitude, 0.0)):
            yield from _rest(RUN_REST_S, start, period_s)
            yield from _run(start, end, speed, period_s)
    yield from _rest(RUN_REST_S, 0.0, period_s)


def _run(start: float, end: float, speed: float, period_s: float) -> Iterator[float]:
    """Yield a trapezoid of speed."""
    way = abs(end - start)
    ramp_s = min(RUN_RAMP_S, way / speed)
    total_s = way / speed + ramp_s
    for cycle in range(1, math.ceil(total_s / period_s)):
        at_s = cycle * period_s
        up, down = min(at_s, ramp_s), min(total_s - at_s, ramp_s)
        gone = speed * (up * up / 2 / ramp_s + max(0.0, min(at_s, total_s - ramp_s) - ramp_s))
        if down < ramp_s:
            gone = way - speed * down * down / 2 / ramp_s
        yield start + math.copysign(gone, end - start)
    yield end


_MADE = {JointTestKind.STEP: _step, JointTestKind.CHIRP: _chirp, JointTestKind.FRICTION: _friction}


def _relay(wish: Wish, period_s: float) -> Motion:
    """Torque against where the joint is (Åström and Hägglund, 1984).

    What a cycle lacks in symmetry is the load's, and shifts the middle. It ends after so many cycles, or
    where nothing oscillates.
    """
    side, bias, position = 1.0, 0.0, 0.0
    lasted = {1.0: 0.0, -1.0: 0.0}
    for _ in range(2 * (wish.repeat + 2)):
        lasted[side] = 0.0
        while side * position < wish.hysteresis or not lasted[side]:
            position = yield bias + side * wish.torque
            lasted[side] += period_s
            if lasted[side] > RELAY_S / 2:
                return
        if side < 0:
            shift = (lasted[1.0] - lasted[-1.0]) / (lasted[1.0] + lasted[-1.0])
            bias += BIAS_GAIN * shift * wish.torque
        side = -side
    yield 0.0
