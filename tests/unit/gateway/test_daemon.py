"""The daemon as clients meet it: bad input, half-closed, silent and flooding clients; nobody else notices."""

import gc
import json
import signal
import socket
import struct
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.joint.quick_stop import StopOutcome
from gateway import daemon
from gateway.connections import session
from gateway.connections.listeners import listen
from gateway.process.futures import done
from gateway.service import Service
from gateway.wire import framing
from gateway.wire.limits import BAD_LINES, LINE_LIMIT
from tests.support.examples import examples
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway import processes
from tests.unit.gateway.harness import CLOCK, ROBOT, Answered, Bench, Client, config, serving

Connect = Callable[[], Client]


def test_hello_names_the_robot_and_the_protocol(client: Client) -> None:
    answer = client.call("hello", client="test", protocol=1)
    assert (answer["protocol"], answer["robot"]) == (1, "exo-test")
    assert answer["boot_id"] == client.call("clock.read")["boot_id"]
    assert answer["version"] == client.call("robot.describe")["version"] == version("gwrms")


def test_another_protocol_is_refused_with_ours(client: Client) -> None:
    assert "speaks protocol 1, not 2" in str(client.refused("hello", client="test", protocol=2))


def test_clock_relates_monotonic_to_utc(client: Client) -> None:
    before_ns, before_utc_ns = time.monotonic_ns(), time.time_ns()
    answer = client.call("clock.read")
    assert before_ns <= answer["monotonic_ns"] <= time.monotonic_ns()
    assert before_utc_ns <= answer["utc_ns"] <= time.time_ns()


@pytest.mark.parametrize(
    "method",
    [
        "resource.snap",
        "parameter.Write",
        "robot",
        "",
    ],
)
def test_a_method_that_does_not_exist_is_named(client: Client, method: str) -> None:
    error = client.refused(method)
    assert (error.code, error.kind) == (framing.METHOD_NOT_FOUND, "unknown_name")
    assert repr(method) in str(error)


@pytest.mark.parametrize(
    ("line", "code", "id_"),
    [
        (b"{\n", -32700, None),
        (b"\xff\xfe\n", -32700, None),
        (b'[{"jsonrpc":"2.0","id":1,"method":"clock.read"}]\n', -32600, None),
        (b'{"jsonrpc":"2.0","id":7,"method":"clock.read","params":[]}\n', -32602, 7),
        (b'{"jsonrpc":"2.0","id":7,"method":"clock.read","params":{"x":1}}\n', -32602, 7),
        (b"{" * (LINE_LIMIT + 1) + b"\n", -32600, None),
        (b'{"jsonrpc":"2.0","id":7,"method":"clock.read","params":' + b"[" * 60000 + b"}\n", -32700, None),
    ],
)
def test_a_bad_line_is_answered_and_the_next_one_served(
    client: Client, line: bytes, code: int, id_: int | None
) -> None:
    client.send(line + CLOCK % 9)
    answer = client.line()
    assert answer is not None
    assert (answer["error"]["code"], answer["id"]) == (code, id_)
    assert client.answer(9)["monotonic_ns"] > 0


@pytest.mark.parametrize("made", [object(), {"text": "\ud800"}, done(object())])
def test_an_answer_that_cannot_be_encoded_is_answered_as_an_error_and_the_next_request_runs(
    client: Client, monkeypatch: pytest.MonkeyPatch, made: object
) -> None:
    monkeypatch.setattr(Service, "_clock", lambda _service: made)
    client.send(CLOCK % 1 + b'{"jsonrpc":"2.0","id":2,"method":"parameter.list"}\n')
    with pytest.raises(Answered, match=r"clock\.read failed inside the gateway: ") as caught:
        client.answer(1)
    assert caught.value.code == framing.INTERNAL_ERROR
    assert client.answer(2)["values"]


def test_a_request_that_cannot_even_be_handled_keeps_no_other_waiting(
    client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    decode = framing.decode_request

    def fail(line: bytes) -> framing.Request:
        if b'"id":1,' in line:
            raise ZeroDivisionError
        return decode(line)

    monkeypatch.setattr(framing, "decode_request", fail)
    client.send(CLOCK % 1 + CLOCK % 2)
    assert client.answer(2)["monotonic_ns"] > 0


def test_a_notification_is_done_and_not_answered(client: Client) -> None:
    client.send(
        b'{"jsonrpc":"2.0","method":"clock.read"}\n{"jsonrpc":"2.0","method":"nonsense"}\n' + CLOCK % 1
    )
    answer = client.line()
    assert answer is not None
    assert answer["id"] == 1


def test_ids_come_back_as_they_were_sent(client: Client) -> None:
    for id_ in (0, -5, 2**64 - 1, -(2**63), "a", "ü\u2028", "", None):
        client.send(json.dumps({"jsonrpc": "2.0", "id": id_, "method": "clock.read"}).encode() + b"\n")
        answer = client.line()
        assert answer is not None
        assert answer["id"] == id_


def test_a_client_that_half_closes_gets_its_answers_first(client: Client, bench: Bench) -> None:
    client.request("component.snapshot")
    last = client.request("clock.read")
    client.send(CLOCK[:-1] % 77)  # the last line needs no newline
    client.socket.shutdown(socket.SHUT_WR)
    answers = {message["id"]: message for message in iter(client.line, None)}
    assert set(answers) == {1, last, 77}
    assert all("result" in message for message in answers.values())


def test_a_client_that_half_closes_is_ended_though_it_streams(connect: Connect, bench: Bench) -> None:
    """A killed one looks the same: its trial and its lease end with it."""
    gone, other = connect(), connect()
    gone.call("stream.start", modules=["component"], rate_hz=0)  # nothing comes of it that could fail
    gone.call("control.acquire", ttl_s=300)
    gone.call("parameter.write", changes={"gait.step_length": 0.45}, trial_s=300)
    gone.socket.shutdown(socket.SHUT_WR)
    until(lambda: bench.gait.node.objects[0x2001, 0] == (400).to_bytes(2, "little"), "it is taken back")
    assert other.call("control.acquire", ttl_s=10)
    assert all("method" in message for message in iter(gone.line, None))


def test_a_device_that_never_answers_does_not_keep_who_has_gone(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "LAST_ANSWERS_S", 0.1)
    bench.left.hanging = Future()
    client.request("robot.stop")
    client.request("clock.read")
    client.socket.shutdown(socket.SHUT_WR)
    answers = list(iter(client.line, None))
    assert [one["id"] for one in answers] == [2]


def test_who_vanishes_while_its_last_answer_is_awaited_is_gone_at_once(
    connect: Connect, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "LAST_ANSWERS_S", 10 * WAIT_S)
    gone, other = connect(), connect()
    gone.call("control.acquire", ttl_s=300)
    monkeypatch.setattr(bench.gait.node, "upload", lambda _index, _subindex: Future())
    gone.request("parameter.read", names=["gait.step_length"])
    gone.socket.shutdown(socket.SHUT_WR)
    gone.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    gone.close()
    until(lambda: _has_lease(other), "its lease has ended")


def _has_lease(client: Client) -> bool:
    try:
        return bool(client.call("control.acquire", ttl_s=10))
    except Answered:
        return False


def test_a_client_that_never_reads_is_bounded_and_nobody_notices(bench: Bench, tmp_path: Path) -> None:
    robot = config(tmp_path, ROBOT.replace("linger_s", "stuck_s = 0.5\nbuffer_kb = 64\nlinger_s"))
    with serving(robot) as address, Client(address) as silent, Client(address) as other:
        for _ in range(32):
            silent.request("stream.start", modules=["component"], rate_hz=1000)
        other.call("stream.start", modules=["component"], rate_hz=20)

        def closed() -> bool:
            other.data()
            try:
                silent.send(CLOCK % 1)
            except OSError:
                return True
            return False

        until(closed, "the silent client is closed")
        assert other.call("clock.read")


def test_a_stop_overtakes_what_its_own_connection_has_queued(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    told_ns: list[int] = []
    stop = bench.left.quick_stop

    def told(*, wake: bool = True) -> "Future[StopOutcome]":
        told_ns.append(time.monotonic_ns())
        return stop(wake=wake)

    monkeypatch.setattr(bench.left, "quick_stop", told)
    client.call("robot.describe")  # comes from the module that stops: it runs now
    lines = [json.dumps({"jsonrpc": "2.0", "id": i, "method": "resource.snapshot"}) for i in range(100)]
    lines.append('{"jsonrpc":"2.0","id":"stop","method":"robot.stop","params":{"reason":"test"}}')
    client.send("\n".join(lines).encode() + b"\n")
    answers = [message for message in (client.line() for _ in range(101)) if message is not None]
    answered_ns = [one["result"]["stamp_ns"] for one in answers if one["id"] != "stop"]
    assert len(answered_ns) == 100
    assert len([stamp_ns for stamp_ns in answered_ns if stamp_ns < told_ns[0]]) < 50


def test_connections_that_come_and_go_leave_nothing(connect: Connect) -> None:
    for _ in range(50):
        one = connect()
        one.request("component.snapshot")
        one.close()
    assert connect().call("clock.read")


GARBAGE = st.one_of(
    st.binary(max_size=300),
    st.sampled_from(
        [b"\n", b"{}\n", b"[]\n", CLOCK % 5, CLOCK[:20], b"\xff\n", b'{"jsonrpc":"2.0",\n', b"\x00" * 70_000]
    ),
)


@settings(max_examples=examples(60))
@given(pieces=st.lists(GARBAGE, max_size=8), cuts=st.lists(st.integers(0, 2000), max_size=4))
def test_garbage_in_any_pieces_hurts_neither_the_daemon_nor_another_session(
    garbage_gateway: tuple[str, int], pieces: list[bytes], cuts: list[int]
) -> None:
    stream = b"".join(pieces)
    with Client(garbage_gateway) as bad, Client(garbage_gateway) as good:
        assert bad.call("clock.read")
        start = 0
        for cut in sorted(cuts):
            bad.send(stream[start:cut])
            start = max(start, cut)
            assert good.call("clock.read")
        bad.send(stream[start:] + b"\n" + CLOCK % 99)
        try:
            assert bad.answer(99)["monotonic_ns"] > 0
        except (ConnectionError, Answered):  # it was ended, for so much that was no request
            assert stream.count(b"\n") >= BAD_LINES - 1
        assert good.call("clock.read")


@pytest.fixture(scope="module")
def garbage_gateway(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, int]]:
    with serving(config(tmp_path_factory.mktemp("garbage"))) as address:
        yield address


class TestProcess:
    """The command itself, as a process of its own."""

    @pytest.fixture
    def process(self, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
        config(tmp_path)
        with processes.process(*processes.GATEWAY, str(tmp_path / "robot.toml")) as process:
            yield process

    @pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
    def test_signals_end_it_cleanly_with_clients_and_modules(
        self, process: "subprocess.Popen[str]", number: signal.Signals
    ) -> None:
        with Client(processes.address(process)) as client:
            client.call("resource.snapshot")
            process.send_signal(number)
            assert client.line() is None
            assert process.wait(WAIT_S) == 0
        assert process.stderr is not None
        beyond_its_file = [line for line in process.stderr if "WARNING gateway.cli.serve" not in line]
        assert beyond_its_file == []

    def test_a_resource_only_client_is_read_and_looked_for_in_a_thread_each(
        self, process: "subprocess.Popen[str]"
    ) -> None:
        with Client(processes.address(process)) as client:
            client.call("hello", client="test")
            client.call("resource.snapshot")
            threads = list(Path(f"/proc/{process.pid}/task").iterdir())
        assert len(threads) == 3  # with the loop


def test_what_a_resource_only_gateway_imports() -> None:
    code = (
        "import sys, gateway.cli.serve, gateway.modules.resource.module, gateway.modules.resource.host; "
        "print([m for m in ('can', 'canopen', 'serial', 'asyncio', 'numpy', 'rich') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=WAIT_S
    )
    assert done.stdout == "[]\n"


def test_what_is_kept_out_while_a_library_is_imported_can_be_imported_afterwards() -> None:
    code = (
        "import sys; from eds.light_imports import without\n"
        "with without('ssl', 'json'): import asyncio\n"
        "print('ssl' in sys.modules); import ssl; print(ssl.OPENSSL_VERSION_INFO[0] > 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=WAIT_S
    )
    assert done.stdout == "False\nTrue\n"


def test_an_eds_is_read_without_python_can_which_can_be_imported_afterwards() -> None:
    code = (
        "import sys; from gateway.modules.component.assembly import _import_canopen as found\n"
        "found(with_can=False)\n"
        "import eds; print(eds.load(eds.locate('joint_drive.eds', None), 2).product, 'can' in sys.modules)\n"
        "import can; print(can.Bus.__module__)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=WAIT_S
    )
    assert done.stdout.splitlines() == ["GWRMS joint drive False", "can.interface"]


def test_a_port_in_use_is_named_with_what_to_do() -> None:
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"127.0.0.1:{port}: .*choose another with --host or --port"):
            listen("127.0.0.1", port)


def test_who_has_gone_is_held_by_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is in a circle is found by the collector only, and that leaves out all it has frozen."""
    known: weakref.WeakSet[session.Session] = weakref.WeakSet()

    class Known(session.Session):
        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            known.add(self)

    monkeypatch.setattr(daemon, "Session", Known)
    with serving(config(tmp_path)) as address, Client(address) as other:
        gc.disable()
        try:
            with Client(address) as client:
                client.call("control.acquire", ttl_s=10)
                client.call("stream.start", modules=["component"], rate_hz=100)
                client.call("resource.snapshot")
                assert len(known) == 2
            until(lambda: other.call("clock.read") and len(known) == 1, "nobody holds it")
        finally:
            gc.enable()
