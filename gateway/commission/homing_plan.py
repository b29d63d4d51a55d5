"""Prerequisites and limits of a homing, also in words for the person at the robot."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drivers.bus.arming import ABORT_CONNECTION, ACTING, CONSUMER
from drivers.errors import DriverError, Unavailable
from drivers.joint.cia402 import ABORT_CONNECTION_OPTIONS, QUICK_STOP_OPTIONS, option_text
from drivers.joint.homing import ACCELERATION, METHODS, SPEEDS, Setup
from drivers.joint.scaling import drive_speed
from eds import Description
from gateway.commission import scale as scales
from gateway.commission.axes import Axis, answered, counts, nearest, number
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say, Talk, agree
from gateway.commission.dialogue import number as ask_number
from gateway.commission.draft import Draft
from gateway.commission.homing_run import HomingLimits
from gateway.commission.joints import ENDS, table, words
from gateway.commission.scale import Scale

QUICK_STOP, VELOCITY_UNIT, MAX_CURRENT, MAX_TORQUE = 0x605A, 0x60A9, 0x6073, 0x6072
TOLD = (QUICK_STOP, ABORT_CONNECTION, MAX_CURRENT, MAX_TORQUE)
SPEED, LEAST_SPEED, MOST_SPEED = 5.0, 0.5, 20.0  # °/s, of the joint
ZERO_SHARE = 0.2  # of that, from the switch on
RAMP_S = 0.25  # to reach it
STILL = math.radians(0.5)  # that a method may move which moves nothing
LAG = math.radians(5.0)  # that a joint may follow behind
EXTRA_S = 20.0
STILL_S = 5.0


@dataclass(frozen=True, slots=True)
class HomingBasis:
    """Prerequisites of homing. `ends` are its limits by hand (rad), None if nobody has shown them."""

    joint: str
    axis: Axis
    scale: Scale
    description: Description
    ends: tuple[float, float] | None
    angle: float  # now
    position: int  # counts

    @property
    def counts_per_turn(self) -> float:
        return self.scale.counts_per_revolution * self.scale.gear_ratio

    def counts_at(self, angle: float) -> int:
        return self.position + round(
            (angle - self.angle) * self.scale.direction * self.counts_per_turn / math.tau
        )


def told(joint: str) -> str:
    return f"told.{joint}"


def refusal(draft: Draft, bench: Bench, joint: str, axis: Axis) -> str | None:
    """Return why it must not be put under power, in words. Raises `DriverError`."""
    for key, index in (("rated_current", 0x6075), ("rated_torque", 0x6076)):
        if not draft.value(table(joint), key) and not draft.value(told(joint), key):
            return f"its {key.replace('_', ' ')} is not known ({index:04X}h, or typed)"
    if not any(number(bench, axis, index) for index in (MAX_CURRENT, MAX_TORQUE)):
        return "its drive tells no limit of current or torque (6073h, 6072h)"
    if counts(bench, axis) is None:
        return "its drive tells no position (6064h)"
    return None


def armed(bench: Bench, axis: Axis) -> Talk[str | None]:
    """Return why it would not stop by itself if this program died; may set 6007h so that it does."""
    reaction = yield from answered(lambda: option(bench, axis, ABORT_CONNECTION))
    entries = yield from answered(lambda: number(bench, Axis(axis.node), CONSUMER))
    if not entries:
        return (
            "its drive cannot watch our heartbeat (1016h), so that nothing would stop it if this program died"
        )
    if reaction in ACTING:
        return None
    if reaction != 0:
        what = option_text({}, reaction)
        return f"nobody knows what its drive does when communication is lost: 6007h {what}"
    yes = yield from agree(
        "If this program died its drive would go on (6007h is 0). Write 6007h = 3, a quick stop? It stays so "
        "until its power goes."
    )
    if not yes:
        return "its drive would go on if this program died (6007h is 0)"
    try:
        bench.write(axis.node, axis.index(ABORT_CONNECTION), 0, (3).to_bytes(2, "little"))
    except DriverError as error:
        return f"6007h was not taken: {error}"
    return None


def option(bench: Bench, axis: Axis, index: int, size: int = 2) -> int | None:
    """Return a signed object; `None` where the drive has none. Raises `DriverError`."""
    data = bench.read(axis.node, axis.index(index))
    return None if data is None else int.from_bytes(data[:size], "little", signed=True)


def known_now(
    draft: Draft, bench: Bench, joint: str, axis: Axis, scale: Scale, description: Description
) -> Talk[HomingBasis]:
    position = yield from answered(lambda: _position(bench, axis))
    position = nearest(position, scales.counts_at_zero(scale))
    ends = draft.value(told(joint), ENDS)
    return HomingBasis(
        joint,
        axis,
        scale,
        description,
        None if ends is None else (ends[0], ends[1]),
        scales.angle(scale, position),
        position,
    )


def _position(bench: Bench, axis: Axis) -> int:
    if (position := counts(bench, axis)) is None:
        raise Unavailable(f"{axis} tells no position (6064h)")
    return position


def planned(bench: Bench, known: HomingBasis, method: int) -> Talk[HomingLimits | None]:
    """Plan the limits; `None` if the speed cannot be set."""
    lag = LAG * known.counts_per_turn / math.tau
    if not METHODS[method].moves:
        ends = [known.counts_at(known.angle + by) for by in (-STILL, STILL)]
        return HomingLimits(Setup(method), min(ends), max(ends), lag, lag, STILL_S)
    low, high = known.ends or (known.angle, known.angle)
    if not low <= known.angle <= high:
        yield Say(
            f"It stands at {math.degrees(known.angle):.1f}°, not between the ends that were shown by hand."
        )
        return None
    degrees = yield from ask_number(
        f"How fast may the {words(known.joint)} move at most?", "°/s", LEAST_SPEED, MOST_SPEED, SPEED
    )
    setup = yield from answered(lambda: _setup(bench, known, method, math.radians(degrees)))
    if setup is None:
        yield Say("Its speeds cannot be set: nobody knows in which unit, or it has no 6099h.")
        return None
    ends = [known.counts_at(end) for end in (low, high)]
    time_s = EXTRA_S + 2 * math.degrees(high - low) / degrees
    return HomingLimits(
        setup, min(ends), max(ends), math.radians(degrees) * known.counts_per_turn / math.tau, lag, time_s
    )


def _setup(bench: Bench, known: HomingBasis, method: int, rad_s: float) -> Setup | None:
    """Return the drive's own units; raises `DriverError`."""
    description, axis, gear = known.description, known.axis, known.scale.gear_ratio
    unit = number(bench, axis, VELOCITY_UNIT)
    fast = drive_speed(rad_s, known.counts_per_turn, gear, unit)
    if fast is None or not description.has(axis.index(SPEEDS), 1) or fast * ZERO_SHARE < 1:
        return None
    in_counts = not unit and description.has(axis.index(ACCELERATION))
    slow = round(fast * ZERO_SHARE) if description.has(axis.index(SPEEDS), 2) else None
    return Setup(method, round(fast), slow, round(fast / RAMP_S) if in_counts else None)


def explained(
    known: HomingBasis, method: int, plan: HomingLimits, told: Mapping[int, int | None]
) -> Iterator[str]:
    """Yield the plan for the person, line by line; `told` are the drive's objects TOLD."""
    one, turn = METHODS[method], known.counts_per_turn
    yield f"What will happen, to the {words(known.joint)} ({known.axis}) alone:"
    yield f"  method {method}: the drive {one.words}; its position then counts as 607Ch says"
    if one.moves:
        low, high = (math.degrees(end) for end in known.ends or (0.0, 0.0))
        speed = math.degrees(plan.fastest * math.tau / turn)
        yield (
            f"  it moves, from {math.degrees(known.angle):.1f}° where it is now, at most to {low:.1f}° and "
            f"{high:.1f}° (its ends by hand), at {speed:.3g}°/s at most, for {plan.time_s:.0f} s at most"
        )
    else:
        yield "  it is held where it is for a moment; more than half a degree ends it"
    for index, what in ((MAX_CURRENT, "current"), (MAX_TORQUE, "torque")):
        if told[index]:
            yield f"  its {what}: at most {(told[index] or 0) / 10:g} % of the rated one ({index:04X}h)"
    yield f"  a stop: the drive {option_text(QUICK_STOP_OPTIONS, told[QUICK_STOP])} (605Ah), and is disabled"
    on_loss = option_text(ABORT_CONNECTION_OPTIONS, told[ABORT_CONNECTION])
    yield f"  if this program dies: the drive {on_loss} (6007h)"
    yield "  STOP: Enter, at any time; so do Ctrl-C, a closed terminal, another master, and a drive that errs"
