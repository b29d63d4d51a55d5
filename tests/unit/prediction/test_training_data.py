"""A walk is learned from with hindsight, and what was learned is tried beside the general model, honestly."""

from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from ml.serving.predictor import Windows
from ml.training.adapted_comparison import beside
from server_gui.core.follow.events import Telemetry
from server_gui.core.prediction.adaptation import LEARNED_S, TRIED_S
from server_gui.core.prediction.phase_truth import PhaseTruth
from server_gui.core.prediction.robot_predictor import _rows
from server_gui.core.prediction.training_data import TrainingData, learn, tried
from tests.unit.prediction import walkers
from tests.unit.prediction.walkers import CHANNELS, MS, STEP_MS, events, walk

EVERY_NS = 60 * MS
LATE = 0.08  # of the stride: how this wearer's hips swing, against those that the model knows


@pytest.fixture(autouse=True)
def one_core() -> Iterator[None]:
    """As in the thread that learns."""
    with threadpool_limits(1):
        yield


def taught(lesson: TrainingData, windows: Windows, feed: Iterator[Telemetry], until_s: float) -> None:
    for event in feed:
        lesson.ask(windows.push(_rows(event.batch, lesson.base.learned.recipe.channels)))
        lesson.see(event.batch)
        if lesson.stepped_s >= until_s:
            return
    raise AssertionError(f"{lesson.stepped_s} s of steps were found")


def test_a_minute_of_a_wearer_s_steps_makes_the_later_ones_less_wrong() -> None:
    base = walkers.model()
    before = [weights.copy() for weights in base.learned.parts["network"].coefs_]
    lesson, windows = TrainingData(base, EVERY_NS), Windows(base.learned.recipe, EVERY_NS)
    feed = events(100.0, LATE)
    taught(lesson, windows, feed, LEARNED_S)
    learned_ns = lesson.rows[-1].stamp_ns
    adapted = learn(base, "exo-01", "P01", lesson.rows, lambda: None)
    lesson.turn_page()
    taught(lesson, windows, feed, TRIED_S)
    assert lesson.rows[0].stamp_ns - learned_ns >= 2_000 * MS, "no window looks back on what was learned"
    found, is_better = tried(base, adapted, lesson.rows)
    assert is_better
    assert found.after < 0.5 * found.before
    assert adapted.objection is not None
    assert (adapted.learned_from, adapted.card.parent, adapted.card.robot) == ("P01", base.card.id, "exo-01")
    assert "P01" not in adapted.card.id
    after = base.learned.parts["network"].coefs_
    assert all(np.array_equal(one, other) for one, other in zip(before, after, strict=True)), "a copy learns"


def test_the_truth_with_hindsight_is_that_of_the_walk() -> None:
    known = PhaseTruth()
    rows, phase = walk(12.0, LATE)
    for event in events(12.0, LATE):
        known.take(event.batch)
    apart = []
    for at in range(len(rows) // 2, len(rows) - 100):
        instant = known.at(at * STEP_MS * MS)
        if instant is not None:
            apart.append(np.abs(([instant.left, instant.right] - phase[at] + 0.5) % 1.0 - 0.5).max())
    assert len(apart) > 100
    assert max(apart) < 0.05


@pytest.mark.parametrize("foot", ["left", "right"])
def test_strides_of_a_strike_that_was_missed_tell_nothing(foot: str) -> None:
    """Of a foot whose insole tells nothing for two seconds nobody knows the phase there."""
    known = PhaseTruth()
    hole = range(8_000, 10_000)
    for event in events(16.0, LATE):
        if event.batch.stamps_ns[0] // MS in hole:
            event.batch.columns[f"{foot}_insole.force"] = [None] * len(event.batch.stamps_ns)
        known.take(event.batch)
    there = [known.at(ms * MS) is not None for ms in range(8_000, 10_000, STEP_MS)]
    assert sum(there) < 0.2 * len(there)
    assert known.at(14_000 * MS) is not None


def test_standing_is_not_learned_from() -> None:
    known = PhaseTruth()
    still: list[float | None] = [700.0] * 5
    for event in events(8.0, 0.0):
        event.batch.columns.update(dict.fromkeys(CHANNELS[2:], still))
        known.take(event.batch)
    assert not any(known.at(ms * MS) for ms in range(0, 8_000, 100))


def test_what_is_no_better_is_not_offered() -> None:
    """The same model beside itself; and one that is better by less than the margin."""
    base = walkers.model().learned
    rows = np.random.default_rng(0).normal(size=(200, len(base.parts["scale"].mean_))).astype(np.float32)
    truth = np.random.default_rng(1).random((200, 2))
    found = beside(base, base, rows, truth, np.arange(200) // 10)
    assert found.left == pytest.approx(1.0)
    assert (found.before, found.is_better) == (found.after, False)
