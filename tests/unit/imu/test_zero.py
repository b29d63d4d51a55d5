"""Zero now: a posture counts as upright, and only a believable one."""

import math
from pathlib import Path

import pytest

from drivers.build_context import BuildContext
from drivers.calibration_file import mark
from drivers.errors import SettingsError
from drivers.imu import rotation, zero
from drivers.imu.build import build_imu
from drivers.imu.formats import FORMATS
from drivers.imu.frame import ImuFrame
from drivers.imu.motion import TILT, TrunkMotion
from drivers.imu.settings import ImuSettings


def up(forward: float, left: float) -> rotation.Vector:
    return rotation.matrix(rotation.from_yaw_pitch_roll(-left, forward, 0.0))[2]


def test_zero_posture_reads_zero_and_others_read_what_they_differ_by() -> None:
    trunk = TrunkMotion("trunk", ImuSettings(port="-"), FORMATS["witmotion"].conventions)
    standing = rotation.from_yaw_pitch_roll(-0.03, 0.08, 1.0)
    for number in range(50):
        trunk.felt(ImuFrame("q", orientation=standing), number)
    trunk.set_zero(zero.measure(trunk.ups_as_mounted()))

    def tilts(attitude: rotation.Quaternion) -> tuple[float | None, ...]:
        felt = trunk.felt(ImuFrame("q", orientation=attitude), 0)
        got = dict(zip(felt.indices, felt.values, strict=True))
        return got[TILT[0]], got[TILT[1]]

    assert tilts(standing) == pytest.approx((0.0, 0.0), abs=1e-9)
    bent = rotation.multiply(rotation.about_z(1.0), rotation.from_yaw_pitch_roll(-0.03, 0.38, 0.0))
    assert tilts(bent)[0] == pytest.approx(0.30, abs=0.002)


def test_level_posture_needs_no_turn() -> None:
    assert zero.measure([(0.0, 0.0, 1.0)]) == rotation.IDENTITY


@pytest.mark.parametrize(
    ("ups", "words"),
    [
        ([], "no attitude"),
        ([up(0.0, 0.0), up(0.2, 0.0)], "stand still"),
        ([up(1.2, 0.0)], "correct `axes`"),
        ([(0.0, 0.0, -1.0)], "correct `axes`"),
    ],
)
def test_unbelievable_zero_is_refused(ups: list[rotation.Vector], words: str) -> None:
    with pytest.raises(zero.NotUpright, match=words):
        zero.measure(ups)


def test_file_keeps_the_zero(tmp_path: Path) -> None:
    measured = zero.measure([up(0.1, -0.05)])
    path = tmp_path / "trunk.zero.toml"
    path.write_text(zero.text(measured, "2026-11-21T08:00:00Z"))
    assert zero.load(path) == pytest.approx(measured, abs=1e-8)
    before = mark(path)
    path.write_text(zero.text(measured, "2026-11-22T08:00:00Z"))
    assert mark(path) != before, "another file is taken for the one before"
    told = build_imu(
        "trunk", ImuSettings(port="-", zero=path.name), BuildContext(tmp_path / "robot.toml")
    ).calibration
    assert told == mark(path)


@pytest.mark.parametrize(
    "text", ["rotation = [1, 0, 0]", "rotation = [2.0, 0.0, 0.0, 0.0]", "x = 1", "=", ""]
)
def test_wrong_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "trunk.zero.toml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"IMU zero .*trunk\.zero\.toml"):
        zero.load(path)
    with pytest.raises(SettingsError, match="IMU zero"):
        zero.load(tmp_path / "missing.toml")


def test_angle_is_the_whole_angle() -> None:
    w = zero.measure([up(math.radians(20), 0.0)])[0]
    assert math.degrees(2 * math.acos(w)) == pytest.approx(20)
