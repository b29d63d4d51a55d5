"""Trust: a robot unlike what its model has learned from is noticed, and so is a model that knows little."""

import dataclasses

import numpy as np
import pytest

from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.predictor import Prediction
from ml.serving.trust import SECOND_NS, WITHIN_S, Trust, Trusting, TrustLevel

RANGES = {"left_hip.position": (-0.5, 0.8)}
CHANNELS = ("left_hip.position", "right_hip.position")
SAID = Prediction("activity", "m", 0, "walk", 0.9, 0.25, {"walk": 0.9, "stand": 0.1})


def trust(*stretches: tuple[int, str, float]) -> Trust:
    """After so many seconds, each, of a label and a position of the left hip, ten times a second."""
    trusting = Trusting(CHANNELS, RANGES)
    seconds = [(label, hip) for count, label, hip in stretches for _ in range(count)]
    for second, (label, hip) in enumerate([*seconds, seconds[-1]]):
        for tenth in range(10):
            said = dataclasses.replace(
                SAID, label=label, stamp_ns=second * SECOND_NS + tenth * SECOND_NS // 10
            )
            trusting.take([said], [np.array([hip, 99.0])])
    return trusting.trust


def test_at_first_nobody_knows() -> None:
    assert Trusting(CHANNELS, RANGES).trust.level is TrustLevel.UNSEEN
    assert trust((1, "walk", 0.0)).level is TrustLevel.UNSEEN


def test_what_is_as_in_learning_is_good() -> None:
    found = trust((5, "walk", 0.0))
    assert found == Trust(decisions=50, novelty=0.25)
    assert found.level is TrustLevel.GOOD


@pytest.mark.parametrize(("label", "level"), [(UNKNOWN, TrustLevel.UNSURE), (ABNORMAL, TrustLevel.DRIFTED)])
def test_a_model_that_does_not_know_its_way_is_not_believed(label: str, level: TrustLevel) -> None:
    assert trust((10, "walk", 0.0), (20, label, 0.0)).level is level


def test_a_channel_that_leaves_its_range_is_named() -> None:
    found = trust((20, "walk", 0.0), (10, "walk", 0.9))
    assert found.outside == {"left_hip.position": pytest.approx(1 / 3)}
    assert found.drifted == ("left_hip.position",)
    assert found.level is TrustLevel.DRIFTED


def test_a_channel_of_which_no_range_is_known_is_not_judged() -> None:
    assert "right_hip.position" not in trust((10, "walk", 0.9)).outside


def test_what_was_a_minute_ago_counts_no_more() -> None:
    assert trust((30, ABNORMAL, 2.0), (WITHIN_S, "walk", 0.0)).level is TrustLevel.GOOD
