"""A serial sensor's line: what arrives when it is noisy, unplugged, at another baud rate, or starts anew."""

import random
from dataclasses import dataclass, field

import pytest

from hil_sim.clock import SECOND_NS
from hil_sim.sensors.faults import LineFaults
from hil_sim.sensors.line import SerialLine
from hil_sim.sensors.serial_sensor import SerialFormat, SerialSensor, Tick
from hil_sim.sensors.uart import heard_at
from tests.unit.hil_sim.listener import Listener

FRAME = bytes(range(64))


@dataclass
class Line:
    """A line at 115200 baud and what has arrived."""

    faults: LineFaults = field(default_factory=LineFaults)
    arrived: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.listener = Listener(115200, self.arrived.append)
        self.line = SerialLine(115200, self.faults, random.Random(1))
        self.line.port = self.listener

    def send(self, times: int = 1) -> bytes:
        """Send `FRAME` so often; all that arrives of it."""
        self.arrived.clear()
        for _ in range(times):
            self.line.send(FRAME)
        return b"".join(self.arrived)


def test_a_good_line_changes_nothing() -> None:
    assert Line().send(3) == FRAME * 3


def test_garbage_replaces_its_share_of_the_bytes() -> None:
    line = Line(LineFaults(garbage_share=0.1))
    data = line.send(100)
    assert len(data) == 6400
    assert sum(a != b for a, b in zip(data, FRAME * 100, strict=True)) == pytest.approx(640, abs=120)


def test_dropouts_lose_their_share_of_whole_frames() -> None:
    line = Line(LineFaults(dropout_share=0.25))
    line.send(400)
    assert set(line.arrived) == {FRAME}
    assert len(line.arrived) == pytest.approx(300, abs=50)


def test_an_unplugged_port_is_gone_until_it_is_plugged_in_again() -> None:
    line = Line(LineFaults(unplugged=True))
    assert line.send() == b""
    assert not line.listener.plugged
    line.faults.unplugged = False
    assert line.send() == FRAME
    assert line.listener.plugged


def test_a_reader_at_another_rate_gets_other_bytes_and_at_the_right_one_the_right_ones() -> None:
    line = Line()
    line.listener.baudrate = 9600
    assert 0 < len(line.send()) < 10
    line.listener.baudrate = 460800
    assert FRAME not in line.send()
    line.faults.wrong_baud = 460800
    assert line.send() == FRAME


@pytest.mark.parametrize(
    ("sent", "sent_baud", "heard_baud", "heard"),
    [
        (b"", 115200, 9600, b""),
        (b"\x55\x00\xff", 9600, 9600, b"\x55\x00\xff"),
        # At half the rate every sample sees a pair of bits; at double the rate each bit is seen twice.
        (b"\xff", 9600, 4800, b""),
        (b"\x00", 9600, 19200, b"\x00\x00"),
        (b"\x0f", 9600, 19200, b"\xfe\x80"),
    ],
)
def test_what_a_uart_hears(sent: bytes, sent_baud: int, heard_baud: int, heard: bytes) -> None:
    assert heard_at(sent, sent_baud, heard_baud) == heard


@pytest.mark.parametrize("error", [0.98, 1.02])
def test_a_rate_two_percent_off_is_no_other_rate(error: float) -> None:
    assert heard_at(FRAME, round(115200 * error), 115200) == FRAME


def numbered(_measured: None, tick: Tick) -> bytes:
    return f"{tick.number & 0xFF} {tick.time_ns // 1000 & 0xFFFFFFFF};".encode()


def test_a_sensor_starts_anew_with_its_banner_when_it_is_plugged_in_again() -> None:
    line = Line()
    sensor = SerialSensor(SerialFormat(numbered, 115200, b"hello;"), line.faults, random.Random(1))
    sensor.line.port = line.listener
    for second in range(6):
        line.faults.unplugged = second in (2, 3)
        sensor.tell(None, second * SECOND_NS)
    assert b"".join(line.arrived) == b"hello;1 0;2 1000040;hello;1 0;2 1000040;"


def test_counters_that_are_about_to_wrap_do_so_within_seconds() -> None:
    line = Line(LineFaults(wraps_soon=True))
    sensor = SerialSensor(SerialFormat(numbered, 115200), line.faults, random.Random(1))
    sensor.line.port = line.listener
    for cycle in range(300):
        sensor.tell(None, cycle * SECOND_NS // 100)
    numbers, times = zip(
        *(map(int, part.split()) for part in b"".join(line.arrived)[:-1].split(b";")), strict=True
    )
    assert numbers[198:202] == (255, 0, 1, 2)
    assert times[0] == 2**32 - 2_000_080
    assert times[-1] < 1_000_000
