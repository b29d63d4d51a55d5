"""Sets and intervals where one subject is left out: each one's limit is by the others."""

import numpy as np
import pytest

from ml.benchmarks import coverage

SUBJECT = np.repeat(np.arange(12), 100)


def test_an_interval_of_a_subject_holds_what_the_others_keep_within() -> None:
    random = np.random.default_rng(1)
    spread = np.repeat(random.uniform(1.0, 2.0, 12), 100)
    spread[SUBJECT == 5] = 8.0
    covered, width = coverage.of_intervals(random.normal(size=len(SUBJECT)) * spread, SUBJECT)
    shares = np.array([covered[np.equal(SUBJECT, one)].mean() for one in range(12)])
    assert (shares >= 0.95).sum() == 11
    assert shares[5] < 0.7, "nobody else errs so much"
    assert width[SUBJECT == 5].max() < width[SUBJECT == 6].max(), "its own errors do not count for it"


def test_a_set_of_a_subject_is_as_wide_as_the_others_need() -> None:
    random = np.random.default_rng(2)
    truth = random.integers(0, 3, len(SUBJECT))
    scores = 4.0 * np.eye(3)[truth] + random.normal(size=(len(SUBJECT), 3))
    scores[SUBJECT == 3] = np.roll(scores[SUBJECT == 3], 1, axis=1)  # nothing of this one is right
    probabilities = np.exp(scores) / np.exp(scores).sum(axis=1, keepdims=True)
    covered, said = coverage.of_sets(probabilities, truth, SUBJECT)
    by_subject = {
        str(one): coverage.of_rows(
            covered, said, probabilities.argmax(axis=1) == truth, np.equal(SUBJECT, one)
        )
        for one in range(12)
    }
    assert by_subject["3"]["covered"] < 0.2
    assert by_subject["3"]["unknown_fraction"] < by_subject["4"]["unknown_fraction"] <= 0.2
    figures = coverage.figures(by_subject)
    assert figures["kept_fraction"] == pytest.approx(11 / 12)
    assert figures["worst_subject_covered"] == by_subject["3"]["covered"] < figures["covered"]


def test_of_nothing_said_nobody_knows_how_right_it_was() -> None:
    nothing = np.zeros(3, dtype=bool)
    found = coverage.of_rows(~nothing, nothing, nothing, ~nothing)
    assert (found["covered"], found["unknown_fraction"]) == (1.0, 1.0)
    assert np.isnan(found["said_accuracy"])
