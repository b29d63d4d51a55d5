"""Splits that never leak, and figures against values by hand."""

import numpy as np
import pytest

from ml.benchmarks import folds, ipol, metrics
from ml.benchmarks.outcome import Goal
from ml.benchmarks.search import chosen, told
from ml.benchmarks.strides import heel_strikes
from tests.unit.ml import recordings

PEOPLE = np.array([1, 1, 2, 2, 2, 3, 4, 4, 5])


@pytest.mark.parametrize("split", [folds.one_left_out, lambda groups: folds.grouped(groups, 3)])
def test_nobody_is_on_both_sides_and_everybody_is_judged_once(split: object) -> None:
    judged = []
    for train, held_out in split(PEOPLE):  # type: ignore[operator]
        assert not set(PEOPLE[train]) & set(PEOPLE[held_out])
        assert len(train) + len(held_out) == len(PEOPLE)
        judged += held_out.tolist()
    assert sorted(judged) == list(range(len(PEOPLE)))


def test_there_are_no_more_folds_than_people() -> None:
    assert len(list(folds.grouped(np.array(["a", "b", "a"]), 5))) == 2


def test_windows_that_share_a_row_through_others_belong_together() -> None:
    rows = np.arange(14.0).reshape(7, 2)
    windows = np.stack([rows[[0, 1]], rows[[1, 2]], rows[[2, 3]], rows[[4, 5]], rows[[6, 5]]])
    first, second, third, fourth, fifth = folds.sharing(windows).tolist()
    assert first == second == third
    assert fourth == fifth != first


def test_folds_come_back_in_their_order_and_pass_errors_on() -> None:
    assert folds.over(lambda number: number * 2, [3, 1, 2]) == [6, 2, 4]
    with pytest.raises(ZeroDivisionError):
        folds.over(lambda number: 1 / number, [1, 0])


def test_a_search_sees_whole_training_groups_only_and_takes_the_best() -> None:
    seen = []

    def score(settings: int, train: folds.Rows, judge: folds.Rows) -> float:
        assert not set(PEOPLE[train]) & set(PEOPLE[judge])
        seen.append(settings)
        return -abs(settings - 7)

    assert chosen(5, (5, 7, 9), PEOPLE, True, score) == 7
    assert seen == [5] * 3 + [7] * 3 + [9] * 3
    assert chosen(5, (5, 7, 9), PEOPLE, False, score) == 5
    assert len(seen) == 9
    assert told([7, 7, 9], True) == "searched: 7 in 2 of 3 folds; 9 in 1 of 3 folds"
    assert told([5, 5], False) == "fixed: 5"


def test_f1_by_hand() -> None:
    truth, predicted = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 0, 1, 1, 0, 0])
    counts = metrics.confusion(truth, predicted, 4)
    assert counts.tolist() == [[2, 1, 0, 0], [1, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0]]
    f1 = metrics.f1_by_class(counts)
    assert f1[:3].tolist() == [pytest.approx(4 / 7), pytest.approx(0.5), 0.0]
    assert np.isnan(f1[3])
    assert metrics.macro_f1(truth, predicted, 4) == pytest.approx((4 / 7 + 0.5) / 3)
    assert metrics.accuracy(truth, predicted) == 0.5


def test_phase_errors_go_the_shorter_way_round() -> None:
    errors = metrics.circular_error(np.array([0.95, 0.05, 0.5, 0.3]), np.array([0.05, 0.95, 0.25, 0.3]))
    assert errors == pytest.approx([-0.1, 0.1, 0.25, 0.0])
    assert metrics.rms(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5))


def test_phase_is_zero_at_heel_strike_and_only_within_strides() -> None:
    strikes = np.array([10, 110, 160, 400])  # a stride of 1 s, one of 0.5 s and one of 2.4 s
    phase = ipol.phase(strikes, 450)
    assert phase[[10, 35, 109]] == pytest.approx([0.0, 0.25, 0.99])
    assert np.isnan(phase[:10]).all()
    assert np.isnan(phase[110:]).all()
    in_air = np.zeros(20, dtype=bool)
    in_air[[3, 4, 5, 9]] = True
    assert ipol.strikes(in_air).tolist() == [6, 10]


def test_heel_strikes_are_found_in_a_foots_own_signal() -> None:
    samples, _, left, _ = recordings.trial(8.0, 1.0, np.random.default_rng(0))
    found, labelled = heel_strikes(samples[:, 10]), ipol.strikes(left)
    near = np.abs(found[:, None] - labelled).min(axis=1)
    assert len(found) >= 8
    assert np.median(near) <= 4


def test_goals_know_which_way_is_better() -> None:
    assert Goal(0.9).reached(0.9)
    assert not Goal(0.9).reached(float("nan"))
    assert Goal(5.0, at_most=True).reached(4.0)
    assert not Goal(5.0, at_most=True).reached(5.1)
    assert [str(Goal(0.9)), str(Goal(5.0, at_most=True))] == ["≥ 0.9", "≤ 5"]
