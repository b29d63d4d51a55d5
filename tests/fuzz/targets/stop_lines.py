"""Stops among whatever a client sends: each that is sound is found, wherever the stream is cut."""

import json

from gateway.connections.stop_lines import STOP, StopSplitter, stop_in
from gateway.wire.framing import BadLine, StopRequest

TOKENS = (
    b'"method": "robot.stop"',
    b'{"jsonrpc": "2.0", "id": 7, "method": "robot.stop", "params": {"reason": "x"}}',
    b"robot.\\u0073top",
    b"\n",
    b"[",
    b"\0",
    b"\\",
    b'"reason":',
)
MODULES = ("gateway.connections.stop_lines", "gateway.wire.framing")
SHORT = 64  # bytes, beyond which a line is too long


def fuzz(data: bytes) -> None:
    whole = _split([data])
    pieces = [data[at : at + 7] for at in range(0, len(data), 7)]
    assert whole == _split(pieces)
    # In a line that is too long, what could still be read of a stop depends on its pieces, but not the stop.
    assert _kinds([data]) == _kinds(pieces), "whether it is a stop depends on where the stream is cut"
    for line in data.split(b"\n"):
        found = stop_in(line)
        assert found is not None or not _asks(line), "a stop is lost"
        assert found is None or found.reason.isprintable()
    behind = _split([data, b"\n", b'{"jsonrpc":"2.0","id":7,"method":"robot.stop"}\n'])
    assert behind[-1] == repr(StopRequest("", 7)), "a stop is lost behind it"


def _split(pieces: list[bytes]) -> list[str]:
    splitter = StopSplitter()
    lines = [line for piece in pieces for line in splitter.feed(piece)] + splitter.end()
    return [str(line) if isinstance(line, BadLine) else repr(line) for line in lines]


def _kinds(pieces: list[bytes]) -> list[type]:
    splitter = StopSplitter()
    splitter.limit = SHORT
    return [type(line) for piece in pieces for line in splitter.feed(piece)] + [
        type(line) for line in splitter.end()
    ]


def _asks(line: bytes) -> bool:
    """As another library reads it."""
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return False
    return isinstance(found, dict) and found.get("method") == STOP
