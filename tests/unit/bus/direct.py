"""An outlet of an SDO channel that hands each request to a device at once."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

from drivers.errors import Unavailable


@dataclass(frozen=True)
class Direct:
    """`hear` may raise `Unavailable`, as a bus does that is not open."""

    hear: Callable[[bytes], None]

    def offer(self, data: bytes, wanted: Callable[[], bool]) -> Callable[[], bool]:
        if wanted():
            self.hear(data)
            return lambda: True
        return lambda: False

    def send_urgent(self, data: bytes) -> bool:
        with contextlib.suppress(Unavailable):
            self.hear(data)
        return True
