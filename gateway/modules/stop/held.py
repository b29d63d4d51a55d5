"""A held stop's watch over one drive: enabled again it is stopped again, and unseen it is asked again.

Unknown is not stopped.
"""

import time
from collections.abc import Callable

from drivers.samples import Sample
from gateway.loop import Loop
from gateway.modules.stop.drive import is_enabled
from gateway.modules.stop.stopper import Stopper


class Held:
    """One drive, from the stop to its reset; `again` is called in the loop when it was enabled again."""

    def __init__(self, stopper: Stopper, loop: Loop, again: Callable[[str], None]) -> None:
        self.again = 0  # how often it had to be stopped again
        self._stopper = stopper
        self._drive = stopper.drive
        self._loop = loop
        self._told = again
        self._statusword = next(
            (i for i, channel in enumerate(self._drive.channels) if channel.quantity == "statusword"), None
        )
        self._end_listening = self._drive.latest.subscribe(self._on_sample)

    def close(self) -> None:
        self._end_listening()

    def look(self, *, ask_unseen: bool) -> None:
        """Stop again where the drive is enabled, or where nobody knows whether it is."""
        enabled = self._enabled()
        if enabled:
            self._on_enabled()
        elif enabled is None and ask_unseen:
            self._stopper.stop()

    def _enabled(self) -> bool | None:
        if self._statusword is None:
            return None
        value, _stamp_ns = self._drive.latest.read(self._statusword, time.monotonic_ns())
        return None if value is None else is_enabled(value)

    def _on_sample(self, sample: Sample) -> None:
        """In the driver's thread: the loop stops the drive, this only tells it."""
        for index, value in zip(sample.indices, sample.values, strict=True):
            if index == self._statusword and value is not None and is_enabled(value):
                self._loop.post(self._on_enabled)

    def _on_enabled(self) -> None:
        if not self._stopper.running:
            self.again += 1
            self._stopper.stop()
            self._told(self._drive.name)
