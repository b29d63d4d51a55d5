"""Sources of a trace's frames: a live bus, or a recording."""

import heapq
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from drivers.bus.interfaces.opening import open_transport
from drivers.bus.settings import CanSettings
from drivers.trace.files import Captured, read

TICK_S = 0.2


@dataclass(frozen=True, slots=True)
class Batch:
    """Frames that came together, perhaps none, and the time then: ns of Unix time."""

    frames: Sequence[Captured]
    now_ns: int
    live: bool


Batches = Generator[Batch, None, None]


def recorded(paths: Sequence[Path]) -> Batches:
    """Yield the frames of files by their times; raises `SettingsError`."""
    for captured in heapq.merge(*map(read, paths), key=lambda one: one.stamp_ns):
        yield Batch((captured,), captured.stamp_ns, live=False)


def live(settings: CanSettings, interface: str, lost: Callable[[int], object]) -> Batches:
    """Frames as they come, or nothing for `TICK_S`; `lost` is told at the end how many did not reach us.

    Raises:
        Unavailable: the interface cannot be opened, or goes.

    """
    transport = open_transport(settings)
    try:
        to_unix_ns = time.time_ns() - time.monotonic_ns()
        while True:
            frames = transport.receive(TICK_S)
            captured = [
                Captured(stamp_ns + to_unix_ns, can_id, data, interface) for stamp_ns, can_id, data in frames
            ]
            yield Batch(captured, time.monotonic_ns() + to_unix_ns, live=True)
    finally:
        if transport.dropped:
            lost(transport.dropped)
        transport.close()


def until(batches: Iterator[Batch], seconds: float | None) -> Iterator[Batch]:
    """Yield those of the first `seconds`, by the time of the frames; `None`: all."""
    began_ns: int | None = None
    for batch in batches:
        began_ns = batch.now_ns if began_ns is None else began_ns
        if seconds is not None and batch.now_ns - began_ns > seconds * 1e9:
            return
        yield batch
