"""A serial port opens, says what is wrong, wakes at once when stopped, and comes back by the same path."""

import errno
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from drivers.errors import Unavailable
from drivers.port import SerialPort, open_port
from tests.support.waiting import until
from tests.unit.port.terminals import Terminal, send_until


class Received:
    """What a port handed out."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.stamps: list[int] = []
        self.openings = 0
        self.closings = 0

    def received(self, data: bytes, stamp_ns: int) -> None:
        self.data += data
        self.stamps.append(stamp_ns)

    def opened(self) -> None:
        self.openings += 1

    def closed(self) -> None:
        self.closings += 1


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    terminal = Terminal(tmp_path / "sensor")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


def port_at(path: Path, sink: Received) -> SerialPort:
    return SerialPort(str(path), 115200, sink.received, sink.opened, sink.closed)


def test_a_consumer_that_fails_is_told_and_reading_goes_on(terminal: Terminal) -> None:
    class Failing(Received):
        def received(self, data: bytes, stamp_ns: int) -> None:
            super().received(data, stamp_ns)
            if data.startswith(b"bad"):
                raise ZeroDivisionError("oops")

    sink = Failing()
    port = port_at(terminal.path, sink)
    port.start()
    try:
        until(lambda: port.opened_ns is not None, "the port to open")
        terminal.send(b"bad")
        until(lambda: port.problem is not None, "the failure to be told")
        assert "ZeroDivisionError: oops" in str(port.problem)
        terminal.send(b"good")
        until(lambda: sink.data.endswith(b"good"), "reading to go on")
        assert sink.closings == 0
    finally:
        port.stop()


def test_bytes_arrive_unchanged_with_rising_stamps(terminal: Terminal) -> None:
    sink, everything = Received(), bytes(range(256))
    port = port_at(terminal.path, sink)
    port.start()
    try:
        until(lambda: port.opened_ns is not None, "the port to open")
        before_ns = time.monotonic_ns()
        terminal.send(everything)
        until(lambda: len(sink.data) == 256, "256 bytes")
        assert bytes(sink.data) == everything
        assert sink.stamps == sorted(sink.stamps)
        assert sink.stamps[0] >= before_ns
    finally:
        port.stop()


def test_what_waited_before_the_port_was_opened_is_thrown_away(terminal: Terminal) -> None:
    terminal.send(b"old news")
    sink = Received()
    port = port_at(terminal.path, sink)
    port.start()
    try:
        until(lambda: port.opened_ns is not None, "the port to open")
        send_until(terminal, b"new", lambda: b"new" in sink.data, "bytes")
        assert b"old" not in sink.data
    finally:
        port.stop()


def test_an_idle_port_uses_no_processor_time_and_stops_at_once(terminal: Terminal) -> None:
    sink = Received()
    port = port_at(terminal.path, sink)
    port.start()
    try:
        until(lambda: port.opened_ns is not None, "the port to open")
        thread = next(thread for thread in threading.enumerate() if thread.name == f"serial {terminal.path}")
        until(lambda: _rests(thread), "it waits for bytes")
    finally:
        port.stop()
    assert not thread.is_alive()


def _rests(thread: threading.Thread) -> bool:
    """Whether it is left alone while nothing comes."""
    before = _switches(thread)
    time.sleep(0.3)
    return _switches(thread) - before <= 3


def _switches(thread: threading.Thread) -> int:
    status = Path(f"/proc/self/task/{thread.native_id}/status").read_text()
    return sum(int(line.split()[1]) for line in status.splitlines() if "ctxt_switches" in line)


def test_missing_port_is_named_and_opened_when_it_appears(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path / "sensor")
    sink = Received()
    port = port_at(terminal.path, sink)
    port.start()
    try:
        until(lambda: port.problem is not None, "a problem")
        assert port.problem is not None
        assert str(terminal.path) in port.problem
        assert "does not exist" in port.problem
        terminal.plug_in()
        until(lambda: port.opened_ns is not None, "the port to open")
        assert port.problem is None
    finally:
        port.stop()
        terminal.unplug()


def test_unplugged_port_comes_back_by_the_same_path(terminal: Terminal) -> None:
    sink = Received()
    port = port_at(terminal.path, sink)
    port.start()
    try:
        for round_number in range(3):
            until(lambda: port.opened_ns is not None, "the port to open")
            mark = f"round {round_number}".encode()
            send_until(terminal, mark, lambda mark=mark: mark in sink.data, "bytes")  # type: ignore[misc]
            terminal.unplug()
            until(lambda: port.opened_ns is None and port.problem is not None, "the unplug to be seen")
            terminal.plug_in()
        until(lambda: port.opened_ns is not None, "the port to open")
        assert sink.openings == 4
        assert sink.closings == 3
    finally:
        port.stop()
    assert sink.closings == 4


def test_port_in_use_is_named(terminal: Terminal) -> None:
    first, second = port_at(terminal.path, Received()), port_at(terminal.path, Received())
    first.start()
    try:
        until(lambda: first.opened_ns is not None, "the first to open")
        second.start()
        until(lambda: second.problem is not None, "a problem")
        assert second.problem is not None
        assert "in use by another program" in second.problem
    finally:
        second.stop()
        first.stop()


def test_file_that_is_no_port_is_named(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a port")
    port = port_at(path, Received())
    port.start()
    try:
        until(lambda: port.problem is not None, "a problem")
        assert port.problem is not None
        assert "is no serial port: correct the port's path" in port.problem
    finally:
        port.stop()


def test_missing_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(errno.EACCES, "could not open port")

    monkeypatch.setattr(serial, "Serial", refuse)
    with pytest.raises(Unavailable, match=r"no permission to open .*usermod -aG"):
        open_port(str(tmp_path), 115200)


def test_start_and_stop_are_idempotent_and_leave_nothing_open(terminal: Terminal) -> None:
    port = port_at(terminal.path, Received())
    port.stop()
    for _ in range(20):
        port.start()
        port.start()
        port.stop()
        port.stop()
    assert port.opened_ns is None


def test_stop_ends_the_wait_between_two_attempts(tmp_path: Path) -> None:
    port = port_at(tmp_path / "nothing", Received())
    port.start()
    until(lambda: port.problem is not None, "a problem")
    port.stop()
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("serial ")]
