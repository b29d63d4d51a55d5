"""The one thread that talks to robots: an asyncio loop that its owner starts and joins."""

import asyncio
import concurrent.futures
from collections.abc import Coroutine
from typing import Any, Self, TypeVar

from server_gui.core.threads.supervision import BEAT_S, Worker

Result = TypeVar("Result")


class Network:
    """An event loop in a thread of its own; use it as a context manager.

    On leaving, everything that still runs in it is cancelled and waited for, then the thread is joined.
    """

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._beating = self._loop.call_later(0.0, lambda: None)
        self.worker = Worker("network", self._run)

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self.run(self._end_all()).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self.worker.join()
        self._loop.close()

    def run(self, work: Coroutine[Any, Any, Result]) -> "concurrent.futures.Future[Result]":
        """Run `work` in the network's thread; cancelling the future cancels it."""
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    def _run(self) -> None:
        self._beat()
        self._loop.run_forever()

    def _beat(self) -> None:
        self.worker.beat()
        self._beating.cancel()
        self._beating = self._loop.call_later(BEAT_S, self._beat)

    @staticmethod
    async def _end_all() -> None:
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.get_running_loop().shutdown_asyncgens()
        await asyncio.get_running_loop().shutdown_default_executor()
