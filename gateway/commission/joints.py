"""The steps of a joint: which drive it is, what its counts mean, how far it goes, what it is rated for."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import eds
from eds.profile import profile_of
from gateway.commission import scale as scales
from gateway.commission.axes import HALF, Axis, answered, counts, nearest, number, powered
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say, Talk, choose, press, word
from gateway.commission.dialogue import number as ask_number
from gateway.commission.draft import Draft
from gateway.commission.live_values import watched
from gateway.commission.scale import HeldPose, Nominal, Scale

USUAL = ("left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle")
CLEARLY = 10  # times as far as any other drive
LEAST_MOVE = 50  # counts
STILL = 3  # tries for a position that is held still
MARGIN = 3.0  # ° within the ends that were found by hand
MOVED, SKIP = "moved", "skip"
ENDS = "ends"  # among what was told of a joint: how far it goes by hand
SET_ITS_ZERO = (
    "without another zero in the drive this joint is not finished. Homing at the present position (below), "
    "or its maker's tool, gives it one"
)
_NAME = re.compile("[a-z][a-z0-9_]*")


def table(joint: str) -> str:
    return f"joint.{joint}"


def words(joint: str) -> str:
    """Return its name for people: left knee."""
    return joint.replace("_", " ")


def names(draft: Draft, axes: Sequence[Axis]) -> Talk[list[str]]:
    """Ask for the robot's joints, in the order of the questions."""
    if not draft.has("robot", "joints"):
        usual = " ".join(USUAL) if len(axes) == len(USUAL) else None
        typed = yield from word(
            f"There are {len(axes)} drives. How are the joints called, in the order in which you reach them "
            "(left_knee …; flexion and dorsiflexion count positive)?",
            usual,
            lambda text: _names_problem(text.split(), len(axes)),
        )
        draft.put("robot", "joints", typed.split())
    found: list[str] = draft.value("robot", "joints")
    return found


def _names_problem(names: Sequence[str], most: int) -> str | None:
    if len(set(names)) != len(names):
        return "two joints have one name"
    wrong = [name for name in names if not _NAME.fullmatch(name)]
    if wrong:
        return f"{wrong[0]!r} is no name of small letters, digits and _, a letter first"
    return f"these are {len(names)} joints, and there are {most} drives" if len(names) > most else None


def unpowered(bench: Bench, axes: Sequence[Axis]) -> Talk[None]:
    """Wait until no drive has power: nobody moves a joint by hand whose drive might move it."""
    while live := (yield from answered(lambda: powered(bench, axes))):
        yield from press(
            f"{', '.join(map(str, live))} may be under power. Switch the drives off (controller off, or STO) "
            "before you take hold of a joint; this command never switches anything on or off."
        )


def stayed_off(bench: Bench, axes: Sequence[Axis]) -> Talk[bool]:
    """Return whether no drive has had power since `unpowered`: else readings may not be by hand alone."""
    live = yield from answered(lambda: powered(bench, axes))
    if live:
        yield Say(
            f"{', '.join(map(str, live))} may be under power now: let go of the joint. What was read does "
            "not count."
        )
    return not live


def which_drive(draft: Draft, bench: Bench, joint: str, axes: Sequence[Axis]) -> Talk[Axis | None]:
    """Find the drive that counts when this joint is moved by hand; `None` to leave it out."""
    if draft.has(table(joint), "node_id"):
        return Axis(draft.value(table(joint), "node_id"), draft.value(table(joint), "axis", 0))
    while True:
        yield from unpowered(bench, axes)
        before = yield from answered(lambda: {axis: counts(bench, axis) for axis in axes})
        typed = yield from choose(
            f"Bend the {words(joint)} by hand by a good part of its way, and keep it there.",
            (MOVED, SKIP),
            MOVED,
            partial(watched, bench, axes, before),
        )
        if typed == SKIP:
            return None
        after = yield from answered(lambda: {axis: counts(bench, axis) for axis in axes})
        if not (yield from stayed_off(bench, axes)):
            continue
        axis, problem = _mover(moved := _moved(before, after))
        if axis is not None:
            others = max((far for one, far in moved.items() if one != axis), default=0)
            how = f"moved by hand: it counted {moved[axis]}, the others {others} or less"
            draft.put(table(joint), "axis", axis.number)
            draft.put(table(joint), "node_id", axis.node, how)
            yield Say(f"{words(joint)} is {axis} ({how}).")
            return axis
        yield Say(problem)


def _moved(before: Mapping[Axis, int | None], after: Mapping[Axis, int | None]) -> dict[Axis, int]:
    """Return the counted way of each axis with a position."""
    return {
        axis: abs(nearest(now, was) - was)
        for axis, was in before.items()
        if was is not None and (now := after[axis]) is not None
    }


def _mover(moved: dict[Axis, int]) -> tuple[Axis | None, str]:
    """Return the one that has moved far more than every other; else what is in the way, in words."""
    order = sorted(moved, key=lambda axis: moved[axis], reverse=True)
    if not order or moved[order[0]] < LEAST_MOVE:
        return (
            None,
            "No drive that is left has counted: is this joint one of these drives, is its encoder connected?",
        )
    if len(order) > 1 and moved[order[1]] * CLEARLY > moved[order[0]]:
        two = " and ".join(f"{axis} ({moved[axis]} counts)" for axis in order[:2])
        return None, f"Two have moved: {two}. Move this joint alone."
    return order[0], ""


def meaning(draft: Draft, bench: Bench, joint: str, axis: Axis) -> Talk[Scale]:
    """Determine the scale of its counts, from two known angles."""
    if not draft.has(table(joint), "zero_offset"):
        nominal = yield from answered(lambda: _nominal(bench, axis))
        while True:
            first = yield from held(bench, joint, axis, "one known angle, such as straight, 0°")
            second = yield from held(
                bench, joint, axis, "another known angle, 30° or more away", first.counts
            )
            problem = scales.problem(first, second)
            if problem is None and (found := (yield from _settled(first, second, nominal))) is not None:
                _keep(draft, joint, found, first, second)
                yield from _fits(found, second)
                break
            if problem is not None:
                yield Say(f"That cannot be: {problem}.")
    one = table(joint)
    return Scale(
        *(
            draft.value(one, key)
            for key in ("counts_per_revolution", "gear_ratio", "direction", "zero_offset")
        )
    )


def _nominal(bench: Bench, axis: Axis) -> Nominal:
    return Nominal(_ratio(bench, axis, 0x608F), _ratio(bench, axis, 0x6091))


def _ratio(bench: Bench, axis: Axis, index: int) -> float | None:
    """1:1 is what drives hold that were never told."""
    above, below = number(bench, axis, index, 1), number(bench, axis, index, 2)
    return above / below if above and below and above != below else None


def held(bench: Bench, joint: str, axis: Axis, where: str, near: int | None = None) -> Talk[HeldPose]:
    """Its counts unwrapped: each near the one before, the first near `near`."""
    while True:
        yield from unpowered(bench, [axis])
        degrees = yield from ask_number(
            f"Hold the {words(joint)} still at {where}, and type the angle in degrees (flexion positive).",
            "°",
            -180,
            360,
            live=partial(watched, bench, [axis]),
        )
        seen = yield from answered(lambda: [counts(bench, axis) for _ in range(STILL)])
        if not (yield from stayed_off(bench, [axis])):
            continue
        found = [one for one in seen if one is not None]
        found = [nearest(one, found[0] if near is None else near) for one in found]
        if len(found) == len(seen) and max(found) - min(found) <= LEAST_MOVE:
            return HeldPose(math.radians(degrees), round(sum(found) / len(found)))
        yield Say("It moved while it was read, or has no position: once more.")


def _settled(first: HeldPose, second: HeldPose, nominal: Nominal) -> Talk[Scale | None]:
    """Return counts and gear that fit both the positions and the drive; `None` to measure again."""
    measured = scales.counts_per_turn(first, second)
    counts_per_revolution, ratio = nominal.counts_per_revolution, nominal.gear_ratio
    off = scales.disagreement(measured, nominal)
    if off is not None:
        yield Say(
            f"The drive says {counts_per_revolution:g} counts (608Fh) and a gear of {ratio:g} (6091h); the "
            f"two angles say {off:.2f} times as many counts a turn."
        )
        choice = yield from choose(
            "Which is right? again: measure again; angles: what was measured; drive: what it says",
            ("again", "angles", "drive"),
            "again",
        )
        if choice == "again":
            return None
        ratio = ratio if choice == "drive" else None
    if counts_per_revolution is None:
        counts_per_revolution = yield from ask_number(
            "Counts of its encoder a revolution of the motor (four times its lines)?", "", 1, 1e9
        )
    if ratio is None:
        guess = scales.gear(measured, counts_per_revolution)
        ratio = yield from ask_number(
            "Revolutions of that encoder a revolution of the joint (the gear)?", "", 0.01, 1e5, guess
        )
    return scales.scale(first, second, counts_per_revolution, ratio)


def _fits(found: Scale, second: HeldPose) -> Talk[None]:
    """Warn of an encoder whose counter wraps near here: the gateway does not unwrap counts."""
    if not -HALF <= second.counts < HALF:
        yield Say(f"Its counter wraps around within the joint's way: {SET_ITS_ZERO}.")
    elif not scales.near(found):
        turns = abs(found.zero_offset) / math.tau
        yield Say(f"It counts from a zero that is {turns:.0f} turns of the joint away: {SET_ITS_ZERO}.")


def _keep(draft: Draft, joint: str, found: Scale, first: HeldPose, second: HeldPose) -> None:
    one = table(joint)
    angles = f"{math.degrees(first.angle):g}° and {math.degrees(second.angle):g}°"
    share = abs(scales.counts_per_turn(first, second)) / (found.counts_per_revolution * found.gear_ratio)
    draft.put(one, "counts_per_revolution", found.counts_per_revolution, "of the encoder that 6064h counts")
    draft.put(
        one, "gear_ratio", found.gear_ratio, f"with the counts {share:.3f} of what {angles} by hand say"
    )
    draft.put(
        one, "direction", found.direction, f"counts {'rise' if found.direction > 0 else 'fall'} with flexion"
    )
    draft.put(one, "zero_offset", round(found.zero_offset, 5), f"rad; of {angles} by hand")


def limits(draft: Draft, bench: Bench, joint: str, axis: Axis, scale: Scale) -> Talk[None]:
    """Ask for the joint's limits by hand; they become a rule of the guard, less a margin."""
    rule = f"guard.rule.{joint}_range"
    if draft.has(rule, "max"):
        return
    margin = yield from ask_number(
        f"How far within its ends may the {words(joint)} go before the guard warns?", "°", 0, 30, MARGIN
    )
    straight = yield from _end(bench, joint, axis, "as straight as it goes", scale)
    bent = yield from _end(bench, joint, axis, "as bent as it goes", scale)
    ends = [_angle(scale, here) for here in (straight, bent)]
    draft.put(f"told.{joint}", ENDS, [min(ends), max(ends)], "rad; by hand")
    low, high = min(ends) + math.radians(margin), max(ends) - math.radians(margin)
    if low >= high:
        yield Say(f"Between these ends nothing is left: {words(joint)} has no limits in the file.")
        return
    how = f"rad; by hand {math.degrees(min(ends)):.1f}° to {math.degrees(max(ends)):.1f}°, less {margin:g}°"
    draft.put(rule, "min", round(low, 4), how)
    draft.put(rule, "max", round(high, 4))


def _angle(scale: Scale, here: int) -> float:
    return scales.angle(scale, nearest(here, scales.counts_at_zero(scale)))


def _end(bench: Bench, joint: str, axis: Axis, end: str, scale: Scale) -> Talk[int]:
    while True:
        yield from unpowered(bench, [axis])
        yield from press(
            f"Bring the {words(joint)} by hand {end}, and keep it there.",
            partial(watched, bench, [axis], angle=partial(_angle, scale)),
        )
        here = yield from answered(lambda: counts(bench, axis))
        if not (yield from stayed_off(bench, [axis])):
            continue
        if here is not None:
            return here
        yield Say("Its position could not be read: once more.")


RATINGS: tuple[tuple[str, int, str, str, Callable[[int, float, float], float]], ...] = (
    ("rated_current", 0x6075, "A", "current", lambda raw, _gear, _nm: raw / 1000),
    ("rated_torque", 0x6076, "N·m", "torque at the joint", lambda raw, gear, nm: raw * nm * gear),
)


def ratings(draft: Draft, bench: Bench, joint: str, axis: Axis, gear: float) -> Talk[None]:
    """Show the drive's ratings, and ask for missing ones, which may stay unknown."""
    torque_nm = _rated_torque_nm(draft, axis.node)
    for key, index, unit, what, si in RATINGS:
        if draft.has(table(joint), key) or draft.has(f"told.{joint}", key):
            continue
        raw = yield from answered(partial(number, bench, axis, index))
        if raw:
            rated = si(raw, gear, torque_nm)
            yield Say(f"{words(joint)}: rated {what} {rated:g} {unit} ({index:04X}h).")
            draft.put(f"told.{joint}", key, rated, f"{index:04X}h")
            continue
        value = yield from ask_number(
            f"The drive does not know its rated {what} ({index:04X}h). What is it? 0: not known",
            unit,
            0,
            1e4,
            0,
        )
        if value:
            draft.put(table(joint), key, value, f"{unit}; typed, {index:04X}h does not say it")
        else:
            draft.put(f"told.{joint}", key, None, "not known")


def _rated_torque_nm(draft: Draft, node: int) -> float:
    """Return the torque of one count of 6076h: 1 mN·m (CiA 402-2), unless the product's profile differs."""
    file = draft.value(f"node.{node}", "eds")
    profile = None if file is None else profile_of(eds.load(eds.locate(file, draft.file), node))
    return 0.001 if profile is None else profile.rated_torque_nm
