"""`gwrms ab` and `gwrms sweep` where nothing can begin: why is said in a line, and nothing is written."""

import pytest

from server_gui.cli.experiments import ab_main
from tests.unit.cli.served import VELOCITY, Served

NAME = "left_knee.profile_velocity"
AB = [
    ([NAME, "65000", "1e9"], "above the largest allowed"),
    ([NAME, "65000", "-1e-3"], "below the smallest allowed, "),
    ([NAME, "65000", "-3e4"], "below the smallest allowed, "),
    ([NAME, "65000", "65000"], "nothing could differ"),
    ([NAME, "65000", "nan"], "'nan' is no number, with a unit or without, as in 0.42 or 3deg"),
    ([NAME, "65000", "2Nm"], "cannot be in 'Nm'"),
    ([NAME, "65000", "65100", "--seconds", "999"], "held for 2 to 240 s"),
    (["left_knee.profile_speed", "1", "2"], "did you mean left_knee.profile_velocity"),
    (["left_knee.producer_heartbeat_time", "100", "200"], "communication"),
]
SWEEPS = [
    (["65000", "66000", "0"], "STEP more than 0"),
    (["66000", "65000", "100"], "FROM less than TO"),
    (["65000", "66000", "1e-9"], "of at most 40: take a larger STEP"),
]


def test_what_cannot_be_is_said_in_a_line_and_nothing_is_written(
    robot: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    held = robot.left(VELOCITY)
    for words, said in [
        *((["ab", *words], said) for words, said in AB),
        *((["sweep", NAME, *words], said) for words, said in SWEEPS),
    ]:
        assert robot.run(*words) == 1
        told = capsys.readouterr()
        assert said in told.err, words
        assert (told.out, told.err.count("\n")) == ("", 1)
    assert robot.left(VELOCITY) == held


@pytest.mark.parametrize("words", [["--pairs", "9" * 50], ["--pairs", "-1"], ["--cycles", "1e3"]])
def test_a_number_of_nothing_that_can_be_is_a_wrong_usage(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        ab_main([NAME, "1", "2", *words])
    assert "is no whole number from" in capsys.readouterr().err
