"""An inlet turned by hand: whose bytes are read when, how much waits, and that a stop in them acts."""

import contextlib
import fcntl
import itertools
import socket
import sys
import termios
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from functools import partial
from typing import Any

import pytest

from gateway.access.identity import ANYBODY
from gateway.connections import incoming_bytes, intake, rate_limit, stop_lines
from gateway.connections.fair_share import FairShare
from gateway.connections.incoming_bytes import (
    ON_THE_WAY,
    RECEIVE_BYTES,
    UNKNOWN_BYTES,
    IncomingBytes,
    ReceivedBytes,
)
from gateway.connections.listeners import listen
from gateway.connections.rate_limit import RateLimit
from gateway.connections.session import Session
from gateway.connections.stop_lines import stop_in
from gateway.process.loop import HANGUP, READ, Loop
from gateway.wire import framing
from gateway.wire.limits import BAD_LINES, MOST_STOPS, QUEUED_LINES
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import CLOCK, STOP

NO_STOP = b'{"jsonrpc":"2.0","id":1,"method":"stream.stop"}\n'  # which is only seen by reading it


def unread(accepted: socket.socket) -> int:
    """The bytes that the kernel keeps for it."""
    return int.from_bytes(fcntl.ioctl(accepted, termios.FIONREAD, bytes(4)), sys.byteorder)


class Turned:
    """An inlet whose two loops a test turns by hand, and its client."""

    def __init__(self, client: socket.socket, accepted: socket.socket) -> None:
        self.client, self.accepted = client, accepted
        self.front, self.loop = Loop(), Loop()
        self.asked: list[str] = []  # reasons of the stops that have acted
        self.heard: list[ReceivedBytes] = []
        self.spent: list[int] = []  # what the thread will have worked, the last first
        answer: Future[Any] = Future()
        intake._prepare(accepted)

        def stop_now(_who: str, reason: str) -> "Future[Any]":
            self.asked.append(reason)
            return answer

        self.inlet = IncomingBytes(
            self.front,
            self.loop,
            accepted,
            "x",
            ANYBODY,
            lambda: stop_now,
            lambda: self.spent.pop() if self.spent else 0,
            lambda _inlet: None,
            RateLimit(self.front),
        )
        self.inlet.receiver = self.heard.append

    def says(self, data: bytes) -> None:
        """One read of a client that is known."""
        self.client.sendall(data)
        self.inlet._receive(RECEIVE_BYTES)

    def holds(self, data: bytes) -> None:
        """That has arrived, and nobody has read it."""
        self.client.sendall(data)
        until(lambda: unread(self.accepted) == len(data), "it has arrived")

    def turn_loop(self) -> float | None:
        """As long as there is something to do; how long it would sleep then."""
        while (patience_s := self.loop._patience_s()) == 0.0:
            self.loop._turn()
        return patience_s

    def close(self) -> None:
        self.inlet.finish()
        self.front.close()
        self.loop.close()


@pytest.fixture
def turned() -> Iterator[Turned]:
    with listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()) as client:
        accepted, _ = listener.accept()
        with accepted, contextlib.closing(Turned(client, accepted)) as turned:
            yield turned


def test_a_stop_that_has_arrived_acts_though_the_loop_has_closed_its_client(turned: Turned) -> None:
    turned.holds(CLOCK % 1 * 1000 + STOP % b"unread")
    turned.inlet.finish()
    assert turned.asked == ["unread"]
    assert turned.accepted.fileno() == -1
    assert len(turned.front._watched) == 1
    turned.inlet.finish()


@pytest.mark.parametrize("cut", range(1, 33))
def test_a_stop_cut_by_the_end_of_reading_acts(turned: Turned, cut: int) -> None:
    """Its first part was read, the second is still in the socket when the connection is closed."""
    line = b'{"method": "robot.stop", "id": 1}'
    turned.says(line[:cut])
    turned.holds(line[cut:])
    turned.inlet.finish()
    assert turned.asked == [""]


def test_stops_that_come_together_are_one_and_each_is_answered(turned: Turned) -> None:
    turned.says(STOP % b"more" * 100 + STOP % b"last")
    turned.turn_loop()
    assert turned.asked == ["last"]
    assert [(one.stop and one.stop.reason, len(one.stops)) for one in turned.heard] == [("last", 101)]


def test_who_floods_with_stops_is_left_alone_and_who_stops_is_not(turned: Turned) -> None:
    turned.says(STOP % b"a few" * rate_limit.FLOOD)
    assert not turned.inlet._rests
    turned.says(STOP % b"many" * (rate_limit.FLOOD + 1))
    assert turned.inlet._rests
    assert turned.asked == ["a few", "many"]


def test_single_stops_by_the_dozen_are_a_flood_too_and_its_rest_is_short(turned: Turned) -> None:
    """However many others are left alone just now: somebody may have reset in between."""
    turned.inlet._pace.resting = 100
    rests: list[float] = []
    turned.front.call_later = lambda delay_s, callback: rests.append(delay_s)  # type: ignore[method-assign, assignment, return-value]
    while not rests:
        turned.says(STOP % b"one")
        assert len(turned.asked) < 10 * rate_limit.FLOOD
    assert len(turned.asked) > rate_limit.FLOOD
    assert rests == [rate_limit.FLOOD_S]


def test_a_flood_of_stops_that_costs_much_rests_no_less(turned: Turned) -> None:
    rests: list[float] = []
    turned.front.call_later = lambda delay_s, callback: rests.append(delay_s)  # type: ignore[method-assign, assignment, return-value]
    turned.spent = [2 * rate_limit.COSTLY_NS, 0]
    turned.says(STOP % b"many" * (rate_limit.FLOOD + 1))
    assert rests == [rate_limit.FLOOD_S]


def test_of_what_a_closed_connection_still_holds_only_so_much_is_looked_through(
    turned: Turned, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incoming_bytes, "LAST_NS", 0)
    turned.holds(STOP % b"early" + NO_STOP)
    turned.inlet.finish()
    assert turned.asked == []


def test_the_last_stop_of_a_closed_connection_acts_however_slow_the_computer_is(
    turned: Turned, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(incoming_bytes, "LAST_NS", 0)
    turned.holds(STOP % b"early" + NO_STOP * 200 + CLOCK % 1 * 500 + STOP % b"last" + CLOCK % 1 * 500)
    turned.inlet.finish()
    assert turned.asked == ["last"]


def test_what_others_take_of_the_processor_is_no_time_of_the_last_look(
    turned: Turned, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = itertools.count(
        0, 10 * incoming_bytes.LAST_NS
    )  # each time that it is read, others have had their turn
    monkeypatch.setattr(time, "monotonic_ns", lambda: next(clock))
    turned.holds(STOP % b"early" + NO_STOP * 5)
    turned.inlet.finish()
    assert turned.asked == ["early"]


def test_stops_beyond_what_may_wait_act_and_are_not_answered(
    turned: Turned, caplog: pytest.LogCaptureFixture
) -> None:
    session = Session(
        turned.loop, turned.inlet, lambda _session, _request: None, 30.0, FairShare(turned.loop)
    )
    heard = ReceivedBytes()
    heard.stops = [framing.StopRequest("x", number) for number in range(MOST_STOPS + 5)]
    heard.stop, heard.stopped = heard.stops[-1], Future()
    session.hear(heard)
    assert session._pending == MOST_STOPS
    session.close()
    assert "5 of its requests were dropped" in caplog.text


def test_an_id_without_end_is_not_kept() -> None:
    stop = stop_in(b'{"jsonrpc":"2.0","method":"robot.stop","id":"%s"}' % (b"x" * 60_000))
    assert stop is not None
    assert stop.id is None


def test_small_costs_add_up(turned: Turned, monkeypatch: pytest.MonkeyPatch) -> None:
    """No single read is dear, and yet they are all that the thread does."""
    monkeypatch.setattr(rate_limit, "PACE_FACTOR", 1 << 60)  # nothing is forgotten
    reads = 0
    while not turned.inlet._rests:
        turned.spent = [rate_limit.COSTLY_NS // 5, 0]
        turned.says(CLOCK % 1)
        reads += 1
        assert reads < 100
    assert reads > 1


def test_what_ends_with_a_client_ends_though_something_else_cannot(turned: Turned) -> None:
    """What came last goes first: a lease is given back before the module that knows it stops."""
    ended: list[str] = []
    session = Session(
        turned.loop, turned.inlet, lambda _session, _request: None, 30.0, FairShare(turned.loop)
    )
    session.on_close(lambda: ended.append("module"))
    session.on_close(lambda: ended.remove("nothing"))
    session.on_close(lambda: ended.append("lease"))
    session.close()
    session.close()
    assert ended == ["lease", "module"]


def test_who_sends_too_much_is_left_alone_for_a_moment_and_read_again(turned: Turned) -> None:
    inlet, front, heard = turned.inlet, turned.front, turned.heard
    turned.client.setblocking(False)
    rest = CLOCK % 1 * 2 * QUEUED_LINES + STOP % b"paced"
    watched_for: set[int] = set()

    def paced() -> bool:
        nonlocal rest
        with contextlib.suppress(BlockingIOError):
            rest = rest[turned.client.send(rest) :] if rest else rest
        front._turn()
        watched_for.add(front._watched[turned.accepted.fileno()][0])
        return bool(turned.asked)

    front.call_later(WAIT_S, lambda: None)
    until(paced, "the stop is read")
    assert watched_for == {READ, HANGUP}
    assert turned.turn_loop() is None
    assert sum(len(one.lines) for one in heard) == QUEUED_LINES
    assert sum(len(one.refusals) for one in heard) == ON_THE_WAY
    inlet.done(
        QUEUED_LINES + ON_THE_WAY,
        sum(framing.size(line) for one in heard for _, line in one.lines),
    )
    assert not inlet._is_full


def test_a_stop_behind_lines_that_were_none_is_heard(turned: Turned) -> None:
    turned.says(b"[]\n" * 2 * BAD_LINES)
    turned.holds(STOP % b"behind")
    turned.inlet.finish()
    assert turned.asked == ["behind"]


def test_who_has_cost_nothing_does_not_rest_for_others(turned: Turned) -> None:
    """The thread's work is counted since the read began, not since somebody else's was."""
    turned.spent = [1000, 1000, 50_000_000]
    turned.says(CLOCK % 1)
    assert not turned.inlet._rests


def test_no_rest_is_long(turned: Turned) -> None:
    turned.inlet._pace.resting = 100
    assert turned.inlet._pace.rest_s(50_000_000) == rate_limit.LONGEST_REST_S


def test_who_has_just_come_is_read_in_turn_and_only_a_little(turned: Turned) -> None:
    turned.client.sendall(CLOCK % 1 * 200)
    turned.inlet._on_ready(READ)
    assert turned.inlet.received_bytes == 0  # whoever is known comes first
    turned.front.call_later(0, lambda: None)
    turned.front._turn()
    assert turned.inlet.received_bytes == UNKNOWN_BYTES


def test_beyond_a_turns_time_also_those_that_are_known_take_turns(
    turned: Turned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fifty that each send a little at the same moment would keep the next one's stop waiting for all."""
    turned.says(CLOCK % 1)
    monkeypatch.setattr(rate_limit, "TURN_NS", 0)
    turned.client.sendall(STOP % b"in turn")
    turned.inlet._on_ready(READ)
    assert turned.asked == []
    turned.inlet._take_turn()
    assert turned.asked == ["in turn"]


def test_who_has_gone_while_it_waits_has_one_turn(turned: Turned) -> None:
    for _ in range(10):
        turned.inlet._on_ready(HANGUP)
    assert [len(runs) for runs in turned.inlet._pace._waiting.values()] == [1]
    turned.inlet._go_on()  # a rest that ends meanwhile
    assert turned.accepted.fileno() not in turned.front._watched


def test_a_rest_is_the_last_one_that_was_said(turned: Turned) -> None:
    turned.inlet._rest(0.0)
    turned.inlet._rest(1000.0)
    turned.front.call_later(0.0, lambda: None)
    turned.front._turn()
    assert turned.inlet._rests
    turned.inlet._end("gone", ReceivedBytes())
    assert turned.inlet._pace.resting == 0


def test_who_costs_something_takes_turns_again(turned: Turned) -> None:
    turned.says(CLOCK % 1)
    assert turned.inlet._is_known
    turned.spent = [rate_limit.COSTLY_NS // 2, 0]
    turned.says(CLOCK % 1)
    assert not turned.inlet._is_known


def test_who_is_admitted_while_nobody_is_accepted_any_more_comes_before_that_is_said(
    turned: Turned,
) -> None:
    """A gateway that went to rest at that moment lost the client."""
    loop, said = Loop(), list[str]()
    thread = intake.Intake(loop, {}, lambda _inlet: said.append("opened"), lambda: None)
    accepting, goes_on = threading.Event(), threading.Event()
    thread.start()
    thread._front.post(partial(_wait, accepting, goes_on))
    assert accepting.wait(WAIT_S)

    def closed() -> None:
        said.append("closed")
        loop.stop()

    thread.listen(on=False, then=closed)
    thread.admit(turned.accepted, "10.0.0.2:1", ANYBODY)
    goes_on.set()
    loop.run()
    thread.end()
    loop.close()
    assert said == ["opened", "closed"]


def _wait(begun: threading.Event, goes_on: threading.Event) -> None:
    begun.set()
    goes_on.wait(WAIT_S)


def test_lines_that_could_hold_no_stop_are_not_looked_into() -> None:
    """Each costs a failed reading: they were 19 ms of the thread in one read."""
    assert all(stop_in(b"{\\" + b"x" * more) is None for more in range(20))
    assert stop_in(b"method:robot.stop") is not None
    assert len(b"method:robot.stop") == stop_lines._SHORTEST
