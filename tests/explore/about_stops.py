"""What must never be with a stop, its hold and its reset."""

from drivers.joint.cia402 import DriveState
from tests.explore.facts import Commanded, Facts
from tests.explore.gateway_life import Asked
from tests.explore.invariants import Complaints, always, at_answers
from tests.explore.world import JOINTS, STOP_TIMEOUT_S

AT_REST = (DriveState.SWITCH_ON_DISABLED, DriveState.FAULT)
STOPPED = (*AT_REST, DriveState.QUICK_STOP_ACTIVE)
OPERATION_BITS, ENABLE_OPERATION = 0x8F, 0x0F
BRAKES_NS = 150_000_000  # longer than any drive here brakes
NOTICED_NS = 2_000_000  # what came so short a time ago may not have been looked at yet
FOLLOWS_NS = 50_000_000  # from a trip to the hold of its stop
ON_THE_BUS_NS = 20_000_000  # from a stop to its last controlword
# A stop that is under way need not be sent anew; one who does not answer is asked less and less often.
UNDER_WAY_NS = {True: 500_000_000, False: 1_200_000_000}
STANDS_S = 3.0  # how long what answers may go on under a held stop …
LED_S = 7.0  # … and while a reset leads the drives down, one axis after the other
HELD_AGAIN_NS = 500_000_000  # from the start of the control module to the hold that was left
COLD_S = 2.0  # more for a stop that has to start its module


@always
def nobody_enables(facts: Facts) -> Complaints:
    """Nothing but robot.enable or another master ever enables a drive, and none that stops is made limp."""
    sent, facts.controlwords = facts.controlwords, []
    for one in sent:
        if one.controlword & OPERATION_BITS == ENABLE_OPERATION and not facts.open["robot.enable"]:
            yield f"controlword 0x{one.controlword:04X} to {one.joint}"
        if one.controlword == 0 and _has_stopped(facts, one):
            yield f"{one.joint} was made limp, though it has stopped as it was asked to"


def _has_stopped(facts: Facts, one: Commanded) -> bool:
    stopped = one.state is DriveState.QUICK_STOP_ACTIVE and facts.now_ns - one.since_ns > BRAKES_NS
    reset = facts.open["robot.reset"] > 0 or facts.now_ns - facts.reset_ns < BRAKES_NS
    return stopped and not reset and facts.healthy_for(JOINTS[one.joint][0], 2.0)


@always
def a_trip_is_held(facts: Facts) -> Complaints:
    """A rule that stops and is tripped with no stop held cannot exist."""
    if facts.held or facts.control_since_ns is None:
        facts.tripped_since = dict.fromkeys(facts.tripped_since, facts.now_ns)
    for rule, since_ns in facts.tripped_since.items():
        if facts.now_ns - since_ns > FOLLOWS_NS:
            yield f"rule {rule} stands tripped, and no stop is held"


@always
def a_hold_ends_knowing(facts: Facts) -> Complaints:
    """A hold ends only when every drive's rest and every controller's stop was read after the last stop."""
    ended, facts.hold_ended = facts.hold_ended, False
    if not ended:
        return
    stop_ns = facts.last_stop_ns(facts.now_ns - NOTICED_NS)
    for joint in JOINTS:
        last = facts.newest(joint, facts.now_ns - NOTICED_NS)
        if last is None or last.state not in AT_REST:
            yield f"the hold has ended, and {joint} was last said to be {last and last.state}"
        elif not any(stop_ns < one.sampled_ns and one.state in AT_REST for one in facts.known[joint]):
            yield f"the hold has ended, and {joint} has not been read at rest since the last stop"
    since = [value for sampled_ns, value in facts.run_read if sampled_ns > stop_ns]
    if not since:
        yield "the hold has ended, and the controller has not been read since the last stop"
    elif since[-1] != 0:
        yield "the hold has ended, and the controller was last read running"


@always
def a_held_stop_outlives_the_gateway(facts: Facts) -> Complaints:
    """A stop that was answered as held is held by the next gateway too, until a reset ends it."""
    since_ns = facts.control_since_ns
    runs = since_ns is not None and facts.now_ns - since_ns > HELD_AGAIN_NS
    if facts.must_hold and runs and not facts.held and not facts.open["robot.reset"]:
        yield "a stop was answered as held, and is not held any more"


@always
def a_stop_is_on_the_bus(facts: Facts) -> Complaints:
    """A stop's controlwords are within 20 ms on every bus that takes frames, whatever another bus does."""
    due = [one for one in facts.stops if facts.now_ns - one.asked_ns > ON_THE_BUS_NS]
    facts.stops = [one for one in facts.stops if one not in due]
    for asked in due:
        if facts.control_since_ns is not None and facts.control_since_ns <= asked.asked_ns:
            for joint in JOINTS:
                if _is_missed(facts, joint, asked.asked_ns):
                    yield f"{joint} was not asked to stop within 20 ms of {asked.who}'s stop"


def _is_missed(facts: Facts, joint: str, asked_ns: int) -> bool:
    """Of two axes of a drive that does not answer, the second cannot be asked yet."""
    bus = JOINTS[joint][0]
    answers = facts.healthy_for(bus, 1.5)
    axes = [joint] if answers else [one for one in JOINTS if JOINTS[one][0] == bus]
    last_ns = max(facts.stopped_at.get(one, 0) for one in axes)
    takes = facts.world.wires[bus].takes_since_ns <= asked_ns
    return takes and last_ns < asked_ns - UNDER_WAY_NS[answers]


@always
def what_is_held_stands(facts: Facts) -> Complaints:
    """While a stop is held, no drive that answers stays enabled, and no controller that answers runs on."""
    patience_s = LED_S if facts.open["robot.reset"] else STANDS_S
    long_ago_ns = facts.now_ns - round(patience_s * 1e9)
    if not facts.held or facts.held_since_ns > long_ago_ns:
        return
    for joint, since_ns in facts.enabled_since.items():
        if since_ns < long_ago_ns and facts.healthy_for(JOINTS[joint][0], patience_s):
            yield f"{joint} has been enabled for {patience_s:g} s under a held stop, and answers"
    runs_since_ns = facts.runs_since
    if runs_since_ns is not None and runs_since_ns < long_ago_ns and facts.healthy_for("gait", patience_s):
        yield f"the controller has run for {patience_s:g} s under a held stop, and answers"


@always
def a_stop_is_answered(facts: Facts) -> Complaints:
    """A stop is answered within its time-out, whatever drives, buses and disk do."""
    for asked in facts.waiting:
        if asked.method == "robot.stop":
            cold = facts.control_since_ns is None or facts.control_since_ns > asked.asked_ns
            waited_s = (facts.now_ns - asked.asked_ns) / 1e9
            if waited_s > STOP_TIMEOUT_S + 0.2 + COLD_S * cold:
                yield f"{asked.who}'s stop is not answered after {waited_s:.1f} s"


@at_answers
def a_stop_is_accepted(_facts: Facts, asked: Asked) -> Complaints:
    """A stop is always accepted."""
    if asked.method == "robot.stop" and asked.error is not None:
        yield f"{asked.who}'s stop was refused: {asked.error}"


@at_answers
def what_a_stop_says_is_true(facts: Facts, asked: Asked) -> Complaints:
    """What a stop calls confirmed its drive has said, and what has stopped and answers it calls confirmed."""
    if asked.method != "robot.stop" or asked.result is None:
        return
    for joint, outcome in asked.result.drives.items():
        axis = facts.world.axes[joint]
        stands = axis.state in STOPPED and facts.now_ns - axis.since_ns > 5 * BRAKES_NS
        healthy_ns = facts.healthy_since.get(JOINTS[joint][0], facts.now_ns)
        if outcome != "confirmed" and stands and healthy_ns < asked.asked_ns - NOTICED_NS:
            yield f"{joint} is called {outcome}, though it has stopped and answers"
        last = facts.newest(joint, facts.now_ns - NOTICED_NS)
        since = [one for one in facts.known[joint] if one.sampled_ns >= asked.asked_ns]
        said = [one.state for one in (last, *since) if one is not None]
        if outcome == "confirmed" and not any(state in STOPPED for state in said):
            yield f"{joint} is called confirmed, and was last said to be {last and last.state}"
