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
        self._newest: Future[Any] | None = None

    def do(self, work: Callable[[], Result]) -> "Future[Result]":
        """Do this after what is to be done already."""
        future = self._pool.submit(work)
        self._newest = future
        return future

    def close(self, within_s: float) -> bool:
        """Begin nothing more, and join the thread; False where what is under way takes longer. Idempotent."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        under_way = [] if self._newest is None else [self._newest]
        if concurrent.futures.wait(under_way, within_s).not_done:
            return False
        self._pool.shutdown()
        return True
