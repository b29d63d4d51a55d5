"""Format `vectornav`, ASCII and binary, against messages that its maker and real devices sent."""

import math
import struct

import pytest

from drivers.imu.formats.vectornav import VectornavParser
from drivers.imu.frame import ImuFrame
from tests.unit.imu.encode import crc16_xmodem, vectornav_ascii, vectornav_binary
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [vectornav_ascii(f"VNYPR,+{n:03d}.5,-001.0,+000.5") for n in range(60)]

# From VectorNav's own programming library (vnproglib), an example.
YMR = (
    b"$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
    b"-00.000018,+00.001122,-00.000551*69"
)
# Captured from a sensor, in the tests of the public imu_dds_adapter.
YPR = b"$VNYPR,-129.867,-000.355,-000.296*61"
WRONG = b"$VNRRG,07,40*4C"  # in a public test, with a wrong checksum
# VN-100 User Manual, section 5.3.7.
BINARY = bytes.fromhex("FA 01 08 00 93 50 2E 42 83 3E F1 3F 48 B5 04 BB 92 88")


def degrees(frame: ImuFrame) -> list[float]:
    return [math.degrees(angle) for angle in frame.roll_pitch_yaw or ()]


def test_makers_ascii_example() -> None:
    (frame,) = parse(VectornavParser, YMR)
    assert frame.kind == "vnymr"
    assert degrees(frame) == pytest.approx([0.715, -7.33, 100.949])
    assert frame.acceleration == (-1.258, -0.1, -9.701)
    assert frame.angular_velocity == (-0.000018, 0.001122, -0.000551)
    assert frame.magnetic_field == pytest.approx((-0.49e-6, -24.49e-6, 53.97e-6))
    assert frame.z_down


def test_captured_ascii() -> None:
    (frame,) = parse(VectornavParser, YPR + b"\r\n")
    assert degrees(frame) == pytest.approx([-0.296, -0.355, -129.867])


def test_wrong_checksum_of_a_public_example_is_refused() -> None:
    parser = VectornavParser()
    assert parser.feed(WRONG + b"\r\n") == []
    assert parser.counters.bad_checksums == 1


def test_manuals_binary_example() -> None:
    (frame,) = parse(VectornavParser, BINARY)
    assert frame.kind == "binary"
    assert degrees(frame) == pytest.approx([-0.0020249654, 1.8847202, 43.578686])


def test_ascii_may_end_with_a_crc_of_four_digits() -> None:
    body = YPR[1 : YPR.index(b"*")]
    message = b"$" + body + f"*{crc16_xmodem(body):04X}\r\n".encode()
    assert len(parse(VectornavParser, message)) == 1
    assert parse(VectornavParser, message.replace(b"129", b"128")) == []


def test_every_split_point_of_both_kinds_in_one_stream() -> None:
    stream = YMR + b"\r\n" + BINARY + YPR + b"\r\n" + WRONG + b"\r\n" + BINARY + YPR
    assert_same_at_every_split(VectornavParser, stream, parse(VectornavParser, stream))
    assert [frame.kind for frame in parse(VectornavParser, stream)] == [
        "vnymr",
        "binary",
        "vnypr",
        "binary",
        "vnypr",
    ]


def test_line_ends_are_not_counted_as_dropped() -> None:
    parser = VectornavParser()
    parser.feed((YPR + b"\r\n") * 3)
    assert (parser.counters.frames, parser.counters.bytes_dropped) == (3, 0)


@pytest.mark.parametrize("damaged", [1, 2, 3])
def test_every_damaged_byte(damaged: int) -> None:
    assert_damage_is_contained(VectornavParser, [YPR + b"\r\n", BINARY, YMR + b"\r\n"] * 3, damaged)


def test_binary_groups_fields_and_sizes() -> None:
    # Groups 1, 3 and 5 with fields the driver knows, and others it must step over.
    payload = (
        struct.pack("<Q", 5_000_000_000)
        + struct.pack("<3f", 1, 2, 3)  # common: time since start-up, yaw pitch roll
        + struct.pack("<H12x", 0)  # IMU: status, uncompensated magnetic field
        + struct.pack("<f", 31.5)  # temperature
        + struct.pack("<3f", 0.1, 0.2, -9.8)  # acceleration
        + struct.pack("<3f", 0.01, 0.02, 0.03)  # rate
        + struct.pack("<4f", 0.0, 0.6, 0.0, 0.8)  # attitude: quaternion, scalar last
    )
    fields = [1 << 0 | 1 << 3, 1 << 0 | 1 << 1 | 1 << 4 | 1 << 9 | 1 << 10, 1 << 2]
    (frame,) = parse(VectornavParser, vectornav_binary(0b10101, fields, payload))
    assert frame.ticks == 5_000_000_000
    assert degrees(frame) == pytest.approx([3, 2, 1])
    assert frame.temperature == 31.5
    assert frame.acceleration == pytest.approx((0.1, 0.2, -9.8))
    assert frame.angular_velocity == pytest.approx((0.01, 0.02, 0.03))
    assert frame.orientation == pytest.approx((0.8, 0.0, 0.6, 0.0))


def test_published_binary_header_has_its_published_length() -> None:
    # github.com/jerabaul29/LoggerWavesInIce: header fa 14 3e 00 3a 00, 116 bytes of payload.
    message = vectornav_binary(0x14, [0x3E, 0x3A], bytes(116))
    assert message[:6] == bytes.fromhex("fa143e003a00")
    assert len(parse(VectornavParser, message)) == 1
    assert parse(VectornavParser, vectornav_binary(0x14, [0x3E, 0x3A], bytes(115))) == []


def test_not_a_number_is_no_value() -> None:
    parser = VectornavParser()
    assert parser.feed(vectornav_binary(1, [8], struct.pack("<3f", math.nan, 0, 0))) == []
    assert parser.feed(vectornav_ascii("VNYPR,nan,0,0")) == []
    assert parser.counters.malformed == 2


@pytest.mark.parametrize("text", ["VNYPR,1,2", "VNYPR,1,2,3,4", "VNYPR,1,x,3", "VNYPR"])
def test_right_checksum_over_wrong_fields_is_malformed(text: str) -> None:
    parser = VectornavParser()
    assert parser.feed(vectornav_ascii(text)) == []
    assert parser.counters.malformed == 1


def test_answers_to_commands_are_named() -> None:
    (frame,) = parse(VectornavParser, vectornav_ascii("VNERR,03"))
    assert (frame.kind, frame.more) == ("vnerr", {"data": "03"})


def test_noise_is_bounded() -> None:
    parser = VectornavParser()
    for _ in range(300):
        parser.feed(b"$abc,\xfa\x01" * 20)
    assert parser.counters.frames == 0
    assert len(parser._buffer) < 2000
