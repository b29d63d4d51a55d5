"""The time by which a frame is judged: the same for all of it, however long it takes to draw."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final


class FrameTime:
    """An instant that all of a frame is judged by; `at_ns` on our monotonic clock."""

    def __init__(self, at_ns: int) -> None:
        self.at_ns = at_ns


_HELD: Final[ContextVar[FrameTime | None]] = ContextVar("moment", default=None)


def this_moment() -> FrameTime | None:
    """Return the one that everything is judged by within `one_moment`: another one each time."""
    return _HELD.get()


def now_ns() -> int:
    """Return our monotonic clock in ns; within `one_moment` what it was when that began."""
    held = _HELD.get()
    return time.monotonic_ns() if held is None else held.at_ns


@contextmanager
def one_moment() -> Iterator[None]:
    """All that this thread judges within is judged by the same instant: else header and page may differ."""
    token = _HELD.set(FrameTime(now_ns()))
    try:
        yield
    finally:
        _HELD.reset(token)
