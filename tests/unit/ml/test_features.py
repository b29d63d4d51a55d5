"""Features: causal, and bit for bit the same in a batch, alone and live."""

import numpy as np
import numpy.typing as npt
import pytest

from ml.features import FeatureStream, Recipe, features
from ml.features.blocks import bins, falls, moments, since
from ml.features.falling import FALLING, moving
from ml.features.gait_context import GAIT_CONTEXT
from ml.features.gait_events import LEFT_EVENTS, RIGHT_EVENTS
from ml.features.gait_phase import LEFT_PHASE, RIGHT_PHASE, SWAPPED, mirrored
from ml.features.gait_status import GAIT_STATUS
from ml.features.gaps import mended
from ml.features.signals import along, length, up
from ml.features.terrain import TERRAIN
from ml.features.terrain import mirrored as other_side
from tests.unit.ml import plain_falling, recordings

RECIPES = (GAIT_STATUS, GAIT_CONTEXT, LEFT_PHASE, RIGHT_PHASE, LEFT_EVENTS, RIGHT_EVENTS, FALLING, TERRAIN)
Samples = npt.NDArray[np.float64]


def walk(recipe: Recipe, rows: int) -> Samples:
    """Something that moves in every channel, around a gravity that is somewhere."""
    random = np.random.default_rng(3)
    shape = (rows, len(recipe.channels))
    return random.normal(0, 3, (1, shape[1])) + random.normal(0, 1, shape).cumsum(axis=0) * 0.1


def test_quick_features_of_a_fall_have_the_bits_of_plain_ones() -> None:
    random = np.random.default_rng(7)
    windows = 3.0 + random.normal(size=(60, 6, FALLING.look_back)).cumsum(axis=2) * 0.3
    windows[::7] = 0.0
    windows[1::7, :, :40] = windows[1::7, :, :1]
    for some in (windows, windows[3:4]):
        assert FALLING.compute(some).tobytes() == plain_falling.compute(some).tobytes()


def test_quick_moments_and_lengths_have_the_bits_of_numpys_own() -> None:
    signals = np.random.default_rng(8).normal(1.0, 3.0, (9, 3, 200))
    signals[0] = 0.0
    newest = signals[..., -50:]
    plain = [newest.mean(axis=-1), newest.std(axis=-1), newest.max(axis=-1), newest.min(axis=-1)]
    assert moments(signals, 50).tobytes() == np.concatenate(plain, axis=1).tobytes()
    assert length(signals).tobytes() == np.sqrt((signals * signals).sum(axis=1)).tobytes()
    vertical = up(signals)
    assert along(signals, vertical).tobytes() == (signals * vertical).sum(axis=1).tobytes()


def test_moments_of_several_lengths_are_those_of_each() -> None:
    signals = np.random.default_rng(9).normal(1.0, 3.0, (9, 3, 200))
    each = [moments(signals, length) for length in (20, 50, 200)]
    assert moments(signals, 20, 50, 200).tobytes() == np.concatenate(each, axis=1).tobytes()


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_what_is_missing_is_mended_and_without_a_gap_nothing_changes(recipe: Recipe) -> None:
    whole = walk(recipe, recipe.look_back).T[None]
    torn = whole.copy()
    torn[..., 3:6] = torn[..., -2:] = np.nan
    assert np.isfinite(recipe.compute(torn)).all()
    assert np.array_equal(recipe.compute(torn), recipe.compute(mended(torn)))
    straight = np.repeat(whole[..., :1], recipe.look_back, axis=2)
    torn = straight.copy()
    torn[..., 4:8] = np.nan
    assert np.array_equal(recipe.compute(torn), recipe.compute(straight))


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_a_stream_gives_the_same_bits_as_a_recording(recipe: Recipe) -> None:
    samples = walk(recipe, recipe.look_back + 40)
    whole = features(recipe, samples, np.arange(len(samples)))
    stream = FeatureStream(recipe)
    for row, sample in enumerate(samples):
        stream.push(sample)
        assert np.array_equal(stream.features()[0], whole[row]), row


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_robots_in_one_batch_get_what_each_gets_alone(recipe: Recipe) -> None:
    samples = walk(recipe, 300)
    ends = np.arange(20, 300, 7)
    together = features(recipe, samples, ends)
    for row, end in enumerate(ends):
        assert np.array_equal(features(recipe, samples, np.array([end]))[0], together[row])


def test_a_streams_window_stays_what_it_was() -> None:
    samples = walk(TERRAIN, 40)
    stream = FeatureStream(TERRAIN)
    windows = []
    for sample in samples:
        stream.push(sample)
        windows.append(stream.window())
    for end in range(TERRAIN.look_back, 40):
        assert np.array_equal(windows[end][0].T, samples[end + 1 - TERRAIN.look_back : end + 1])


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_the_future_changes_no_feature(recipe: Recipe) -> None:
    samples = walk(recipe, 400)
    ends = np.array([0, 5, 150, 250])
    before = features(recipe, samples, ends)
    for row, end in enumerate(ends):
        other = samples.copy()
        other[end + 1 :] = 1e3
        assert np.array_equal(features(recipe, other, np.array([end]))[0], before[row])


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_what_is_older_than_the_look_back_changes_no_feature(recipe: Recipe) -> None:
    rows = recipe.look_back + 200
    samples = walk(recipe, rows)
    other = samples.copy()
    other[:200] = -7.0
    end = np.array([rows - 1])
    assert np.array_equal(features(recipe, samples, end), features(recipe, other, end))
    other[200] = -7.0
    assert not np.array_equal(features(recipe, samples, end), features(recipe, other, end))


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.name)
def test_features_are_finite_where_nothing_moves_and_nothing_weighs(recipe: Recipe) -> None:
    still = np.zeros((3, len(recipe.channels), recipe.look_back))
    assert np.isfinite(recipe.compute(still)).all()


def test_no_decisions_are_no_rows() -> None:
    none = features(TERRAIN, walk(TERRAIN, 20), np.array([], dtype=np.intp))
    assert none.shape[0] == 0
    assert none.shape[1] == features(TERRAIN, walk(TERRAIN, 20), np.array([5])).shape[1]


def test_a_stream_without_samples_says_so() -> None:
    with pytest.raises(ValueError, match="no sample has come yet"):
        FeatureStream(TERRAIN).features()


def test_a_recipe_is_offered_only_with_every_sensor() -> None:
    every = set(GAIT_STATUS.channels) | {"left_knee.position"}
    assert GAIT_STATUS.offered(every)
    assert not GAIT_STATUS.offered(every - {"left_foot.angular_velocity_y"})


def test_no_recipe_reads_a_heading() -> None:
    assert not [
        name for recipe in RECIPES for name in recipe.channels if "yaw" in name or "orientation" in name
    ]


def test_the_right_foot_is_the_left_one_in_a_mirror() -> None:
    window = walk(LEFT_PHASE, 200).T[None]
    assert np.array_equal(mirrored(mirrored(window)), window)
    assert np.array_equal(RIGHT_PHASE.compute(window), LEFT_PHASE.compute(mirrored(window)))
    assert not np.array_equal(RIGHT_PHASE.compute(window), LEFT_PHASE.compute(window))


def test_a_step_of_the_right_leg_on_the_ground_is_the_left_ones_in_a_mirror() -> None:
    window = walk(TERRAIN, TERRAIN.look_back).T[None]
    assert np.array_equal(other_side(other_side(window)), window)
    assert np.array_equal(TERRAIN.compute(window), TERRAIN.compute(other_side(window)))
    one_leg = window.copy()
    one_leg[:, [0, 2]] += 0.5  # whichever leads, the other leg's part is not its own
    assert not np.array_equal(TERRAIN.compute(window), TERRAIN.compute(one_leg))


@pytest.mark.parametrize("recipe", [GAIT_STATUS, GAIT_CONTEXT], ids=lambda recipe: recipe.name)
def test_status_does_not_know_left_from_right_nor_which_way_it_turns(recipe: Recipe) -> None:
    window = walk(recipe, recipe.look_back).T[None]
    swapped = window[:, SWAPPED]
    assert np.allclose(recipe.compute(window), recipe.compute(swapped), atol=1e-4)
    other_way = mirrored(window)[:, SWAPPED]  # back to their own sides, but turning the other way
    assert np.allclose(recipe.compute(window), recipe.compute(other_way), atol=1e-4)


def test_a_window_of_a_walk_says_when_the_foot_last_struck() -> None:
    samples, *_ = recordings.trial(8.0, 1.0, np.random.default_rng(0))
    pitch = samples[None, 450:650, 10]
    strikes = falls(pitch > 1.0, 2)[0]
    assert strikes[1] - strikes[0] == pytest.approx(100, abs=3)


def test_blocks_against_values_by_hand() -> None:
    signal = np.arange(6.0).reshape(1, 1, 6)
    assert bins(signal, 2, 2).tolist() == [[2.5, 4.5]]
    assert moments(signal, 3).tolist() == [[4.0, pytest.approx(np.sqrt(2 / 3)), 5.0, 3.0]]
    held = np.array([[True, False, True, False, False]])
    assert since(held).tolist() == [2.0]
    assert since(~held | held).tolist() == [0.0]
    assert since(held & ~held).tolist() == [5.0]
    assert falls(held, 3).tolist() == [[1.0, 3.0, 5.0]]


def test_who_moves_is_told_from_who_stands() -> None:
    random = np.random.default_rng(0)
    standing, walking = (
        np.tile(np.array([[0.0], [9.81], [0.0], [0.0], [0.0], [0.0]]), (1, 1, 75)) for _ in range(2)
    )
    walking[:, 1] += random.normal(0, 3, (1, 75))
    assert moving(FALLING.compute(standing)).tolist() == [False]
    assert moving(FALLING.compute(walking)).tolist() == [True]
