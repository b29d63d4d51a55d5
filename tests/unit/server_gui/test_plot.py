"""`gwrms plot`: curves of braille letters, with holes where nothing was."""

import math

import pytest

from gateway.cli.value_display import Channels
from gateway.main import main
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo
from server_gui.cli.plot import ROWS, Curves, fitted
from server_gui.terminal.braille import BLANK, draw, extent
from tests.fake_robot import FakeRobot
from tests.support.terminal import Terminal
from tests.support.waiting import WAIT_S

EMPTY = chr(BLANK)


def test_a_line_goes_from_the_lower_left_to_the_upper_right() -> None:
    lines = draw([(number / 7, number / 7) for number in range(8)], 0.0, 1.0, 0.0, 1.0, (4, 2))
    assert lines == ["⠀⠀⡠⠊", "⡠⠊⠀⠀"]


def test_what_is_missing_is_a_hole_and_no_line_is_drawn_over_it() -> None:
    samples = [(0.0, 0.0), (0.1, None), (0.9, 1.0), (1.0, math.nan)]
    lines = draw(samples, 0.0, 1.0, 0.0, 1.0, (6, 1))
    assert lines[0][1:5] == EMPTY * 4
    assert lines[0][0] != EMPTY
    assert lines[0][5] != EMPTY


def test_a_step_is_joined() -> None:
    (line,) = draw([(0.0, 0.0), (1.0, 1.0)], 0.0, 1.0, 0.0, 1.0, (1, 1))
    assert line == "⡸"


@pytest.mark.parametrize("values", [[], [3.0, 3.0], [-1e-9], [1e9, 1e9 + 1], [0.0, 12.3], [-9e299, 9e299]])
def test_the_scale_is_never_nothing_and_holds_what_is_drawn(values: list[float]) -> None:
    low, high = extent([(0.0, value) for value in values])
    assert low < high
    assert all(low <= value <= high for value in values)


def test_what_is_too_large_is_a_hole() -> None:
    samples = [(0.0, 0.0), (0.5, -1.7e308), (0.6, 1.7e308), (1.0, 1.0)]
    (line,) = draw(samples, 0.0, 1.0, *extent(samples), (6, 1))
    assert line[1:5] == EMPTY * 4


def test_curves_are_printed_once_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        robot.lost.add("left_insole")
        argv = [
            "plot",
            "trunk",
            "left_insole.force",
            "--terminal",
            "--seconds",
            "0.5",
            "--robot",
            robot.address,
        ]
        assert main(argv) == 0
    lines = capsys.readouterr().out.splitlines()
    titles = [line for line in lines if line[:1] not in ("", " ")]
    assert any(line.startswith("trunk.tilt_forward [°]  ") for line in titles)
    assert any(line == "left_insole.force [N]  –" for line in titles)
    assert any(0x2800 < ord(letter) <= 0x28FF for letter in "".join(lines))


def test_it_ends_in_time_and_says_so_where_nothing_comes_any_more(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        robot.frozen = True
        argv = ["plot", "trunk", "--terminal", "--seconds", "1.5", "--robot", robot.address]
        assert main(argv) == 0
    assert "nothing came in the last 1." in capsys.readouterr().out


def test_q_ends_it() -> None:
    with FakeRobot() as robot, Terminal("plot", "trunk", "--terminal", "--robot", robot.address) as terminal:
        terminal.read_until("trunk.tilt_side.*the last 10 s")
        terminal.press(b"q")
        terminal.read_until(None)
        assert terminal.program.wait(WAIT_S) == 0


def test_channels_of_the_robots_computer_are_asked_of_their_module() -> None:
    with FakeRobot() as robot:
        channels = ["resource.cpu_percent", "trunk.tilt_side"]
        assert main(["plot", *channels, "--terminal", "--seconds", "0.1", "--robot", robot.address]) == 0
        assert robot.called("stream.start")[0]["modules"] == ["component", "resource"]


def a_description(channel: ChannelInfo) -> Description:
    return Description(
        robot="exo-01",
        boot_id="b",
        role="observer",
        components=[],
        channels=[channel],
        parameters=[],
        modules={},
        clock=Clock(0, 0, "b"),
        stop=StopInfo(False, None, None, {}, {}),
        guard=GuardInfo(),
    )


def a_curve() -> Curves:
    channel = ChannelInfo("trunk.tilt_side", "N", "trunk", "tilt_side")
    return Curves(Channels(a_description(channel), degrees=True), 10.0)


def test_what_is_silent_has_no_newest_value_and_goes_out_of_sight(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr("server_gui.cli.plot.time.monotonic", lambda: now_s)
    curves = a_curve()
    curves.take(5.0, {"trunk.tilt_side": 7.0})
    assert curves.lines(40)[0] == "trunk.tilt_side [N]  7.0"
    now_s += 3.0
    title, *drawn, last = curves.lines(40)
    assert title == "trunk.tilt_side [N]  –"
    assert "nothing came in the last 3.0 s" in last
    assert all(line[-7:] == EMPTY * 7 for line in drawn)
    now_s += 10.0
    assert not any(ord(letter) > 0x2800 for letter in "".join(curves.lines(40)[1:-1]))


def test_another_boot_has_another_clock_and_begins_anew() -> None:
    curves = a_curve()
    curves.take(5000.0, {"trunk.tilt_side": 7.0})
    curves.take(3.0, {"trunk.tilt_side": 1.0})
    curves.take(4.0, {"trunk.tilt_side": 1.0})
    lines = curves.lines(40)
    assert lines[1].split()[0] == "1.001"
    assert any(ord(letter) > 0x2800 for letter in "".join(lines))


def test_curves_that_a_terminal_has_no_room_for_are_counted() -> None:
    lines = [f"line {number}" for number in range(12 * (ROWS + 1) + 1)]
    shown = fitted(lines, 23)
    assert shown[:-1] == lines[: 3 * (ROWS + 1)]
    assert shown[-1] == f"{lines[-1]}; 9 of 12 channels need a taller terminal"
    assert fitted(lines, 1) == [f"{lines[-1]}; 12 of 12 channels need a taller terminal"]
    assert fitted(lines, len(lines)) == lines


def test_a_channel_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        assert main(["plot", "left_nee.position", "--terminal", "--robot", robot.address]) == 1
    assert "did you mean left_knee.position" in capsys.readouterr().err
