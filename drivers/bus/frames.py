"""CAN frames as the drivers pass them on, and where identifiers carry flags.

An identifier carries the flags of SocketCAN: an extended (29-bit) one has `EXTENDED` set, an error frame
`ERROR`, a remote request `REMOTE`. So no extended frame is ever taken for a CANopen one.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

EXTENDED = 0x8000_0000
REMOTE = 0x4000_0000
ERROR = 0x2000_0000

Frame = tuple[int, int, bytes]  # stamp_ns (monotonic, at reception), identifier, data (0–8 bytes)
FrameHandler = Callable[[int, bytes], None]  # stamp_ns, data; in the bus's thread: returns at once


class Transport(Protocol):
    """An open CAN interface. One thread receives; any thread sends.

    `receive` waits up to `timeout_s` and returns what came, oldest first, perhaps nothing. It and `send`
    raise `drivers.errors.Unavailable` when the interface is gone; the transport is then of no more use.
    """

    dropped: int  # frames that came and were lost, as far as the interface tells
    warning: str | None  # what is wrong with it although it is open, in words

    def receive(self, timeout_s: float) -> Sequence[Frame]: ...

    def send(self, can_id: int, data: bytes) -> None: ...

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Only these identifiers matter (`None`: all): the interface may keep the others to itself."""

    def close(self) -> None: ...
