"""The socketcand protocol: CAN frames as ASCII lines over TCP (the server is a hub or a Linux box with CAN).

python-can's own client does not notice that the server has gone and loses the handshake when a frame is glued
to it; this one says what is wrong at once and costs less per frame.
"""

import math
import select
import socket
import time
from collections.abc import Sequence

from drivers.bus.frames import ERROR, EXTENDED, REMOTE, STANDARD_IDS, Frame
from drivers.errors import Unavailable

CONNECT_TIMEOUT_S = 1.0
RECEIVE_BYTES = 65536
REMOTE_WORD = "R"  # of the simulator's hub; the protocol has none
AWAY_NS = 20_000_000  # without a look at the socket: what is there now has waited
QUICK_NS = 5_000_000
MOST_READS = 64  # 4 MB, some half a minute of a robot
MAX_PENDING = 4096  # characters without the end of a message: not socketcand


class SocketcandParser:
    """`feed(text) -> messages`: what stands between `<` and `>`, across any split. Garbage is skipped."""

    def __init__(self) -> None:
        self.skipped = 0  # pieces that were no message
        self._rest = ""

    def feed(self, text: str) -> list[str]:
        """Complete messages in `text`, without their brackets."""
        *complete, self._rest = (self._rest + text).split(">")
        if len(self._rest) > MAX_PENDING:
            self._rest = ""
            self.skipped += 1
        messages = []
        for piece in complete:
            _, bracket, message = piece.rpartition("<")
            if bracket:
                messages.append(message)
            else:
                self.skipped += 1
        return messages


def frame_of(message: str, stamp_ns: int) -> Frame | None:
    """Return a frame out of ` frame 181 1234.5 0102 `; `None` for other or damaged messages.

    ` error 088 1234.5 ` is an error frame, of which the protocol tells no more than its class.
    """
    words = message.split()
    if len(words) == 4 and words[0] == "frame" and words[3] == REMOTE_WORD:
        return _remote_frame(words[1], stamp_ns)
    if len(words) == 3 and words[0] == "error":
        return _error_frame(words[1], stamp_ns)
    if len(words) < 3 or words[0] != "frame":
        return None
    try:
        can_id = int(words[1], 16)
        data = bytes.fromhex("".join(words[3:]))
    except ValueError:
        return None
    is_standard = len(words[1]) <= 3
    if len(data) > 8 or not 0 <= can_id <= (0x7FF if is_standard else 0x1FFF_FFFF):
        return None
    return stamp_ns, can_id if is_standard else can_id | EXTENDED, data


def _error_frame(error_class: str, stamp_ns: int) -> Frame | None:
    try:
        found = int(error_class, 16)
    except ValueError:
        return None
    return (stamp_ns, found & (ERROR - 1) | ERROR, b"") if found > 0 else None


def _remote_frame(identifier: str, stamp_ns: int) -> Frame | None:
    found = frame_of(f" frame {identifier} 0 ", stamp_ns)
    return None if found is None else (stamp_ns, found[1] | REMOTE, b"")


def waited_stamps(messages: Sequence[str], since_ns: int, now_ns: int) -> list[int]:
    """Return when frames came, by the server's stamps; the last one came now, the others before.

    None came before `since_ns`, for until then all was read: so a server's clock that steps does no harm.
    """
    times = [server_ns(message) for message in messages]
    last_ns = next((one for one in reversed(times) if one is not None), None)
    stamps, stamp_ns = [], since_ns
    for one in times:
        if one is not None and last_ns is not None:
            stamp_ns = max(stamp_ns, min(now_ns, now_ns - last_ns + one))
        stamps.append(stamp_ns)
    return stamps


def server_ns(message: str) -> int | None:
    """Return the server's stamp in ` frame 181 1234.5 0102 `; `None` where there is none."""
    words = message.split(maxsplit=3)
    try:
        seconds = float(words[2]) if len(words) > 2 else math.nan
    except ValueError:
        return None
    return round(seconds * 1e9) if math.isfinite(seconds) else None


def send_message(can_id: int, data: bytes) -> str:
    """Return the line that sends a frame."""
    identifier = f"{can_id & 0x1FFF_FFFF:08X}" if can_id & EXTENDED else f"{can_id & STANDARD_IDS:03X}"
    content = REMOTE_WORD if can_id & REMOTE else f"{len(data)} {data.hex(' ')}"
    return f"< send {identifier} {content} >"


class SocketcandTransport:
    """An open connection to one CAN channel of a socketcand server.

    With `remote_frames` it must know a word for these, as the simulator's hub does.
    """

    blocks = False

    def __init__(self, host: str, port: int, channel: str, *, remote_frames: bool = False) -> None:
        """Connect and enter raw mode; raises `Unavailable`."""
        self.dropped = 0  # messages that were no frames
        self.warning: str | None = None
        self._where = f"socketcand at {host}:{port}"
        self.full = f"{self._where} takes no frames: is the CAN server, or the network to it, stuck?"
        self._remote_frames = remote_frames
        self._unsent = b""  # of a frame that was taken
        self._parser = SocketcandParser()
        self._early: list[str] = []
        self._read_ns = time.monotonic_ns()  # when all was read that had come
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_TIMEOUT_S)
        except OSError as error:
            raise Unavailable(
                f"nothing answers as {self._where} ({error}): start the CAN server or the simulator there, "
                "or correct host and port"
            ) from error
        try:
            _tune(self._socket)
            self._handshake(channel)
        except OSError as error:
            self._socket.close()
            raise Unavailable(f"{self._where} broke off while connecting ({error})") from error
        except Unavailable:
            self._socket.close()
            raise
        self._out = self._socket.dup()  # the same connection, whose time-out is for receiving only
        self._out.setblocking(False)
        self._room = select.poll()
        self._room.register(self._out, select.POLLOUT)

    def receive(self, timeout_s: float) -> Sequence[Frame]:
        """Return frames that came, stamped when they were read; those that waited by `waited_stamps`."""
        messages = self._early or self._read(timeout_s)
        self._early = []
        since_ns, self._read_ns = self._read_ns, time.monotonic_ns()
        if not messages or self._read_ns - since_ns <= AWAY_NS:
            stamps = [self._read_ns] * len(messages)
        else:
            messages = [*messages, *self._drain()]
            stamps = waited_stamps(messages, since_ns, self._read_ns)
        frames = []
        for message, stamp_ns in zip(messages, stamps, strict=True):
            frame = frame_of(message, stamp_ns)
            if frame is not None:
                frames.append(frame)
            else:
                self.dropped += 1
        return frames

    def try_send(self, can_id: int, data: bytes) -> bool:
        if can_id & REMOTE and not self._remote_frames:
            raise Unavailable(
                f"{self._where}: the protocol has no remote frames, so no node guarding; the simulator's hub "
                "has them for who says remote_frames = true"
            )
        if not self.flush():
            return False
        line = send_message(can_id, data).encode("ascii")
        sent = self._write(line)
        self._unsent = line[sent:] if sent else b""
        return sent > 0

    def flush(self) -> bool:
        if self._unsent:
            self._unsent = self._unsent[self._write(self._unsent) :]
        return not self._unsent

    def await_room(self, timeout_s: float) -> None:
        self._room.poll(timeout_s * 1000)

    def carried(self) -> tuple[int, int] | None:
        return None

    def accept(self, can_ids: frozenset[int] | None) -> None:
        """Ignore filters: the protocol's raw mode has none."""

    def close(self) -> None:
        self._out.close()
        self._socket.close()

    def _write(self, line: bytes) -> int:
        """Write a line, and return the number of bytes that the connection took."""
        try:
            return self._out.send(line)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Unavailable(f"{self._where} is gone ({error})") from error

    def _read(self, timeout_s: float) -> list[str]:
        if self._socket.gettimeout() != timeout_s:
            self._socket.settimeout(timeout_s)
        return self._take(self._socket)

    def _drain(self) -> list[str]:
        """All that waits: until a look that took no time finds nothing, so that the last frame is of now."""
        messages: list[str] = []
        for _ in range(MOST_READS):
            looked_ns = time.monotonic_ns()
            more = self._take(self._out)
            self._read_ns = time.monotonic_ns()
            messages += more
            if not more and self._read_ns - looked_ns < QUICK_NS:
                break
        return messages

    def _take(self, connection: socket.socket) -> list[str]:
        try:
            data = connection.recv(RECEIVE_BYTES)
        except (TimeoutError, BlockingIOError):
            return []
        except OSError as error:
            raise Unavailable(f"{self._where} is gone ({error})") from error
        if not data:
            raise Unavailable(f"{self._where} closed the connection")
        return self._parser.feed(data.decode("ascii", errors="replace"))

    def _handshake(self, channel: str) -> None:
        deadline = time.monotonic() + CONNECT_TIMEOUT_S
        self._expect("hi", deadline)
        if self._remote_frames:
            self._socket.sendall(b"< remote >")
            self._expect("ok", deadline)
        for request in (f"< open {channel} >", "< rawmode >"):
            self._socket.sendall(request.encode("ascii"))
            self._expect("ok", deadline)

    def _expect(self, answer: str, deadline: float) -> None:
        while True:
            while self._early:
                message = self._early.pop(0).strip()
                if message == answer:
                    return
                if not message.startswith("frame"):
                    raise Unavailable(f"{self._where} answered {message!r} instead of {answer!r}")
            if time.monotonic() > deadline:
                raise Unavailable(f"{self._where} did not answer {answer!r}: is it a socketcand server?")
            self._early = self._read(max(0.01, deadline - time.monotonic()))


def _tune(sock: socket.socket) -> None:
    """Send at once, and notice within seconds that the other machine is gone."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 2)):
        sock.setsockopt(socket.IPPROTO_TCP, option, value)
