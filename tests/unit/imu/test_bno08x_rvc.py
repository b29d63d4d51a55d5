"""Format `bno08x-rvc`, against the frame that its datasheet works out."""

import math

import pytest

from drivers.imu import rotation
from drivers.imu.formats.bno08x_rvc import Bno08xRvcParser, from_angles
from tests.unit.imu.encode import bno08x_rvc
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [bno08x_rvc(n, n, -n, n, 1, 2, 1000) for n in range(60)]

# The example of the BNO08X datasheet, section UART-RVC; also in the tests of github.com/klimatt/bno08x-rvc.
DATASHEET = bytes.fromhex("AA AA DE 01 00 92 FF 25 08 8D FE EC FF D1 03 00 00 00 E7")


def test_datasheets_frame_has_the_datasheets_values() -> None:
    (frame,) = parse(Bno08xRvcParser, DATASHEET)
    assert frame.sequence == 222
    assert frame.roll_pitch_yaw == pytest.approx([math.radians(angle) for angle in (20.85, -1.1, 0.01)])
    assert frame.acceleration == pytest.approx([9.80665e-3 * milli_g for milli_g in (-371, -20, 977)])


def test_order_of_the_angles_agrees_with_gravity_in_the_same_frame() -> None:
    (frame,) = parse(Bno08xRvcParser, DATASHEET)
    if frame.roll_pitch_yaw is None or frame.acceleration is None:
        raise AssertionError("angles and acceleration are in every frame")
    up = rotation.rotate(rotation.conjugate(from_angles(*frame.roll_pitch_yaw)), (0.0, 0.0, 1.0))
    length = math.hypot(*frame.acceleration)
    assert up == pytest.approx([part / length for part in frame.acceleration], abs=1.5e-3)


def test_every_split_point() -> None:
    stream = b"".join(bno08x_rvc(s, 100 * s, -s, s, 0, 0, 1000) for s in range(4)) + DATASHEET
    assert_same_at_every_split(Bno08xRvcParser, stream, parse(Bno08xRvcParser, stream))
    assert len(parse(Bno08xRvcParser, stream)) == 5


def test_every_damaged_byte() -> None:
    frames = [bno08x_rvc(s, 0x5511 + s, -3, 0x0AAA, 4, 5, 1000) for s in range(6)]
    assert_damage_is_contained(Bno08xRvcParser, frames, damaged=2)


def test_banner_at_reset_is_dropped_and_counted() -> None:
    banner = b"\r\n%Hillcrest Laboratories Inc.\r\n%SW Ver 3.2.x\r\n"
    parser = Bno08xRvcParser()
    assert len(parser.feed(DATASHEET + banner + DATASHEET)) == 2
    assert parser.counters.bytes_dropped == len(banner)


def test_header_byte_before_the_header_costs_nothing() -> None:
    assert len(parse(Bno08xRvcParser, b"\xaa" + DATASHEET)) == 1
    assert len(parse(Bno08xRvcParser, bno08x_rvc(0xAA, -21846, 0, 0, 0, 0, 0))) == 1  # AA AA AA AA AA


def test_missing_frames_are_counted_by_the_index() -> None:
    parser = Bno08xRvcParser()
    for index in (254, 255, 0, 3, 2):
        parser.feed(bno08x_rvc(index, 0, 0, 0, 0, 0, 1000))
    assert (parser.counters.sequence_gaps, parser.counters.frames_missed) == (1, 2)
    assert parser.counters.out_of_order == 1
