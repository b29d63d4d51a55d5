"""Frames that belong to one moment become one; the next moment begins where a kind comes again."""

from drivers.imu.frame import ImuFrame, moments

ACCELERATION = ImuFrame("acceleration", acceleration=(1.0, 2.0, 3.0), temperature=20.0)
RATE = ImuFrame("rate", angular_velocity=(0.1, 0.2, 0.3), temperature=21.0)
ANGLES = ImuFrame("angles", roll_pitch_yaw=(0.01, 0.02, 0.03), z_down=True)
QUATERNION = ImuFrame("quaternion", orientation=(1.0, 0.0, 0.0, 0.0))


def test_frames_of_different_kinds_are_one_moment() -> None:
    (moment,) = moments([ACCELERATION, RATE, ANGLES, QUATERNION])
    assert moment.acceleration == ACCELERATION.acceleration
    assert moment.angular_velocity == RATE.angular_velocity
    assert moment.roll_pitch_yaw == ANGLES.roll_pitch_yaw
    assert moment.orientation == QUATERNION.orientation
    assert (moment.temperature, moment.z_down) == (21.0, True)


def test_a_kind_that_comes_again_begins_the_next_moment() -> None:
    first, second, third = moments([QUATERNION, ACCELERATION, RATE, ACCELERATION, RATE, RATE])
    assert (first.orientation, first.acceleration) == (QUATERNION.orientation, ACCELERATION.acceleration)
    assert (second.orientation, second.angular_velocity) == (None, RATE.angular_velocity)
    assert third is RATE


def test_a_device_of_one_frame_a_moment_is_left_as_it_is() -> None:
    frames = [ImuFrame("mtdata2", sequence=number, ticks=10 * number) for number in range(3)]
    assert moments(frames) == frames
