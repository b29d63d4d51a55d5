"""Delivery of answers from the network's thread to the window's."""

import concurrent.futures
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")
Deliver = Callable[[Callable[[], None]], None]  # run this soon in the window's thread; called in any thread


def when_done(
    future: "concurrent.futures.Future[Result]",
    deliver: Deliver,
    done: Callable[[Result], None],
    failed: Callable[[Exception], None],
) -> None:
    """Call `done` or `failed` in the window's thread; neither where the future was cancelled."""

    def hand_over(ended: "concurrent.futures.Future[Result]") -> None:
        if ended.cancelled():
            return
        error = ended.exception()
        if error is None:
            result = ended.result()
            deliver(lambda: done(result))
        elif isinstance(error, Exception):
            deliver(lambda: failed(error))

    future.add_done_callback(hand_over)
