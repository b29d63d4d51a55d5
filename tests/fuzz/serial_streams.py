"""What every parser of a serial stream is asked: the same frames and counts however the stream comes."""

from collections.abc import Callable
from typing import Any

import msgspec

from drivers.parsing import GRANT, SAVED, FrameScanner, Parser

Make = Callable[[], Parser[Any]]
LARGEST = 1 << 63  # of a whole number that the wire takes


def judge(make: Make, data: bytes) -> None:
    """Feed it at once, and in pieces that it says itself."""
    whole, cut = make(), make()
    frames = whole.feed(data)
    assert not isinstance(whole, FrameScanner) or whole.looked_at <= SAVED + GRANT * len(data)
    frames += whole.finish()
    pieces = [frame for piece in _pieces(data) for frame in cut.feed(piece)] + cut.finish()
    assert repr(frames) == repr(pieces), "it depends on where the stream is cut"
    assert whole.counters == cut.counters, f"{whole.counters} at once, {cut.counters} in pieces"
    assert whole.counters.frames == len(frames)
    assert 0 <= whole.counters.bytes_dropped <= len(data)
    for frame in frames:
        _check_numbers(msgspec.structs.asdict(frame))


def _pieces(data: bytes) -> list[bytes]:
    size = 1 + (data[-1] % 13 if data else 0)
    return [data[at : at + size] for at in range(0, len(data), size)]


def _check_numbers(found: Any) -> None:
    """Every whole number can be sent."""
    if isinstance(found, dict):
        found = list(found.values())
    if isinstance(found, list | tuple):
        for one in found:
            _check_numbers(one)
    elif isinstance(found, int):
        assert abs(found) < LARGEST, f"{found} is no number that can be sent"
