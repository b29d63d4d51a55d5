"""The newest value of every channel of one component, and those who listen to its samples.

One driver thread writes; any thread reads. A value is handed out only while it is fresh: a reader never
sees an old number as if it were live.
"""

import threading
from collections.abc import Callable, Sequence

from drivers.samples import Channel, Sample

Listener = Callable[[Sample], None]


class Latest:
    """Latest-value table of one component.

    A slot is replaced as one (stamp, value) tuple, so that a reader in another thread never pairs a value
    with the stamp of another.
    """

    def __init__(self, component: str, channels: Sequence[Channel], stale_after_s: float) -> None:
        self.component = component
        self.channels = tuple(channels)
        self.stale_after_ns = round(stale_after_s * 1e9)
        self.updated_ns: int | None = None
        self._slots: list[tuple[int, float | None] | None] = [None] * len(self.channels)
        self._listeners: tuple[Listener, ...] = ()
        self._listening = threading.Lock()

    def update(self, stamp_ns: int, indices: tuple[int, ...], values: tuple[float | None, ...]) -> None:
        """Store values received together at `stamp_ns`, and tell the listeners."""
        slots = self._slots
        for index, value in zip(indices, values, strict=True):
            slots[index] = (stamp_ns, value)
        self.updated_ns = stamp_ns
        if self._listeners:
            sample = Sample(self.component, stamp_ns, indices, values)
            for listener in self._listeners:
                listener(sample)

    def read(self, index: int, now_ns: int) -> tuple[float | None, int | None]:
        """Value and stamp of one channel; the value is `None` when missing or stale."""
        slot = self._slots[index]
        if slot is None:
            return None, None
        stamp_ns, value = slot
        return (value if now_ns - stamp_ns <= self.stale_after_ns else None), stamp_ns

    def stamp_ns(self, index: int) -> int | None:
        """Return the time of a channel's value, fresh or not."""
        slot = self._slots[index]
        return None if slot is None else slot[0]

    def age_ns(self, now_ns: int) -> int | None:
        """Time since the last update, `None` before the first."""
        return None if self.updated_ns is None else max(0, now_ns - self.updated_ns)

    def clear(self) -> None:
        """Forget every value: what comes after a reconnect must not look like what was before it."""
        self._slots = [None] * len(self.channels)
        self.updated_ns = None

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call `listener` with every sample, in the driver's thread; returns how to end it.

        A listener must return at once and never raise. For any thread.
        """
        with self._listening:
            self._listeners = (*self._listeners, listener)

        def unsubscribe() -> None:
            with self._listening:
                self._listeners = tuple(known for known in self._listeners if known is not listener)

        return unsubscribe
