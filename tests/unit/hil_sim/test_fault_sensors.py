"""Faults of insoles and IMU, as a reader of the port sees them, by the sensors' manuals."""

import binascii
import struct
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import pytest
import serial

from hil_sim.faults.fault import FaultRefused
from hil_sim.robot import SimulatedRobot
from hil_sim.without_bus import BareExoskeleton
from tests.unit.hil_sim.outside import Outside

FRAMES_PER_S = 100
CELLS = 16
UNIT_PA = 100.0
RIGHT, SATURATED = 0x01, 0x04


class Frame(NamedTuple):
    """The default insole format."""

    flags: int
    sequence: int
    cells: tuple[int, ...]


@pytest.fixture(scope="module")
def module_robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Outside]:
    """Without frames on its bus: its sensors are the same, and it costs a third."""
    with closing(Outside(tmp_path_factory.mktemp("robot"), kind=BareExoskeleton, sensors=True)) as outside:
        yield outside


def insole_frames(data: bytes) -> list[Frame]:
    """Frames whose checksum is right."""
    found = []
    for block in data.split(b"\0"):
        body = cobs_decode(block)
        if len(body) == 44 and binascii.crc_hqx(body[:-2], 0xFFFF) == int.from_bytes(body[-2:], "little"):
            _, flags, sequence, _, _, _, *cells = struct.unpack("<BBHIBB16H", body[:-2])
            found.append(Frame(flags, sequence, tuple(cells)))
    return found


def cobs_decode(block: bytes) -> bytes:
    decoded = bytearray()
    while block:
        code, block = block[0], block[1:]
        decoded += block[: code - 1]
        block = block[code - 1 :]
        if block and code < 0xFF:
            decoded.append(0)
    return bytes(decoded)


def witmotion(data: bytes, kind: int) -> list[tuple[int, ...]]:
    """The four int16 of each frame of a kind whose sum is right."""
    found = []
    for at in range(len(data) - 10):
        frame = data[at : at + 11]
        if frame[:2] == bytes([0x55, kind]) and sum(frame[:10]) & 0xFF == frame[10]:
            found.append(struct.unpack("<4h", frame[2:10]))
    return found


def insole(shared: Outside, name: str, seconds: float) -> list[Frame]:
    shared.ports[name].take()
    shared.run(seconds)
    return insole_frames(shared.ports[name].take())


def trunk(shared: Outside, kind: int, seconds: float) -> list[tuple[int, ...]]:
    shared.ports["trunk"].take()
    shared.run(seconds)
    return witmotion(shared.ports["trunk"].take(), kind)


def gaps(frames: list[Frame]) -> int:
    return frames[-1].sequence - frames[0].sequence + 1 - len(frames)


@pytest.mark.parametrize("name", ["left_insole", "right_insole", "trunk"])
def test_sensor_unplugged_takes_the_port_away_and_starts_anew(shared: Outside, name: str) -> None:
    port = shared.ports[name]
    shared.faults.begin("sensor_unplugged", name, for_s=0.5)
    shared.run(0.1)
    port.take()
    shared.run(0.3)
    assert port.take() == b""
    assert not port.plugged
    shared.run(0.5)
    assert port.plugged
    assert port.data
    if name != "trunk":
        assert insole_frames(port.data)[0].sequence <= 2  # its banner may spoil the first


def test_sensor_unplugged_hangs_up_a_real_port(tmp_path: Path) -> None:
    robot = SimulatedRobot(tmp_path, virtual_channel=str(tmp_path), speed=None)
    robot.open()
    with closing(robot):
        with serial.Serial(str(tmp_path / "trunk"), 115200, timeout=20) as port:
            robot.run(0.1)
            assert port.read(11)
            robot.faults.begin("sensor_unplugged", "trunk")
            robot.run(0.1)
            assert not (tmp_path / "trunk").is_symlink()
            with pytest.raises(serial.SerialException):
                port.read(4096)  # more than can be left in the buffer
        robot.faults.clear()
        robot.run(0.1)
        assert (tmp_path / "trunk").is_symlink()


def test_sensor_garbage_is_nothing_but_noise(shared: Outside) -> None:
    shared.faults.begin("sensor_garbage", "left_insole")
    shared.faults.begin("sensor_garbage", "trunk")
    assert insole(shared, "left_insole", 0.5) == []
    shared.ports["trunk"].take()
    shared.run(0.5)
    noise = shared.ports["trunk"].take()
    assert len(noise) == 0.5 * FRAMES_PER_S * 44
    assert len(set(noise)) > 200
    shared.faults.clear()
    assert len(insole(shared, "left_insole", 0.5)) == 50


def test_sensor_garbage_of_a_few_bytes_costs_a_few_frames(shared: Outside) -> None:
    shared.faults.begin("sensor_garbage", "left_insole", params={"percent": 0.5})
    frames = insole(shared, "left_insole", 1.0)
    assert 50 < len(frames) < 98
    assert gaps(frames) > 0


def test_sensor_wrong_baud_sends_other_bytes_and_not_one_good_frame(shared: Outside) -> None:
    shared.ports["left_insole"].take()
    shared.run(0.5)
    usual = len(shared.ports["left_insole"].take())
    shared.faults.begin("sensor_wrong_baud", "left_insole", params={"baudrate": 57600})
    shared.run(0.5)
    heard = shared.ports["left_insole"].take()
    assert insole_frames(heard) == []
    assert len(heard) > 1.5 * usual  # a quarter of the rate: each bit is read four times
    shared.faults.clear()
    assert insole(shared, "left_insole", 0.5)


def test_sensor_wrong_baud_too_fast_loses_bytes(shared: Outside) -> None:
    shared.faults.begin("sensor_wrong_baud", "trunk", params={"baudrate": 460800})
    shared.ports["trunk"].take()
    shared.run(0.5)
    heard = shared.ports["trunk"].take()
    assert 0 < len(heard) < 0.5 * FRAMES_PER_S * 44
    assert witmotion(heard, 0x51) == []


def test_sensor_frozen_counts_on_with_the_same_values(shared: Outside) -> None:
    shared.run(1.0)
    shared.faults.begin("sensor_frozen", "left_insole")
    shared.faults.begin("sensor_frozen", "trunk")
    shared.run(0.05)
    frames = insole(shared, "left_insole", 0.5)
    assert len({frame.cells for frame in frames}) == 1
    assert gaps(frames) == 0
    assert len(set(trunk(shared, 0x51, 0.5))) == 1
    shared.faults.clear()
    assert len({frame.cells for frame in insole(shared, "left_insole", 0.5)}) > 20
    assert len(set(trunk(shared, 0x51, 0.5))) > 20


def test_sensor_dropout_leaves_gaps_in_the_sensors_own_count(shared: Outside) -> None:
    shared.faults.begin("sensor_dropout", "left_insole", params={"percent": 30})
    frames = insole(shared, "left_insole", 1.0)
    assert len(frames) == pytest.approx(70, abs=18)  # four standard deviations
    assert gaps(frames) == pytest.approx(30, abs=18)


def test_insole_stuck_cell_says_one_thing_on_the_ground_and_in_the_air(shared: Outside) -> None:
    shared.run(1.0)
    shared.faults.begin("insole_stuck_cell", "left_insole", params={"cell": 7})
    frames = insole(shared, "left_insole", 2.0)
    assert len({frame.cells[7] for frame in frames}) == 1
    assert all(len({frame.cells[cell] for frame in frames}) > 20 for cell in range(CELLS) if cell != 7)
    assert min(sum(frame.cells) - frame.cells[7] for frame in frames) < 300  # the foot was in the air


def test_insole_drift_grows_in_every_cell_and_goes_away_with_its_cause(shared: Outside) -> None:
    shared.run(1.0)
    lowest = min(min(frame.cells) for frame in insole(shared, "left_insole", 1.0))
    shared.faults.begin("insole_drift", "left_insole", params={"kpa_per_s": 10})
    shared.run(1.0)
    frames = insole(shared, "left_insole", 0.5)
    assert min(min(frame.cells) for frame in frames) > lowest + 9.5 * 1000 / UNIT_PA
    shared.faults.clear()
    assert min(min(frame.cells) for frame in insole(shared, "left_insole", 1.0)) < lowest + 10


def test_insole_saturated_ends_at_a_ceiling_and_says_so_in_its_flags(shared: Outside) -> None:
    shared.run(1.0)
    usual = insole(shared, "left_insole", 2.0)
    assert not any(frame.flags & SATURATED for frame in usual)
    shared.faults.begin("insole_saturated", "left_insole")
    frames = insole(shared, "left_insole", 2.0)
    ceiling = max(max(frame.cells) for frame in frames)
    assert ceiling < max(max(frame.cells) for frame in usual)
    for frame in frames:
        assert bool(frame.flags & SATURATED) == (ceiling in frame.cells)
    assert any(frame.flags & SATURATED for frame in frames)


def test_imu_drift_tilts_what_is_told_and_not_what_is_felt(shared: Outside) -> None:
    def pitch_deg() -> float:
        """Mean pitch of the angle frames."""
        told = [words[1] * 180.0 / 32768.0 for words in trunk(shared, 0x53, 1.0)]
        return sum(told) / len(told)

    def forward_g() -> float:
        """Mean acceleration along x, in which a true tilt shows gravity."""
        felt = [words[0] * 16.0 / 32768.0 for words in trunk(shared, 0x51, 1.0)]
        return sum(felt) / len(felt)

    shared.run(1.0)
    before, felt_before = pitch_deg(), forward_g()
    shared.faults.begin("imu_drift", "trunk", params={"deg_per_s": 10})
    shared.run(1.0)
    assert pitch_deg() == pytest.approx(before + 15, abs=3)
    assert forward_g() == pytest.approx(felt_before, abs=0.05)
    shared.faults.clear()
    assert pitch_deg() == pytest.approx(before, abs=3)


def test_imu_saturated_never_says_more_than_its_limit(shared: Outside) -> None:
    def most() -> float:
        frames = trunk(shared, 0x51, 0.5)
        return max(abs(word) * 16.0 * 9.80665 / 32768.0 for words in frames for word in words[:3])

    assert most() > 9
    shared.faults.begin("imu_saturated", "trunk", params={"limit": 6})
    shared.run(0.02)
    assert most() == pytest.approx(6, abs=0.01)


def test_swapped_feet_load_each_insole_in_the_other_ones_turn(tmp_path: Path) -> None:
    def loads(swapped: bool) -> dict[str, list[int]]:
        with closing(Outside(tmp_path, kind=BareExoskeleton, sensors=True)) as outside:
            outside.run(1.0)
            if swapped:
                outside.faults.begin("swapped_feet")
            outside.run(1.1)
            return {
                name: [sum(frame.cells) for frame in insole_frames(outside.ports[name].take())[-100:]]
                for name in ("left_insole", "right_insole")
            }

    usual, swapped = loads(swapped=False), loads(swapped=True)
    assert swapped["left_insole"] == pytest.approx(usual["right_insole"], abs=300)
    assert swapped["right_insole"] == pytest.approx(usual["left_insole"], abs=300)
    assert swapped["left_insole"] != pytest.approx(usual["left_insole"], abs=2000)


def test_swapped_ports_bring_frames_of_the_other_foot(shared: Outside) -> None:
    assert {frame.flags & RIGHT for frame in insole(shared, "left_insole", 0.2)} == {0}
    shared.faults.begin("swapped_ports", for_s=0.3)
    assert {frame.flags & RIGHT for frame in insole(shared, "left_insole", 0.2)} == {RIGHT}
    assert {frame.flags & RIGHT for frame in insole(shared, "right_insole", 0.05)} == {0}
    shared.run(0.2)
    assert {frame.flags & RIGHT for frame in insole(shared, "left_insole", 0.2)} == {0}


def test_a_sensor_without_a_serial_line_has_no_baud_rate_to_be_wrong(outside: Outside) -> None:
    del outside.robot.sensors.lines["trunk"]  # as where the IMU is on the CAN bus
    with pytest.raises(FaultRefused, match="trunk is on the CAN bus here"):
        outside.faults.begin("sensor_wrong_baud", "trunk")
