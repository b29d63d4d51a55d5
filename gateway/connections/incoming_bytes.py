"""One client's incoming bytes: stop requests act at once, every other line goes to the loop.

Reading never ends because requests wait: beyond what may wait they are refused, and stops act.
"""

import logging
import time
from collections.abc import Callable
from concurrent.futures import Future

from gateway.access.identity import Identity
from gateway.connections.listener_kind import Stream
from gateway.connections.rate_limit import COSTLY_NS, FLOOD_S, Account, RateLimit
from gateway.connections.stop_lines import StopSplitter
from gateway.process.loop import HANGUP, READ, Loop, Timer
from gateway.wire import framing
from gateway.wire.limits import BAD_LINES, QUEUED_BYTES, QUEUED_LINES
from gateway.wire.stop import Stopped

log = logging.getLogger(__name__)

StopNow = Callable[[str, str], Future[Stopped]]  # carries out a stop for whom, and why; from any thread

RECEIVE_BYTES = 16 * 1024  # at once, so that no other client's stop waits long behind it …
UNKNOWN_BYTES = 2 * 1024  # … and of whoever has just come, or has cost something just now
ON_THE_WAY = 1024  # refusals and stops' answers that may wait for the loop as well; beyond, nobody is told
LAST_READS = 16  # of a connection that ends: a stop may still be in it …
LAST_NS = 1_000_000  # … which is looked for so long

_TOO_MANY = framing.refuse(
    framing.ErrorKind.UNAVAILABLE,
    "too many requests wait; this one is not done: ask again when some have been answered",
)

SHORTEST = len(b'{"method":""}')  # of all that could be a request
FOREIGN = "speaks another protocol: is it a browser, or another program?"
# What a client of ours begins with, or a stop in an odd form: no method of HTTP, no TLS and no SSH.
_BEGINNINGS = frozenset(b"{[ \t\"'")
_NOTHING_YET = b"\r\n\0"  # of these UTF-16 and UTF-32 have the last before the first letter


class ReceivedBytes:
    """Bytes of one read, on their way to the loop."""

    __slots__ = ("cpu_ns", "ended", "lines", "lost", "refusals", "stamp_ns", "stop", "stopped", "stops")

    def __init__(self) -> None:
        self.stamp_ns = time.monotonic_ns()
        self.stops: list[framing.StopRequest] = []  # which are one stop …
        self.stop: framing.StopRequest | None = None  # … the newest of them
        self.stopped: Future[Stopped] | None = None  # what answers it; `None`: nobody could act on it yet
        self.lines: list[tuple[int, bytes | framing.BadLine]] = []  # with when they came in (monotonic, ns)
        self.refusals: list[bytes] = []  # of what was too much, ready to be sent
        self.ended = False  # the client will say nothing more
        self.lost: str | None = None  # why there is nobody any more
        self.cpu_ns = 0


def _may_be_request(line: bytes) -> bool:
    """As far as that can be seen at once: what is none is counted before it costs more."""
    return len(line) >= SHORTEST and line.lstrip()[:1] == b"{"


class IncomingBytes:
    """One client's incoming bytes, in the intake's thread; `receiver`, `done` and `close` are the loop's."""

    def __init__(
        self,
        front: Loop,
        loop: Loop,
        connection: Stream,
        peer: str,
        identity: Identity,
        stop_now: Callable[[], StopNow | None],
        spent: Callable[[], int],
        finished: "Callable[[IncomingBytes], None]",
        pace: RateLimit,
    ) -> None:
        self.socket = connection
        self.peer = peer
        self.identity = identity
        self.who = identity.called(peer)  # how the journal calls it
        self.received_bytes = self.unanswered = 0
        self.receiver: Callable[[ReceivedBytes], object] = bool  # in the loop; set before anything is heard
        self._front = front
        self._loop = loop
        self._stop_now = stop_now
        self._spent = spent
        self._finished = finished
        self._pace = pace
        self._rests = False
        self._timer: Timer | None = None  # until it is read again
        self._waits = False  # for its turn
        self._bad = 0  # lines that are no requests, whatever is in them
        self._splitter = StopSplitter()
        self._began = self._ended = self._closed = False
        # Each is counted by one thread: by the intake what was handed over, by the loop what it has done.
        self._handed = self._handed_bytes = self._done = self._done_bytes = 0
        self._account = Account()
        # Bytes that are decrypted already: no poll tells of them. A bare socket has none.
        self._pending: Callable[[], int] | None = getattr(connection, "pending", None)
        front.watch(connection, READ, self._on_ready)
        if self._pending is not None:
            front.post(self._look_again)  # what has come with the end of a handshake

    # In the loop's thread.

    def done(self, count: int, size: int = 0) -> None:
        """Note that so much of what was handed over does not wait any more."""
        self._done += count
        self._done_bytes += size

    def close(self) -> None:
        """End the connection; a stop that has arrived already still acts."""
        self._front.post(self.finish)

    # In the intake's thread.

    def finish(self) -> None:
        """Read the remaining bytes, for the stops in them, and close; idempotent."""
        if self._closed:
            return
        if not self._ended:
            self._read_last()
        self._closed = True
        self._wake()
        self._front.watch(self.socket, 0, self._on_ready)
        self.socket.close()
        self._finished(self)
        self._loop.post(self._forget_receiver)

    def _forget_receiver(self) -> None:
        """Release both, so that neither keeps the other in memory."""
        self.receiver = bool

    def _read_last(self) -> None:
        """Read for the newest stop in it, as far as that takes this thread no long time."""
        found, until_ns = None, time.thread_time_ns() + LAST_NS
        for found in self._splitter.newest_first(self._unread()):
            if found is not None or time.thread_time_ns() >= until_ns:
                break
        self._hand_over(self._sorted([] if found is None else [found]))

    def _unread(self) -> bytes:
        data = b""
        try:
            for _ in range(LAST_READS):
                data += (more := self.socket.recv(RECEIVE_BYTES))
                if not more:
                    break
        except OSError:
            pass  # there is no more
        return data

    def _on_ready(self, events: int) -> None:
        if self._ended:
            if events & HANGUP:
                self._end("it has gone", ReceivedBytes())
        elif self._is_known and self._pace.has_time_for_known():
            self._receive(RECEIVE_BYTES)
        else:
            self._front.watch(self.socket, 0, self._on_ready)
            if not self._waits:
                self._waits = True
                self._pace.add(self.address, self._take_turn)

    @property
    def address(self) -> str:
        """Whence it comes, without the port."""
        return self.peer.rpartition(":")[0]

    @property
    def _is_known(self) -> bool:
        """Whether it has said something, and costs little."""
        return not self._account.settle() and self._began

    def _take_turn(self) -> None:
        """Read as an unknown client, or one without time left: together they delay nobody else."""
        self._waits = False
        if not (self._ended or self._closed):
            self._front.watch(self.socket, READ, self._on_ready)
            self._receive(UNKNOWN_BYTES)

    def _receive(self, most: int) -> bool:
        """Read once; false where there was nothing. What of it is decrypted and left has another turn."""
        read = self._read(most)
        if read and self._pending is not None and not self._ended and self._pending():
            self._front.post(self._look_again)
        return read

    def _look_again(self) -> None:
        """Look at what no poll tells of; who rests or waits for a turn is looked at after that."""
        if not (self._ended or self._closed or self._waits or self._rests):
            self._on_ready(READ)

    def _read(self, most: int) -> bool:
        self._spent()  # what was worked for others
        try:
            data = self.socket.recv(most)
        except BlockingIOError:
            self._account.pay(self._spent())  # TLS may have had something, that is none of ours
            if self._account.owed_ns > COSTLY_NS:
                self._rest(self._pace.rest_s(self._account.owed_ns))
            return False
        except OSError as error:
            self._end(str(error), self._sorted(self._splitter.end()))
            return True
        if not data:
            self._end(None, self._sorted(self._splitter.end()))
            return True
        if not self._began:
            self._began = bool(begin := data.lstrip(_NOTHING_YET))
            if self._began and begin[0] not in _BEGINNINGS and begin[0] < 0x80:
                self._end(FOREIGN, ReceivedBytes())
                return True
        self.received_bytes += len(data)
        lines = self._splitter.feed(data)
        heard = self._sorted(lines)
        self._account.pay(self._spent())
        owed_ns = self._account.owed_ns
        floods = self._account.floods(sum(isinstance(line, framing.StopRequest) for line in lines))
        if self._is_full or self._splitter.dropping or owed_ns > COSTLY_NS:
            self._rest(max(self._pace.rest_s(owed_ns), FLOOD_S * floods))
        elif floods:
            self._rest(FLOOD_S)
        if self._bad >= BAD_LINES:  # from now on only stops are heard, until the loop has closed it
            heard.ended = True
            self._rest(self._pace.rest_s(owed_ns))
        if lines or heard.ended:
            self._hand_over(heard)
        return True

    def _rest(self, seconds: float) -> None:
        """Leave it alone for a while."""
        self._front.watch(self.socket, HANGUP, self._on_ready)
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._front.call_later(seconds, self._go_on)
        self._pace.resting += not self._rests
        self._rests = True

    def _wake(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._pace.resting -= self._rests
        self._rests = False

    def _end(self, lost: str | None, heard: ReceivedBytes) -> None:
        """End the client's input, or the client: `lost` says why."""
        self._ended = heard.ended = True
        self._wake()
        heard.lost = lost
        self._front.watch(self.socket, HANGUP if lost is None else 0, self._on_ready)
        self._hand_over(heard)

    def _go_on(self) -> None:
        self._wake()
        if not (self._ended or self._closed or self._waits):
            self._front.watch(self.socket, READ, self._on_ready)
            if self._pending is not None and self._pending():
                self._front.post(self._look_again)

    def _hand_over(self, heard: ReceivedBytes) -> None:
        heard.cpu_ns = self._account.take_spent_ns()
        self._loop.post(lambda: self.receiver(heard))

    # What becomes of the lines

    @property
    def _is_full(self) -> bool:
        lines, size = self._handed - self._done, self._handed_bytes - self._done_bytes
        return lines >= QUEUED_LINES or size >= QUEUED_BYTES

    @property
    def _has_room(self) -> bool:
        """Whether the loop keeps up, so that it can be given what is no request."""
        return self._handed - self._done < QUEUED_LINES + ON_THE_WAY

    def _sorted(self, lines: list[framing.Line]) -> ReceivedBytes:
        heard = ReceivedBytes()
        newest = next((one for one in reversed(lines) if isinstance(one, framing.StopRequest)), None)
        if newest is not None:
            heard.stop, heard.stopped = newest, self._stop(newest)
        asked_ns = heard.stamp_ns  # before that stop
        for line in lines:
            if line is newest:
                asked_ns = time.monotonic_ns()  # what follows was asked for after it
            if isinstance(line, framing.StopRequest):
                if self._has_room:
                    heard.stops.append(line)
                    self._handed += 1
                else:  # it acts; only its answer is lost
                    self.unanswered += 1
            elif self._bad >= BAD_LINES:
                self.unanswered += 1
            elif not self._is_full:
                self._bad += isinstance(line, framing.BadLine) or not _may_be_request(line)
                heard.lines.append((asked_ns, line))
                self._handed += 1
                self._handed_bytes += framing.size(line)
            elif self._has_room:
                heard.refusals.append(framing.encode_refusal(line, _TOO_MANY))
                self._handed += 1
            else:
                self.unanswered += 1
        return heard

    def _stop(self, request: framing.StopRequest) -> Future[Stopped] | None:
        """Act at once, where somebody can."""
        stop_now = self._stop_now()
        if stop_now is None:
            return None
        try:
            return stop_now(self.who, request.reason)
        except Exception:  # whatever it is, the loop tries the long way
            log.exception("a stop could not be carried out at once")
            return None
