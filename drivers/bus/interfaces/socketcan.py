"""Linux SocketCAN, read directly: kernel filters and time stamps, and a count of what the kernel dropped.

It costs half of what python-can's own reader costs per frame.
"""

import errno
import select
import socket
import struct
import time
from collections.abc import Sequence
from pathlib import Path

from drivers.bus.frames import EXTENDED, REMOTE, Frame
from drivers.bus.interfaces.link_report import blocking_problem, missing_link, warning
from drivers.bus.interfaces.netlink import read_link
from drivers.bus.nmt import HEARTBEAT
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable

_FRAME = struct.Struct("=IB3x8s")  # struct can_frame: identifier with flags, length, data
_FILTER = struct.Struct("=II")
_TIME = struct.Struct("@ll")
_SO_TIMESTAMPNS, _SO_RXQ_OVFL = 35, 40  # <asm-generic/socket.h>; Python has no names for them
_CAN_RAW_ERR_FILTER = 2  # <linux/can/raw.h>
_ERRORS = 0x1FF  # every class, such as a controller's state or a violation on the wire (<linux/can/error.h>)
_STATISTICS = Path("/sys/class/net")
_ANCILLARY_BYTES = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(4)
_MAX_FILTERS = 512
_NODE = 0x7F  # of an identifier, the bits of its node
RECEIVE_BUFFER = 4 * 1024 * 1024  # the kernel gives what net.core.rmem_max allows
CLOCK_ATTEMPTS, CLOCK_APART_NS = 3, 1_000_000
QUEUE_LOOK_S = 0.001  # nobody tells when a queue that was full has room: a frame of 8 bytes takes 0.13 ms


class SocketCanTransport:
    """An open socket that carries `struct can_frame`."""

    blocks = False

    def __init__(
        self, sock: socket.socket, where: str, warning: str | None = None, statistics: Path | None = None
    ) -> None:
        """`sock` is bound already, `statistics` the kernel's folder for it; see `open_socketcan`."""
        self.dropped = 0  # by the kernel, because we were too slow
        self.warning = warning
        self.full = f"{where} does not send: does anybody on the bus acknowledge?"
        self._socket = sock
        self._where = where
        self._statistics = statistics
        self._timeout_s: float | None = None
        self._queue_full = False
        self._room = select.poll()
        self._room.register(sock, select.POLLOUT)
        sock.setblocking(True)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        for option in (_SO_TIMESTAMPNS, _SO_RXQ_OVFL):
            sock.setsockopt(socket.SOL_SOCKET, option, 1)

    def receive(self, timeout_s: float) -> Sequence[Frame]:
        if timeout_s != self._timeout_s:
            self._timeout_s = timeout_s
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _timeval(timeout_s))
        try:
            data, ancillary, _, _ = self._socket.recvmsg(_FRAME.size, _ANCILLARY_BYTES)
        except BlockingIOError:
            return ()
        except OSError as error:
            raise Unavailable(f"{self._where} is gone ({error.strerror})") from error
        if len(data) != _FRAME.size:
            return ()
        can_id, length, payload = _FRAME.unpack(data)
        return ((self._stamp_ns(ancillary), can_id, payload[:length]),)

    def try_send(self, can_id: int, data: bytes) -> bool:
        try:
            self._socket.send(_FRAME.pack(can_id, len(data), data), socket.MSG_DONTWAIT)
        except OSError as error:
            if error.errno not in (errno.ENOBUFS, errno.EAGAIN):
                raise Unavailable(f"{self._where} does not send ({error.strerror})") from error
            self._queue_full = error.errno == errno.ENOBUFS
            return False
        return True

    def flush(self) -> bool:
        return True  # the kernel takes a frame whole

    def await_room(self, timeout_s: float) -> None:
        self._room.poll(timeout_s * 1000)
        if self._queue_full:  # the interface's, which the socket knows nothing of
            time.sleep(QUEUE_LOOK_S)

    def carried(self) -> tuple[int, int] | None:
        """Return it as the kernel counts for the interface, whatever its filters keep from us."""
        if self._statistics is None:
            return None
        try:
            rx, tx, rx_bytes, tx_bytes = (
                int((self._statistics / name).read_text(encoding="ascii"))
                for name in ("rx_packets", "tx_packets", "rx_bytes", "tx_bytes")
            )
        except (OSError, ValueError):
            return None
        return rx + tx, rx_bytes + tx_bytes

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Let the kernel pass only these identifiers, heartbeats of whomever, and error frames."""
        if self._socket.family == socket.AF_CAN:
            self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, filters(can_ids))

    def close(self) -> None:
        self._socket.close()

    def _stamp_ns(self, ancillary: list[tuple[int, int, bytes]]) -> int:
        """Return the kernel's stamp on the monotonic clock.

        The offset is read anew, for wall time may jump.
        """
        now_ns, wall_ns = _both_clocks()
        stamp_ns = now_ns
        for _, kind, data in ancillary:
            if kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIME.unpack(data)
                stamp_ns = now_ns - max(0, wall_ns - seconds * 1_000_000_000 - nanoseconds)
            elif kind == _SO_RXQ_OVFL:
                self.dropped = int.from_bytes(data, "little")
        return stamp_ns


def open_socketcan(settings: CanSettings) -> SocketCanTransport:
    """Open the interface that is the channel of `settings`; raises `Unavailable` with what to do."""
    name = str(settings.channel)
    try:
        link = read_link(name)
        if link is None:
            raise Unavailable(missing_link(name))
        problem = blocking_problem(name, link, settings.bitrate)
        if problem is not None:
            raise Unavailable(problem)
        return SocketCanTransport(
            _bound_socket(name),
            f"interface {name}",
            warning(name, link, settings.bitrate),
            _STATISTICS / name / "statistics",
        )
    except OSError as error:
        raise Unavailable(
            f"interface {name} cannot be opened ({error.strerror}): has this kernel CAN? "
            "Run: sudo modprobe can_raw"
        ) from error


def obstacle(settings: CanSettings) -> str | None:
    """Return why no frame would pass, or what differs from `settings`; only look at the interface."""
    name = str(settings.channel)
    try:
        link = read_link(name)
    except OSError as error:
        return f"interface {name} cannot be looked at ({error.strerror})"
    if link is None:
        return missing_link(name)
    return blocking_problem(name, link, settings.bitrate) or warning(name, link, settings.bitrate)


def _bound_socket(name: str) -> socket.socket:
    sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    try:
        sock.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, _ERRORS)
        sock.bind((name,))
    except OSError:
        sock.close()
        raise
    return sock


def _both_clocks() -> tuple[int, int]:
    """Monotonic and wall time of one moment: asked anew where we were kept waiting in between."""
    for _ in range(CLOCK_ATTEMPTS):
        now_ns, wall_ns = time.monotonic_ns(), time.time_ns()
        if time.monotonic_ns() - now_ns < CLOCK_APART_NS:
            break
    return now_ns, wall_ns  # at the worst a stamp is too old


def filters(can_ids: frozenset[int] | None) -> bytes:
    """As the kernel takes them: who boots on the bus later, by an id that nobody knows, is heard too."""
    others = sorted(one for one in can_ids or () if one & ~_NODE != HEARTBEAT)
    if can_ids is None or len(others) >= _MAX_FILTERS:
        return _FILTER.pack(0, 0)
    heartbeats = _FILTER.pack(HEARTBEAT, _mask(HEARTBEAT) & ~_NODE)
    return heartbeats + b"".join(_FILTER.pack(can_id, _mask(can_id)) for can_id in others)


def _mask(can_id: int) -> int:
    return (0x1FFF_FFFF if can_id & EXTENDED else 0x7FF) | EXTENDED | REMOTE


def _timeval(seconds: float) -> bytes:
    return _TIME.pack(int(seconds), int(seconds % 1 * 1_000_000))
