"""Predictions: the same live, of many robots together and over a recording; the unknown is called so."""

import itertools
from dataclasses import replace

import numpy as np

from ml.robot.task import ABNORMAL, UNKNOWN
from ml.serving.predictor import Prediction, Window, Windows, judged, replayed
from tests.unit.ml.serving.small import MS, STEP_MS, Floats, hips, learned

EVERY_NS = 100 * MS


def stamps(rows: Floats, begin_ns: int = 7 * MS) -> list[int]:
    return [begin_ns + at * STEP_MS * MS for at in range(len(rows))]


def windows(rows: Floats, begin_ns: int = 7 * MS) -> list[Window]:
    found = Windows(learned().recipe, EVERY_NS)
    one_by_one = ([row] for row in zip(stamps(rows, begin_ns), rows.tolist(), strict=True))
    return list(itertools.chain.from_iterable(map(found.push, one_by_one)))


def live(rows: Floats) -> list[Prediction]:
    return [one for window in windows(rows) for one in judged("m", learned(), [window])]


def over(rows: Floats, begin_ns: int = 7 * MS) -> list[Prediction]:
    return replayed("m", learned(), np.array(stamps(rows, begin_ns)), rows, EVERY_NS)


WALK = np.concatenate([hips(4, walks=False), hips(5, walks=True, begin_s=4)])


def test_standing_and_walking_are_told_apart_at_every_multiple_of_the_time_between_decisions() -> None:
    found = live(WALK)
    assert [one.stamp_ns for one in found] == list(range(found[0].stamp_ns, found[-1].stamp_ns + 1, EVERY_NS))
    assert {one.stamp_ns % EVERY_NS for one in found} == {0}
    assert {one.label for one in found if one.stamp_ns < 4_000 * MS} == {"stand"}
    assert {one.label for one in found if one.stamp_ns > 6_500 * MS} == {"walk"}
    assert all(abs(sum(one.probabilities.values()) - 1) < 1e-9 for one in found)
    assert all(one.probability == max(one.probabilities.values()) for one in found)


def test_a_recording_gives_exactly_what_was_said_live() -> None:
    assert over(WALK) == live(WALK)


def test_robots_judged_together_get_what_each_gets_alone() -> None:
    robots = [hips(3, walks=robot % 2 == 0, seed=robot) for robot in range(5)]
    due = [windows(robot, begin_ns=number * MS) for number, robot in enumerate(robots)]
    together = judged("m", learned(), list(itertools.chain.from_iterable(due)))
    alone = [over(robot, begin_ns=number * MS) for number, robot in enumerate(robots)]
    assert together == list(itertools.chain.from_iterable(alone))


def test_nothing_is_decided_before_a_whole_window_has_been_seen_and_again_after_a_gap() -> None:
    look_back_ms = round(1000 * learned().recipe.look_back / learned().recipe.rate_hz)
    assert not live(hips((look_back_ms - 40) / 1000, walks=True))
    rows = hips(9, walks=True)
    rows[400:420, 1] = np.nan  # of 200 ms: longer than a value may be held
    found = live(rows)
    assert found == over(rows)
    points = np.array([one.stamp_ns for one in found])
    after = points[points > 4_300 * MS]
    assert not ((points > 4_150 * MS) & (points < 4_200 * MS + look_back_ms * MS)).any()
    assert after[0] - 4_200 * MS >= (look_back_ms - 20) * MS


def test_what_is_like_nothing_learned_from_is_abnormal() -> None:
    rows = np.random.default_rng(5).normal(0, 2.0, (600, 2))
    assert {one.label for one in live(rows)} == {ABNORMAL}
    assert all(one.novelty >= 1 for one in live(rows))


def test_a_model_that_abstains_says_which_classes_it_may_be() -> None:
    unsure = replace(learned(), numbers=learned().numbers | {"threshold": 1.5})
    found = judged("m", unsure, windows(hips(9, walks=True)))
    assert {one.label for one in found} == {UNKNOWN}
    for one in found:
        assert one.either == tuple(sorted(one.probabilities, key=lambda name: -one.probabilities[name]))
    assert not any(one.either for one in live(hips(9, walks=True)) if one.label != UNKNOWN)


def test_of_nothing_nothing_is_said() -> None:
    assert not judged("m", learned(), [])
    assert not over(hips(0.5, walks=True))
