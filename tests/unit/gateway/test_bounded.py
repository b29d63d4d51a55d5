"""What one client may ask for is bounded, whoever it is; what is beyond is answered in words or not."""

import json
import re
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.connections import session
from gateway.connections.stop_lines import StopSplitter
from gateway.streaming.sources import Wanted
from gateway.wire import limits
from gateway.wire.framing import BadLine, RpcError, decode_request
from gateway.wire.limits import BAD_LINES, GLOBS, NAME_LENGTH, NAME_OR_GLOB_LENGTH, NAMES, WILD_CARDS
from tests.support.waiting import WAIT_S
from tests.unit.gateway.harness import Answered, Bench, Client, config, serving

HTTP = b"POST / HTTP/1.1\r\nHost: robot\r\nContent-Type: text/plain\r\nContent-Length: 200\r\n\r\n"
TLS = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"
STOP = b'{"jsonrpc":"2.0","id":1,"method":"robot.stop"}\n'
CLOCK = b'{"jsonrpc":"2.0","id":1,"method":"clock.read"}\n'


@pytest.fixture
def address(bench: Bench, tmp_path: Path) -> Iterator[tuple[str, int]]:
    with serving(config(tmp_path)) as address:
        yield address


def everything(connection: socket.socket) -> bytes:
    """What is answered until the end; a connection that was reset has ended as well."""
    got = b""
    try:
        while more := connection.recv(65536):
            got += more
    except ConnectionResetError:
        pass
    return got


@pytest.mark.parametrize("hello", [HTTP, TLS, b"SSH-2.0-x\r\n", b"1\n"])
def test_another_protocol_is_not_answered_and_nothing_in_it_is_done(
    address: tuple[str, int], hello: bytes
) -> None:
    """A web page on an operator's computer may send all of this to the loopback."""
    with socket.create_connection(address) as stranger:
        stranger.settimeout(WAIT_S)
        stranger.sendall(hello + STOP + CLOCK)
        assert everything(stranger) == b""
    with Client(address) as client:
        assert client.call("robot.describe")["stop"]["held"] is False


def test_a_stop_in_an_odd_form_is_still_a_stop(address: tuple[str, int]) -> None:
    with socket.create_connection(address) as client:
        client.settimeout(WAIT_S)
        client.sendall(b" [" + STOP[:-1] + b"]\n")
        assert json.loads(client.recv(65536))["result"]["held"] is True


@pytest.mark.parametrize("line", [b"[]\n", b"{\n", b'{"a":1,"a":1}\n'])
def test_so_many_lines_that_are_no_requests_end_the_connection(address: tuple[str, int], line: bytes) -> None:
    with Client(address) as bad, Client(address) as good:
        bad.call("clock.read")
        bad.send(line * 100)  # as many as one read takes: what is unread at the end resets the connection
        told = list(iter(bad.line, None))
        assert len(told) == BAD_LINES + 1
        assert f"{BAD_LINES} lines were no requests" in told[-1]["error"]["message"]
        assert good.call("clock.read")


def test_who_says_nothing_at_all_is_not_kept(
    address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "SPEAK_S", 0.2)
    with Client(address) as speaks, socket.create_connection(address) as silent, Client(address) as loris:
        loris.send(CLOCK[:10])
        assert speaks.call("clock.read")
        silent.settimeout(WAIT_S)
        assert b"nothing was asked for in 0.2 s" in everything(silent)
        assert "nothing was asked for" in (loris.line() or {})["error"]["message"]
        assert speaks.call("clock.read")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b'{"jsonrpc":"2.0","id":1,"id":2,"method":"clock.read"}', "the key 'id' stands in it twice"),
        (
            b'{"jsonrpc":"2.0","id":1,"method":"parameter.write","params":{"changes":{"a":1,"a":2}}}',
            "the key 'a' stands in it twice",
        ),
        (
            b'{"jsonrpc":"2.0","id":1,"method":"x","params":[' + b"9" * 200 + b"]}",
            "an integer of 200 digits is more than 64 bits hold",
        ),
        (
            b'{"jsonrpc":"2.0","id":1,"method":"x","params":[%d]}' % 2**64,
            "an integer of 20 digits is more than 64 bits hold",
        ),
        (b'{"jsonrpc":"2.0","id":1,"method":"x","params":' + b"[" * 30_000, "nested too deeply"),
    ],
)
def test_what_two_readers_may_read_in_two_ways_is_no_request(line: bytes, words: str) -> None:
    with pytest.raises(BadLine, match=words):
        decode_request(line)


@pytest.mark.parametrize("name", ["x" * (NAME_LENGTH + 1), "a\nb", "a\x1b[2J", "a\u202eb"])
def test_a_clients_name_is_short_and_can_be_printed(address: tuple[str, int], name: str) -> None:
    with Client(address) as client, pytest.raises(Answered, match=r"client|printable"):
        client.call("hello", client=name)


class TestGlobs:
    @pytest.mark.parametrize(
        ("globs", "words"),
        [
            (["x"] * (NAMES + 1), f"and {NAMES} are the most"),
            (["x" * (NAME_OR_GLOB_LENGTH + 1)], f"and {NAME_OR_GLOB_LENGTH} are the most"),
            (["*a" * (WILD_CARDS + 1)], f"more than {WILD_CARDS} of"),
            (["[\u4e00-\uff00]"], "beyond ASCII"),
            ([f"{number}*" for number in range(GLOBS + 1)], f"may have {GLOBS} globs, not {GLOBS + 1}"),
        ],
    )
    def test_more_than_anybody_needs_is_refused(self, globs: list[str], words: str) -> None:
        with pytest.raises(RpcError, match=words):
            Wanted(globs)

    def test_they_mean_what_they_say(self) -> None:
        wanted = Wanted(["left_knee.position", "right_*", "imu.[xy]", "imu.[xy]"])
        names = ["left_knee.position", "left_knee.velocity", "right_hip.position", "imu.x", "imu.z"]
        assert [name for name in names if name in wanted] == [
            "left_knee.position",
            "right_hip.position",
            "imu.x",
        ]
        assert list(Wanted(["nobody", "no*", "imu.x"]).meaningless(names)) == ["nobody", "no*"]
        assert all(name in Wanted(None) for name in names)
        assert not any(name in Wanted([]) for name in names)

    def test_the_worst_of_them_cost_little(self) -> None:
        """Work is compared, not time alone: a thousand names against one."""
        globs = ["*a" * (WILD_CARDS - 1) + "*", "*" * WILD_CARDS]

        def cost_s(count: int) -> float:
            wanted, names = Wanted(globs), ["a" * 60 + str(number) for number in range(count)]
            return shortest_s(lambda: sum(name in wanted for name in names))

        assert cost_s(1000) < 100 * cost_s(100)


def shortest_s(work: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        began = time.thread_time()
        work()
        times.append(time.thread_time() - began)
    return min(times)


@pytest.mark.parametrize("piece", [b"\n", b"1\n", b"{}\n"])
def test_reading_garbage_costs_no_more_than_its_length(piece: bytes) -> None:
    def cost_s(size: int) -> float:
        return shortest_s(lambda: StopSplitter().feed(piece * (size // len(piece))))

    assert cost_s(160_000) < 50 * max(cost_s(16_000), 1e-5)


def test_the_table_of_limits_says_what_is_true() -> None:
    """docs/reference/limits.md names every limit, with its number."""
    text = (Path(__file__).parents[3] / "docs" / "reference" / "limits.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    for name, number in vars(limits).items():
        if not name.isupper():
            continue
        said = f"{number:,g}" if isinstance(number, float) else f"{number:,}"
        if name in rows:
            assert re.search(rf"\| {said} ", rows[name]), name
        else:
            assert f"`{name}` ({said})" in text, name
