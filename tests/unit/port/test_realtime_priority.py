"""Real-time priority, where the system allows it, and why not where it does not."""

import os
import threading

from drivers.realtime_priority import make_realtime


def test_a_thread_gets_real_time_priority_or_says_why_not() -> None:
    found: list[tuple[str | None, int]] = []

    def ask() -> None:
        found.append((make_realtime(), os.sched_getscheduler(0)))

    before = os.sched_getscheduler(0)
    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    ((why_not, policy),) = found
    if why_not is None:
        assert policy == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    else:
        assert "LimitRTPRIO=30" in why_not
    assert os.sched_getscheduler(0) == before
