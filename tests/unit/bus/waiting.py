"""Waiting for something to become true, with a generous end."""

import time
from collections.abc import Callable

WAIT_S = 15.0


def until(condition: Callable[[], object], what: str = "the condition", within_s: float = WAIT_S) -> None:
    """Return as soon as `condition()` holds; fail the test if it never does."""
    deadline = time.monotonic() + within_s
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"{what} did not come true within {within_s:g} s")
        time.sleep(0.002)
