"""Lines that ask for a stop: every form in which that can be read, and none of those in which it cannot."""

import json
import time
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import UNSET

from gateway.connections.stop_lines import StopSplitter, stop_in
from gateway.wire import framing
from gateway.wire.limits import LINE_LIMIT, REASON_LENGTH

PLAIN = b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":"fall"}}'
LONG = b"x" * LINE_LIMIT


@pytest.mark.parametrize(
    ("line", "id_", "reason"),
    [
        (PLAIN, 1, "fall"),
        (b'{"jsonrpc":"2.0","method":"robot.stop"}', UNSET, ""),
        (b'{"jsonrpc":"2.0","id":null,"method":"robot.stop","params":null}', None, ""),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":["fall"]}', 1, "fall"),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":[{"reason":"fall"}]}', 1, "fall"),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":[]}', 1, ""),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":"fall"}', 1, "fall"),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":[1]}}', 1, ""),
        (b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":7,"at":"once"}}', 1, "7"),
        (b'{"id":"a","method":"robot.stop"}', "a", ""),
        (b'{"method":"robot.stop"}', None, ""),
        (b'{"jsonrpc":"1.0","id":3,"method":"robot.stop","now":true}', 3, ""),
        (b'{"jsonrpc":"2.0","id":1.5,"method":"robot.stop"}', 1.5, ""),
        (b'{"jsonrpc":"2.0","id":true,"method":"robot.stop"}', None, ""),
        (b'{"jsonrpc":"2.0","id":{"a":1},"method":"robot.stop"}', None, ""),
        (b'{"jsonrpc":"2.0","id":1180591620717411303424,"method":"robot.stop"}', 2**70, ""),
        (b"[" + PLAIN + b"]", 1, "fall"),
        (b'[{"jsonrpc":"2.0","id":8,"method":"clock.read"}, 5, ' + PLAIN + b"]", 1, "fall"),
        (b'{"jsonrpc":"2.0","id":4,"\\u006dethod":"robot\\u002estop"}', 4, ""),
        (b' \t{ "id" : 2 , "method" : "robot.stop" } ', 2, ""),
        # What is no JSON
        (
            b'{"jsonrpc":"2.0","id":4,"method":"robot.stop","params":{"reason":"h\xf6r auf"}}',
            4,
            "h\ufffdr auf",
        ),
        (b'{"jsonrpc":"2.0","id":4,"method":"robot.stop","params":{"reason":"a\x01\tb"}}', 4, "a  b"),
        (b'{"id":"s","method":"robot.stop"', "s", ""),
        (b'{"method" \t:\x00 "robot.stop","params":{"reason":"fal', None, "fal"),
        (b'{"method":"robot\\u002estop",', None, ""),
        (b'{"id":-1.5e3,"method":"robot.stop"}}', -1500.0, ""),
        (b'{"id":' + b"9" * 50 + b',"method":"robot.stop"', None, ""),
        (b'{"id":1e999,"method":"robot.stop"}', None, ""),
        (b"{'id':1,'method':'robot.stop'}", None, ""),
        (b"{id:1,method:robot.stop}", None, ""),
        (b'{\\"id\\":1,\\"method\\":\\"robot.stop\\"}', None, ""),
        (b'{"id":1 "method":"robot.stop"}', 1, ""),
        (b'{"method":"robot.stop","params":' + b"[" * 30_000, None, ""),
        (b"\xef\xbb\xbf" + PLAIN, 1, "fall"),
        ('{"method":"robot.stop"}'.encode("utf-16"), None, ""),
    ],
)
def test_whatever_its_form_a_stop_is_read(line: bytes, id_: Any, reason: str) -> None:
    found = stop_in(line)
    assert found is not None
    assert (found.id, type(found.id), found.reason) == (id_, type(id_), reason)
    assert json.loads(msgspec.json.encode(found))  # it can be answered and journaled


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b"robot.stop",
        b'"robot.stop"',
        b'["robot.stop"]',
        b'{"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"robot.stop","method":"robot.stop"}}',
        b'{"jsonrpc":"2.0","id":1,"method":"x","params":{"a":["method","robot.stop"],"b":' + PLAIN + b"}}",
        b'{"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"\\"method\\":\\"robot.stop\\""}}',
        b'[[{"jsonrpc":"2.0","id":1,"method":"hello","params":' + PLAIN + b"}]]",
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stopped"}',
        b'{"jsonrpc":"2.0","id":1,"method":"stream.stop","params":{"stream":1}}',
        b'{"method":"robot.stopped"',
        b'{"method":"robot.stop.now"',
        b'{"method":"robot.sto',
        b'{"method":"my.robot.stop"',
        b'{"nomethod":"robot.stop"',
        b'{"method":["robot.stop"]',
    ],
)
def test_what_asks_for_something_else_is_no_stop(line: bytes) -> None:
    assert stop_in(line) is None


def test_a_reason_is_cut_to_what_can_be_printed() -> None:
    reason = "a\n\u202eb" + "\U0001f6d1" * 1000
    line = json.dumps({"method": "robot.stop", "params": {"reason": reason}}).encode()
    for sent in (line, line[:-1]):
        found = stop_in(sent)
        assert found is not None
        assert len(found.reason) <= REASON_LENGTH
        assert found.reason.isprintable()


@given(
    st.binary(max_size=200),
    st.sampled_from([b"", b'"method":"robot.stop"', b"\\u0", PLAIN]),
    st.binary(max_size=80),
)
def test_no_line_is_too_odd_to_be_looked_at(before: bytes, inside: bytes, after: bytes) -> None:
    found = stop_in(before + inside + after)
    assert found is None or msgspec.json.encode(found)


@pytest.mark.parametrize(
    "piece",
    [
        b"\\",
        b"\\u006",
        b"[",
        b'"id":',
        b'"id":"',
        b'"reason":"\\',
        b"method",
        b'method":',
        b'"method":"robot.stopx',
        b" ",
    ],
)
def test_the_longest_line_is_read_in_no_time_whatever_is_in_it(piece: bytes) -> None:
    line = (b'{"stop"' + piece * LINE_LIMIT)[:LINE_LIMIT]
    began_s = time.thread_time()
    for _ in range(5):
        stop_in(line)
    assert time.thread_time() - began_s < 1.0  # it is a thousandth of that; a square would be a minute


# In pieces, and longer than a line may be


def split(data: bytes, cuts: list[int]) -> list[framing.Line]:
    splitter = StopSplitter()
    found: list[framing.Line] = []
    for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        found += splitter.feed(data[start:end])
    return found + splitter.end()


def shapes(lines: list[framing.Line]) -> list[object]:
    return ["stop" if isinstance(one, framing.StopRequest) else type(one) for one in lines]


LONG_STOP = b'{"method":"robot.stop","id":5,"params":{"reason":"' + LONG + b'"}}'


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (PLAIN, ["stop"]),
        (b"a\n" + PLAIN + b"\r\nb\n", [bytes, "stop", bytes]),
        (PLAIN[:60], ["stop"]),
        (LONG_STOP + b"\nb\n", ["stop", bytes]),
        (LONG_STOP[:-3], ["stop"]),
        (b'{"params":"' + LONG + b'","method":"robot.stop"}\nb', ["stop", bytes]),
        (b'{"params":"' + LONG + b'","method" : ' + b" " * 500 + b'"rob\\u006ft.stop"', ["stop"]),
        (b'{"method":"robot.stop",' + LONG + b'"method":"robot.stop"}\n', ["stop"]),
        (b'{"params":"' + LONG + b'","method":"robot.stopped"}\nb', [framing.BadLine, bytes]),
        (LONG + b"x\n" + LONG + b"y\n" + PLAIN, [framing.BadLine, framing.BadLine, "stop"]),
    ],
)
def test_a_stop_is_found_wherever_the_bytes_are_cut(data: bytes, expected: list[object]) -> None:
    whole = split(data, [])
    assert shapes(whole) == expected
    tail = data.rfind(b"method")
    near = {*range(tail - 3, tail + 40), *range(tail + 40, tail + 500, 9), *range(tail + 500, tail + 560)}
    for cut in {*near.intersection(range(len(data))), 1, LINE_LIMIT, len(data) - 1}:
        assert shapes(split(data, [cut])) == expected
        assert shapes(split(data, sorted({cut, min(cut + 2, len(data))}))) == expected


def test_of_a_line_that_is_too_long_what_comes_first_can_be_read() -> None:
    (found,) = split(LONG_STOP, [])
    assert found == framing.StopRequest("x" * REASON_LENGTH, 5)


def test_a_stop_in_a_line_that_is_too_long_does_not_wait_for_its_end() -> None:
    splitter = StopSplitter()
    splitter.feed(LONG + b"x")
    assert shapes(splitter.feed(b'"method":"robot.stop",')) == ["stop"]
    assert splitter.feed(LONG) == []
    assert splitter.feed(b"\n") == []


def test_nothing_is_kept_of_what_is_dropped() -> None:
    splitter = StopSplitter()
    for _ in range(100):
        splitter.feed(LONG + b"x")
        assert splitter._search is not None
        assert len(splitter._rest) + len(splitter._search._tail) < 1000


def test_numbers_by_the_thousand_are_not_read_to_see_that_a_line_is_no_stop() -> None:
    """Some take the reader of numbers very long: the thread that hears stops must not read them."""
    slow = b'{"params":[' + b"5e-324," * 9000 + b'1],"x":"\\n","method":"clock.read"}'
    quick = b'{"params":["' + b"5e-324," * 9000 + b'1"],"x":"\\n","method":"clock.read"}'

    def cost_s(line: bytes) -> float:
        times = []
        for _ in range(5):
            began_s = time.thread_time()
            assert stop_in(line) is None
            times.append(time.thread_time() - began_s)
        return min(times)

    assert cost_s(slow) < 20 * cost_s(quick)


# The newest of what a connection still holds


def newest(data: bytes, cut: int) -> framing.StopRequest | None:
    """The first that is found behind `cut`, from the end on."""
    splitter = StopSplitter()
    splitter.feed(data[:cut])
    return next(filter(None, splitter.newest_first(data[cut:])), None)


ANY_LINE = st.sampled_from(
    [
        b"",
        PLAIN,
        PLAIN[:-1] + b',"x":1}\r',
        PLAIN.replace(b"fall", b"later"),
        PLAIN[:60],
        PLAIN.decode().encode("utf-16-le"),
        b'{"jsonrpc":"2.0","id":1,"method":"clock.read"}',
        b'{"jsonrpc":"2.0","id":1,"method":"stream.stop"}',
        b"\\",
        LONG_STOP,
        LONG + b"x",
    ]
)


@given(st.lists(ANY_LINE, max_size=6), st.data())
def test_the_newest_stop_is_the_last_that_would_be_cut(lines: list[bytes], draw: st.DataObject) -> None:
    data = b"\n".join(lines)
    cut = draw.draw(st.integers(0, len(data)))
    splitter = StopSplitter()
    splitter.feed(data[:cut])
    each = splitter.feed(data[cut:]) + splitter.end()
    stops = [one for one in each if isinstance(one, framing.StopRequest)]
    assert newest(data, cut) == (stops[-1] if stops else None)


def test_lines_in_which_nothing_hints_at_a_stop_are_not_looked_at_to_find_the_newest() -> None:
    data = b'{"jsonrpc":"2.0","id":1,"method":"clock.read"}\n' * 5000
    assert list(StopSplitter().newest_first(data + PLAIN + b"\n" + data)) == [stop_in(PLAIN)]


@pytest.mark.parametrize(
    "piece", [b"x", b"\\", b'"method":', b"\\u006d", b"\0 ", b"\\\n", b"[" * 9999 + b"\\\n"]
)
def test_one_can_end_the_look_for_the_newest_whatever_there_is(
    piece: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is looked at without a pause is short."""
    data = (piece * 2 * LINE_LIMIT)[: 2 * LINE_LIMIT]
    fed: list[int] = []
    feed = StopSplitter.feed

    def count(self: StopSplitter, data: bytes) -> list[framing.Line]:
        fed.append(len(data))
        return feed(self, data)

    monkeypatch.setattr(StopSplitter, "feed", count)
    assert list(StopSplitter().newest_first(data)) == [None] * len(fed)
    assert max(fed, default=0) <= 16 * 1024
