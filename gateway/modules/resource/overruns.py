"""A control loop's cycles as its frames tell them, and who ran instead of it where one came late. Pure."""

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum

from gateway.modules.resource.tasks import Look, Spent

NOTHING = Spent(0, 0)
USUAL = 32  # cycles in time that tell what the loop itself runs in one


class Reason(StrEnum):
    """Cause of a late cycle."""

    OTHERS = "others_ran"  # it was ready, and others ran
    OWN_WORK = "own_work"  # it ran longer than it usually does
    ASLEEP = "asleep"  # neither: it waited for a device, a lock, or its timer


@dataclass(frozen=True, slots=True)
class Late:
    """A frame that came more than the tolerance after its time."""

    stamp_ns: int
    late_ns: int  # after its time


class Deadline:
    """Due time of the next frame: one period after the last."""

    def __init__(self, period_ns: int, tolerance_ns: int) -> None:
        self._period_ns = period_ns
        self._tolerance_ns = tolerance_ns
        self._last_ns: int | None = None
        self.cycles = 0
        self.missed = 0

    def met(self, stamp_ns: int) -> Late | None:
        """Take a frame; what is wrong with its time."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None:
            return None
        self.cycles += 1
        late_ns = stamp_ns - last_ns - self._period_ns
        if late_ns <= self._tolerance_ns:
            return None
        self.missed += 1
        return Late(stamp_ns, late_ns)


@dataclass(frozen=True, slots=True)
class Blame:
    """The loop's own use between two measurements, the cause of its delay, and the other processes' use."""

    reason: Reason
    own: Spent
    others: list[tuple[int, int, int]]  # process, its thread that ran most, nanoseconds; the most first


class Judge:
    """Remembers what the loop usually runs in a cycle, so that its own work can be blamed too."""

    def __init__(self) -> None:
        self._usual: deque[int] = deque(maxlen=USUAL)

    def in_time(self, cycles: int, before: Look, after: Look, control: Collection[int]) -> None:
        """Count so many cycles that came in time."""
        self._usual.append(_own(before, after, control).ran_ns // cycles)

    def late(self, late: Late, cycles: int, before: Look, after: Look, control: Collection[int]) -> Blame:
        """One or more, and one of them did not. A thread that is not in `before` has begun since then."""
        own = _own(before, after, control)
        usual_ns = cycles * sorted(self._usual)[len(self._usual) // 2] if self._usual else 0
        if 2 * own.waited_ns >= late.late_ns:
            reason = Reason.OTHERS
        elif 2 * (own.ran_ns - usual_ns) >= late.late_ns:
            reason = Reason.OWN_WORK
        else:
            reason = Reason.ASLEEP
        return Blame(reason, own, _others(before, after, control))


def _own(before: Look, after: Look, control: Collection[int]) -> Spent:
    ran_ns = waited_ns = 0
    for task, spent in after.items():
        if task[0] in control:
            had = before.get(task, NOTHING)
            ran_ns += spent.ran_ns - had.ran_ns
            waited_ns += spent.waited_ns - had.waited_ns
    return Spent(ran_ns, waited_ns)


def _others(before: Look, after: Look, control: Collection[int]) -> list[tuple[int, int, int]]:
    most: dict[int, tuple[int, int]] = {}  # process → what its busiest thread ran, and which it is
    ran: dict[int, int] = {}
    for task, spent in after.items():
        pid, tid = task
        ran_ns = spent.ran_ns - before.get(task, NOTHING).ran_ns
        if ran_ns > 0 and pid not in control:
            ran[pid] = ran.get(pid, 0) + ran_ns
            most[pid] = max(most.get(pid, (0, 0)), (ran_ns, tid))
    return sorted(((pid, most[pid][1], ran_ns) for pid, ran_ns in ran.items()), key=lambda one: -one[2])
