"""What must never be, each in a sentence: judged between any two tasks, at each answer, and when all is quiet."""

from collections.abc import Callable, Iterator

from drivers.joint.cia402 import DriveState
from gateway.records.undo import Undo, UndoChange
from tests.explore.facts import PARAMETERS, Download, Facts
from tests.explore.gateway_life import Asked
from tests.explore.world import JOINTS, STOP_TIMEOUT_S

Complaints = Iterator[str]

AT_REST = (DriveState.SWITCH_ON_DISABLED, DriveState.FAULT)
STOPPED = (*AT_REST, DriveState.QUICK_STOP_ACTIVE)
ENABLE_OPERATION, OPERATION_BITS = 0x0F, 0x8F
NOTICED_NS = 2_000_000  # what came so short a time ago may not have been looked at yet
FOLLOWS_NS = 50_000_000  # from a trip to the hold of its stop
ON_THE_BUS_NS = 20_000_000  # from a stop to its last controlword
ASKED_BEFORE_NS = 500_000_000  # a stop that is under way need not be sent anew
STANDS_S = 3.0  # how long what answers may go on under a held stop
TAKEN_BACK_S = 4.0  # how long after its end a trial may be in force, where its device answers
KEEPS_TRYING_S = 7.0  # between two attempts, at most, and one more

ALWAYS: dict[str, Callable[[Facts], Complaints]] = {}
AT_ANSWERS: dict[str, Callable[[Facts, Asked], Complaints]] = {}
AT_THE_END: dict[str, Callable[[Facts], Complaints]] = {}


def _always(check: Callable[[Facts], Complaints]) -> Callable[[Facts], Complaints]:
    ALWAYS[check.__name__] = check
    return check


def _at_answers(check: Callable[[Facts, Asked], Complaints]) -> Callable[[Facts, Asked], Complaints]:
    AT_ANSWERS[check.__name__] = check
    return check


def _at_the_end(check: Callable[[Facts], Complaints]) -> Callable[[Facts], Complaints]:
    AT_THE_END[check.__name__] = check
    return check


# Always


@_always
def nobody_enables(facts: Facts) -> Complaints:
    """Nothing but robot.enable or another master ever enables a drive."""
    sent, facts.controlwords = facts.controlwords, []
    for _stamp_ns, joint, controlword in sent:
        if controlword & OPERATION_BITS == ENABLE_OPERATION and not facts.enabling:
            yield f"controlword 0x{controlword:04X} to {joint}"


@_always
def a_trip_is_held(facts: Facts) -> Complaints:
    """A rule that stops and is tripped with no stop held cannot exist."""
    if facts.held or facts.control_since_ns is None:
        facts.tripped_since = dict.fromkeys(facts.tripped_since, facts.now_ns)
    for rule, since_ns in facts.tripped_since.items():
        if facts.now_ns - since_ns > FOLLOWS_NS:
            yield f"rule {rule} stands tripped, and no stop is held"


@_always
def a_hold_ends_knowing(facts: Facts) -> Complaints:
    """A hold ends only when every drive's rest and every controller's stop was read after the last stop."""
    ended, facts.hold_ended = facts.hold_ended, False
    if not ended:
        return
    for joint in JOINTS:
        last = facts.newest(joint, facts.now_ns - NOTICED_NS)
        if last is None or last.state not in AT_REST:
            yield f"the hold has ended, and {joint} was last said to be {last and last.state}"
        elif not any(
            one.sampled_ns > facts.last_stop_ns and one.state in AT_REST for one in facts.known[joint]
        ):
            yield f"the hold has ended, and {joint} has not been read at rest since the last stop"
    since = [one for one in facts.run_read if one[0] > facts.last_stop_ns]
    if not since:
        yield "the hold has ended, and the controller has not been read since the last stop"
    elif since[-1][2] != 0:
        yield "the hold has ended, and the controller was last read running"


@_always
def stop_is_on_the_bus(facts: Facts) -> Complaints:
    """A stop's controlwords are within 20 ms on every bus that takes frames, whatever another bus does."""
    due = [one for one in facts.stops if facts.now_ns - one.asked_ns > ON_THE_BUS_NS]
    facts.stops = [one for one in facts.stops if one not in due]
    for asked in due:
        if facts.control_since_ns is None or facts.control_since_ns > asked.asked_ns:
            continue
        for joint, (bus, _axis) in JOINTS.items():
            # Of two axes of a drive that does not answer, the second cannot be asked yet.
            axes = (
                [joint] if facts.healthy_for(bus, 0.1) else [one for one in JOINTS if JOINTS[one][0] == bus]
            )
            last_ns = max(facts.quick_stops.get(one, 0) for one in axes)
            takes = facts.world.wires[bus].takes_since_ns <= asked.asked_ns
            if takes and last_ns < asked.asked_ns - ASKED_BEFORE_NS:
                yield f"{joint} was not asked to stop within 20 ms of {asked.who}'s stop"


@_always
def what_is_held_stands(facts: Facts) -> Complaints:
    """While a stop is held, no drive that answers stays enabled, and no controller that answers runs on."""
    if not facts.held or facts.now_ns - facts.held_since_ns < STANDS_S * 1e9:
        return
    for joint, since_ns in facts.enabled_since.items():
        if facts.now_ns - since_ns > STANDS_S * 1e9 and facts.healthy_for(JOINTS[joint][0], STANDS_S):
            yield f"{joint} has been enabled for {STANDS_S:g} s under a held stop, and answers"
    if facts.runs_since is not None and facts.healthy_for("gait", STANDS_S):
        if facts.now_ns - facts.runs_since > STANDS_S * 1e9:
            yield f"the controller has run for {STANDS_S:g} s under a held stop, and answers"


@_always
def nothing_forbidden_is_written(facts: Facts) -> Complaints:
    """What the machine forbids never reaches the bus: a restart of the controller, a write from before a stop,
    a step that is too large."""
    sent, facts.downloads = facts.downloads, []
    for one in sent:
        yield from _about(facts, one)


def _about(facts: Facts, one: Download) -> Complaints:
    held = facts.held and facts.held_since_ns < one.stamp_ns - NOTICED_NS
    if one.name == "gait.run" and one.value and held:
        yield f"gait.run = {one.value} was sent while a stop is held: it starts the controller"
    most = {"gait.step_length": 100, "ankle.max_torque": 200}.get(one.name)
    if most is not None and abs(one.value - one.before) > most:
        yield f"{one.name} was changed by {abs(one.value - one.before)} counts at once; allowed are {most}"
    if one.name == "knee.max_torque":
        seen = facts.newest("knee", one.stamp_ns - FOLLOWS_NS)
        if (
            seen is not None
            and seen.state is DriveState.OPERATION_ENABLED
            and facts.enabled_since.get("knee")
        ):
            yield f"{one.name} is not live, and was written while the knee is known to be enabled"
    if one.stamp_ns - facts.last_stop_ns > NOTICED_NS and not _is_wanted(facts, one):
        yield f"{one.name} = {one.value} was sent after the stop, which nobody has asked for since"


def _is_wanted(facts: Facts, one: Download) -> bool:
    """A write that was asked for after the last stop; else it takes back, or stops the controller."""
    scale = PARAMETERS[one.name][2]
    if one.name == "gait.run" and one.value == 0:
        return True
    for asked in facts.life.asked:
        value = asked.params.get("changes", {}).get(one.name) if asked.method == "parameter.write" else None
        if value is not None and round(value * scale) == one.value and asked.asked_ns >= facts.last_stop_ns:
            return True
    before = [
        round(change.before_value * scale) for change in facts.undo.values() if change.parameter == one.name
    ]
    return one.value in before or one.value in facts.legit[one.name]


@_always
def an_undo_entry_is_dropped_for_a_reason(facts: Facts) -> Complaints:
    """An undo entry is dropped only when its write was done, confirmed, claimed or taken over, or when the
    device no longer holds what was written."""
    dropped, facts.dropped = facts.dropped, []
    for write, change, left in dropped:
        if not _may_go(facts, write, change, left):
            yield f"the entry of {change.parameter} (write {write}) was dropped, the device holds what was written"


def _may_go(facts: Facts, write: int, change: UndoChange, left: tuple[Undo, ...]) -> bool:
    name = change.parameter
    held, scale = facts.value(name), PARAMETERS[name][2]
    written, before = round(change.written_value * scale), round(change.before_value * scale)
    if held != written or held == before or not facts.is_ours(name):
        return True
    if name == "gait.run" and facts.held and held == 0:
        return True
    taken_over = (one for undo in left for one in undo.changes if one.parameter == name)
    if any(one.before == change.before for one in taken_over):
        return True
    return any(_keeps(asked, write, name, written) for asked in facts.life.asked)


def _keeps(asked: Asked, write: int, name: str, written: int) -> bool:
    """Whether a request that was not refused wants that value to stay."""
    if asked.error is not None:
        return False
    if asked.method == "parameter.confirm":
        return bool(asked.params["write"] == write)
    if asked.method != "parameter.write" or asked.params.get("trial_s") is not None:
        return False
    value = asked.params["changes"].get(name)
    return value is not None and round(value * PARAMETERS[name][2]) == written


@_always
def a_trial_ends(facts: Facts) -> Complaints:
    """What is to be taken back is, soon after its time where its device answers."""
    for (write, name), change in facts.undo.items():
        trial = facts.trials.get(write)
        due_ns = facts.undo_since[write, name] if trial is None else trial.due_ns
        patience_s = TAKEN_BACK_S if trial is not None else KEEPS_TRYING_S
        device, _, scale = PARAMETERS[name]
        in_force = facts.value(name) == round(change.written_value * scale) and facts.is_ours(name)
        running = (
            facts.control_since_ns is not None and facts.now_ns - facts.control_since_ns > patience_s * 1e9
        )
        if (
            in_force
            and running
            and facts.now_ns - due_ns > patience_s * 1e9
            and facts.healthy_for(device, patience_s)
        ):
            yield f"{name} of write {write} is still in force {patience_s:g} s after its end, and {device} answers"


@_always
def no_error_of_our_own(facts: Facts) -> Complaints:
    """No thread of the gateway ends by an error, and nothing in it fails that nobody expected."""
    yield from facts.world.errors.unexpected
    for task in facts.world.runtime.failed:
        yield f"the thread {task.name} ended: {type(task.error).__name__}: {task.error}"


@_always
def requests_are_answered(facts: Facts) -> Complaints:
    """A stop is always accepted, and answered within its time-out."""
    for asked in facts.life.asked:
        if asked.method == "robot.stop" and asked.answered_ns is None:
            cold = facts.control_since_ns is None or facts.control_since_ns > asked.asked_ns
            if facts.now_ns - asked.asked_ns > (STOP_TIMEOUT_S + 0.2 + 2.0 * cold) * 1e9:
                yield f"{asked.who}'s stop is not answered after {(facts.now_ns - asked.asked_ns) / 1e9:.1f} s"


# At answers


@_at_answers
def a_stop_is_accepted(_facts: Facts, asked: Asked) -> Complaints:
    """A stop is always accepted."""
    if asked.method == "robot.stop" and asked.error is not None:
        yield f"{asked.who}'s stop was refused: {asked.error}"


@_at_answers
def a_confirmed_stop_is_true(facts: Facts, asked: Asked) -> Complaints:
    """What a stop calls confirmed is stopped, as far as its drive has said."""
    if asked.method != "robot.stop" or asked.result is None:
        return
    for joint, outcome in asked.result.drives.items():
        last = facts.newest(joint, facts.now_ns - NOTICED_NS)
        since = [one for one in facts.known[joint] if one.sampled_ns >= asked.asked_ns]
        said = [one for one in (last, *since) if one is not None]
        if outcome == "confirmed" and not any(one.state in STOPPED for one in said):
            yield f"{joint} is called confirmed, and was last said to be {last and last.state}"


@_at_answers
def an_answer_to_a_write_is_true(facts: Facts, asked: Asked) -> Complaints:
    """After "unchanged" or "taken back" the device holds the old value, after success the new one."""
    if asked.method != "parameter.write":
        return
    outcome = (asked.error.data.outcome or {}) if asked.error is not None else {}
    for name, value in asked.params["changes"].items():
        written, held = round(value * PARAMETERS[name][2]), facts.value(name)
        if name == "gait.run" and not written:
            continue  # as a stop writes it too
        if asked.result is not None and held != written and facts.is_ours(name) and name != "gait.run":
            yield f"{name} is answered as written to {written}, the device holds {held}"
        said = outcome.get(name)
        ours = facts.is_ours(name) and written not in facts.legit[name]
        if said in ("unchanged", "taken back", "not written") and held == written and ours:
            yield f"{name} is answered as {said!r}, the device holds {held}, which was written"


# At the end


@_at_the_end
def values_are_wanted(facts: Facts) -> Complaints:
    """Whatever the gateway wrote is wanted: answered as written, confirmed, or kept to be taken back."""
    kept = {name: change for (_, name), change in facts.undo.items()}
    for name, allowed in facts.legit.items():
        held = facts.value(name)
        if not facts.is_ours(name) or held in allowed or (name == "gait.run" and held == 0):
            continue
        change = kept.get(name)
        if change is None or round(change.written_value * PARAMETERS[name][2]) != held:
            yield f"{name} holds {held}, which nobody wants: {sorted(allowed)} would be right"


@_at_the_end
def all_is_answered(facts: Facts) -> Complaints:
    """Everything comes to rest: each request is answered, whatever happened."""
    for asked in facts.life.asked:
        if asked.answered_ns is None and asked.who in facts.life.people:
            yield f"{asked.method} of {asked.who} was never answered"


@_at_the_end
def everybody_is_back(facts: Facts) -> Complaints:
    """What is well again is known to be well."""
    component = facts.life.module("component")
    if component is not None:
        for one in component.components():
            if one.state == "lost":
                yield f"{one.name} is well, and the gateway calls it lost: {one.problem}"
