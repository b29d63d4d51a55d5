"""Several buses as one trace: each is read by a thread of its own, and their frames come by time."""

import queue
import threading
import time
from collections.abc import Callable, Mapping
from typing import Final

from drivers.bus.settings import CanSettings
from drivers.errors import DriverError
from drivers.trace.files import Captured
from drivers.trace.sources import TICK_S, Batch, Batches, live

HOLD_NS: Final = 100_000_000  # so long a frame waits for older ones of other buses
MOST: Final = 10_000  # batches that may wait for whoever reads the trace

Told = Batch | DriverError


def merged(buses: Mapping[str, CanSettings], lost: Callable[[int], object]) -> Batches:
    """Return frames of all of these, `HOLD_NS` after they came; by interface, as candump names it.

    Raises:
        Unavailable: one of them cannot be opened, or goes.

    """
    told: queue.Queue[Told] = queue.Queue(MOST)
    ended = threading.Event()
    readers = [
        threading.Thread(target=_read, args=(settings, name, lost, told, ended), name=f"trace {name}")
        for name, settings in buses.items()
    ]
    for reader in readers:
        reader.start()
    try:
        yield from _by_time(told)
    finally:
        ended.set()
        for reader in readers:
            reader.join()


def _read(
    settings: CanSettings,
    name: str,
    lost: Callable[[int], object],
    told: "queue.Queue[Told]",
    ended: threading.Event,
) -> None:
    """Read until the end; an exception is told."""
    batches = live(settings, name, lost)
    try:
        for batch in batches:
            if ended.is_set():
                return
            if batch.frames:
                _put(batch, told, ended)
    except DriverError as error:
        _put(error, told, ended)
    finally:
        batches.close()


def _put(one: Told, told: "queue.Queue[Told]", ended: threading.Event) -> None:
    while not ended.is_set():
        try:
            told.put(one, timeout=TICK_S)
        except queue.Full:
            continue
        return


def _by_time(told: "queue.Queue[Told]") -> Batches:
    waiting: list[Captured] = []
    while True:
        try:
            one = told.get(timeout=TICK_S / 4)
            while True:
                if isinstance(one, DriverError):
                    raise one
                waiting += one.frames
                one = told.get_nowait()
        except queue.Empty:
            until_ns = time.time_ns() - HOLD_NS
        waiting.sort(key=lambda captured: captured.stamp_ns)
        due = sum(captured.stamp_ns <= until_ns for captured in waiting)
        yield Batch(waiting[:due], until_ns, live=True)
        del waiting[:due]
