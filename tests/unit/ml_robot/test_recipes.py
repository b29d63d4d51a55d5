"""Recipes of a robot's own channels: offered by its sensors, and the same bits however they are computed."""

import numpy as np
import numpy.typing as npt
import pytest

from ml.errors import UnusableModel
from ml.features import FeatureStream, Recipe, features
from ml.robot import task as tasks
from ml.robot.classes import ABNORMAL, CLASSES
from ml.robot.groups import GROUPS, present, unit
from ml.robot.task import TASKS, recipe_named

ALL = frozenset(channel for group in GROUPS.values() for channel in group)
NAMES = (
    "activity/hips+knees+ankles+feet+trunk",
    "activity/feet",
    "gait_phase/hips+knees+ankles+feet+trunk",
    "gait_phase/feet",
    "falling/trunk",
)
Samples = npt.NDArray[np.float64]


def walk(recipe: Recipe, rows: int, seed: int = 3) -> Samples:
    """Something that moves in every channel, around a value that is somewhere."""
    random = np.random.default_rng(seed)
    shape = (rows, len(recipe.channels))
    return random.normal(0, 3, (1, shape[1])) + random.normal(0, 1, shape).cumsum(axis=0) * 0.1


def without(*groups: str) -> frozenset[str]:
    return ALL - {channel for group in groups for channel in GROUPS[group]}


@pytest.mark.parametrize("name", NAMES)
def test_a_stream_a_batch_and_one_window_give_the_same_bits(name: str) -> None:
    recipe = recipe_named(name)
    samples = walk(recipe, recipe.look_back + 30)
    whole = features(recipe, samples, np.arange(len(samples)))
    stream = FeatureStream(recipe)
    for row, sample in enumerate(samples):
        stream.push(sample)
        assert np.array_equal(stream.features()[0], whole[row]), row
    ends = np.array([4, 50, len(samples) - 1])
    assert np.array_equal(features(recipe, samples, ends), whole[ends])


@pytest.mark.parametrize("name", NAMES)
def test_features_look_back_only_and_not_too_far(name: str) -> None:
    recipe = recipe_named(name)
    samples = walk(recipe, 300)
    before = features(recipe, samples, np.array([200]))
    other = samples.copy()
    other[201:] = 1e3
    other[: 201 - recipe.look_back] = -7.0
    assert np.array_equal(features(recipe, other, np.array([200])), before)
    other[201 - recipe.look_back] = -7.0
    assert not np.array_equal(features(recipe, other, np.array([200])), before)


@pytest.mark.parametrize("name", NAMES)
def test_features_are_finite_where_nothing_moves_and_nothing_weighs(name: str) -> None:
    recipe = recipe_named(name)
    assert np.isfinite(recipe.compute(np.zeros((3, len(recipe.channels), recipe.look_back)))).all()


def test_a_robot_gets_the_richest_recipe_that_its_channels_allow() -> None:
    wanted = {
        "activity": (ALL, "activity/hips+knees+ankles+feet+trunk"),
        "gait_phase": (without("trunk", "ankles"), "gait_phase/hips+knees+feet"),
        "falling": (ALL, "falling/trunk"),
    }
    for task, (channels, name) in wanted.items():
        recipe = TASKS[task].recipe(channels | {"resource.cpu_percent"})
        assert recipe is not None
        assert recipe.name == name
        assert recipe.offered(set(channels))
        assert recipe_named(name).channels == recipe.channels


def test_one_side_alone_is_no_group() -> None:
    assert present(ALL - {"right_knee.position"}) == ("hips", "ankles", "feet", "trunk")


def test_what_the_sensors_cannot_tell_is_not_offered() -> None:
    activity = TASKS["activity"]
    assert set(activity.classes(recipe_named("activity/hips+trunk"))) == set(activity.support)
    assert "turn" not in activity.classes(recipe_named("activity/hips+knees"))
    assert "sit" not in activity.classes(recipe_named("activity/trunk"))
    assert activity.classes(recipe_named("activity/feet")) == ("stand", "walk")
    assert TASKS["falling"].recipe(without("trunk")) is None
    assert TASKS["gait_phase"].recipe(frozenset(GROUPS["trunk"])) is None
    assert [task.recipe(frozenset()) for task in TASKS.values()] == [None, None, None]


def test_every_class_is_what_some_label_means() -> None:
    for task in TASKS.values():
        if task.fold:
            assert set(task.fold.values()) == set(task.support)


@pytest.mark.parametrize(
    "name",
    [
        "gait_status",
        "walking/hips",
        "activity/",
        "activity/hips+wings",
        "activity/trunk+hips",
        "falling/hips+trunk",
    ],
)
def test_an_unknown_recipe_is_refused_in_a_sentence(name: str) -> None:
    with pytest.raises(UnusableModel, match="is no recipe of"):
        recipe_named(name)


def test_every_channel_has_its_unit() -> None:
    assert {unit(channel) for channel in ALL} == {"rad", "N", "m/s²", "rad/s"}


def test_activity_does_not_know_left_from_right() -> None:
    for name in ("activity/hips+feet", "activity/knees+trunk"):
        recipe = recipe_named(name)
        window = walk(recipe, recipe.look_back).T[None]
        swapped = window.copy()
        swapped[:, [0, 1]] = window[:, [1, 0]]
        assert np.allclose(recipe.compute(window), recipe.compute(swapped))
    phase = recipe_named("gait_phase/hips")
    window = walk(phase, phase.look_back).T[None]
    assert not np.allclose(phase.compute(window), phase.compute(window[:, ::-1]))


def test_names_that_need_no_library_are_those_of_the_tasks() -> None:
    assert {name: tuple(task.support) for name, task in TASKS.items()} == dict(CLASSES)
    assert ABNORMAL == tasks.ABNORMAL
