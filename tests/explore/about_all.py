"""What must never be with the gateway as a whole."""

from gateway.records.chain import Broken
from gateway.records.journal import read_verified
from tests.explore.disk import SYNC_NS
from tests.explore.facts import Facts
from tests.explore.invariants import Complaints, always, at_the_end
from tests.explore.world import JOINTS

THERE_S = 5.0  # how long it may take to come up
LOOKS_NS = 500_000_000
ANSWERED_S = 20.0  # how long anything may take, whatever is wrong


@always
def nothing_fails_unexpectedly(facts: Facts) -> Complaints:
    """No thread of the gateway ends by an error, and nothing in it fails that nobody expected."""
    yield from facts.world.errors.unexpected
    for task in facts.world.runtime.failed:
        yield f"the thread {task.name} ended: {type(task.error).__name__}: {task.error}"


@always
def who_answers_is_there(facts: Facts) -> Complaints:
    """What has answered for seconds is not called lost."""
    if facts.now_ns - facts.looked_at_all_ns < LOOKS_NS:
        return
    facts.looked_at_all_ns = facts.now_ns
    long_ago_ns = facts.now_ns - round(THERE_S * 1e9)
    since_ns = facts.control_since_ns
    if since_ns is None or max(since_ns, facts.reset_ns) > long_ago_ns or _is_busy(facts):
        return
    for one in facts.life.module("component").components():
        device = JOINTS[one.name][0] if one.name in JOINTS else one.name
        if one.state == "lost" and facts.whole_since.get(device, facts.now_ns) < long_ago_ns:
            yield f"{one.name} has answered for {THERE_S:g} s, and is called lost: {one.problem}"


def _is_busy(facts: Facts) -> bool:
    """While one axis is led down, or fought over, nobody asks for the other one of its drive."""
    fought = facts.held and (facts.world.gait.runs or bool(facts.enabled_since))
    return fought or facts.open["robot.reset"] > 0


@always
def requests_are_answered(facts: Facts) -> Complaints:
    """No request waits for ever."""
    for asked in facts.waiting:
        if facts.now_ns - asked.asked_ns > ANSWERED_S * 1e9 and facts.world.disk.sync_ns <= SYNC_NS:
            yield f"{asked.method} of {asked.who} is not answered after {ANSWERED_S:g} s"


@at_the_end
def all_is_answered(facts: Facts) -> Complaints:
    """Everything comes to rest: each request is answered, whatever happened."""
    for asked in facts.waiting:
        if asked.who in facts.life.people:
            yield f"{asked.method} of {asked.who} was never answered"


@at_the_end
def the_journal_holds(facts: Facts) -> Complaints:
    """Whatever happened, the journal's chain is whole."""
    try:
        if facts.control_since_ns is not None:
            read_verified(facts.world.records / "journal.jsonl")
    except (Broken, OSError) as error:
        yield f"the journal: {error}"
