"""CAN frames as the drivers pass them on, and where identifiers carry flags.

An identifier carries the flags of SocketCAN: an extended (29-bit) one has `EXTENDED` set, an error frame
`ERROR`, a remote request `REMOTE`. So no extended frame is ever taken for a CANopen one.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

EXTENDED = 0x8000_0000
REMOTE = 0x4000_0000
ERROR = 0x2000_0000
STANDARD_IDS = 0x7FF  # the last identifier of 11 bits

Frame = tuple[int, int, bytes]  # stamp_ns (monotonic, at reception), identifier, data (0–8 bytes)
FrameHandler = Callable[[int, bytes], None]  # stamp_ns, data; in the bus's thread: returns at once


def wire_id(cob_id: int) -> int:
    """Return a configured identifier with its flag: above 7FFh it is an extended one."""
    return cob_id | EXTENDED if cob_id > STANDARD_IDS else cob_id


class Transport(Protocol):
    """An open CAN interface. One thread receives; any one thread at a time sends.

    `receive` waits up to `timeout_s` and returns what came, oldest first, perhaps nothing. It, `try_send` and
    `flush` raise `drivers.errors.Unavailable` when the interface is gone, and it is then of no more use.
    """

    dropped: int  # frames that came and were lost, as far as the interface tells
    warning: str | None  # what is wrong with it although it is open, in words
    blocks: bool  # whether `try_send` may wait, so that it is for a thread of its own
    full: str  # what it means that it takes no frame, in words

    def receive(self, timeout_s: float) -> Sequence[Frame]: ...

    def try_send(self, can_id: int, data: bytes) -> bool:
        """Hand over a frame; `False`: it would have to wait now, and nothing of it was sent.

        One that was sent in part is finished first.
        """

    def flush(self) -> bool:
        """Go on with a frame that was taken and left in part only; whether nothing is left of it."""

    def await_room(self, timeout_s: float) -> None:
        """Wait until it may take a frame again; while others send."""

    def carried(self) -> tuple[int, int] | None:
        """Frames and their data bytes that passed the bus, where the interface counts also those it keeps.

        `None`: those that came and left are all that is known.
        """

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Take only these identifiers (`None`: all): the interface may keep the others to itself."""

    def close(self) -> None: ...
