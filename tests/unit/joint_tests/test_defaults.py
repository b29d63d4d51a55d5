"""A test as it is by default works: far from its own limits, and shown whole, as a page and as JSON."""

import math

import numpy as np
import pytest

from gateway.cli.joint_test import _parser, _wish
from gateway.joint_test.limits import LAG, MOST_SPEED
from gateway.joint_test.motion import JointTestKind, Wish
from gateway.main import main
from server_gui.core.joint_tests.comparing import ANALYSES, AnalysedTest, told
from tests.unit.hil_sim.bench import Bench
from tests.unit.joint_tests.truth import RATED_NM, recorded

TORQUE = ("--torque", "12")


def usual(kind: JointTestKind) -> Wish:
    typed = ["robot.toml:left_knee", *(TORQUE if kind.by_torque else ())]
    return _wish(kind, _parser(str(kind)).parse_args(typed))


@pytest.mark.parametrize("kind", JointTestKind)
def test_what_it_does_by_default_has_twice_the_room(kind: JointTestKind) -> None:
    wish = usual(kind)
    test = recorded(Bench(0.14), wish)
    room = wish.amplitude if kind.by_torque else LAG
    away = test["position"] - (test["position"][0] if kind.by_torque else test["target"])
    assert np.max(np.abs(test["torque"])) < RATED_NM / 1.8
    assert np.max(np.abs(test["velocity"])) < MOST_SPEED / 2
    assert np.max(np.abs(away)) < room / 2
    shown = told(AnalysedTest(test, ANALYSES[str(kind)](test)), None)
    values = [one["value"] for one in shown["measures"] if one["value"] is not None]
    assert len(values) >= 3
    assert all(type(one) is float and math.isfinite(one) for one in values)
    assert bool(shown["proposals"]) is kind.by_torque


@pytest.mark.parametrize("word", ["nan", "inf", "-inf", "0", "-1", "1e9", "one"])
@pytest.mark.parametrize("option", ["--amplitude", "--speed", "--max-speed", "--max-torque", "--late"])
def test_what_is_no_sensible_number_is_no_limit(
    option: str, word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["joint-test", "step", "robot.toml:left_knee", f"{option}={word}"])
    assert end.value.code == 2
    assert option in capsys.readouterr().err
