"""Format `xsens`, against messages that real MTi devices sent."""

import math
import struct

import pytest

from drivers.imu.formats.xsens import XsensParser
from tests.unit.imu.encode import mtdata2, xbus
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [mtdata2({0x1020: struct.pack(">H", n), 0x2030: struct.pack(">3f", n, 1, 2)}) for n in range(60)]

# A capture of an MTi-300, decoded by Xsens' MT Manager: github.com/Scottapotamas/xsens-mti, its tests.
QUATERNION = bytes.fromhex(
    "FA FF 36 26 10 20 02 46 82 10 60 04 01 C4 FC 3E 20 10 10 3F 71 CE 6C BE A5 6B CF 3C 61 3B D8 BD 69 1D 25"
    "E0 20 04 00 40 00 03 12"
)
# The example in a comment of Xsens' public driver (DataPacketParser.cpp).
EULER = bytes.fromhex("FA FF 36 16 10 60 04 09 3A 7C B7 20 30 0C BF 49 1A 52 BE C3 6A 10 C3 2E E2 EF 3E")


def test_captured_quaternion() -> None:
    (frame,) = parse(XsensParser, QUATERNION)
    assert (frame.sequence, frame.ticks) == (18050, 29686846)
    assert frame.orientation == pytest.approx([0.944556, -0.32308814, 0.01374718, -0.05691256])
    assert frame.more == {"status": 4194307}
    assert not frame.z_down


def test_captured_euler_angles() -> None:
    (frame,) = parse(XsensParser, EULER)
    assert frame.roll_pitch_yaw == pytest.approx(
        [math.radians(angle) for angle in (-0.78556, -0.38167, -174.88646)], abs=1e-6
    )


def test_every_split_point() -> None:
    stream = QUATERNION + EULER + QUATERNION
    assert_same_at_every_split(XsensParser, stream, parse(XsensParser, stream))
    assert len(parse(XsensParser, stream)) == 3


@pytest.mark.parametrize("damaged", [1, 2])
def test_every_damaged_byte_also_of_the_length(damaged: int) -> None:
    assert_damage_is_contained(XsensParser, [QUATERNION, EULER] * 3, damaged)


NUMBER = 1.5 - 1 / 1024


@pytest.mark.parametrize(
    ("number_format", "encoded"),
    [
        (0, struct.pack(">f", NUMBER)),
        (1, struct.pack(">i", round(NUMBER * 2**20))),
        (2, struct.pack(">IH", round((NUMBER - 1) * 2**32), 1)),
        (3, struct.pack(">d", NUMBER)),
    ],
)
def test_every_number_format(number_format: int, encoded: bytes) -> None:
    (frame,) = parse(XsensParser, mtdata2({0x4020 | number_format: encoded * 3}))
    assert frame.acceleration == pytest.approx((NUMBER,) * 3, abs=1e-9)


def test_negative_fixed_point_16_32() -> None:
    minus = struct.pack(">Ih", 0x80000000, -2)  # −2 + ½
    (frame,) = parse(XsensParser, mtdata2({0x8022: minus * 3}))
    assert frame.angular_velocity == (-1.5, -1.5, -1.5)


def test_frame_of_reference_is_told() -> None:
    ned = mtdata2({0x2014: struct.pack(">4f", 0, 1, 0, 0)})
    nwu = mtdata2({0x2018: struct.pack(">4f", 1, 0, 0, 0)})
    assert [frame.z_down for frame in parse(XsensParser, ned, nwu)] == [True, False]


def test_extended_length() -> None:
    items = {0x0810: struct.pack(">f", 30.25)} | {0xA000 + 16 * n: bytes(30) for n in range(10)}
    (frame,) = parse(XsensParser, mtdata2(items))
    assert frame.temperature == 30.25


def test_unknown_item_is_kept_as_it_is() -> None:
    (frame,) = parse(XsensParser, mtdata2({0x5042: b"\x01\x02", 0x4020: b"\x00" * 5}))
    assert frame.more == {"item_5042": "0102", "item_4020": "0000000000"}
    assert frame.acceleration is None


def test_clipped_sensor_is_counted() -> None:
    parser = XsensParser()
    parser.feed(mtdata2({0xE020: struct.pack(">I", 1 << 8)}) + mtdata2({0xE020: struct.pack(">I", 7)}))
    assert parser.counters.saturated == 1


def test_message_that_is_no_measurement_is_named() -> None:
    assert [frame.kind for frame in parse(XsensParser, xbus(0x3E, b""), xbus(0x42, b"\x03"))] == [
        "wake_up",
        "error",
    ]


def test_items_that_do_not_fill_the_payload_are_malformed() -> None:
    parser = XsensParser()
    assert parser.feed(xbus(0x36, bytes.fromhex("2010 10 00000000"))) == []
    assert parser.counters.malformed == 1
