"""Rotations: conventions that must never change by themselves."""

import math

import pytest

from drivers.imu import rotation as r

QUARTER = math.pi / 2


@pytest.mark.parametrize(
    ("q", "vector", "turned"),
    [
        (r.about_x(QUARTER), (0, 1, 0), (0, 0, 1)),
        (r.about_y(QUARTER), (0, 0, 1), (1, 0, 0)),
        (r.about_z(QUARTER), (1, 0, 0), (0, 1, 0)),
        (r.multiply(r.about_z(QUARTER), r.about_x(QUARTER)), (0, 1, 0), (0, 0, 1)),
        (r.from_yaw_pitch_roll(0, QUARTER, QUARTER), (1, 0, 0), (0, 0, -1)),
    ],
)
def test_right_hand_rule(q: r.Quaternion, vector: r.Vector, turned: r.Vector) -> None:
    assert r.rotate(q, vector) == pytest.approx(turned, abs=1e-12)
    assert r.rotate(r.conjugate(q), turned) == pytest.approx(vector, abs=1e-12)


@pytest.mark.parametrize(
    "axes",
    [
        ("x", "y", "z"),
        ("x", "-y", "-z"),
        ("y", "-x", "z"),
        ("z", "x", "y"),
        ("-x", "-y", "z"),
        ("-z", "y", "x"),
    ],
)
def test_axes_map_each_sensor_axis_to_its_body_axis(axes: tuple[str, str, str]) -> None:
    body_from_sensor = r.from_axes(axes)
    for place, axis in enumerate(axes):
        sign = -1.0 if axis[0] == "-" else 1.0
        sensor = tuple(sign * (name == axis[-1]) for name in "xyz")
        body = tuple(float(place == index) for index in range(3))
        assert r.rotate(body_from_sensor, (sensor[0], sensor[1], sensor[2])) == pytest.approx(body, abs=1e-12)


@pytest.mark.parametrize("axes", [("x", "y", "-z"), ("x", "x", "z"), ("y", "x", "z")])
def test_axes_that_are_no_right_handed_frame_are_refused(axes: tuple[str, str, str]) -> None:
    with pytest.raises(ValueError, match="no right-handed frame"):
        r.from_axes(axes)


def test_quaternion_far_from_unit_length_is_no_orientation() -> None:
    assert r.normalised((0.0, 0.0, 0.0, 0.0)) is None
    assert r.normalised((0.99, 0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0)
