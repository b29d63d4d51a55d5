"""A queue from many threads to one, with waits that always end in time."""

import contextlib
import queue
import threading
import time
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")


class Inbox(Generic[T]):
    """A queue without a bound, of any number of threads that put and one that gets; nobody waits to put.

    `queue.SimpleQueue` is not that: before CPython 3.13 its `get` with a time-out can wait for ever. Where it
    is empty and its lock is free (the last item was taken without a wait), and the time-out ends between two
    of its looks at the clock, it waits for less than nothing, which never ends. `queue.Queue` takes 1.3 times
    as long from thread to thread, and the answers of drives come through here.
    """

    def __init__(self) -> None:
        self._items: deque[T] = deque()
        self._asleep = threading.Lock()  # free: something was put in since somebody last waited

    def put(self, item: T) -> None:
        """Put it behind all others."""
        self._items.append(item)
        if self._asleep.locked():
            with contextlib.suppress(RuntimeError):  # somebody else has just put something in, too
                self._asleep.release()

    def get(self, timeout: float | None = None) -> T:
        """Take the first; wait for it, for ever or `timeout` seconds. Raises `queue.Empty` after them."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._items:
            left_s = -1.0 if deadline is None else deadline - time.monotonic()
            if deadline is not None and left_s <= 0:
                raise queue.Empty
            self._asleep.acquire(timeout=left_s)
        return self._items.popleft()

    def get_nowait(self) -> T:
        """Take the first; raises `queue.Empty` where there is none."""
        try:
            return self._items.popleft()
        except IndexError:
            raise queue.Empty from None

    def empty(self) -> bool:
        """Return whether nothing is in it."""
        return not self._items

    def qsize(self) -> int:
        """Return the number of items."""
        return len(self._items)
