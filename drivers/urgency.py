"""Real-time priority for threads that must not wait for their turn, where the system allows it.

A stop waits for whoever has a lock that it needs: so all who may have one get the same priority as its own
thread. Beside other threads that take the interpreter for many short turns, one without it may wait for a
turn of its own for 0.1 s and more, with the lock in its hands.
"""

import os

PRIORITY = 30  # of SCHED_FIFO: above all ordinary threads, below those of the kernel's interrupts (50)


def make_urgent() -> str | None:
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
