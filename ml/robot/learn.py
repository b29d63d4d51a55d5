"""Learning: features and truth → a model that knows how far to trust itself.

Probabilities, what it promises of its sets and the limit of what it knows come from people who were left out;
then it learns from all.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from sklearn.isotonic import IsotonicRegression
from sklearn.model_selection import GroupKFold
from sklearn.neural_network import MLPClassifier, MLPRegressor
from sklearn.preprocessing import StandardScaler

from ml.errors import UnusableData
from ml.features.recipe import Features, Recipe
from ml.neural import fixed_epochs
from ml.progress import Tell, untold
from ml.robot import novelty
from ml.robot.conformal import passed_over, promised
from ml.robot.learned import Floats, Learned, on_circle, scaled, scores, softmax
from ml.robot.network import FAR, Rows, outputs
from ml.robot.task import STRIDE, Task

FOLDS: Final = 3
LEAST_ROWS: Final = 20  # of each class
HIDDEN: Final = (64,)
BATCH: Final = 256
PENALTY: Final[Mapping[str, float]] = {"activity": 0.01, "gait_phase": 0.01, "falling": 1.0}
EPOCHS: Final = 12
ONLY_TO_LEARN: Final = ("_optimizer", "_random_state")  # of a network: no part of what it says
TEMPERATURES: Final = np.geomspace(0.3, 6.0, 60)
WITHIN: Final = 0.1  # of the cycle: what gait_phase's probability is about

Groups = npt.NDArray[Any]
Network = Callable[[Task, int], Any]  # for a task, from a seed


@dataclass(frozen=True, slots=True)
class _Lesson:
    """Arguments of `learn`."""

    task: Task
    recipe: Recipe
    features: Features
    truth: npt.NDArray[Any]
    group: Groups
    seed: int
    told: Tell


def learn(
    task: Task,
    recipe: Recipe,
    features: Features,
    truth: npt.NDArray[Any],
    group: Groups,
    seed: int = 0,
    told: Tell = untold,
) -> Learned:
    """Return a model for `task` from rows of features.

    `truth`: (n,) names of classes; for gait_phase (n, 2) phases of the left and the right leg, NaN where the
    legs do not step. Rows of classes that the recipe's sensors cannot tell are left out. `group` (n,): whose
    rows they are.

    Raises:
        UnusableData: too few people, classes or examples; numbers that are not finite.

    """
    if not np.isfinite(features).all():
        raise UnusableData(f"{recipe.name}: features that are not finite cannot be learned from")
    lesson = _Lesson(task, recipe, features, truth, np.asarray(group), seed, told)
    return _classes(lesson) if task.fold else _phases(lesson)


def _classes(lesson: _Lesson) -> Learned:
    recipe, truth = lesson.recipe, lesson.truth
    classes = learned_classes(lesson.task, recipe, Counter(truth.tolist()))
    rows = np.flatnonzero(np.isin(truth, classes))
    targets = (truth[rows, None] == np.array(classes)).argmax(axis=1)
    model, unseen, limits = _taught(lesson, rows, targets, _classifier, len(classes))
    temperature = _temperature(unseen, targets)
    probabilities = softmax(unseen / temperature)
    above = passed_over(probabilities, targets)
    promise = promised(above, probabilities.max(axis=1), lesson.group[rows])
    numbers = {"temperature": temperature, **asdict(promise), **limits}
    return Learned(lesson.task, recipe, classes, model, numbers)


def _phases(lesson: _Lesson) -> Learned:
    missing = np.isnan(lesson.truth)
    rows = np.flatnonzero(missing.all(axis=1) | ~missing.any(axis=1))
    truth = lesson.truth[rows].astype(np.float64)
    steps = ~np.isnan(truth[:, 0])
    learned_classes(lesson.task, lesson.recipe, {STRIDE: int(steps.sum())})
    model, unseen, limits = _taught(lesson, rows, pointers(truth), _regressor, 4)
    phases, lengths = on_circle(unseen.astype(np.float32))
    error = np.abs((phases - np.where(steps[:, None], truth, 0.0) + 0.5) % 1.0 - 0.5)
    right = steps & (error <= WITHIN).all(axis=1)
    trust = IsotonicRegression(y_min=0.0, y_max=1.0, out_of_bounds="clip").fit(lengths.min(axis=1), right)
    model |= {"length": trust.X_thresholds_, "trust": trust.y_thresholds_}
    sure = np.interp(lengths.min(axis=1), model["length"], model["trust"])
    # What is said is that both phases are within a tenth; where nothing is said, anything may be true.
    promise = promised(np.where(right, 0.0, sure), sure[steps], lesson.group[rows])
    numbers = {**asdict(promise), **limits}
    return Learned(lesson.task, lesson.recipe, (STRIDE,), model, numbers)


def learned_classes(task: Task, recipe: Recipe, examples: Mapping[str, int]) -> tuple[str, ...]:
    """Return the classes that are learned from so many examples of each; for gait_phase, of `STRIDE`.

    Raises:
        UnusableData: too few classes or examples.

    """
    can = task.classes(recipe)
    classes = tuple(name for name in can if examples.get(name))
    if task.fold and len(classes) < 2:
        raise UnusableData(
            f"{recipe.name} needs examples of two classes, of {', '.join(can)}; there are those of"
            f" {', '.join(classes) or 'none'}"
        )
    for name in classes if task.fold else can:
        _enough(name if task.fold else "steps", examples.get(name, 0))
    return classes


def pointers(truth: Floats) -> Rows:
    """(n, 2) phases → (n, 4): cosine and sine of the left, then of the right leg; 0 where none steps."""
    angle = 2.0 * np.pi * truth
    pairs = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    both: Rows = np.nan_to_num(pairs, nan=0.0).reshape(len(truth), 4).astype(np.float32)
    return both


def _taught(
    lesson: _Lesson, rows: npt.NDArray[np.intp], targets: npt.NDArray[Any], network: Network, columns: int
) -> tuple[dict[str, Any], Floats, dict[str, float]]:
    """Parts that learned from all; what was said of left-out people (n, columns); the novelty's limits."""
    features, group = lesson.features[rows], lesson.group[rows]

    def parts_of(features: Features, targets: npt.NDArray[Any]) -> dict[str, Any]:
        return _parts(features, targets, network(lesson.task, lesson.seed), lesson.seed)

    people = len(np.unique(group))
    if people < 2:
        raise UnusableData(
            "examples of one person or session alone cannot show how far to trust a model: give two at least"
        )
    unseen = np.zeros((len(features), columns))
    far = np.zeros((2, len(features)))
    folds = min(FOLDS, people)
    for fold, (train, held_out) in enumerate(GroupKFold(folds).split(features, groups=group)):
        lesson.told("learning", fold, folds + 1)
        if len(np.unique(targets[train])) < 2:
            raise UnusableData(
                "each class has examples of too few people: without some of them one class alone is left"
            )
        parts = parts_of(features[train], targets[train])
        inputs = scaled(parts["scale"], features[held_out])
        unseen[held_out] = _columns(parts["network"], outputs(parts["network"], inputs), columns)
        far[:, held_out] = novelty.distances(parts, inputs)
    lesson.told("learning", folds, folds + 1)
    return parts_of(features, targets), unseen, novelty.limits((far[0], far[1]))


def _parts(features: Features, targets: npt.NDArray[Any], network: Any, seed: int) -> dict[str, Any]:
    scale = StandardScaler().fit(features.astype(np.float64))
    inputs = scaled(scale, features)
    with fixed_epochs():
        fitted = network.set_params(batch_size=min(BATCH, len(inputs))).fit(
            np.clip(inputs, -FAR, FAR), targets
        )
    for name in ONLY_TO_LEARN:
        del vars(fitted)[name]
    return {"scale": scale, "network": fitted, **novelty.fitted(inputs, seed)}


def _columns(network: Any, found: Rows, columns: int) -> Floats:
    """Return a classifier's scores in every class's column.

    Those that it has not met are out of the question.
    """
    if not hasattr(network, "classes_"):
        return found.astype(np.float64)
    every = np.full((len(found), columns), -30.0)
    every[:, network.classes_] = scores(found)
    return every


def _classifier(task: Task, seed: int) -> Any:
    return MLPClassifier(HIDDEN, alpha=PENALTY[task.name], max_iter=EPOCHS, random_state=seed)


def _regressor(task: Task, seed: int) -> Any:
    return MLPRegressor(
        hidden_layer_sizes=HIDDEN, alpha=PENALTY[task.name], max_iter=EPOCHS, random_state=seed
    )


def _temperature(unseen: Floats, targets: npt.NDArray[np.int_]) -> float:
    """Return the temperature that makes the truth of left-out people most likely."""
    rows = np.arange(len(targets))
    surprise = [
        -np.log(np.maximum(softmax(unseen / one)[rows, targets], 1e-12)).mean() for one in TEMPERATURES
    ]
    return float(TEMPERATURES[int(np.argmin(surprise))])


def _enough(what: str, count: int) -> None:
    if count < LEAST_ROWS:
        raise UnusableData(f"there are {count} examples of {what}: {LEAST_ROWS} are needed at least")
