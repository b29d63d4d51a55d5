"""The sensors' bytes, against the manuals' own examples and layouts; what they measure, and their faults."""

import math
import random
import struct

import pytest

from drivers.insole.layout import load as load_layout
from hil_sim.gait.wearer import GRAVITY, Foot, Trunk
from hil_sim.sensors.faults import ImuFaults, InsoleFaults
from hil_sim.sensors.imus import vectornav, witmotion, xsens
from hil_sim.sensors.imus.bno08x_rvc import BNO08X_RVC, phone_angles
from hil_sim.sensors.imus.witmotion_can import payloads
from hil_sim.sensors.insoles import insole_cobs, insole_csv, insole_frame
from hil_sim.sensors.serial_sensor import Tick
from hil_sim.sensors.sole import Cell, Pressures, Sole
from hil_sim.sensors.trunk_imu import Motion, TrunkImu, quaternion

START = Tick(1, 0)
NOBODY = Foot(0.0, 0.1, 0.0)
UPRIGHT = Trunk(0.0, 0.0, 0.0, (0.0, 0.0, 0.0))


class Quiet(random.Random):
    """A sensor without noise."""

    def gauss(self, mu: float = 0.0, sigma: float = 1.0) -> float:
        return mu


def motion(trunk: Trunk) -> Motion:
    return TrunkImu(ImuFaults(), Quiet()).measure(trunk, 0.01)


def sole(
    cells: tuple[Cell, ...] = insole_cobs.CELLS,
    right: bool = False,
    faults: InsoleFaults | None = None,
    source: random.Random | None = None,
) -> Sole:
    return Sole(cells, right, faults or InsoleFaults(), source or Quiet())


# Insoles.


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
    assert insole_cobs.cobs_encode(bytes.fromhex(plain)) == bytes.fromhex(stuffed)


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
        insole_cobs.frame(
            flags=0x03, sequence=0x1_0102, time_us=0x1_0203_0405, cells=(0, 1, 0xFFFF), adc_bits=12
        )
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
    measured = sole(right=right).measure(foot, NOBODY, 0.01)
    flags, cells = decode_cells(insole_cobs.encode(measured, START))
    assert flags == (0x03 if right else 0x02)
    places = insole_cobs.CELLS
    forces = [count * 100.0 * cell.area for count, cell in zip(cells, places, strict=True)]
    assert sum(forces) == pytest.approx(800.0, abs=2.0)
    x = sum(force * cell.x for force, cell in zip(forces, places, strict=True)) / sum(forces)
    y = sum(force * side * cell.y for force, cell in zip(forces, places, strict=True)) / sum(forces)
    assert x == pytest.approx(foot.cop_x, abs=0.02)
    assert y == pytest.approx(foot.cop_y, abs=0.01)


def test_the_measured_centre_of_pressure_goes_forward_with_the_load() -> None:
    insole, places = sole(), []
    for cop_x in (0.03, 0.08, 0.13, 0.18, 0.205):
        cells = insole.pressures(Foot(800.0, cop_x, 0.0))
        total = sum(pascal * cell.area for pascal, cell in zip(cells, insole.cells, strict=True))
        places.append(
            sum(pascal * cell.area * cell.x for pascal, cell in zip(cells, insole.cells, strict=True)) / total
        )
    assert places == sorted(places)
    assert places[-1] - places[0] > 0.13


def test_a_foot_in_the_air_feels_less_than_the_driver_takes_for_contact() -> None:
    insole = sole(source=random.Random(1))
    for _ in range(200):
        felt = insole.measure(NOBODY, NOBODY, 0.01).pascal
        assert sum(pascal * cell.area for pascal, cell in zip(felt, insole.cells, strict=True)) < 5.0


def test_the_counters_count_frames_and_wrap() -> None:
    measured = Pressures(False, (0.0,) * 16, False)
    ticks = [Tick(-1, -1000), Tick(0, 0), Tick(1, 1000), Tick(0x1_0001, 0x1_0000_0000_000)]
    bodies = [destuff(insole_cobs.encode(measured, tick)) for tick in ticks]
    assert [int.from_bytes(body[2:4], "little") for body in bodies] == [0xFFFF, 0, 1, 1]
    assert int.from_bytes(bodies[0][4:8], "little") == 0xFFFF_FFFF


def test_a_text_line_of_an_insole() -> None:
    measured = Pressures(True, (0.0, 4.0, 4.0 * 100**1.4, 1e9, 0.0, 0.0, 0.0, 0.0), False)
    line = insole_csv.encode(measured, Tick(7, 1_234_000_000))
    assert line == b"1234;7;R;0;4095;4094;3995;0;4095;4095;4095;4095\r\n"


def test_a_fixed_frame_of_an_insole() -> None:
    measured = Pressures(True, (100.0, 25_600.0, 1e9, *(0.0,) * 15), False)
    frame = insole_frame.encode(measured, START)
    assert frame == bytes.fromhex("AA 02 0001 0100 0FFF" + "0000" * 15 + "BC")


@pytest.mark.parametrize(
    ("layout", "cells"),
    [
        ("insole-16", insole_cobs.CELLS),
        ("insole-8", insole_csv.CELLS),
        ("insole-18", insole_frame.CELLS),
    ],
)
def test_the_cells_are_where_the_shipped_layout_says(layout: str, cells: tuple[Cell, ...]) -> None:
    assert load_layout(layout).cells == tuple(tuple(cell) for cell in cells)


def felt(faults: InsoleFaults, seconds: int = 1) -> Pressures:
    insole = sole(faults=faults)
    for _ in range(seconds):
        measured = insole.measure(Foot(500.0, 0.1, 0.005), Foot(100.0, 0.2, 0.01), 1.0)
    return measured


def test_each_fault_of_an_insole_is_felt() -> None:
    right = felt(InsoleFaults())
    assert felt(InsoleFaults(stuck_cell=9)).pascal[9] == 73_000.0
    saturated = felt(InsoleFaults(saturated=True))
    assert (saturated.saturated, max(saturated.pascal)) == (True, 40_000.0)
    drifted = felt(InsoleFaults(drift=50.0), seconds=4)
    assert [a - b for a, b in zip(drifted.pascal, right.pascal, strict=True)] == pytest.approx([200.0] * 16)
    in_the_other_shoe = sole().pressures(Foot(100.0, 0.2, -0.01))
    assert felt(InsoleFaults(swapped=True)).pascal == pytest.approx(in_the_other_shoe)


def test_a_frozen_sensor_says_the_same_until_it_is_well_again() -> None:
    faults = InsoleFaults()
    insole = sole(faults=faults, source=random.Random(1))
    before = insole.measure(Foot(500.0, 0.1, 0.0), NOBODY, 0.01)
    faults.frozen = True
    assert insole.measure(NOBODY, NOBODY, 0.01) == before
    faults.frozen = False
    assert insole.measure(NOBODY, NOBODY, 0.01) != before


# IMUs.


@pytest.mark.parametrize(
    ("kind", "words", "frame"),
    [
        (0x51, [12, 659, 2157, 1975], "55 51 0C 00 93 02 6D 08 B7 07 7A"),
        (0x53, [3076, -31, -3473, 18124], "55 53 04 0C E1 FF 6F F2 CC 46 0B"),
    ],
)
def test_witmotion_frames_byte_for_byte(kind: int, words: list[int], frame: str) -> None:
    assert witmotion.frame(kind, words) == bytes.fromhex(frame)


def words_of(data: bytes) -> dict[int, tuple[int, ...]]:
    frames = [data[start : start + 11] for start in range(0, len(data), 11)]
    assert all(frame[0] == 0x55 and sum(frame[:10]) & 0xFF == frame[10] for frame in frames)
    return {frame[1]: struct.unpack("<4h", frame[2:10]) for frame in frames}


def test_a_tilted_imu_at_rest_feels_gravity_where_it_should() -> None:
    lean = Trunk(roll=0.0, pitch=0.3, yaw=0.0, acceleration=(0.0, 0.0, 0.0))
    words = words_of(witmotion.encode(motion(lean), START))
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
    sensor = TrunkImu(ImuFaults(), Quiet())
    sensor.measure(Trunk(0.1, 0.2, 0.3, (0.0, 0.0, GRAVITY)), 0.01)
    rate = sensor.measure(Trunk(0.1, 0.21, 0.3, (0.0, 0.0, 0.0)), 0.01).rate
    assert rate == pytest.approx([0.0, math.cos(0.1), -math.sin(0.1)], abs=1e-3)


def test_an_acceleration_beyond_its_range_stays_at_its_end() -> None:
    words = words_of(witmotion.encode(motion(Trunk(0.0, 0.0, 0.0, (500.0, -500.0, 0.0))), START))
    assert words[0x51][:2] == (32767, -32768)


def test_the_can_variant_has_the_words_of_the_serial_one_in_eight_bytes() -> None:
    lean = motion(Trunk(0.1, 0.2, 0.3, (0.0, 0.0, 0.0)))
    serial = words_of(witmotion.encode(lean, START))
    sent = payloads(lean)
    assert [payload[:2] for payload in sent] == [b"\x55\x51", b"\x55\x52", b"\x55\x53"]
    assert [struct.unpack("<3h", payload[2:]) for payload in sent] == [
        words[:3] for kind, words in serial.items() if kind != 0x59
    ]


def test_a_bno08x_frame_byte_for_byte() -> None:
    data = BNO08X_RVC.encode(motion(UPRIGHT), Tick(0x1DE, 0))
    assert data == bytes.fromhex("AA AA DE 0000 0000 0000 0000 0000 E803 000000 C9")


def test_a_phones_pitch_is_about_x_and_its_roll_about_y() -> None:
    assert phone_angles(quaternion(Trunk(0.4, 0.0, 0.0, (0, 0, 0)))) == pytest.approx((0.0, 0.4, 0.0))
    assert phone_angles(quaternion(Trunk(0.0, 0.4, 0.0, (0, 0, 0)))) == pytest.approx((0.0, 0.0, 0.4))
    assert phone_angles(quaternion(Trunk(0.0, 0.0, 0.4, (0, 0, 0)))) == pytest.approx((0.4, 0.0, 0.0))


def test_an_xsens_message_byte_for_byte() -> None:
    assert xsens.message(xsens.WAKE_UP, b"") == bytes.fromhex("FA FF 3E 00 C3")
    data = xsens.encode(motion(UPRIGHT), Tick(0x1_1234, 0x1_0000_0000 * 100_000 + 700_000))
    assert data[:4] == bytes.fromhex("FA FF 36 44")
    assert len(data) == 4 + 0x44 + 1
    assert sum(data[1:]) & 0xFF == 0
    assert data[4:9] == bytes.fromhex("1020 02 1234")
    assert data[9:16] == bytes.fromhex("1060 04 00000007")
    assert data[16:23] == bytes.fromhex("2010 10 3F800000")


def test_a_vectornav_message_has_its_checksum_and_its_axes_point_down() -> None:
    lean = motion(Trunk(0.1, 0.2, 0.3, (0.0, 0.0, 0.0)))
    data = vectornav.encode_ascii(lean, START)
    body, _, checksum = data[1:-2].partition(b"*")
    total = 0
    for byte in body:
        total ^= byte
    assert (data[:1], data[-2:], int(checksum, 16)) == (b"$", b"\r\n", total)
    name, *fields = body.decode().split(",")
    assert (name, len(fields)) == ("VNYMR", 12)
    angles = [math.radians(float(field)) for field in fields[:3]]
    assert angles == pytest.approx([-0.3, -0.2, 0.1], abs=1e-5)
    assert float(fields[8]) == pytest.approx(-lean.acceleration[2], abs=1e-3)


def crc16_xmodem(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def test_a_binary_vectornav_message_is_laid_out_as_its_fields_say() -> None:
    data = vectornav.encode_binary(motion(Trunk(0.0, 0.2, 0.0, (0.0, 0.0, 0.0))), Tick(1, 5_000_000))
    assert data[:4] == bytes.fromhex("FA 01 3905")
    assert len(data) == 4 + 8 + 12 + 16 + 12 + 12 + 20 + 2
    assert crc16_xmodem(data[1:]) == 0
    (time_ns,) = struct.unpack_from("<Q", data, 4)
    yaw, pitch, roll, qx, qy, qz, qw = struct.unpack_from("<7f", data, 12)
    assert time_ns == 5_000_000
    assert (yaw, pitch, roll) == pytest.approx((0.0, -math.degrees(0.2), 0.0))
    assert (qw, qx, qy, qz) == pytest.approx((math.cos(0.1), 0.0, -math.sin(0.1), 0.0))
