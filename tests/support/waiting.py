"""The one way to wait in a test: until something is so, by the clock, however often one has looked."""

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

WAIT_S = 120.0  # only what hangs takes so long; pytest itself ends a test far later
LOOK_S = 0.003
PAUSE_S = (
    1.0  # at most: what sleeps again when nobody asks for some seconds, as a gateway, would never wake up
)

Found = TypeVar("Found")


def until(
    condition: Callable[[], Found | None],
    what: object = "the condition",
    within_s: float = WAIT_S,
    step: Callable[[], object] | None = None,
) -> Found:
    """Return what `condition` gives as soon as that is true.

    `what` says, or when called finds out, what was waited for or what there was instead; `step` drives what
    moves only when it is driven, between two looks.

    Raises:
        AssertionError: It was never so.
    """
    deadline_s = time.monotonic() + within_s
    while True:
        began_s = time.monotonic()
        if found := condition():
            return found
        now_s = time.monotonic()
        assert now_s < deadline_s, f"not in {within_s:g} s: {what() if callable(what) else what}"
        if step is not None:
            step()
        # What takes long to look at is left most of the time.
        time.sleep(min(PAUSE_S, max(LOOK_S, 4 * (now_s - began_s))))


async def until_in_loop(condition: Callable[[], object], within_s: float = WAIT_S) -> None:
    """Wait while the event loop goes on."""
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(LOOK_S)
