"""What `gwrms predict --robot` shows: in an order that stays, on a terminal of 80 columns, nothing unsaid."""

import time
from datetime import UTC, datetime, timedelta

import pytest

from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from server_gui.core.prediction.live import Watched
from server_gui.core.prediction.news import Predicted
from server_gui.core.prediction.state import Quality, share
from server_gui.terminal.predictions import made, told
from tests.unit.ml.serving.small import learned
from tests.unit.prediction.robots import ROBOT, card

LABELS = {"falling": "near_fall", "gait_phase": "stride", "activity": "stand_to_sit"}
PHASES = {"left": 0.43, "right": 0.91}
QUALITY = Quality(123_456, 123_000, 0, 456, {}, seconds=2_469, recordings=12)


def watched(label_of_phase: str = "stride") -> Watched:
    found = Watched()
    for task, label in (LABELS | {"gait_phase": label_of_phase}).items():
        values = PHASES if task == "gait_phase" else {}
        said = Prediction(task, f"{task}-0123456789ab", 5, label, 0.9, 12.34, {label: 0.9}, values)
        model = card(learned(), task=task, id=f"{task}-0123456789ab")
        quality = None if task == "gait_phase" else QUALITY
        found.predictions.take(Predicted(ROBOT, said, model, Trust(), time.time_ns(), 30_000_000, quality))
    return found


def test_it_fits_a_terminal_of_80_columns_and_tasks_stay_in_order() -> None:
    lines = told(ROBOT, watched()).splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[0] for line in lines if "not yet known" in line] == [
        "activity",
        "gait_phase",
        "falling",
    ]
    assert "falling-0123456789ab     today  simulated" in lines
    assert lines[lines.index("by labels of the last 7 days:") + 1 :] == [
        f"{task}: 99.6 % right, 0.0 % wrong, 0.4 % not said of 41 min in 12 recordings"
        for task in ("activity", "falling")
    ]
    assert any("stride left 0.43 right 0.91" in line for line in lines)


@pytest.mark.parametrize("label", ["unknown", "abnormal"])
def test_a_model_that_says_nothing_has_no_phase_to_show(label: str) -> None:
    text = told(ROBOT, watched(label))
    assert f"gait_phase  {label}  " in text
    assert "0.43" not in text


@pytest.mark.parametrize(("hours", "words"), [(1, "today"), (25, "1 day ago"), (49, "2 days ago")])
def test_a_models_age_is_in_days(hours: float, words: str) -> None:
    assert made(card(learned(), made=datetime.now(UTC) - timedelta(hours=hours))) == words


@pytest.mark.parametrize(
    ("count", "of", "digits", "said"),
    [
        (9996, 10_000, 1, "99.9"),
        (10_000, 10_000, 1, "100.0"),
        (4, 10_000, 1, "0.1"),
        (0, 9, 1, "0.0"),
        (299, 300, 0, "99"),
    ],
)
def test_all_or_nothing_is_said_only_of_all_or_nothing(count: int, of: int, digits: int, said: str) -> None:
    assert share(count, of, digits) == said


def test_a_minute_in_two_recordings_is_just_enough() -> None:
    assert Quality(600, 600, 0, 0, {}, 60, 2).is_enough
    assert not Quality(600, 600, 0, 0, {}, 59, 2).is_enough
