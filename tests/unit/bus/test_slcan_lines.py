"""Lines of a CAN adapter on a serial port: a damaged one costs itself, and never becomes a frame."""

from collections.abc import Iterator
from typing import Any

import pytest

from drivers.bus.frames import EXTENDED
from drivers.bus.interfaces.python_can import MAX_PENDING, PythonCanTransport
from drivers.bus.settings import CanSettings

SOUND = b"t1812AABB\r"


class Adapter:
    """A transport whose adapter says what a test wants."""

    def __init__(self) -> None:
        more = {"sleep_after_open": 0}
        self.transport = PythonCanTransport(CanSettings(interface="slcan", channel="loop://", more=more))
        self.hear(b"")  # what opens the adapter comes back
        self.transport.dropped = 0

    @property
    def port(self) -> Any:
        return self.transport._bus.serialPortOrig  # type: ignore[attr-defined]

    @property
    def pending(self) -> int:
        return len(self.transport._bus._buffer)  # type: ignore[attr-defined]

    def hear(self, line: bytes) -> list[tuple[int, bytes]]:
        """The frames in what the adapter says."""
        self.port.write(line)
        frames = []
        while self.port.in_waiting:
            frames += [(can_id, data) for _, can_id, data in self.transport.receive(0.0)]
        return frames


@pytest.fixture
def adapter() -> Iterator[Adapter]:
    made = Adapter()
    yield made
    made.transport.close()


def test_what_is_sound_is_a_frame(adapter: Adapter) -> None:
    assert adapter.hear(SOUND + b"T12345678188\rt0800\r") == [
        (0x181, b"\xaa\xbb"),
        (0x12345678 | EXTENDED, b"\x88"),
        (0x80, b""),
    ]


@pytest.mark.parametrize(
    "line",
    [
        b"t",
        b"t18",
        b"t181",
        b"t1812AA",
        b"t1812AABBC",
        b"t1812AAxx",
        b"t-012AABB",
        b"t8002AABB",
        b"t\xff",
        b"TFFFFFFFF0",
        b"T-12345670",
        b"t1819" + b"00" * 9,
        b"d1819" + b"00" * 12,
        b"R",
    ],
)
def test_a_damaged_line_costs_only_itself(adapter: Adapter, line: bytes) -> None:
    frames = adapter.hear(line + b"\r" + SOUND)
    assert frames[-1:] == [(0x181, b"\xaa\xbb")]
    assert frames[:-1] in ([], [(0x181, b"\xaa\xbb")])
    assert adapter.transport.dropped + len(frames) == 2


def test_a_line_that_never_ends_is_bounded(adapter: Adapter) -> None:
    for _ in range(20):
        adapter.hear(b"t" * MAX_PENDING)
        adapter.transport.receive(0.0)
    assert adapter.pending <= 2 * MAX_PENDING
    assert adapter.hear(b"\r" + SOUND)[-1:] == [(0x181, b"\xaa\xbb")]
