"""`gwrms calibrate`: known loads give back the gain they were made with, and nothing is written unasked."""

import argparse
import io
import math
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.cli import calibrate
from drivers.cli.calibrate import _imu_on_port
from drivers.errors import SettingsError, Unavailable
from drivers.imu import zero
from drivers.imu.device import Imu
from drivers.insole import layout as layouts
from drivers.insole.calibration import CellCalibration, Cells, load
from drivers.insole.calibration_fit import BadFit, Load, fit, text
from drivers.insole.foot import Foot
from drivers.samples import ComponentState
from tests.support.waiting import until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.imu.encode import witmotion
from tests.unit.imu.test_inclinometer import device as inclinometer
from tests.unit.insole.encode import Sender
from tests.unit.port.terminals import Terminal
from tests.unit.sensor_cli.test_sensor import Talking

LAYOUT = layouts.load("insole-16")
TARES = [float(10 + cell) for cell in range(16)]


def loads(gain: float, exponent: float, *depths: float) -> list[Load]:
    """Loads that an insole of this law reads `depths` counts above its tare under."""
    made = []
    for depth in depths:
        force = sum(area * gain * depth**exponent for area in LAYOUT.areas)
        made.append(Load(force, tuple(tare + depth for tare in TARES)))
    return made


def test_linear_gain_is_found() -> None:
    fitted = fit(LAYOUT, TARES, loads(120.0, 1.0, 100.0, 300.0), CellCalibration())
    assert fitted.calibration.cell["3"].gain == pytest.approx(120.0)
    assert fitted.calibration.cell["3"].tare == 13
    assert fitted.rms_error == pytest.approx(0.0, abs=1e-6)


def test_power_law_is_found() -> None:
    fitted = fit(LAYOUT, TARES, loads(4.0, 1.4, 100.0, 300.0, 900.0), CellCalibration(), power=True)
    assert fitted.calibration.cell["0"].exponent == pytest.approx(1.4)
    assert fitted.calibration.cell["0"].gain == pytest.approx(4.0)


def test_written_text_is_a_calibration(tmp_path: Path) -> None:
    base = CellCalibration(polarity="falling", full_scale=4095, saturation=4000)
    fitted = fit(LAYOUT, TARES, loads(50.0, 1.0, 200.0), base)
    path = tmp_path / "left.toml"
    path.write_text(text(fitted, "2026-11-21T08:00:00Z"))
    cells = Cells(load(path), 16)
    assert cells.pressures([4095 - 10 - 200] + [4095.0] * 15)[0] == pytest.approx(10_000)


def test_load_that_was_not_felt_is_refused() -> None:
    with pytest.raises(BadFit, match="did not feel"):
        fit(LAYOUT, TARES, [Load(700.0, tuple(TARES))], CellCalibration())
    with pytest.raises(BadFit, match="too few loads"):
        fit(LAYOUT, TARES, [], CellCalibration())
    with pytest.raises(BadFit, match="two different ones"):
        fit(LAYOUT, TARES, loads(1.0, 1.0, 50.0), CellCalibration(), power=True)


@pytest.fixture
def terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Terminal]:
    monkeypatch.setattr(calibrate, "AVERAGE_S", 0.5)
    terminal = Terminal(tmp_path / "sensor")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


@pytest.fixture
def hears(monkeypatch: pytest.MonkeyPatch) -> None:
    """An insole is listened to until a frame has come: on a busy computer that takes as long as it takes."""
    made: list[calibrate._Average] = []

    class Noted(calibrate._Average):
        def __init__(self, foot: Foot | None, cells: int) -> None:
            super().__init__(foot, cells)
            made.append(self)

    waits = SimpleNamespace(wait=lambda _s: until(lambda: made[-1].frames or made[-1].refused))
    monkeypatch.setattr(calibrate, "_Average", Noted)
    monkeypatch.setattr(calibrate, "threading", SimpleNamespace(Event=lambda: waits))


@pytest.fixture
def feels(monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as an IMU on a port takes to say something."""
    made: list[Imu] = []

    def on_port(options: argparse.Namespace) -> Imu:
        made.append(_imu_on_port(options))
        return made[-1]

    waits = SimpleNamespace(
        wait=lambda _s: until(lambda: made[-1].quality(time.monotonic_ns()).state is ComponentState.OK)
    )
    monkeypatch.setattr(calibrate, "_imu_on_port", on_port)
    monkeypatch.setattr(calibrate, "threading", SimpleNamespace(Event=lambda: waits))


def answer(monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join(lines) + "\n"))


def insole_stream(depth: int) -> bytes:
    sender = Sender()
    return b"".join(sender.frame([100 + depth] * 16, flags=0) for _ in range(20))


@pytest.mark.parametrize(("said", "written"), [("y", True), ("n", False), ("", False)])
def test_guided_calibration_shows_its_fit_and_writes_only_when_told(
    said: str,
    written: bool,
    terminal: Terminal,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    answer(monkeypatch, "", "70", "x", "", said)
    averages = iter([[100.0] * 16, [300.0] * 16])
    monkeypatch.setattr(calibrate, "_average", lambda *_: next(averages))
    file = tmp_path / "left.toml"
    code = calibrate.main(["insole", str(terminal.path), "--write", str(file)])
    out = capsys.readouterr().out
    assert "error 0.0 N" in out
    assert "'x' is no mass" in out
    assert (code == 0, file.exists()) == (written, written)
    if written:
        cells = Cells(load(file), 16)
        force = sum(p * a for p, a in zip(cells.pressures([300.0] * 16), LAYOUT.areas, strict=True) if p)
        assert force == pytest.approx(70 * 9.80665)


@pytest.mark.usefixtures("hears")
def test_counts_are_averaged_from_the_port(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer(monkeypatch, "", "")
    with Talking(terminal, insole_stream(7)), pytest.raises(BadFit):
        calibrate.main(["insole", str(terminal.path), "--write", str(tmp_path / "x.toml")])
    assert "tare: 107 107" in capsys.readouterr().out


def test_silent_insole_is_named(terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answer(monkeypatch, "")
    with pytest.raises(Unavailable, match="16 cells came"):
        calibrate.main(["insole", str(terminal.path), "--write", str(tmp_path / "x.toml")])


@pytest.mark.usefixtures("hears")
@pytest.mark.parametrize(
    ("cells", "flags", "more", "said"),
    [
        (16, 2, [], r"sensor: it sends pressure already and needs no calibration"),
        (8, 0, [], "frames of 8 cells come, and the layout has 16"),
        (16, 1, ["--foot", "left"], "frames of the right foot come, not of the left one"),
    ],
)
def test_an_insole_whose_frames_do_not_count_is_told_why(
    cells: int, flags: int, more: list[str], said: str, terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer(monkeypatch, "")
    sender = Sender()
    stream = b"".join(sender.frame([100] * cells, flags=flags) for _ in range(20))
    with Talking(terminal, stream), pytest.raises(Unavailable, match=said):
        calibrate.main(["insole", str(terminal.path), *more, "--write", "x.toml"])


@pytest.mark.usefixtures("hears")
def test_an_insole_is_found_by_its_table(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer(monkeypatch, "", "")
    file = tmp_path / "robot.toml"
    file.write_text(f'[insole.left_insole]\nport = "{terminal.path}"\nlayout = "insole-16"\n')
    with Talking(terminal, insole_stream(7)), pytest.raises(BadFit):
        calibrate.main(["insole", f"{file}:left_insole", "--write", str(tmp_path / "x.toml")])
    assert "tare: 107 107" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", r"has no table of the name 'insole', which \[insole.left_insole\] needs"),
        ("[insole.left_insole]\nprt = 1\n", "prt"),
        (None, "cannot be read: No such file"),
    ],
)
def test_an_insoles_table_that_cannot_be_used_is_said(content: str | None, said: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(SettingsError, match=said):
        calibrate.main(["insole", f"{file}:left_insole", "--write", "x.toml"])


@pytest.mark.usefixtures("feels")
def test_zero_of_an_imu_is_written(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer(monkeypatch, "y")
    file = tmp_path / "trunk.zero.toml"
    with Talking(terminal, witmotion(0x53, 0, round(6 / 180 * 32768), 0, 0) * 10):
        assert calibrate.main(["imu", str(terminal.path), "--write", str(file)]) == 0
    assert "6.0°" in capsys.readouterr().out
    assert zero.load(file)[0] < 1.0


@pytest.mark.usefixtures("feels")
def test_axes_that_point_the_other_way_can_be_given(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer(monkeypatch, "y")
    argv = ["imu", str(terminal.path), "--axes", "-x -y z", "--write", str(tmp_path / "trunk.zero.toml")]
    with Talking(terminal, witmotion(0x53, 0, round(6 / 180 * 32768), 0, 0) * 10):
        assert calibrate.main(argv) == 0
    assert "6.0°" in capsys.readouterr().out


@pytest.mark.parametrize("axes", ["x y", "x y w", "x,y,z", ""])
def test_axes_that_are_none_are_wrong_usage(axes: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate.main(["imu", "/dev/none", "--axes", axes, "--write", "x.toml"]) == 2
    assert "is not three of x, y, z, -x, -y, -z, such as 'y -x z'" in capsys.readouterr().err


def test_zero_of_an_imu_in_the_robots_file_needs_nothing_said_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    answer(monkeypatch, "y")
    robot, file = tmp_path / "robot.toml", tmp_path / "trunk.zero.toml"
    robot.write_text(
        f'[can.main]\ninterface = "virtual"\nchannel = "{tmp_path}"\n'
        '[imu.trunk]\nbus = "main"\nnode_id = 20\nzero = "trunk.zero.toml"\npoll_hz = 50\n'
    )
    with FakeNode(str(tmp_path), 20, inclinometer(longitudinal=600, lateral=0)):
        assert calibrate.main(["imu", f"{robot}:trunk", "--write", str(file)]) == 0
    assert "6.0°" in capsys.readouterr().out
    assert math.degrees(2 * math.acos(zero.load(file)[0])) == pytest.approx(6.0, abs=0.01)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "No such file"),
        ("[imu", "robot.toml: "),
        ("[imu.other]", "no table of the name 'trunk'"),
        ('[imu.trunk]\nbus = "main"\ncan_id = 80', "no table of the name 'can'"),
        ('[imu.trunk]\nformat = "xsens"', "missing required field `port`"),
    ],
)
def test_a_robots_file_without_the_imu_is_named(tmp_path: Path, text: str | None, says: str) -> None:
    robot = tmp_path / "robot.toml"
    if text is not None:
        robot.write_text(text)
    with pytest.raises(SettingsError, match=says):
        calibrate.main(["imu", f"{robot}:trunk", "--write", str(tmp_path / "zero.toml")])


def test_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate.main([]) == 2
    assert calibrate.main(["shoe"]) == 2
    assert calibrate.main(["--help"]) == 0
    assert calibrate.main(["insole", "--help"]) == 0
    assert "usage" in capsys.readouterr().out
