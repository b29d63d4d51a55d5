"""Lines of a CAN adapter on a serial port, as python-can and then our transport read them."""

import atexit
from typing import Any

from drivers.bus.frames import EXTENDED, REMOTE
from drivers.bus.interfaces.python_can import MAX_PENDING, PythonCanTransport
from drivers.bus.settings import CanSettings

TOKENS = (
    b"t",
    b"T",
    b"r",
    b"R",
    b"d",
    b"B",
    b"\r",
    b"\a",
    b"t1812AABB\r",
    b"T123456781AA\r",
    b"V1013\r",
    b"N1234\r",
    b"-",
)
MODULES = ("drivers.bus.interfaces.python_can",)
_transport = PythonCanTransport(
    CanSettings(interface="slcan", channel="loop://", more={"sleep_after_open": 0, "timeout": 0})
)
atexit.register(_transport.close)
_bus: Any = _transport._bus


def fuzz(data: bytes) -> None:
    _bus.flush()
    for at in range(0, len(data), 2048):  # more does not fit into a port that hears itself
        _bus.serialPortOrig.write(data[at : at + 2048])
        while _bus.serialPortOrig.in_waiting:
            _check(_transport.receive(0.0))
    assert len(_bus._buffer) <= MAX_PENDING + 2048
    _bus.serialPortOrig.write(b"\rt1812AABB\r")
    frames: list[Any] = []
    while _bus.serialPortOrig.in_waiting:
        frames += _transport.receive(0.0)
    assert [frame[1:] for frame in frames[-1:]] == [(0x181, b"\xaa\xbb")], "a sound line is lost behind it"


def _check(frames: Any) -> None:
    for _, can_id, data in frames:
        assert len(data) <= 8
        bare = can_id & ~(EXTENDED | REMOTE)
        assert 0 <= bare <= (0x1FFF_FFFF if can_id & EXTENDED else 0x7FF)
