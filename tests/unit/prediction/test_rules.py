"""Rules on predictions: they begin after their time, hold with hysteresis, and act once."""

import dataclasses
from collections.abc import Iterable

import numpy as np
import pytest
from msgspec.structs import replace

from ml.registry.registry import Registry
from ml.robot.task import ABNORMAL, TASKS, UNKNOWN
from ml.serving.predictor import Prediction
from server_gui.core.prediction import robot_predictor
from server_gui.core.prediction.rules import PredictionRule
from server_gui.core.settings.prediction import EVERY_MS, Action, RuleSettings
from tests.unit.ml.serving.small import MS, hips
from tests.unit.prediction.robots import (
    ROBOT,
    predicting,
    promoters,
    publish,
    served,
    settings,
    signature,
    telemetry,
)

NEAR_FALL = RuleSettings("falling", "near_fall", at_least=0.9, for_ms=60, release=0.5)
EVERY_MS_HERE = 40


def said(at_ms: int, probability: float, label: str = "near_fall") -> Prediction:
    probabilities = {"near_fall": probability, "steady": 1 - probability}
    return Prediction("falling", "m", at_ms * MS, label, max(probabilities.values()), 0.1, probabilities)


def told(rule: RuleSettings, found: Iterable[Prediction]) -> list[tuple[int, bool]]:
    """When it began (True) and ended."""
    one = PredictionRule(rule, EVERY_MS_HERE * MS)
    changes = [(prediction.stamp_ns // MS, one.take(prediction)) for prediction in found]
    return [(at, change) for at, change in changes if change is not None]


def every(*probabilities: float) -> list[Prediction]:
    return [said(EVERY_MS_HERE * at, one) for at, one in enumerate(probabilities)]


def test_it_begins_when_the_label_was_probable_for_long_enough_and_not_before() -> None:
    assert told(NEAR_FALL, every(0.95, 0.91, 0.9, 0.95)) == [(80, True)]
    assert not told(NEAR_FALL, every(0.95, 0.91, 0.89, 0.95, 0.95))


def test_it_holds_until_the_label_is_less_probable_than_its_release() -> None:
    assert told(NEAR_FALL, every(1, 1, 1, 0.6, 0.5, 0.95, 0.49, 0.95)) == [(80, True), (240, False)]


def test_it_acts_at_once_where_no_time_is_asked() -> None:
    assert told(replace(NEAR_FALL, for_ms=0), every(0.2, 0.95)) == [(40, True)]


def test_a_hole_in_the_predictions_is_no_time_in_which_it_was_so() -> None:
    assert told(NEAR_FALL, [said(0, 1), said(40, 1), said(400, 1), said(440, 1)]) == []


def test_what_is_abnormal_is_no_label_of_the_model_but_one_of_rules() -> None:
    strange = [dataclasses.replace(one, label=ABNORMAL, novelty=2.0) for one in every(1, 1, 1, 1)]
    assert not told(NEAR_FALL, strange)
    assert told(RuleSettings("falling", ABNORMAL, 1.0), strange) == [(0, True)]


def test_a_probability_counts_also_where_the_model_abstains() -> None:
    assert told(NEAR_FALL, [dataclasses.replace(one, label=UNKNOWN) for one in every(1, 1, 1)]) == [
        (80, True)
    ]


def test_every_task_has_a_time_between_decisions() -> None:
    assert EVERY_MS.keys() == TASKS.keys()


def test_a_rule_stops_its_robot_once_and_before_anything_is_told(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_predictor, "LATE_NS", 3_600_000 * MS)
    publish(folder_url, by="anna")
    walking = RuleSettings("activity", "walk", 0.9, for_ms=300, robot="exo-*", action=Action.STOP)
    alarm = RuleSettings("activity", "stand", 0.9)
    known = replace(settings(folder_url, walking, alarm), promoters=promoters("anna"))
    with predicting(known) as (one, heard):
        for robot in (ROBOT, "other"):
            served(one, heard, robot)
            for event in telemetry(np.concatenate([hips(4, walks=False), hips(4, walks=True, begin_s=4)])):
                one.take(robot, event)
        heard.until(lambda: heard.stops and len(heard.ruled()) == 5)
    (stop,) = heard.stops
    assert (stop.robot, stop.rule, stop.began) == (ROBOT, walking, True)
    assert "rule activity walk ≥ 0.9 for 300 ms (stop) holds: walk" in stop.text
    assert heard.order.index("stop") < heard.order.index(stop)
    here = [(ruled.rule.label, ruled.began) for ruled in heard.ruled() if ruled.robot == ROBOT]
    assert here == [("stand", True), ("stand", False), ("walk", True)]
    assert [ruled.began for ruled in heard.ruled() if ruled.robot == "other"] == [True, False]


@pytest.mark.parametrize(
    ("by", "why"), [(None, "is unsigned: tester had no key"), ("ben", "which is none of [promoters]")]
)
def test_a_rule_stops_no_robot_by_a_model_of_somebody_who_has_no_right_to(
    folder_url: str, monkeypatch: pytest.MonkeyPatch, by: str | None, why: str
) -> None:
    """It is said before anything happens, and when it does; the model serves for display all the same."""
    monkeypatch.setattr(robot_predictor, "LATE_NS", 3_600_000 * MS)
    publish(folder_url, by=by)
    walking = RuleSettings("activity", "walk", 0.9, for_ms=300, action=Action.STOP)
    known = replace(settings(folder_url, walking), promoters=promoters("anna"))
    with predicting(known) as (one, heard):
        served(one, heard, ROBOT)
        (problem,) = one.state.problems
        for event in telemetry(hips(4, walks=True)):
            one.take(ROBOT, event)
        heard.until(heard.ruled)
    assert problem.startswith(f"{ROBOT}: rule {walking.name} CANNOT STOP IT: ")
    assert why in problem
    (ruled,) = heard.ruled()
    assert f"NOT STOPPED, {ruled.objection}" in ruled.text
    assert heard.stops == []


def test_a_model_that_serves_unsigned_is_signed_by_promoting_it_again(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = publish(folder_url)
    walking = RuleSettings("activity", "walk", 0.9, action=Action.STOP)
    known = replace(settings(folder_url, walking), promoters=promoters("anna"))
    with predicting(known) as (one, heard):
        served(one, heard, ROBOT)
        assert one.state.problems
        Registry(folder_url, sign=signature("anna")).promote(name, who="anna", why="it is good")
        heard.until(lambda: not one.state.problems)
