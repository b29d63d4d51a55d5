"""Real-time priority for threads that must not wait for their turn, where the system allows it.

A stop waits for whoever has a lock that it needs: so all who may have one get the same priority as its own
thread. Beside other threads that take the interpreter for many short turns, one without it may wait for a
turn of its own for 0.1 s and more, with the lock in its hands.
"""

import contextlib
import os
from collections.abc import Iterator

PRIORITY = 30  # of SCHED_FIFO: above all ordinary threads, below those of the kernel's interrupts (50)


def make_realtime() -> str | None:
    """Give the calling thread real-time priority; returns why it has none, in words.

    What it forks or starts does not inherit it.
    """
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
    except OSError as error:
        return (
            f"no real-time priority ({error.strerror}): allow it with LimitRTPRIO={PRIORITY}, or CAP_SYS_NICE"
        )
    return None


@contextlib.contextmanager
def lent_realtime(thread: int) -> Iterator[None]:
    """Make another thread (by its native id) urgent within the block; for who waits for its lock.

    Of one that is urgent anyway, or has ended, or where the system does not allow it, nothing changes.
    """
    try:
        policy, parameters = os.sched_getscheduler(thread), os.sched_getparam(thread)
        ordinary = policy & ~os.SCHED_RESET_ON_FORK not in (os.SCHED_FIFO, os.SCHED_RR)
        if ordinary:
            os.sched_setscheduler(thread, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except OSError:
        ordinary = False
    try:
        yield
    finally:
        if ordinary:
            with contextlib.suppress(OSError):
                os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, parameters)
