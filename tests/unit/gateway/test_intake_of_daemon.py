"""The intake of a whole daemon: stops act past the loop, whatever it does; no bytes are another's."""

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, cast

import pytest

from gateway.connections.incoming_bytes import ON_THE_WAY
from gateway.connections.listeners import listen
from gateway.connections.session import Session
from gateway.daemon import Daemon
from gateway.handlers import Handlers, on
from gateway.registry import Context, Spec
from gateway.wire import framing
from gateway.wire.limits import BAD_LINES, QUEUED_BYTES, QUEUED_LINES
from gateway.wire.stop import ROBOT_STOP, Stopped
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway import processes
from tests.unit.gateway.harness import CLOCK, HEAD, STOP, Client, config

RESET = struct.pack("ii", 1, 0)  # SO_LINGER: closing resets the connection


class Stops:
    """A module that stops what there is, and tells; it stands in the place of `control`."""

    def __init__(self, context: Context) -> None:
        self.handlers = Handlers(on(ROBOT_STOP, self._late))
        self.asked: list[tuple[str, str]] = []
        self.late: list[tuple[str, str]] = []  # what came by the loop
        self.answer: Future[Stopped] = Future()
        self.broken = False
        self._context = context
        self.answer.set_result(Stopped({}, held=True))

    def start(self) -> None:
        self._context.stops_by(self._stop)

    def stop(self) -> None:
        self._context.stops_by(None)

    def describe(self) -> Any:
        return self.answer

    def _stop(self, who: str, reason: str) -> "Future[Stopped]":
        if self.broken:
            raise RuntimeError("nothing works")
        self.asked.append((who, reason))
        return self.answer

    def _late(self, session: Any, params: Any) -> "Future[Stopped]":
        self.late.append((session.who, params.reason))
        return self.answer


class Serving:
    """A daemon whose loop a test can hold."""

    def __init__(self, daemon: Daemon, stops: Stops) -> None:
        self.daemon = daemon
        self.stops = stops
        self._clients = contextlib.ExitStack()

    def connect(self) -> Client:
        return self._clients.enter_context(Client(self.daemon.address))

    def close(self) -> None:
        self._clients.close()

    @contextlib.contextmanager
    def hung(self) -> Iterator[None]:
        """While inside, the loop is in a callback that does not return."""
        there, over = threading.Event(), threading.Event()

        def hang() -> None:
            there.set()
            over.wait(WAIT_S)

        self.daemon._loop.post(hang)
        assert there.wait(WAIT_S)
        try:
            yield
        finally:
            over.set()

    def session_of(self, client: Client) -> Session:
        port = client.socket.getsockname()[1]
        return next(one for one in self.daemon._places.taken if one.peer.endswith(f":{port}"))

    def wait_for_stop(self, reason: str) -> tuple[str, str]:
        until(lambda: any(one[1] == reason for one in self.stops.asked), f"the stop {reason!r} acts")
        return next(one for one in self.stops.asked if one[1] == reason)


@pytest.fixture
def serving(tmp_path: Path) -> Iterator[Serving]:
    specs = {"control": Spec("tests.unit.gateway.test_intake_of_daemon:Stops")}
    robot = config(tmp_path, HEAD.replace("0.05", "1000"))
    daemon = Daemon(robot, listen("127.0.0.1", 0), specs)
    thread = threading.Thread(target=daemon.run, name="daemon")
    thread.start()
    with Client(daemon.address) as first:
        first.call("robot.stop", reason="cold")  # by the loop: the module comes up with it
    stops = cast("Stops", daemon._service.registry.running("control"))
    assert stops.late == [(stops.late[0][0], "cold")]
    made = Serving(daemon, stops)
    yield made
    made.close()
    daemon.end()
    thread.join(WAIT_S)
    assert not thread.is_alive()
    assert stops._context.stops_by is not None
    assert daemon._service.registry.stop_now is None


# A loop that stands still


def test_a_stop_acts_while_the_loop_hangs_and_is_answered_afterwards(serving: Serving) -> None:
    client = serving.connect()
    client.call("hello", client="test")
    with serving.hung():
        client.send(CLOCK % 1 + STOP % b"now")
        who, _ = serving.wait_for_stop("now")
        assert who == f"test (127.0.0.1:{client.socket.getsockname()[1]})"
    assert client.answer("stop")["held"] is True
    assert client.answer(1)


def test_who_comes_while_the_loop_hangs_can_stop_too(serving: Serving) -> None:
    with serving.hung():
        late = serving.connect()
        late.send(STOP % b"from nobody yet")
        who, _ = serving.wait_for_stop("from nobody yet")
        assert who.startswith("127.0.0.1:")
    assert late.answer("stop")["held"] is True


def test_a_stop_that_fails_at_once_is_tried_by_the_loop(serving: Serving) -> None:
    client = serving.connect()
    serving.stops.broken = True
    assert client.call("robot.stop", reason="again")["held"] is True
    assert serving.stops.late[-1][1] == "again"
    assert serving.stops.asked == []


def test_a_stop_of_who_has_gone_before_anybody_could_act_is_done_all_the_same(serving: Serving) -> None:
    client = serving.connect()
    client.call("hello", client="test")
    serving.stops.broken = True
    with serving.hung():
        client.send(STOP % b"last")
        client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        client.close()
    until(lambda: serving.stops.late[-1][1] == "last", "it is done")


# However it is written


@pytest.mark.parametrize("by_the_loop", [False, True])
@pytest.mark.parametrize(
    ("line", "id_"),
    [
        (b'{"method":"robot.stop"}\n', None),
        (b'{"jsonrpc":"2.0","id":1.5,"method":"robot.stop","params":[1,2]}\n', 1.5),
        (b'{"jsonrpc":"2.0","id":{},"method":"robot.stop","more":1}\n', None),
        (b'[{"jsonrpc":"2.0","id":3,"method":"robot.stop"}]\n', 3),
        (b'{"jsonrpc":"2.0","id":3,"method":"robot.stop","params":{"reason":"\xe9\x01"}}\n', 3),
        (b'{"id":"a","method":"robot.stop","params":{"reason":"' + b"x" * 70_000 + b'"}}\n', "a"),
        (b'{"id":4,"method":"robot.stop"', 4),
        ('{"method":"robot.stop"}'.encode("utf-16-le"), None),
        ('{"method":"robot.stop"}'.encode("utf-16-be"), None),
        ('{"method":"robot.stop"}'.encode("utf-32-be"), None),
    ],
)
def test_a_stop_is_never_refused_for_its_form(
    serving: Serving, line: bytes, id_: Any, by_the_loop: bool
) -> None:
    serving.stops.broken = by_the_loop
    client = serving.connect()
    client.send(line)
    client.socket.shutdown(socket.SHUT_WR)
    message = client.line()
    assert message is not None
    assert (message["id"], message["result"]["held"]) == (id_, True)
    assert client.line() is None
    assert len(serving.stops.asked) + len(serving.stops.late) == 2


def test_a_stop_in_the_parameters_of_something_else_is_none(serving: Serving) -> None:
    client = serving.connect()
    client.send(b'{"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"x","method":"robot.stop"}}\n')
    message = client.line()
    assert message is not None
    assert "there is no method here" in message["error"]["message"]
    assert serving.stops.asked == []


def test_a_stop_without_an_id_acts_and_is_not_answered(serving: Serving) -> None:
    client = serving.connect()
    client.send(b'{"jsonrpc":"2.0","method":"robot.stop","params":{"reason":"told"}}\n' + CLOCK % 1)
    serving.wait_for_stop("told")
    message = client.line()
    assert message is not None
    assert message["id"] == 1


# However much waits


def test_a_thousand_requests_at_once_are_answered_in_order(serving: Serving) -> None:
    client = serving.connect()
    client.send(b"".join(CLOCK % number for number in range(1000)))
    assert [(client.line() or {})["id"] for _ in range(1000)] == list(range(1000))


def test_a_stop_behind_more_than_may_wait_acts_and_what_is_too_much_is_refused(serving: Serving) -> None:
    client = serving.connect()
    most, more = QUEUED_LINES, 500
    with serving.hung():
        client.send(b"".join(CLOCK % number for number in range(most + more)) + STOP % b"behind")
        serving.wait_for_stop("behind")
    answers = {}
    for _ in range(most + more + 1):
        message = client.line()
        assert message is not None
        answers[message["id"]] = message
    assert "result" in answers["stop"]
    served = [number for number in range(most + more) if "result" in answers[number]]
    assert served == list(range(most))
    assert {answers[number]["error"]["data"]["kind"] for number in range(most, most + more)} == {
        "unavailable"
    }


def test_who_sends_without_end_and_takes_nothing_is_bounded_and_can_still_stop(serving: Serving) -> None:
    flood, other = serving.connect(), serving.connect()
    flood.call("clock.read")
    lines = CLOCK % 1 * 20_000

    def too_much() -> bool:
        flood.send(lines)
        session = serving.session_of(flood)
        assert sum(framing.size(line) for _asked_ns, line in session._queue) <= QUEUED_BYTES
        assert len(session._queue) <= QUEUED_LINES
        assert session.waiting_bytes < 3 * 1024 * 1024
        return session._unanswered + session._inlet.unanswered > 0

    until(too_much, "more is sent than is answered")
    assert other.call("clock.read")
    flood.send(STOP % b"behind all that")
    serving.wait_for_stop("behind all that")


def test_what_waits_for_a_loop_that_hangs_is_bounded_too(serving: Serving) -> None:
    client = serving.connect()
    client.call("clock.read")
    with serving.hung():
        client.send((CLOCK % 1 + STOP % b"many") * (QUEUED_LINES + ON_THE_WAY))
        client.send(STOP % b"last")
        serving.wait_for_stop("last")
        inlet = serving.session_of(client)._inlet
        assert inlet._handed - inlet._done <= QUEUED_LINES + ON_THE_WAY
        assert inlet.unanswered > 0
    assert client.answer("stop")["held"] is True


# Connections that come and go


def test_nobody_ever_gets_another_s_answer_however_connections_end(serving: Serving) -> None:
    wrong: list[object] = []

    def come_and_go(base: int) -> None:
        for number in range(base, base + 60):
            with Client(serving.daemon.address) as client:
                client.send(CLOCK % number)
                if number % 3 == 0:
                    client.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                elif number % 3 == 1:
                    client.socket.shutdown(socket.SHUT_WR)
                    wrong.extend(one for one in iter(client.line, None) if one["id"] != number)
                else:
                    message = client.line()
                    wrong.extend([message] if message is None or message["id"] != number else [])

    threads = [threading.Thread(target=come_and_go, args=(base,)) for base in range(1000, 7000, 1000)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT_S)
    assert wrong == []
    until(lambda: not serving.daemon._places.taken, "all have gone")
    until(lambda: not serving.daemon._intake._inlets, "their sockets are closed")
    assert serving.connect().call("clock.read")


def test_a_client_that_says_nothing_wakes_nobody(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    with (
        processes.process(*processes.GATEWAY, str(file)) as running,
        Client(processes.address(running)) as client,
    ):
        client.call("clock.read")
        until(lambda: processes.sleeps(running.pid), "what it does at once is over, and nothing wakes it")


@pytest.mark.parametrize("line", [b" " + CLOCK % 1, b"\t" + CLOCK % 1])
def test_a_blank_before_a_request_makes_it_none_the_worse(serving: Serving, line: bytes) -> None:
    client = serving.connect()
    for _ in range(2 * BAD_LINES):
        client.send(line)
        assert client.answer(1)
    client.send(STOP % b"after blanks")
    serving.wait_for_stop("after blanks")
