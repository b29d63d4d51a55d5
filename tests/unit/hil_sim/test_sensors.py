"""The serial sensors' bytes, against the manuals' own examples and layouts."""

import math
import random
import struct

import pytest

from drivers.insole.layout import load as load_layout
from hil_sim.gait.wearer import GRAVITY, Foot, Trunk
from hil_sim.sensors import imu
from hil_sim.sensors.insole import CELLS, Insole, cobs_encode, encode


class Quiet(random.Random):
    """A sensor without noise."""

    def gauss(self, mu: float = 0.0, sigma: float = 1.0) -> float:
        return mu


@pytest.mark.parametrize(
    ("plain", "stuffed"),
    [
        ("", "01"),
        ("00", "01 01"),
        ("00 00", "01 01 01"),
        ("11 22 00 33", "03 11 22 02 33"),
        ("11 22 33 44", "05 11 22 33 44"),
        ("11 00 00 00", "02 11 01 01 01"),
    ],
)
def test_cobs(plain: str, stuffed: str) -> None:
    assert cobs_encode(bytes.fromhex(plain)) == bytes.fromhex(stuffed)


def crc16_ccitt_false(data: bytes) -> int:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def destuff(frame: bytes) -> bytes:
    assert frame.endswith(b"\0")
    assert frame.count(b"\0") == 1
    out, position = bytearray(), 0
    while position < len(frame) - 1:
        code = frame[position]
        out += frame[position + 1 : position + code]
        position += code
        if code < 0xFF and position < len(frame) - 1:
            out.append(0)
    return bytes(out)


def test_the_check_value_of_the_crc() -> None:
    assert crc16_ccitt_false(b"123456789") == 0x29B1


def test_an_insole_frame_byte_for_byte() -> None:
    body = destuff(
        encode(flags=0x03, sequence=0x1_0102, time_us=0x1_0203_0405, cells=(0, 1, 0xFFFF), adc_bits=12)
    )
    assert body[:-2] == bytes.fromhex("31 03 02 01 05 04 03 02 03 0C 00 00 01 00 FF FF")
    assert int.from_bytes(body[-2:], "little") == crc16_ccitt_false(body[:-2])


def decode_cells(frame: bytes) -> tuple[int, tuple[int, ...]]:
    body = destuff(frame)
    kind, flags, _, _, count, bits = struct.unpack_from("<BBHIBB", body)
    assert (kind, count, bits) == (0x31, 16, 16)
    return flags, struct.unpack_from("<16H", body, 10)


@pytest.mark.parametrize("right", [False, True])
def test_the_cells_give_force_and_centre_of_pressure(right: bool) -> None:
    side = -1.0 if right else 1.0
    foot = Foot(force=800.0, cop_x=0.11, cop_y=side * 0.004)
    flags, cells = decode_cells(Insole(right, Quiet()).frame(foot, 0))
    assert flags == (0x03 if right else 0x02)
    forces = [count * 100.0 * cell.area for count, cell in zip(cells, CELLS, strict=True)]
    assert sum(forces) == pytest.approx(800.0, abs=2.0)
    x = sum(force * cell.x for force, cell in zip(forces, CELLS, strict=True)) / sum(forces)
    y = sum(force * side * cell.y for force, cell in zip(forces, CELLS, strict=True)) / sum(forces)
    assert x == pytest.approx(foot.cop_x, abs=0.02)
    assert y == pytest.approx(foot.cop_y, abs=0.01)


def test_the_measured_centre_of_pressure_goes_forward_with_the_load() -> None:
    insole = Insole(False, Quiet())
    places = []
    for cop_x in (0.03, 0.08, 0.13, 0.18, 0.205):
        _, cells = decode_cells(insole.frame(Foot(800.0, cop_x, 0.0), 0))
        total = sum(count * cell.area for count, cell in zip(cells, CELLS, strict=True))
        places.append(sum(n * cell.area * cell.x for n, cell in zip(cells, CELLS, strict=True)) / total)
    assert places == sorted(places)
    assert places[-1] - places[0] > 0.13


def test_a_foot_in_the_air_feels_less_than_the_driver_takes_for_contact() -> None:
    insole = Insole(False, random.Random(1))
    for _ in range(200):
        _, cells = decode_cells(insole.frame(Foot(0.0, 0.1, 0.0), 0))
        assert sum(count * 100.0 * cell.area for count, cell in zip(cells, CELLS, strict=True)) < 5.0


def test_the_sequence_counts_frames() -> None:
    insole = Insole(False, Quiet())
    counters = [destuff(insole.frame(Foot(0.0, 0.1, 0.0), 0))[2] for _ in range(3)]
    assert counters == [1, 2, 3]


def test_the_cells_are_where_the_shipped_layout_says() -> None:
    assert load_layout("insole-16").cells == tuple(tuple(cell) for cell in CELLS)


@pytest.mark.parametrize(
    ("kind", "words", "frame"),
    [
        (0x51, (12, 659, 2157, 1975), "55 51 0C 00 93 02 6D 08 B7 07 7A"),
        (0x53, (3076, -31, -3473, 18124), "55 53 04 0C E1 FF 6F F2 CC 46 0B"),
        (0x52, (40_000, -40_000, 0, 0), "55 52 FF 7F 00 80 00 00 00 00 A5"),
    ],
)
def test_witmotion_frames_byte_for_byte(kind: int, words: tuple[int, int, int, int], frame: str) -> None:
    assert imu.encode(kind, words) == bytes.fromhex(frame)


def words_of(data: bytes) -> dict[int, tuple[int, ...]]:
    frames = [data[start : start + 11] for start in range(0, len(data), 11)]
    assert all(frame[0] == 0x55 and sum(frame[:10]) & 0xFF == frame[10] for frame in frames)
    return {frame[1]: struct.unpack("<4h", frame[2:10]) for frame in frames}


def test_a_tilted_imu_at_rest_feels_gravity_where_it_should() -> None:
    lean = Trunk(roll=0.0, pitch=0.3, yaw=0.0, acceleration=(0.0, 0.0, 0.0))
    words = words_of(imu.Imu(Quiet()).frames(lean, 0.01))
    assert list(words) == [0x51, 0x52, 0x53, 0x59]
    x, y, z = (word / 32768 * 16 for word in words[0x51][:3])
    assert (x, y, z) == pytest.approx((-math.sin(0.3), 0.0, math.cos(0.3)), abs=1e-3)
    assert words[0x52][:3] == (0, 0, 0)
    assert [word / 32768 * 180 for word in words[0x53][:3]] == pytest.approx(
        [0.0, math.degrees(0.3), 0.0], abs=0.01
    )
    w, qx, qy, qz = (word / 32768 for word in words[0x59])
    assert (w, qx, qy, qz) == pytest.approx((math.cos(0.15), 0.0, math.sin(0.15), 0.0), abs=1e-3)


def test_the_rate_is_that_of_the_attitude() -> None:
    sensor = imu.Imu(Quiet())
    before = Trunk(0.1, 0.2, 0.3, (0.0, 0.0, GRAVITY))
    sensor.frames(before, 0.01)
    words = words_of(sensor.frames(Trunk(0.1, 0.21, 0.3, (0.0, 0.0, 0.0)), 0.01))
    rate = [math.radians(word / 32768 * 2000) for word in words[0x52][:3]]
    assert rate == pytest.approx([0.0, math.cos(0.1), -math.sin(0.1)], abs=2e-3)
