"""What the window knows of predictions: the newest of each task, how old it is, or why there is none."""

import time

import pytest

from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from server_gui.core.prediction.newest_predictions import NOT_YET, OFF, STALE_S, StationPredictions
from server_gui.core.prediction.news import Predicted, Ruled, Serves
from server_gui.core.settings.prediction import RuleSettings
from tests.unit.ml.serving.small import learned
from tests.unit.prediction.robots import ROBOT, card

RULE = RuleSettings("activity", "walk", 0.9)


@pytest.fixture(scope="module")
def predicted() -> Predicted:
    said = Prediction("activity", "activity-1", 5, "walk", 0.9, 0.2, {"walk": 0.9, "stand": 0.1})
    return Predicted(ROBOT, said, card(learned()), Trust(), time.time_ns(), took_ns=30_000_000)


def test_the_newest_of_a_task_is_there_with_its_age(predicted: Predicted) -> None:
    known = StationPredictions()
    known.take(predicted)
    shown = known.by_task["activity"]
    assert shown.predicted is predicted
    assert shown.age_s(shown.came_ns + 10_000_000) == pytest.approx(0.040)
    assert not shown.is_stale(shown.came_ns)
    assert shown.is_stale(shown.came_ns + round(STALE_S * 1e9))
    assert known.problem == ""


def test_rules_that_hold_are_there_until_they_are_over(predicted: Predicted) -> None:
    known = StationPredictions()
    known.take(Ruled(ROBOT, RULE, True, predicted))
    assert [ruled.rule for ruled in known.rules] == [RULE]
    known.take(Ruled(ROBOT, RULE, False, predicted))
    assert known.rules == ()


def test_where_nothing_is_predicted_it_says_why(predicted: Predicted) -> None:
    assert StationPredictions(off=True).problem == OFF
    known = StationPredictions()
    assert known.problem == NOT_YET
    known.take(Serves(ROBOT, {}, {"activity": "no model serves activity"}))
    assert known.problem == "no model serves activity"
    known.take(predicted)
    assert known.problem == ""
    known.take(Serves(ROBOT, {}, {"activity": "the model broke"}))
    assert (known.problem, known.by_task) == ("the model broke", {})


def test_with_the_link_goes_what_was_known(predicted: Predicted) -> None:
    known = StationPredictions()
    known.take(predicted)
    known.take(Ruled(ROBOT, RULE, True, predicted))
    before = known.revision
    known.clear()
    assert not known.by_task
    assert not known.rules
    assert known.revision > before
