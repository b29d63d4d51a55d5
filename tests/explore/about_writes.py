"""What must never be with a write, a trial, and what is kept to take them back."""

from drivers.joint.cia402 import DriveState
from gateway.records.undo import Undo, UndoChange
from tests.explore.about_stops import FOLLOWS_NS, NOTICED_NS
from tests.explore.facts import Download, Facts
from tests.explore.gateway_life import Asked
from tests.explore.invariants import Complaints, always, at_answers, at_the_end
from tests.explore.parameters import PARAMETERS, counts

TAKEN_BACK_S = (
    14.0  # how long after its end a write may be in force: one device or disk is asked after the other
)
_LEFT = ("unchanged", "taken back", "not written")  # what an answer calls a value that is the old one


@always
def nothing_forbidden_is_written(facts: Facts) -> Complaints:
    """What the machine forbids never reaches the bus: a start of the controller under a held stop, a write
    from before a stop, too large a step, a change that is not live while its drive is known to be enabled."""
    sent, facts.downloads = facts.downloads, []
    for one in sent:
        parameter = PARAMETERS[one.name]
        if parameter.starts and one.value and facts.held and facts.held_since_ns < one.stamp_ns - NOTICED_NS:
            yield f"{one.name} = {one.value} was sent while a stop is held: it starts the controller"
        step = abs(one.value - one.before)
        if parameter.most_step is not None and step > parameter.most_step and one.seen:
            yield f"{one.name} was changed by {step} counts at once; allowed are {parameter.most_step}"
        if parameter.rests is not None and _is_known_enabled(facts, parameter.rests, one.stamp_ns):
            yield f"{one.name} is not live, and was written while {parameter.rests} is known to be enabled"
        if not _is_wanted(facts, one, facts.last_stop_ns(one.stamp_ns - NOTICED_NS)):
            yield f"{one.name} = {one.value} was sent after the stop, which nobody has asked for since"


def _is_known_enabled(facts: Facts, joint: str, stamp_ns: int) -> bool:
    seen = facts.newest(joint, stamp_ns - FOLLOWS_NS)
    known = seen is not None and seen.state is DriveState.OPERATION_ENABLED
    return known and joint in facts.enabled_since


def _is_wanted(facts: Facts, one: Download, stop_ns: int) -> bool:
    """A write that was asked for after the last stop; else it takes back, or stops the controller."""
    if PARAMETERS[one.name].starts and one.value == 0:
        return True
    for asked in facts.life.asked:
        wanted = _wanted(asked, one.name)
        if wanted == one.value and asked.asked_ns >= stop_ns:
            return True
    changes = (change for (_, name), change in facts.undo.items() if name == one.name)
    before = [counts(one.name, change.before_value) for change in changes]
    return one.value in before or one.value in facts.legit[one.name]


def _wanted(asked: Asked, name: str) -> int | None:
    """What a write wants of a parameter."""
    value = asked.params["changes"].get(name) if asked.method == "parameter.write" else None
    return None if value is None else counts(name, value)


@always
def an_undo_entry_is_dropped_for_a_reason(facts: Facts) -> Complaints:
    """An undo entry is dropped only when its write was done, confirmed, claimed or taken over, or when the
    device no longer holds what was written."""
    dropped, facts.dropped = facts.dropped, []
    for write, change, left in dropped:
        if not _may_go(facts, write, change, left):
            yield f"the entry of {change.parameter} (write {write}) was dropped, its value is in force"


def _may_go(facts: Facts, write: int, change: UndoChange, left: tuple[Undo, ...]) -> bool:
    name, held = change.parameter, facts.value(change.parameter)
    written, before = counts(name, change.written_value), counts(name, change.before_value)
    if held != written or held == before or not facts.is_ours(name):
        return True
    if PARAMETERS[name].starts and facts.held:
        return True  # it belongs to the stop
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
    return _wanted(asked, name) == written and asked.params.get("trial_s") is None


@always
def a_trial_ends(facts: Facts) -> Complaints:
    """What is to be taken back is, soon after its time, where its device answers."""
    patience_s = TAKEN_BACK_S
    long_ago_ns = facts.now_ns - round(patience_s * 1e9)
    if facts.control_since_ns is None or facts.control_since_ns > long_ago_ns:
        return
    for (write, name), change in facts.undo.items():
        device, rests = PARAMETERS[name].device, PARAMETERS[name].rests
        trial = facts.trials.get(write)
        due_ns = facts.undo_since[write, name] if trial is None else trial.due_ns
        if rests is not None:  # it must not be written while that is enabled
            due_ns = max(due_ns, facts.rests_since.get(rests, facts.now_ns))
        in_force = facts.value(name) == counts(name, change.written_value) and facts.is_ours(name)
        if due_ns < long_ago_ns and in_force and facts.healthy_for(device, patience_s):
            yield f"{name} of write {write} is in force {patience_s:g} s after its end, and {device} answers"


@at_answers
def an_answer_to_a_write_is_true(facts: Facts, asked: Asked) -> Complaints:
    """After "unchanged" or "taken back" the device holds the old value, after success the new one."""
    if asked.method != "parameter.write":
        return
    outcome = asked.outcome
    for name in asked.params["changes"]:
        written, held = _wanted(asked, name), facts.value(name)
        if not facts.is_ours(name) or (PARAMETERS[name].starts and not written):
            continue  # somebody else, or a stop, wrote it too
        if asked.result is not None and held != written and not PARAMETERS[name].starts:
            yield f"{name} is answered as written to {written}, the device holds {held}"
        if outcome.get(name) in _LEFT and held == written and written not in facts.legit[name]:
            yield f"{name} is answered as {outcome[name]!r}, the device holds {held}, which was written"


@at_the_end
def values_are_wanted(facts: Facts) -> Complaints:
    """Whatever the gateway wrote is wanted: answered as written, confirmed, or kept to be taken back."""
    kept = {(name, counts(name, change.written_value)) for (_, name), change in facts.undo.items()}
    for name, allowed in facts.legit.items():
        held = facts.value(name)
        stopped = PARAMETERS[name].starts and held == 0
        if facts.is_ours(name) and held not in allowed and (name, held) not in kept and not stopped:
            yield f"{name} holds {held}, which nobody wants: {sorted(allowed)} would be right"
