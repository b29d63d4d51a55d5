"""One client's requests and what it is answered: answers and streams out, everything bounded.

What the client says comes from its inlet (`intake.py`). Where a client is slow, it is the client that
loses: its requests wait, its streams drop rows, and one that takes nothing for `stuck_s` is closed. Nobody
else waits for it.
"""

import functools
import logging
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Concatenate, ParamSpec, Protocol

import msgspec
from msgspec import UNSET, UnsetType

from gateway.connections.fair_share import FairShare
from gateway.connections.incoming_bytes import FOREIGN, IncomingBytes, ReceivedBytes
from gateway.connections.stop_lines import STOP
from gateway.process.futures import outcome
from gateway.process.loop import WRITE, Loop, Timer
from gateway.wire import framing
from gateway.wire.limits import BAD_LINES, MOST_STOPS, OUTPUT_BYTES, PENDING, SPEAK_S
from gateway.wire.robot import CLOCK_READ, HELLO

log = logging.getLogger(__name__)

GREETINGS = frozenset({HELLO.name, CLOCK_READ.name})
STREAM_BYTES = 64 * 1024  # output not yet taken before streams hold back
LAST_ANSWERS_S = 10.0  # how long a client that will say nothing more is waited for

SILENCE_S = 5.0  # how long one that may only stop may say nothing

_NO_REQUESTS = framing.refuse(
    framing.ErrorKind.BAD_PARAMS,
    f"{BAD_LINES} lines were no requests, so this connection ends; send one JSON-RPC request a line",
)

Answer = object | Future[object]
P = ParamSpec("P")


class Outlet(Protocol):
    """A stream's end at one client."""

    def next_line(self) -> bytes | None:
        """Return the next notification, or `None` when there is none yet."""


def _spends(work: "Callable[Concatenate[Session, P], None]") -> "Callable[Concatenate[Session, P], None]":
    """Put down on the session's account what the thread works in this method and all that it calls."""

    @functools.wraps(work)
    def metered(session: "Session", /, *args: P.args, **options: P.kwargs) -> None:
        if session.spending:
            work(session, *args, **options)
            return
        session.spending, began_ns = True, time.thread_time_ns()
        try:
            work(session, *args, **options)
        finally:
            session.cpu_ns += time.thread_time_ns() - began_ns
            session.spending = False

    return metered


class Session:
    """A connection from accept to close. It belongs to the loop's thread.

    Where `refusal` is given, everything but a stop, and the greeting that our own clients begin with, is
    answered with it, and ends the connection.
    """

    def __init__(
        self,
        loop: Loop,
        inlet: IncomingBytes,
        handle: "Callable[[Session, framing.Request], Answer]",
        stuck_s: float,
        sharing: FairShare,
        refusal: framing.RpcError | None = None,
    ) -> None:
        self.peer = inlet.peer
        self.identity = inlet.identity
        self.cpu_ns = 0  # that was worked for it
        self.requests = self.sent_bytes = 0
        self.outlets: dict[int, Outlet] = {}
        self.closed = False
        self.named: str | None = None  # what it has called itself
        self.spoke = False  # whether it has said anything yet
        self.came_ns = self.heard_ns = time.monotonic_ns()  # when it came, and when it said something last
        self.spending = False  # whether what is worked now is put down already
        self._loop = loop
        self._inlet = inlet
        self._socket = inlet.socket
        self._handle = handle
        self._stuck_s = stuck_s
        self._sharing = sharing
        self._refusal = refusal
        self.asked_ns = 0  # when the request came in that is handled now
        self._queue: deque[tuple[int, bytes | framing.BadLine]] = deque()
        self._scheduled = False
        self._pending = 0
        self._output: deque[memoryview] = deque()
        self._output_bytes = 0
        self._waiting = False  # for room, because the socket takes no more
        self._unanswered = 0
        self._input_ended = False
        self._stuck: Timer | None = None
        self._end: Timer | None = None
        self._moved_ns = 0
        self._farewells: dict[object, Callable[[], None]] = {}
        inlet.receiver = self.hear
        self._bad = 0  # lines that were no requests
        if refusal is not None:
            self._end = loop.call_later(SILENCE_S, self._check_silence)
        else:
            self._end = loop.call_later(SPEAK_S, self._check_spoke)

    @property
    def address(self) -> str:
        """Whence it comes, without the port."""
        return self.peer.rpartition(":")[0]

    @property
    def who(self) -> str:
        """How the journal calls it."""
        return self._inlet.who

    @who.setter
    def who(self, name: str) -> None:
        self._inlet.who = name

    @property
    def received_bytes(self) -> int:
        return self._inlet.received_bytes

    @property
    def waiting_bytes(self) -> int:
        """Bytes of answers and streams that the client has not read."""
        return self._output_bytes

    @property
    def waits(self) -> bool:
        """Whether it is still to be told something that it has asked for."""
        return bool(self._queue or self._pending or self._output)

    def on_close(self, farewell: Callable[[], None], whose: object = None) -> None:
        """Call `farewell` when the connection has ended; what was asked for last goes first.

        Another one of the same `whose`, where that is given, takes the place of the first.
        """
        key = object() if whose is None else whose
        self._farewells.pop(key, None)
        self._farewells[key] = farewell

    def send(self, line: bytes) -> None:
        """Queue one line and send what the socket takes now."""
        if not self.closed:
            self._enqueue(line)
            self._flush()

    @_spends
    def pump(self) -> None:
        """Send what the streams have, as far as the client keeps up."""
        if self.closed or self._input_ended:
            return
        progress = True
        while progress and self._output_bytes < STREAM_BYTES:
            progress = False
            for outlet in tuple(self.outlets.values()):
                line = outlet.next_line()
                if line is not None:
                    self._enqueue(line)
                    progress = True
        self._flush()

    def close(self, why: framing.RpcError | None = None) -> None:
        """End the connection, telling why, and tell everybody who serves it; idempotent."""
        if why is not None:
            self.send(framing.encode_error(None, why))
        if self.closed:
            return
        self.closed = True
        self._loop.watch(self._socket, 0, self._on_room)
        self._inlet.close()
        for timer in (self._stuck, self._end):
            if timer is not None:
                timer.cancel()
        unanswered = self._unanswered + self._inlet.unanswered
        if unanswered:
            log.warning("%s sent more than it took: %d of its requests were dropped", self.who, unanswered)
        self._queue.clear()
        self._output.clear()
        self._count_output(-self._output_bytes)
        self.outlets.clear()
        farewells, self._farewells = self._farewells, {}  # a session that is closed is held by nobody
        for farewell in reversed(farewells.values()):  # a lease ends before the module that knows it
            try:
                farewell()
            except Exception:  # the others are still to be told
                log.exception("%s has gone, and not everything has ended with it", self.who)

    # What the client says

    @_spends
    def hear(self, heard: ReceivedBytes) -> None:
        """Take the bytes of one read; stops first, even of a client that has gone."""
        self.cpu_ns += heard.cpu_ns
        if heard.stop is not None:
            self._stop(heard.stop, heard)
        self._inlet.done(len(heard.stops) + len(heard.refusals))
        if self.closed:
            return
        self.spoke, self.heard_ns = True, heard.stamp_ns
        if heard.refusals:
            self._send_if_room(heard.refusals)
        if self.closed:
            return
        if heard.lost is not None:
            log.info("%s: %s", self.peer, heard.lost)
            if heard.lost == FOREIGN:
                self._sharing.complain(self.address, FOREIGN)
            self.close()
            return
        if self._refusal is None:
            self._queue.extend(heard.lines)
        else:
            self._hear_greetings(heard.lines, self._refusal)
        if heard.ended:
            self._end_input()
        if not self._scheduled:
            self._scheduled = True
            self._sharing.take(self.address, self._run_next)

    def _hear_greetings(
        self, lines: list[tuple[int, bytes | framing.BadLine]], refusal: framing.RpcError
    ) -> None:
        """Hear greetings up to the first other line: that one is answered, and ends what is heard."""
        others = (at for at, (_asked_ns, line) in enumerate(lines) if not _is_greeting(line))
        heard = 0 if self._input_ended else next(others, len(lines))
        self._queue.extend(lines[:heard])
        rest = [line for _asked_ns, line in lines[heard:]]
        self._inlet.done(len(rest), sum(map(framing.size, rest)))
        if rest and not self._input_ended:
            self._send_if_room([framing.encode_refusal(rest[0], refusal)])
            self._end_input()

    def _end_input(self) -> None:
        """Nothing more is asked: what was asked is answered, as far as that can be soon."""
        if self._input_ended:
            return
        self._input_ended = True
        if self._end is not None:
            self._end.cancel()
        self._end = self._loop.call_later(LAST_ANSWERS_S, self.close)

    def _check_silence(self) -> None:
        silent_s = (time.monotonic_ns() - self.heard_ns) / 1e9
        if silent_s >= SILENCE_S and not self.waits:
            self.close()
        else:
            self._end = self._loop.call_later(max(SILENCE_S - silent_s, 0.1), self._check_silence)

    def _check_spoke(self) -> None:
        if not self.spoke:
            self.close(
                framing.refuse(
                    framing.ErrorKind.UNAVAILABLE, f"nothing was asked for in {SPEAK_S:g} s; connect again"
                )
            )

    # Answering

    def _stop(self, stop: framing.StopRequest, heard: ReceivedBytes) -> None:
        """Answer a stop that has acted; where nobody could act yet, let it be done now, ahead of all else."""
        self.requests += len(heard.stops)
        answer: Answer = heard.stopped
        if answer is None:
            params = msgspec.Raw(msgspec.json.encode({"reason": stop.reason}))
            answer = self._handled(framing.Request("2.0", STOP, params))
        room = max(0, MOST_STOPS - self._pending)
        self._unanswered += len(heard.stops[room:])
        self._follow([one.id for one in heard.stops[:room]], STOP, answer)

    @property
    def _may_run(self) -> bool:
        """Whether there is a request whose answer there is room for."""
        return bool(self._queue) and self._pending < PENDING and self._output_bytes < OUTPUT_BYTES

    def _schedule(self) -> None:
        """One request at a time, so that a client that sends a thousand does not keep the others."""
        if not self._scheduled and self._may_run:
            self._scheduled = True
            self._sharing.add(self.address, self._run_next)

    @_spends
    def _run_next(self) -> None:
        self._scheduled = False
        try:
            if not self.closed and self._may_run:
                self._run(*self._queue.popleft())
        finally:  # whatever became of that request, the next one has its turn
            self._schedule()
            self._finish_if_done()

    def _run(self, asked_ns: int, line: bytes | framing.BadLine) -> None:
        self.asked_ns = asked_ns
        self._inlet.done(1, framing.size(line))
        try:
            if isinstance(line, framing.BadLine):
                raise line
            request = framing.decode_request(line)
        except framing.BadLine as error:
            self._answer_bad(error)
            return
        self.requests += 1
        self._follow([request.id], request.method, self._handled(request))

    def _answer_bad(self, error: framing.BadLine) -> None:
        self._bad += 1
        is_last = self._bad == BAD_LINES
        self.send(framing.encode_error(error.id, error) + framing.encode_error(None, _NO_REQUESTS) * is_last)
        if is_last:
            self._sharing.complain(
                self.address, f"sends what is no request, {BAD_LINES} lines on one connection"
            )
            self.close()

    def _handled(self, request: framing.Request) -> Answer:
        try:
            return self._handle(self, request)
        except Exception as error:  # noqa: BLE001 - whatever it is, this client is told and the others never notice
            return error

    def _follow(self, ids: list[framing.Id | float | UnsetType], method: str, answer: Answer) -> None:
        """Answer these requests, which are one, once that is known."""
        if isinstance(answer, Future):
            self._pending += len(ids)
            answer.add_done_callback(
                lambda future: self._loop.call(lambda: self._complete(ids, method, future))
            )
        else:
            self._answer(ids, method, answer)

    @_spends
    def _complete(
        self, ids: list[framing.Id | float | UnsetType], method: str, future: Future[object]
    ) -> None:
        self._pending -= len(ids)
        self._answer(ids, method, outcome(future))
        self._schedule()
        self._finish_if_done()

    def _answer(self, ids: list[framing.Id | float | UnsetType], method: str, answer: object) -> None:
        asked = [id_ for id_ in ids if id_ is not UNSET]
        try:
            lines = framing.encode_answers(asked, self._told(method, answer))
        except Exception as error:  # noqa: BLE001 - an answer of ours that is none: it is told, and logged
            lines = framing.encode_answers(asked, self._told(method, error))
        if method == STOP:
            self._send_if_room(lines)
        elif lines:
            self.send(b"".join(lines))

    def _told(self, method: str, answer: object) -> object:
        """Return a failure of our own as the error that it is answered with; it is logged."""
        if not isinstance(answer, Exception) or isinstance(answer, framing.RpcError):
            return answer
        log.error("%s from %s failed", method, self.peer, exc_info=answer)
        return framing.internal_error(method, answer)

    def _finish_if_done(self) -> None:
        """End a client that sends nothing more after its answers, streams or not."""
        if self._input_ended and not self.waits:
            self.close()

    # Writing

    def _send_if_room(self, lines: list[bytes]) -> None:
        """Send the lines if the client reads; else only count them."""
        if self._output_bytes < OUTPUT_BYTES:
            self.send(b"".join(lines))
        else:
            self._unanswered += len(lines)

    def _enqueue(self, line: bytes) -> None:
        self._output.append(memoryview(line))
        self._count_output(len(line))

    def _count_output(self, size: int) -> None:
        self._output_bytes += size
        self._sharing.hold(self, size)

    def _flush(self) -> None:
        """Send until the socket takes no more; what is left goes when it does."""
        sent_any = False
        try:
            while self._output:
                sent = self._socket.send(self._output[0])
                sent_any = True
                self.sent_bytes += sent
                self._count_output(-sent)
                if sent < len(self._output[0]):
                    self._output[0] = self._output[0][sent:]
                else:
                    self._output.popleft()
        except BlockingIOError:
            pass
        except OSError as error:
            log.info("%s: %s", self.peer, error)
            self.close()
            return
        if sent_any:
            self._moved_ns = time.monotonic_ns()
        if self._output and self._stuck is None:
            self._moved_ns = time.monotonic_ns()
            self._stuck = self._loop.call_later(self._stuck_s, self._check_stuck)
        if self._waiting != bool(self._output):
            self._waiting = not self._waiting
            self._loop.watch(self._socket, WRITE * self._waiting, self._on_room)
        self._schedule()
        self._finish_if_done()

    @_spends
    def _on_room(self, _events: int) -> None:
        self._flush()
        self.pump()

    def _check_stuck(self) -> None:
        self._stuck = None
        if not self._output:
            return
        still_s = self._stuck_s - (time.monotonic_ns() - self._moved_ns) / 1e9
        if still_s > 0:
            self._stuck = self._loop.call_later(still_s, self._check_stuck)
        else:
            log.warning("%s takes nothing for %g s; closed", self.peer, self._stuck_s)
            self.close()


def _is_greeting(line: bytes | framing.BadLine) -> bool:
    """Return whether a line needs no module: our client sends it before it asks for a stop."""
    try:
        return isinstance(line, bytes) and framing.decode_request(line).method in GREETINGS
    except framing.BadLine:
        return False
