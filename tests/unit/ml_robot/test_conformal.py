"""Conformal sets: new wearers are covered as promised, few promise little, and a model still speaks."""

import numpy as np
import numpy.typing as npt
import pytest

from ml.robot import conformal
from ml.robot.conformal import COVERED, LEAST_SURE, MOST_ABSTAINED, WEARERS, Promise, passed_over, promised

Floats = npt.NDArray[np.float64]
Decisions = tuple[Floats, npt.NDArray[np.int_]]
DECISIONS = 100


def of_wearer(random: np.random.Generator) -> Decisions:
    """What a model says of one wearer, whom it knows well or badly: of three classes; and the truth."""
    truth = random.integers(0, 3, DECISIONS)
    scores = random.normal(size=(DECISIONS, 3)) + random.uniform(1.0, 6.0) * np.eye(3)[truth]
    powers = np.exp(scores)
    return powers / powers.sum(axis=1, keepdims=True), truth


def promise_of(people: list[Decisions]) -> Promise:
    probabilities, truth = (np.concatenate(column) for column in zip(*people, strict=True))
    group = np.repeat(np.arange(len(people)), DECISIONS)
    return promised(passed_over(probabilities, truth), probabilities.max(axis=1), group)


def covered(promise: Promise, wearer: Decisions) -> float:
    probabilities, truth = wearer
    sets = conformal.together(probabilities, promise.threshold)
    return float(sets[np.arange(len(truth)), truth].mean())


def test_so_many_new_wearers_are_covered_as_is_promised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conformal, "MOST_ABSTAINED", 0.999)
    random = np.random.default_rng(9)
    kept, draws, people = 0, 80, 9
    for _ in range(draws):
        promise = promise_of([of_wearer(random) for _ in range(people)])
        assert promise.covered >= COVERED
        assert promise.wearers == WEARERS
        kept += covered(promise, of_wearer(random)) >= COVERED
    assert kept / draws >= promise.wearers - 3.0 * np.sqrt(promise.wearers * (1 - promise.wearers) / draws)
    assert kept / draws < 1.0, "a promise that is never broken says too little"


def test_where_too_much_would_be_left_unsaid_less_is_promised() -> None:
    random = np.random.default_rng(3)
    probabilities, truth = of_wearer(random)
    strange = probabilities, (truth + 1) % 3  # somebody of whom nearly all is wrong, and said without doubt
    others = [of_wearer(random) for _ in range(9)]
    promise = promise_of([*others, strange])
    said = np.concatenate([each.max(axis=1) for each, _ in (*others, strange)]) >= promise.threshold
    assert said.mean() >= 1.0 - MOST_ABSTAINED
    assert promise.covered == pytest.approx(covered(promise, strange))
    assert promise.covered < 0.5
    assert promise_of(others).covered > promise.covered


def test_what_is_as_likely_wrong_as_right_is_never_said() -> None:
    certain = np.tile([0.9, 0.1, 0.0], (DECISIONS, 1)), np.zeros(DECISIONS, dtype=np.int_)
    assert promise_of([certain, certain]) == Promise(LEAST_SURE, 1.0, 2 / 3)


def test_a_set_holds_the_likeliest_until_they_reach_the_threshold() -> None:
    probabilities = np.array([[0.2, 0.7, 0.1], [0.4, 0.35, 0.25], [0.5, 0.5, 0.0]])
    sets = conformal.together(probabilities, 0.7)
    assert sets.tolist() == [[False, True, False], [True, True, False], [True, True, False]]
    assert passed_over(probabilities, np.array([0, 2, 2])).tolist() == pytest.approx([0.7, 0.75, 1.0])
