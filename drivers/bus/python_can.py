"""Any interface that python-can knows, from slcan to virtual."""

import time
from collections.abc import Sequence

import can

from drivers.bus.frames import ERROR, EXTENDED, REMOTE, Frame
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable

_NEVER_BLOCKS = ("virtual",)


class PythonCanTransport:
    """An open python-can bus."""

    def __init__(self, settings: CanSettings) -> None:
        """Open it; raises `Unavailable`."""
        self.dropped = 0  # python-can does not tell
        self.warning: str | None = None
        self.blocks = settings.interface not in _NEVER_BLOCKS
        self._where = f"{settings.interface} channel {settings.channel}"
        self.full = f"{self._where} does not send: does anybody on the bus acknowledge?"
        keys = settings.more if settings.bitrate is None else {**settings.more, "bitrate": settings.bitrate}
        try:
            # The robot's file says everything: what python-can finds in its own files must not change it.
            self._bus = can.Bus(settings.channel, settings.interface, ignore_config=True, **keys)
        except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
            raise Unavailable(f"{self._where} cannot be opened: {error}") from error

    def receive(self, timeout_s: float) -> Sequence[Frame]:
        try:
            message = self._bus.recv(timeout_s)
        except (can.CanError, OSError, ValueError) as error:
            raise Unavailable(f"{self._where} is gone: {error}") from error
        if message is None:
            return ()
        return ((time.monotonic_ns(), _identifier(message), bytes(message.data)),)

    def try_send(self, can_id: int, data: bytes) -> bool:
        message = can.Message(
            arbitration_id=can_id & 0x1FFF_FFFF,
            is_extended_id=bool(can_id & EXTENDED),
            is_remote_frame=bool(can_id & REMOTE),
            data=None if can_id & REMOTE else data,
        )
        try:
            self._bus.send(message, None if self.blocks else 0)
        except (can.CanError, OSError, ValueError) as error:
            raise Unavailable(f"{self._where} does not send: {error}") from error
        return True

    def flush(self) -> bool:
        return True

    def await_room(self, timeout_s: float) -> None:
        """It always takes a frame, or fails."""

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Most interfaces filter in Python, which costs more than it saves."""

    def close(self) -> None:
        self._bus.shutdown()


def _identifier(message: can.Message) -> int:
    can_id: int = message.arbitration_id
    if message.is_extended_id:
        can_id |= EXTENDED
    if message.is_remote_frame:
        can_id |= REMOTE
    if message.is_error_frame:
        can_id |= ERROR
    return can_id
