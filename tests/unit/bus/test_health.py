"""A bus tells its load, its error frames and its controller's state, each since when and what to check."""

import itertools
from pathlib import Path

import can
import pytest

from drivers.bus.bus import CanBus
from drivers.bus.frames import ERROR
from drivers.bus.health import ERROR_LOOKS, BusHealth
from drivers.bus.interfaces.socketcan import SocketCanTransport
from drivers.bus.settings import CanSettings
from tests.support.waiting import until

SECOND_NS = 1_000_000_000


class Watched:
    """A bus's health, looked at once a second."""

    def __init__(self, bitrate: int | None = 1_000_000) -> None:
        self.health = BusHealth(bitrate)
        self.health.opened()
        self._now_ns, self._frames, self._dropped = 0, 0, 0
        self.live(0)

    def live(self, frames_per_s: int, seconds: int = 1, errors: int = 0, lost: int = 0) -> str:
        for _ in range(seconds):
            self._now_ns += SECOND_NS
            self._frames += frames_per_s
            self._dropped += lost
            for _ in range(errors):
                self.health.take_error(self._now_ns, ERROR | 0x88, b"")
            self.health.look(self._now_ns, lambda: (self._frames, 8 * self._frames, self._dropped))
        return "; ".join(finding.text(self._now_ns) for finding in self.health.findings)


def test_the_load_is_that_of_all_frames_with_average_stuff_bits() -> None:
    bus = Watched()
    assert bus.live(1000) == ""
    assert bus.health.load_percent == pytest.approx(11.8, abs=0.1)
    assert bus.health.frames_per_s == 1000
    assert "95 % of its time is taken (for 0 s): send fewer PDOs" in bus.live(8000)
    assert "(for 3 s)" in bus.live(6200, seconds=3), "still, as long as it is not clearly less"
    assert bus.live(1000) == ""


def test_without_a_bitrate_there_is_no_load() -> None:
    bus = Watched(bitrate=None)
    assert bus.live(100_000) == ""
    assert (bus.health.load_percent, bus.health.frames_per_s) == (None, 100_000)


def test_error_frames_are_told_until_none_has_come_for_a_while() -> None:
    bus = Watched()
    assert bus.live(100, errors=1) == "", "one says nothing"
    assert "6 error frames in the last 2 s (for 0 s): check termination" in bus.live(100, errors=5)
    assert "error frames" in bus.live(100, seconds=ERROR_LOOKS - 1)
    assert bus.live(100, seconds=2) == ""
    assert bus.health.error_frames == 6


def test_lost_frames_are_told() -> None:
    bus = Watched()
    assert "7 frames were lost on their way to us" in bus.live(100, lost=7)
    assert bus.live(100) == ""


def test_a_controller_that_goes_bus_off_is_told_since_then() -> None:
    bus = Watched()
    bus.health.take_error(3 * SECOND_NS, ERROR | 0x40, b"")
    bus.health.take_error(4 * SECOND_NS, ERROR | 0x40, b"")
    (finding,) = bus.health.findings
    assert (finding.since_ns, bus.health.bus_offs) == (3 * SECOND_NS, 1)
    assert finding.words == "the CAN controller is bus off, no frame can pass"
    bus.health.take_error(5 * SECOND_NS, ERROR | 0x100, b"")
    assert (bus.health.findings, bus.health.error_frames) == ((), 0)


def test_what_is_wrong_ends_with_the_bus() -> None:
    bus = Watched()
    assert bus.live(8000, errors=9, lost=1) != ""
    bus.health.opened()
    assert bus.health.findings == ()
    assert bus.health.load_percent is None


def test_error_frames_are_no_frames_that_were_heard(request: pytest.FixtureRequest) -> None:
    bus = CanBus("main", CanSettings(interface="virtual", channel=request.node.name))
    with can.Bus(channel=request.node.name, interface="virtual") as peer:
        bus.start()
        until(lambda: bus.opened)
        for _ in range(3):
            peer.send(can.Message(arbitration_id=0x88, data=bytes(8), is_error_frame=True))
        peer.send(can.Message(arbitration_id=0x181, data=bytes(8), is_extended_id=False))
        until(lambda: bus.frames)
        bus.stop()
    assert (bus.frames, bus.health.error_frames) == (1, 3)
    assert ERROR | 0x88 not in bus.unclaimed


def test_the_kernels_own_counts_tell_of_frames_that_its_filters_keep(tmp_path: Path) -> None:
    import socket

    counts = itertools.count(1)
    for name in ("rx_packets", "tx_packets", "rx_bytes", "tx_bytes"):
        (tmp_path / name).write_text(f"{next(counts)}\n", encoding="ascii")
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    transport = SocketCanTransport(ours, "interface can0", statistics=tmp_path)
    assert transport.carried() == (3, 7)
    (tmp_path / "rx_bytes").unlink()
    assert transport.carried() is None
    transport.close()
    theirs.close()
