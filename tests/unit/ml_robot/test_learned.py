"""Learning and judging: right about new people, calibrated, silent where unsure, abnormal where strange."""

import functools
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ml.errors import UnusableData, UnusableModel
from ml.features import FeatureStream
from ml.robot import learn as learning
from ml.robot.learn import learn
from ml.robot.learned import ABNORMAL_FROM, NONE, Learned, Verdicts
from ml.robot.task import STRIDE, TASKS, Task, recipe_named
from tests.unit.ml_robot.walkers import ACTIVITY, HIPS, PHASE, Lessons, lessons


@functools.cache
def learned(name: str = "activity") -> Learned:
    task = TASKS[name]
    recipe = task.recipe(HIPS)
    assert recipe is not None
    return learn(task, recipe, *lessons(task, range(1, 7)))


@pytest.fixture
def briefly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it does not matter how well something is learned."""
    monkeypatch.setattr(learning, "EPOCHS", 2)
    monkeypatch.setattr(learning, "FOLDS", 2)


def test_new_people_are_told_right() -> None:
    model, new = learned(), lessons(ACTIVITY, [20, 21, 22])
    verdicts = model.judge(new.features)
    assert model.classes == ("stand", "walk", "sit")
    assert (np.array(model.classes)[verdicts.label] == new.truth).mean() > 0.95
    assert np.allclose(verdicts.probabilities.sum(axis=1), 1.0)
    assert (verdicts.novelty < ABNORMAL_FROM).mean() > 0.95


def test_phases_of_new_people_are_near_and_silent_where_nobody_steps() -> None:
    model, new = learned(PHASE.name), lessons(PHASE, [20, 21, 22])
    verdicts = model.judge(new.features)
    steps = ~np.isnan(new.truth[:, 0])
    said = np.stack([verdicts.values["left"], verdicts.values["right"]], axis=1)[steps]
    error = np.abs((said - new.truth[steps] + 0.5) % 1.0 - 0.5)
    assert np.sqrt((error**2).mean()) < 0.05
    assert model.classes == (STRIDE,)
    assert verdicts.probabilities.shape == (len(new.features), 1)
    assert (verdicts.label[steps] == 0).mean() > 0.9
    assert (verdicts.label[~steps] == NONE).mean() > 0.95


def test_what_nobody_has_learned_from_is_abnormal() -> None:
    model, new = learned(), lessons(ACTIVITY, [30])
    upside_down = model.judge(np.negative(3 * new.features))
    assert (upside_down.novelty >= ABNORMAL_FROM).mean() > 0.9
    assert (model.judge(new.features).novelty < ABNORMAL_FROM).mean() > 0.9


def test_a_model_that_is_unsure_abstains() -> None:
    rows, truth, group = lessons(ACTIVITY, range(1, 7))
    random = np.random.default_rng(1)
    wrong = np.where(random.random(len(truth)) < 0.5, random.permutation(truth), truth)
    recipe = recipe_named("activity/hips")
    doubtful = learn(ACTIVITY, recipe, rows, wrong, group)
    assert (doubtful.judge(rows).label == NONE).mean() > (learned().judge(rows).label == NONE).mean()
    # Two thirds of what it heard was right: it says neither 0.95 nor 0.4.
    assert 0.5 < doubtful.judge(lessons(ACTIVITY, [20, 21]).features).probabilities.max(axis=1).mean() < 0.85


@pytest.mark.parametrize("threshold", [0.5, 0.9, 0.999999])
def test_a_set_is_of_one_class_exactly_where_that_is_said(threshold: float) -> None:
    model = learned()
    assert {"threshold", "covered", "wearers"} <= set(model.numbers)
    model = replace(model, numbers=model.numbers | {"threshold": threshold})
    verdicts = model.judge(lessons(ACTIVITY, [20, 21]).features)
    sets = model.together(verdicts.probabilities)
    assert np.array_equal(sets.sum(axis=1) == 1, verdicts.label != NONE)
    assert sets[np.arange(len(sets)), verdicts.probabilities.argmax(axis=1)].all()


@pytest.mark.parametrize("task", [ACTIVITY, PHASE], ids=lambda task: task.name)
def test_a_model_that_promises_nothing_serves_on(task: Task) -> None:
    """One that was stored before there were promises has a threshold alone."""
    model, rows = learned(task.name), lessons(task, [41]).features
    older = {name: value for name, value in model.numbers.items() if name not in ("covered", "wearers")}
    restored = Learned.restored(model.state() | {"numbers": older})
    assert same(restored.judge(rows), model.judge(rows), slice(None))


@pytest.mark.parametrize("task", [ACTIVITY, PHASE], ids=lambda task: task.name)
def test_alone_in_a_batch_and_live_a_row_has_the_same_bits(task: Task) -> None:
    model, rows = learned(task.name), lessons(task, [40]).features
    whole = model.judge(rows)
    for row in range(0, len(rows), 17):
        assert same(model.judge(rows[row : row + 1]), whole, slice(row, row + 1))
        assert same(model.judge(rows[row : row + 50]), whole, slice(row, row + 50))


def same(verdicts: Verdicts, whole: Verdicts, rows: slice) -> bool:
    pairs = [
        (verdicts.probabilities, whole.probabilities[rows]),
        (verdicts.label, whole.label[rows]),
        (verdicts.novelty, whole.novelty[rows]),
        *((values, whole.values[name][rows]) for name, values in verdicts.values.items()),
    ]
    return all(np.array_equal(one, other) for one, other in pairs)


def test_the_same_seed_learns_the_same_model() -> None:
    rows = lessons(ACTIVITY, [20]).features
    recipe = recipe_named("activity/hips")
    again = learn(ACTIVITY, recipe, *lessons(ACTIVITY, range(1, 7)), 0).judge(rows)
    assert np.allclose(again.probabilities, learned().judge(rows).probabilities, atol=1e-3)


@pytest.mark.parametrize("task", [ACTIVITY, PHASE], ids=lambda task: task.name)
def test_a_state_is_restored_as_it_was(task: Task) -> None:
    model, rows = learned(task.name), lessons(task, [41]).features
    restored = Learned.restored(model.state())
    assert same(restored.judge(rows), model.judge(rows), slice(None))


@pytest.mark.usefixtures("briefly")
def test_a_class_that_one_person_alone_shows_is_learned_all_the_same() -> None:
    most, sitting = lessons(ACTIVITY, range(1, 5), ["stand", "walk"]), lessons(ACTIVITY, [9], ["sit"])
    taught = [np.concatenate(column) for column in zip(most, sitting, strict=True)]
    model = learn(ACTIVITY, recipe_named("activity/hips"), taught[0], taught[1], taught[2])
    assert model.classes == ("stand", "walk", "sit")


@pytest.mark.usefixtures("briefly")
def test_labels_that_the_sensors_cannot_tell_are_left_out() -> None:
    rows, truth, group = lessons(ACTIVITY, range(1, 5))
    model = learn(
        ACTIVITY, recipe_named("activity/hips"), rows, np.where(truth == "sit", "turn", truth), group
    )
    assert model.classes == ("stand", "walk")


Spoiled = Callable[[Lessons], Lessons]
SPOILED: dict[str, tuple[Task, Spoiled, str]] = {
    "one person": (
        ACTIVITY,
        lambda all_: all_._replace(group=np.full(len(all_.group), "ada")),
        "one person or session alone",
    ),
    "one class": (
        ACTIVITY,
        lambda all_: all_._replace(truth=np.full(len(all_.truth), "walk")),
        "two classes",
    ),
    "a class with one example": (
        ACTIVITY,
        lambda all_: all_._replace(
            truth=np.array(["sit", *["walk", "stand"] * len(all_.truth)])[: len(all_.truth)]
        ),
        "1 examples of sit: 20 are needed",
    ),
    "each class by somebody else": (
        ACTIVITY,
        lambda all_: all_._replace(truth=np.where(all_.group == "person 1", "walk", "sit")),
        "one class alone is left",
    ),
    "not a number": (
        ACTIVITY,
        lambda all_: all_._replace(features=np.where(all_.features > 0.5, np.nan, all_.features)),
        "not finite",
    ),
    "nobody steps": (
        PHASE,
        lambda all_: all_._replace(truth=np.full_like(all_.truth, np.nan)),
        "0 examples of steps",
    ),
}


@pytest.mark.parametrize("case", SPOILED)
def test_what_cannot_be_learned_from_is_refused_in_a_sentence(case: str) -> None:
    task, spoil, sentence = SPOILED[case]
    recipe = task.recipe(HIPS)
    assert recipe is not None
    with pytest.raises(UnusableData, match=sentence):
        learn(task, recipe, *spoil(lessons(task, range(1, 4))))


FORGED: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "no task": (lambda state: state.pop("task"), "'task' is missing"),
    "another task": (lambda state: state.update(task="dancing"), "task is 'dancing'"),
    "another recipe": (
        lambda state: state.update(recipe="activity/hips+trunk"),
        "does not fit activity/hips",
    ),
    "a recipe of another task": (
        lambda state: state.update(recipe="gait_phase/hips"),
        "is no recipe of activity",
    ),
    "classes that hips cannot tell": (lambda state: state.update(classes=["stand", "turn"]), "can tell"),
    "one class too few": (lambda state: state.update(classes=["stand", "walk"]), "does not fit"),
    "a part of another kind": (lambda state: state["parts"].update(network={}), "'network' is a dict"),
    "no prototypes": (lambda state: state["parts"].pop("prototypes"), "'prototypes' is missing"),
    "a threshold that is no number": (
        lambda state: state["numbers"].update(threshold=float("nan")),
        "threshold",
    ),
    "no temperature": (lambda state: state["numbers"].pop("temperature"), "'temperature'"),
    "numbers that are not finite": (
        lambda state: state["parts"].update(prototypes=state["parts"]["prototypes"] * np.nan),
        "not finite",
    ),
}


@pytest.mark.parametrize("case", FORGED)
def test_a_state_that_is_no_model_of_ours_is_refused_in_a_sentence(case: str) -> None:
    forge, sentence = FORGED[case]
    state = learned().state()
    forge(state)
    with pytest.raises(UnusableModel, match=sentence):
        Learned.restored(state)
    Learned.restored(learned().state())


@pytest.mark.usefixtures("briefly")
def test_one_prediction_is_quick_and_fifty_are_not_fifty_times_as_slow() -> None:
    """Limits by the CPU time of this thread: the computer may be busy with other things."""
    recipe = recipe_named("activity/hips+knees+ankles+feet+trunk")
    random = np.random.default_rng(0)
    windows = random.normal(size=(50, len(recipe.channels), recipe.look_back))
    columns = recipe.compute(windows).shape[1]
    truth = np.resize(np.array(TASKS["activity"].classes(recipe)), 300)
    rows = random.normal(size=(300, columns)).astype(np.float32)
    model = learn(ACTIVITY, recipe, rows, truth, np.arange(300) % 3)
    stream = FeatureStream(recipe)
    stream.push(windows[0, :, -1])
    one = cpu_ms(lambda: model.judge(stream.features()), 40)
    fifty = cpu_ms(lambda: model.judge(recipe.compute(windows)), 10)
    assert one < 5.0
    assert fifty < 20.0


def cpu_ms(work: Callable[[], object], times: int) -> float:
    """The median."""
    taken = []
    for _ in range(times):
        began = time.thread_time()
        work()
        taken.append((time.thread_time() - began) * 1e3)
    return float(np.median(taken))
