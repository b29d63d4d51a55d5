"""Format `witmotion-can`: eight bytes a frame, no checksum, so that only the heads keep step."""

import math

import pytest

from drivers.imu.can.witmotion_can import WitmotionCanParser, decode
from tests.unit.port.streams import assert_same_at_every_split, parse

# Logged from a USB-CAN adapter, published in a comment of 2020-04-17.
LOG = bytes.fromhex(
    "55 51 e4 ff e2 04 3d 06 55 52 00 00 00 00 00 00 55 53 05 1b 80 00 01 40 55 54 f1 09 00 00 00 00"
)


def test_logged_frames() -> None:
    acceleration, rate, angle, magnetic = parse(WitmotionCanParser, LOG)
    assert acceleration.acceleration == pytest.approx(
        [g * 9.80665 for g in (-0.01367, 0.61035, 0.77979)], abs=1e-4
    )
    assert rate.angular_velocity == (0, 0, 0)
    assert angle.roll_pitch_yaw == pytest.approx(
        [math.radians(angle) for angle in (37.9962, 0.7031, 90.0055)], abs=1e-5
    )
    assert magnetic.more["magnetic_raw_x"] == 2545


def test_every_split_point() -> None:
    assert_same_at_every_split(WitmotionCanParser, LOG, parse(WitmotionCanParser, LOG))


def test_lost_or_added_bytes_cost_at_most_two_frames() -> None:
    for at in range(8, 16):
        for damaged in (LOG[:at] + LOG[at + 1 :], LOG[:at] + b"\x00" + LOG[at:]):
            kinds = [frame.kind for frame in parse(WitmotionCanParser, damaged)]
            assert kinds[0] == "acceleration", at
            assert kinds[-1] == "magnetic", at


def test_one_payload_of_the_bus() -> None:
    frame = decode(LOG[16:24])
    assert frame is not None
    assert frame.kind == "angle"
    assert decode(LOG[16:23]) is None
    assert decode(b"\x56" + LOG[17:24]) is None
    assert decode(b"\x55\x40" + LOG[18:24]) is None


def test_other_types_are_named_and_not_guessed_at() -> None:
    frame = decode(bytes.fromhex("55 59 01 02 03 04 05 06"))
    assert frame is not None
    assert (frame.kind, frame.more) == ("type_59", {"data": "010203040506"})
