"""`gwrms plot`: curves of braille letters, with holes where nothing was."""

import math

import pytest

from gateway.main import main
from server_gui.terminal.braille import BLANK, draw, extent
from tests.fake_robot import FakeRobot

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


@pytest.mark.parametrize("values", [[], [3.0, 3.0], [-1e-9], [1e9, 1e9 + 1], [0.0, 12.3]])
def test_the_scale_is_never_nothing_and_holds_what_is_drawn(values: list[float]) -> None:
    low, high = extent([(0.0, value) for value in values])
    assert low < high
    assert all(low <= value <= high for value in values)


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


def test_a_channel_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with FakeRobot() as robot:
        assert main(["plot", "left_nee.position", "--terminal", "--robot", robot.address]) == 1
    assert "did you mean left_knee.position" in capsys.readouterr().err
