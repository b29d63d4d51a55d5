"""Format `witmotion`, against frames that a real device sent."""

import math

import pytest

from drivers.imu.formats.witmotion import WitmotionParser
from tests.unit.imu.encode import witmotion
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [witmotion(0x51, n, -n, 2048, 2500) + witmotion(0x53, n, 2 * n, 3 * n, 0) for n in range(60)]

# Captured from a WT901, published in the README of github.com/aarushmaddula/bsli-payload-project.
TIME = bytes.fromhex("55 50 00 00 00 00 05 28 95 01 68")
ACCELERATION = bytes.fromhex("55 51 0c 00 93 02 6d 08 b7 07 7a")
RATE = bytes.fromhex("55 52 00 00 00 00 00 00 b7 07 65")
ANGLE = bytes.fromhex("55 53 04 0c e1 ff 6f f2 cc 46 0b")
MAGNETIC = bytes.fromhex("55 54 ac f9 3b 0b 86 e7 00 00 01")
QUATERNION = bytes.fromhex("55 59 23 83 84 ed 5f 03 f1 14 2c")
CAPTURE = [TIME, ACCELERATION, RATE, ANGLE, MAGNETIC, QUATERNION]


def test_captured_frames_have_the_values_their_maker_shows() -> None:
    time, acceleration, rate, angle, magnetic, quaternion = parse(WitmotionParser, *CAPTURE)
    assert (time.kind, time.more["minute"], time.more["second"]) == ("time", 5, 40.405)
    assert acceleration.acceleration == pytest.approx(
        [g * 9.80665 for g in (0.005859, 0.321777, 1.053223)], abs=1e-5
    )
    assert acceleration.temperature == pytest.approx(19.75)
    assert rate.angular_velocity == (0, 0, 0)
    assert angle.roll_pitch_yaw == pytest.approx(
        [math.radians(degrees) for degrees in (16.897, -0.1703, -19.0778)], abs=1e-5
    )
    assert angle.more == {"version": 18124}
    assert [magnetic.more[f"magnetic_raw_{axis}"] for axis in "xyz"] == [-1620, 2875, -6266]
    assert quaternion.orientation == pytest.approx([-0.97549, -0.14441, 0.02634, 0.1636], abs=1e-5)


def test_every_split_point() -> None:
    stream = b"".join(CAPTURE)
    assert_same_at_every_split(WitmotionParser, stream, parse(WitmotionParser, stream))


@pytest.mark.parametrize("damaged", range(1, 4))
def test_every_damaged_byte(damaged: int) -> None:
    assert_damage_is_contained(WitmotionParser, [*CAPTURE, *CAPTURE], damaged)


def test_stream_entered_in_the_middle_starts_at_the_first_whole_frame() -> None:
    parser = WitmotionParser()
    frames = parser.feed(b"".join(CAPTURE)[4:])
    assert [frame.kind for frame in frames] == [
        "acceleration",
        "angular_velocity",
        "angle",
        "magnetic",
        "quaternion",
    ]
    assert parser.counters.bytes_dropped == 7


@pytest.mark.parametrize(
    ("kind", "words", "saturated"),
    [
        (0x51, (32767, 0, 0), 1),
        (0x52, (0, -32768, 0), 1),
        (0x51, (32766, -32767, 0), 0),
        (0x53, (32767, 0, 0), 0),
    ],
)
def test_range_ends_are_counted_where_they_are_ends(
    kind: int, words: tuple[int, int, int], saturated: int
) -> None:
    parser = WitmotionParser()
    assert len(parser.feed(witmotion(kind, *words, 0))) == 1
    assert parser.counters.saturated == saturated


def test_frame_types_of_other_models_are_named_and_not_guessed_at() -> None:
    (frame,) = parse(WitmotionParser, witmotion(0x56, 1, 2, 3, 4))
    assert (frame.kind, frame.more) == ("barometer", {"data": "0100020003000400"})
    assert parse(WitmotionParser, witmotion(0x5F, 1, 2, 3, 4)) == []


def test_noise_is_bounded_and_counted() -> None:
    parser = WitmotionParser()
    for _ in range(500):
        parser.feed(b"\x55\x55\x51\xff" * 25)
    assert len(parser._buffer) < 11
    assert parser.counters.frames == 0
    assert parser.counters.bytes_dropped + len(parser._buffer) == 50_000
