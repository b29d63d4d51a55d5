"""The moment that something is judged by: one for all that a frame shows, however long it takes to draw."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

_HELD: Final[ContextVar[int | None]] = ContextVar("moment", default=None)


def now_ns() -> int:
    """Return our monotonic clock in ns; within `one_moment` what it was when that began."""
    held = _HELD.get()
    return time.monotonic_ns() if held is None else held


@contextmanager
def one_moment() -> Iterator[None]:
    """All that this thread judges within is judged by the same instant: else header and page may differ."""
    token = _HELD.set(now_ns())
    try:
        yield
    finally:
        _HELD.reset(token)
