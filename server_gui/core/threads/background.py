"""Work that takes long, one piece after another in a thread of its own, whose owner joins it."""

import concurrent.futures
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

Result = TypeVar("Result")


class Background:
    """`do` returns at once; its future is done in the thread."""

    def __init__(self, name: str) -> None:
        self._pool = concurrent.futures.ThreadPoolExecutor(1, name)
        self._under_way: set[Future[Any]] = set()

    def do(self, work: Callable[[], Result]) -> "Future[Result]":
        """Do this after what is to be done already."""
        future = self._pool.submit(work)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        return future

    def close(self, within_s: float) -> bool:
        """Begin nothing more, and join the thread; False where what is under way takes longer. Idempotent."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        # What was cancelled while it waited is no longer among these: nobody would ever call it done.
        if concurrent.futures.wait(set(self._under_way), within_s).not_done:
            return False
        self._pool.shutdown()
        return True
