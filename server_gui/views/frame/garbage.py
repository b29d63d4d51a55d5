"""Garbage is collected in the window's thread alone.

A widget that Python's collector finds while another thread allocates would be destroyed in that thread, which
Qt does not allow: it waits there for the interpreter while it holds a lock that the window waits for, and the
window, with its STOP, stands still for good.
"""

import gc
import time
from typing import Final

FULL_S: Final = 60.0  # between two looks at everything that there is, at least


class Garbage:
    """Takes the place of the automatic collection, which ends with it; `look` is for the window's thread."""

    def __init__(self) -> None:
        gc.disable()
        self._full_s = time.monotonic()

    def look(self) -> None:
        """Collect what is due by Python's own thresholds; call it with every frame."""
        young, middle, old = (
            count > threshold for count, threshold in zip(gc.get_count(), gc.get_threshold(), strict=True)
        )
        if old and time.monotonic() - self._full_s > FULL_S:
            gc.collect()
            self._full_s = time.monotonic()
        elif middle:
            gc.collect(1)
        elif young:
            gc.collect(0)
