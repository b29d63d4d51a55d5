"""Format `microstrain`, against the example in its maker's manuals and packets written from their tables."""

import itertools
import math
import struct

import pytest

from drivers.imu.formats.microstrain import FORMAT, MicrostrainParser
from drivers.imu.frame import moments
from drivers.imu.motion import TILT, TrunkMotion
from drivers.imu.settings import ImuSettings
from drivers.parsing import Counters
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

# "3DM-CV7 User Manual" and "3DM-GX5-35 DCP Manual", Example Data Packet. Its last float is no number: its two
# words are printed the wrong way round, and BF7F 7FE5 would be −0.998 g. The checksum does not see that.
PRINTED = bytes.fromhex("7565 800E 0E04 3E7A63A0 BB8E3B29 7FE5BF7F 84EE")
# "3DM-GX5-35 DCP Manual", the reply to a ping (01h, 01h).
ACKNOWLEDGED = bytes.fromhex("7565 0104 04F1 0100 D56A")


def packet(descriptor_set: int, *fields: tuple[int, bytes]) -> bytes:
    """One packet."""
    body = b"".join(bytes([2 + len(data), descriptor]) + data for descriptor, data in fields)
    whole = bytes([0x75, 0x65, descriptor_set, len(body)]) + body
    sums = list(itertools.accumulate(whole))
    return whole + bytes([sums[-1] % 256, sum(sums) % 256])


def floats(*numbers: float) -> bytes:
    return struct.pack(f">{len(numbers)}f", *numbers)


def measured(n: int) -> bytes:
    return packet(
        0x80, (0xD5, struct.pack(">Q", 10_000_000 * n)), (0x04, floats(0, 0, -1)), (0x05, floats(n, 2, 3))
    )


def attitude(n: int, valid: int = 1) -> bytes:
    quaternion = floats(0.5, 0.5, -0.5, 0.5) + struct.pack(">H", valid)
    return packet(0x82, (0xD5, struct.pack(">Q", 10_000_000 * n)), (0x03, quaternion))


STREAM = [measured(n) for n in range(60)]


def fed(stream: bytes) -> Counters:
    parser = MicrostrainParser()
    parser.feed(stream)
    return parser.counters


def test_the_manuals_example_has_the_right_checksum_and_its_number_that_is_none_is_refused() -> None:
    counters = fed(PRINTED)
    assert (counters.frames, counters.bad_checksums, counters.malformed) == (0, 0, 1)


def test_the_manuals_example_as_it_was_meant() -> None:
    (frame,) = parse(MicrostrainParser, packet(0x80, (0x04, bytes.fromhex("3E7A63A0 BB8E3B29 BF7F7FE5"))))
    assert frame.acceleration == pytest.approx((2.3977, -0.042559, -9.787097), rel=1e-3)


def test_an_answer_to_a_command_is_named_and_is_no_motion() -> None:
    (frame,) = parse(MicrostrainParser, ACKNOWLEDGED)
    assert (frame.kind, frame.acceleration, frame.more) == ("set_01", None, {"data": "04f10100"})


def test_units_are_si() -> None:
    (frame,) = parse(
        MicrostrainParser,
        packet(
            0x80,
            (0xD5, struct.pack(">Q", (1 << 60) + 1)),
            (0x04, floats(0.5, 0, -1)),
            (0x05, floats(0.25, -0.5, 2)),
            (0x06, floats(0.5, 0, -0.25)),
            (0x0C, floats(0.1, 0.2, -3)),
            (0x0A, floats(0, 1, 0, 0)),
            (0x17, floats(1013.25)),
        ),
    )
    assert frame.acceleration == pytest.approx((4.903325, 0, -9.80665))
    assert frame.angular_velocity == (0.25, -0.5, 2)
    assert frame.magnetic_field == pytest.approx((5e-5, 0, -2.5e-5))
    assert frame.roll_pitch_yaw == pytest.approx((0.1, 0.2, -3))
    assert (frame.orientation, frame.z_down) == ((0, 1, 0, 0), True)
    assert frame.more["pressure"] == pytest.approx(101_325)
    assert frame.ticks == (1 << 60) + 1


def test_what_the_filter_says_is_not_valid_is_absent() -> None:
    valid, invalid = parse(MicrostrainParser, attitude(1), attitude(2, valid=0))
    assert valid.orientation == (0.5, 0.5, -0.5, 0.5)
    assert invalid.orientation is None


def test_both_packets_of_a_moment_are_kept_by_the_clock_and_a_repetition_is_not() -> None:
    frames = parse(MicrostrainParser, measured(1), attitude(1), measured(2), attitude(2), measured(1))
    assert FORMAT.clock is not None
    clock = FORMAT.clock.make()
    ticks = [frame.ticks for frame in frames if frame.ticks is not None]
    kept = [clock.stamp(one, 1_000_000_000 + n) is not None for n, one in enumerate(ticks)]
    assert kept == [True, True, True, True, False]
    (moment,) = moments(frames[:2])
    assert (moment.angular_velocity, moment.orientation) == ((1, 2, 3), (0.5, 0.5, -0.5, 0.5))


def test_a_level_sensor_is_upright_and_one_whose_nose_is_down_leans_forward() -> None:
    motion = TrunkMotion("trunk", ImuSettings(port="-", format="microstrain"), FORMAT.conventions)
    for pitch, leaning in ((0.0, 0.0), (-0.2, 0.2)):
        (frame,) = parse(MicrostrainParser, packet(0x82, (0x05, floats(0, pitch, 1) + b"\0\1")))
        felt = motion.felt(frame, 0)
        tilt = [felt.values[felt.indices.index(index)] for index in TILT]
        assert tilt == pytest.approx([leaning, 0.0], abs=1e-6)


def test_gravity_at_rest_points_up_in_the_trunk() -> None:
    motion = TrunkMotion("trunk", ImuSettings(port="-", format="microstrain"), FORMAT.conventions)
    (frame,) = parse(MicrostrainParser, packet(0x80, (0x04, floats(0, 0, -1))))
    assert motion.felt(frame, 0).acceleration == pytest.approx((0, 0, 9.80665))


def test_an_axis_at_its_end_is_counted() -> None:
    assert fed(packet(0x80, (0x18, b"\0\x20")) + packet(0x80, (0x18, b"\x07\0"))).saturated == 1


def test_unknown_field_is_kept_as_it_is() -> None:
    (frame,) = parse(MicrostrainParser, packet(0x80, (0x7A, b"\x01\x02")))
    assert frame.more == {"field_7a": "0102"}


@pytest.mark.parametrize(
    "field", [(0x04, floats(1, 2)), (0x04, floats(1, 2, 3, 4)), (0x05, floats(math.inf, 0, 0))]
)
def test_a_field_of_another_size_or_without_a_number_is_malformed(field: tuple[int, bytes]) -> None:
    assert fed(packet(0x80, field)).malformed == 1


@pytest.mark.parametrize("body", ["03 04 00 09 05", "01 04", "00 00"])
def test_fields_that_do_not_fill_the_packet_are_malformed(body: str) -> None:
    raw = bytes.fromhex(body)
    whole = bytes([0x75, 0x65, 0x80, len(raw)]) + raw
    sums = list(itertools.accumulate(whole))
    assert fed(whole + bytes([sums[-1] % 256, sum(sums) % 256])).malformed == 1


def test_a_wrong_checksum_and_a_truncated_packet_cost_themselves_only() -> None:
    wrong = bytearray(measured(2))
    wrong[-1] ^= 1
    stream = [measured(1), bytes(wrong), measured(3), measured(4)[:-3], measured(5), b"ue\x80", measured(6)]
    frames = parse(MicrostrainParser, *stream)
    assert [frame.angular_velocity and frame.angular_velocity[0] for frame in frames] == [1, 3, 5, 6]
    counters = fed(b"".join(stream))
    assert counters.bad_checksums >= 1
    assert counters.bytes_dropped == len(wrong) + len(stream[3]) + 3


def test_every_split_point() -> None:
    stream = b"\x75" + measured(1) + b"ue" + attitude(1) + ACKNOWLEDGED
    assert_same_at_every_split(MicrostrainParser, stream, parse(MicrostrainParser, stream))
    assert len(parse(MicrostrainParser, stream)) == 3


@pytest.mark.parametrize("damaged", [1, 2])
def test_every_damaged_byte_also_of_the_length(damaged: int) -> None:
    frames = [measured(1), attitude(2), measured(3), attitude(4), measured(5), attitude(6)]
    assert_damage_is_contained(MicrostrainParser, frames, damaged)
