"""Any interface that python-can knows, from slcan to virtual."""

import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import can

from drivers.bus.frames import ERROR, EXTENDED, REMOTE, Frame
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable

_NEVER_BLOCKS = ("virtual",)
_DAMAGED = (ValueError, IndexError)  # what python-can raises for a line of an adapter that is none
MAX_PENDING = 4096  # bytes of such a line without its end
WRITE_S = 0.1  # how long an adapter may take for one frame, also for its last one


class PythonCanTransport:
    """An open python-can bus."""

    def __init__(self, settings: CanSettings) -> None:
        """Open it; raises `Unavailable`."""
        self.dropped = 0  # what an adapter said that is no frame; python-can tells of no others
        self.warning: str | None = None
        self.blocks = settings.interface not in _NEVER_BLOCKS
        self._where = f"{settings.interface} channel {settings.channel}"
        self.full = f"{self._where} does not send: does anybody on the bus acknowledge?"
        keys = settings.more if settings.bitrate is None else {**settings.more, "bitrate": settings.bitrate}
        try:
            # The robot's file says everything: what python-can finds in its own files must not change it.
            self._bus = can.Bus(settings.channel, settings.interface, ignore_config=True, **keys)
        except (can.CanError, OSError, ValueError, TypeError, ImportError, NotImplementedError) as error:
            raise Unavailable(f"{self._where} cannot be opened: {error}") from error
        for port in self._serial_ports():
            port.write_timeout = WRITE_S

    def receive(self, timeout_s: float) -> Sequence[Frame]:
        try:
            message = self._bus.recv(timeout_s)
        except (can.CanError, OSError, *_DAMAGED) as error:
            self._drop_line(error)
            return ()
        if message is None:
            self._bound_line()
            return ()
        if not _is_possible(message):
            self.dropped += 1
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
            self._bus.send(message, WRITE_S if self.blocks else 0)
        except (can.CanError, OSError, ValueError) as error:
            raise Unavailable(f"{self._where} does not send: {error}") from error
        return True

    def flush(self) -> bool:
        return True

    def await_room(self, timeout_s: float) -> None:
        """Return at once: the interface always accepts a frame, or fails."""

    def carried(self) -> tuple[int, int] | None:
        return None

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Most interfaces filter in Python, which costs more than it saves."""

    def close(self) -> None:
        """Close the adapter, even if it does not accept its last frame."""
        try:
            self._bus.shutdown()
        except OSError as error:
            raise Unavailable(f"{self._where} was not closed by its adapter: {error}") from error
        finally:
            for port in self._serial_ports():
                port.close()

    def _drop_line(self, error: Exception) -> None:
        """One of an adapter on a serial port costs only itself; python-can would keep what it cannot read."""
        is_damaged = isinstance(error, _DAMAGED) or isinstance(error.__cause__, UnicodeDecodeError)
        pending = getattr(self._bus, "_buffer", None)
        if not is_damaged or not isinstance(pending, bytearray):
            raise Unavailable(f"{self._where} is gone: {error}") from error
        pending.clear()
        self.dropped += 1

    def _bound_line(self) -> None:
        """Bound the line of an adapter that never ends it."""
        pending = getattr(self._bus, "_buffer", None)
        if isinstance(pending, bytearray) and len(pending) > MAX_PENDING:
            pending.clear()
            self.dropped += 1

    def _serial_ports(self) -> Iterator[Any]:
        """Yield the serial ports of an adapter; pyserial would write to them for ever."""
        serial = sys.modules.get("serial")
        if serial is not None:
            yield from (one for one in vars(self._bus).values() if isinstance(one, serial.Serial))


def _is_possible(message: can.Message) -> bool:
    """Return whether it is a classic frame whose parts fit together: a damaged line can say anything."""
    if message.is_error_frame:
        return True
    highest = 0x1FFF_FFFF if message.is_extended_id else 0x7FF
    told = 0 if message.is_remote_frame else message.dlc
    return 0 <= message.arbitration_id <= highest and len(message.data) == told <= 8


def _identifier(message: can.Message) -> int:
    can_id: int = message.arbitration_id
    if message.is_extended_id:
        can_id |= EXTENDED
    if message.is_remote_frame:
        can_id |= REMOTE
    if message.is_error_frame:
        can_id |= ERROR
    return can_id
