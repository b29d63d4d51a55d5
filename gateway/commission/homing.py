"""The step of homing: the drive finds its own zero (CiA 402 mode 6), only after somebody's explicit word.

It is offered, told in words, and begun only where all is known that could stop the joint. The methods that
take the present position as home, and move nothing, come first.
"""

import math
from functools import partial
from pathlib import Path

import eds
from drivers.errors import DriverError
from drivers.joint.homing import HOME_OFFSET, METHODS, offered
from drivers.joint.settings import JointSettings
from eds import Description
from gateway.commission import scale as scales
from gateway.commission.axes import Axis, answered, nearest, number
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Ask, Moving, Say, Talk, choose, press
from gateway.commission.draft import Draft, DraftValue
from gateway.commission.homing_plan import (
    STILL,
    TOLD,
    HomingBasis,
    armed,
    explained,
    known_now,
    option,
    planned,
    refusal,
    told,
)
from gateway.commission.homing_run import HomingLimits, HomingRun
from gateway.commission.joints import ENDS, held, table, words
from gateway.commission.nodes import table as node_table
from gateway.commission.powered_run import NotStopped, PoweredRunResult
from gateway.commission.scale import Scale

NO = "no"
LASTING = "an encoder that is not absolute forgets it with its power: home it again then"


def homing(draft: Draft, bench: Bench, joint: str, axis: Axis, scale: Scale) -> Talk[None]:
    """Offer it; what came of it is in the draft, with the zero that holds from then on."""
    methods = () if draft.has(told(joint), "homing") else (yield from _methods(draft, bench, joint, axis))
    while methods and not draft.has(told(joint), "homing"):
        method = yield from _chosen(joint, methods)
        if method is None:
            draft.put(told(joint), "homing", None, "not homed by its drive")
        else:
            scale = yield from _one(draft, bench, joint, axis, scale, method)
    if draft.has(table(joint), "zero_offset") and not scales.near(scale):
        draft.forget(table(joint), "zero_offset")
        yield Say(f"The {words(joint)} is not finished: its zero is not within a turn of the drive's.")


def _methods(draft: Draft, bench: Bench, joint: str, axis: Axis) -> Talk[tuple[int, ...]]:
    description = _description(draft, axis)
    found = yield from answered(lambda: offered(partial(number, bench, axis), description, axis.index(0)))
    return tuple(one for one in found if not METHODS[one].moves or draft.has(told(joint), ENDS))


def _description(draft: Draft, axis: Axis) -> Description:
    path: Path = eds.locate(draft.value(node_table(axis.node), "eds"), draft.file)
    return eds.load(path, axis.node)


def _chosen(joint: str, methods: tuple[int, ...]) -> Talk[int | None]:
    listed = "; ".join(f"{one}: {METHODS[one].words}" for one in methods)
    choice = yield from choose(
        f"Should the drive of the {words(joint)} find its own zero (homing)? It gets power for that, and is "
        f"disabled again. {NO}: nothing gets power; {listed}",
        (NO, *map(str, methods)),
        NO,
    )
    return None if choice == NO else int(choice)


def _one(draft: Draft, bench: Bench, joint: str, axis: Axis, scale: Scale, method: int) -> Talk[Scale]:
    """One try; returns the scale that holds then. Where it is not over it may be tried again."""
    why = yield from answered(lambda: refusal(draft, bench, joint, axis))
    why = why or (yield from armed(bench, axis))
    if why is not None:
        yield Say(f"The {words(joint)} is not homed: {why}.")
        draft.put(told(joint), "homing", None, f"not homed: {why}")
        return scale
    known = yield from known_now(draft, bench, joint, axis, scale, _description(draft, axis))
    plan = yield from planned(bench, known, method)
    if plan is None or not (yield from _agreed(bench, known, method, plan)):
        yield Say("Nothing gets power.")
        return scale
    yield Say("Listening whether somebody else is on the bus; then it begins …")
    zero = _forget_zero(draft, joint)
    outcome = yield from _run(draft, bench, known, plan)
    if outcome is None or outcome.before is None:  # nothing was begun that could have given it another zero
        draft.put(table(joint), "zero_offset", zero.value, zero.how)
        return scale
    return (yield from _new_zero(draft, bench, known, method, outcome))


def _forget_zero(draft: Draft, joint: str) -> DraftValue:
    """Forget the zero from before a homing, also on disk, whatever becomes of this program."""
    zero = draft.tables[table(joint)]["zero_offset"]
    draft.forget(table(joint), "zero_offset")
    draft.put(told(joint), "homing_begun", True)
    return zero


# The word.


def _agreed(bench: Bench, known: HomingBasis, method: int, plan: HomingLimits) -> Talk[bool]:
    yield from press(
        f"The drive of the {words(known.joint)} is to get power. Nobody wears the robot, all hands are "
        "off it, the hardware emergency stop is within reach, and the drive's power and STO are released."
    )
    options = yield from answered(lambda: {index: option(bench, known.axis, index) for index in TOLD})
    yield Say("\n".join(explained(known, method, plan, options)))
    phrase = f"home {known.joint}"
    typed = yield Ask(f"Type  {phrase}  to put it under power and begin; anything else: nothing gets power.")
    return typed == phrase


# Under power.


def _run(draft: Draft, bench: Bench, known: HomingBasis, plan: HomingLimits) -> Talk[PoweredRunResult | None]:
    try:
        with bench.power(_settings(draft, known), known.description) as power:
            why = yield Moving(f"The {words(known.joint)} gets power now. STOP: Enter.")
            if why:  # pressed while it listened
                yield Say(f"Nothing got power: {why}.")
                return None
            run = HomingRun(power, plan)
            outcome = yield from _followed(run, known)
    except DriverError as error:
        yield Say(f"Nothing got power: {error}.")
        return None
    result = "Home was found" if outcome.problem is None else f"Not homed: {outcome.problem}"
    yield Say(f"{result}; {outcome.text}.")
    if power.left is not None:
        yield Say(f"{power.left}.")
    return outcome


def _followed(run: HomingRun, known: HomingBasis) -> Talk[PoweredRunResult]:
    """Every way out of here ends it, and waits for that."""
    try:
        run.start()
        while not run.done:
            moved = math.degrees(run.moved * known.scale.direction * math.tau / known.counts_per_turn)
            why = yield Moving(
                f"The {words(known.joint)} is under power. STOP: Enter. {run.said} ({moved:+.1f}°)"
            )
            if why:
                run.stop(why)
            else:
                run.keep()
    finally:
        outcome = run.end()
        if not outcome.off:
            raise NotStopped(f"{words(known.joint)}: {outcome.problem or 'homed'}; {outcome.text}")
    return outcome


def _settings(draft: Draft, known: HomingBasis) -> JointSettings:
    return JointSettings(
        bus="main",
        node_id=known.axis.node,
        axis=known.axis.number,
        eds=draft.value(node_table(known.axis.node), "eds"),
        counts_per_revolution=known.scale.counts_per_revolution,
        gear_ratio=known.scale.gear_ratio,
        direction=1 if known.scale.direction > 0 else -1,
    )


# The zero that holds from now on.


def _new_zero(
    draft: Draft, bench: Bench, known: HomingBasis, method: int, outcome: PoweredRunResult
) -> Talk[Scale]:
    """Determine the joint's zero: as the drive counted, or by a known angle if it may have moved."""
    joint, scale = known.joint, known.scale
    offset = yield from answered(lambda: option(bench, known.axis, HOME_OFFSET, 4))
    if _is_there(known, method, outcome, offset) and outcome.before is not None and outcome.after is not None:
        angle = scales.angle(scale, nearest(outcome.before, known.position))
        position, how = outcome.after, "where it stood"
    else:
        found = yield from held(bench, joint, known.axis, "one known angle, without power")
        angle, position, how = found.angle, found.counts, "by hand"
    new = scales.with_zero(scale, angle, position)
    text = f"rad; {math.degrees(angle):.2f}° {how} after homing by method {method}"
    if outcome.problem is None:
        text += f", 607Ch {offset}; {LASTING}"
        draft.put(told(joint), "homing", method, f"homed by its drive, method {method}, 607Ch {offset}")
    draft.put(table(joint), "zero_offset", round(new.zero_offset, 5), text)
    yield Say(f"{words(joint)}: the zero is {new.zero_offset:.4f} rad. {LASTING[0].upper()}{LASTING[1:]}.")
    return new


def _is_there(known: HomingBasis, method: int, outcome: PoweredRunResult, offset: int | None) -> bool:
    """Return whether nothing has moved, and the drive counts as homing makes it: its 607Ch is where it is."""
    if METHODS[method].moves or outcome.problem is not None or outcome.after is None:
        return False
    return (
        abs(nearest(outcome.after, offset or 0) - (offset or 0)) <= STILL * known.counts_per_turn / math.tau
    )
