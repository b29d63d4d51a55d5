"""What labels say of an instant: who is trusted, who contradicts whom, and where in its stride a leg is."""

import numpy as np
import pytest

from ml.robot.task import TASKS
from ml.store.labels import ACTIVITIES, LabelSource
from ml.training.truth import NOBODY, LabelSpan, activities, phases

S = 10**9


def said(begin: float, end: float, label: str, source: LabelSource = LabelSource.PERSON) -> LabelSpan:
    return LabelSpan(round(begin * S), round(end * S), label, source)


def at(*seconds: float) -> np.ndarray:
    return np.array([round(second * S) for second in seconds], np.int64)


def test_a_label_holds_from_its_beginning_up_to_its_end() -> None:
    names, sources = activities([said(1, 2, "walk")], at(0.9, 1, 1.5, 2))
    assert names.tolist() == [NOBODY, "walk", "walk", NOBODY]
    assert sources.tolist() == [NOBODY, "person", "person", NOBODY]


def test_the_most_trusted_says_what_is_so() -> None:
    told = [
        said(0, 4, "sit", LabelSource.PSEUDO),
        said(0, 3, "stand", LabelSource.SIMULATOR),
        said(0, 2, "walk", LabelSource.PERSON),
    ]
    names, sources = activities(told, at(1, 2.5, 3.5))
    assert names.tolist() == ["walk", "stand", "sit"]
    assert sources.tolist() == ["person", "simulator", "pseudo"]


def test_where_two_differ_nobody_knows_not_even_a_less_trusted_one() -> None:
    told = [said(0, 3, "walk"), said(2, 4, "turn_left"), said(0, 4, "walk", LabelSource.SIMULATOR)]
    names, _ = activities(told, at(1, 2.5, 3.5))
    assert names.tolist() == ["walk", NOBODY, "turn_left"]


def test_other_words_and_instants_say_nothing_of_what_is_done() -> None:
    names, _ = activities([said(0, 4, "new insoles"), said(1, 1, "left_heel_strike")], at(1, 2))
    assert names.tolist() == [NOBODY, NOBODY]


def test_a_phase_goes_evenly_from_strike_to_strike() -> None:
    strikes = [said(t, t, "left_heel_strike") for t in (0, 1, 2)]
    strikes += [said(t, t, "right_heel_strike") for t in (0.5, 1.5, 2.5)]
    found, sources = phases(strikes, at(0.25, 0.75, 1.0, 1.6, 2.2))
    np.testing.assert_allclose(found[1:4], [[0.75, 0.25], [0.0, 0.5], [0.6, 0.1]])
    assert sources.tolist() == [NOBODY, "person", "person", "person", NOBODY]  # where both are known


@pytest.mark.parametrize("length_s", [0.4, 2.6])
def test_what_is_no_stride_has_no_phase(length_s: float) -> None:
    strikes = [said(t, t, f"{leg}_heel_strike") for leg in ("left", "right") for t in (0, length_s)]
    found, _ = phases(strikes, at(0.2))
    assert np.isnan(found).all()


def test_of_each_leg_one_source_alone_tells_the_strikes() -> None:
    right = [said(t, t, "right_heel_strike") for t in (0, 1, 2)]
    left = [said(t, t, "left_heel_strike", LabelSource.SIMULATOR) for t in (0, 1, 2)]
    seen = [said(t + 0.5, t + 0.5, "left_heel_strike", LabelSource.SENSORS) for t in (0, 1)]
    found, sources = phases([*right, *left, *seen], at(0.5, 1.25))
    np.testing.assert_allclose(found, [[0.5, 0.5], [0.25, 0.25]])
    assert set(sources) == {"simulator"}  # no better than the less trusted of both legs


def test_standing_and_sitting_are_known_not_to_step_and_falling_has_no_phase() -> None:
    strikes = [said(t, t, f"{leg}_heel_strike") for leg in ("left", "right") for t in (0, 1, 2)]
    told = [said(0.5, 1, "fall"), said(5, 6, "stand"), said(6, 7, "walk")]
    found, sources = phases([*strikes, *told], at(0.25, 0.75, 5.5, 6.5))
    assert sources.tolist() == ["person", NOBODY, "person", NOBODY]
    assert np.isnan(found[2]).all()


def test_every_label_that_a_task_learns_from_can_be_given() -> None:
    for task in TASKS.values():
        assert set(task.fold) <= set(ACTIVITIES)
