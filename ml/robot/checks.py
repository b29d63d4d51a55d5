"""Validation of a model's state: complete, with the right types and sizes."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from sklearn.neural_network import MLPClassifier, MLPRegressor
from sklearn.preprocessing import StandardScaler

from ml.errors import UnusableModel
from ml.features.recipe import Recipe
from ml.robot.task import TASKS, Task

KEYS: Final[Mapping[str, type]] = {
    "task": str,
    "recipe": str,
    "classes": list,
    "parts": dict,
    "numbers": dict,
}
_COMMON: Final[Mapping[str, type]] = {"scale": StandardScaler, "axes": np.ndarray, "prototypes": np.ndarray}
_OF_CLASSES: Final[Mapping[str, type]] = {**_COMMON, "network": MLPClassifier}
_OF_PHASES: Final[Mapping[str, type]] = {
    **_COMMON,
    "network": MLPRegressor,
    "length": np.ndarray,
    "trust": np.ndarray,
}
_NUMBERS: Final = ("threshold", "near", "out")


def check(state: Mapping[str, Any]) -> None:
    """Check a state; raises `UnusableModel` for one that `Learned` cannot use."""
    _all_there(state, KEYS, "the model")
    task = TASKS.get(state["task"])
    if task is None:
        raise UnusableModel(f"the model's task is {state['task']!r}: those here are {', '.join(TASKS)}")
    recipe = task.named(state["recipe"])
    _check_classes(task, recipe, state["classes"])
    parts, numbers = state["parts"], state["numbers"]
    _all_there(parts, _OF_CLASSES if task.fold else _OF_PHASES, "the model's parts")
    _check_numbers(numbers, (*_NUMBERS, "temperature") if task.fold else _NUMBERS)
    _check_sizes(recipe, parts, len(state["classes"]) if task.fold else 4)


def _all_there(found: Mapping[str, Any], wanted: Mapping[str, type], what: str) -> None:
    for name, kind in wanted.items():
        if type(found.get(name)) is not kind:
            given = f"a {type(found[name]).__name__}" if name in found else "missing"
            raise UnusableModel(f"{what}: {name!r} is {given}, expected a {kind.__name__}")


def _check_classes(task: Task, recipe: Recipe, classes: list[Any]) -> None:
    can = task.classes(recipe)
    if tuple(classes) != tuple(name for name in can if name in classes) or len(classes) < min(2, len(can)):
        raise UnusableModel(
            f"the model's classes are {', '.join(map(str, classes))}; {recipe.name} can tell {', '.join(can)}"
        )


def _check_numbers(numbers: Mapping[str, Any], wanted: tuple[str, ...]) -> None:
    for name in wanted:
        value = numbers.get(name)
        if not isinstance(value, float) or not 0.0 <= value < np.inf or (name != "threshold" and not value):
            raise UnusableModel(f"the model's number {name!r} is {value!r}, expected one greater than 0")


def _check_sizes(recipe: Recipe, parts: Mapping[str, Any], outputs: int) -> None:
    columns = recipe.compute(np.zeros((1, len(recipe.channels), recipe.look_back))).shape[1]
    layers = [np.asarray(one) for one in getattr(parts["network"], "coefs_", ())]
    axes, prototypes = parts["axes"], parts["prototypes"]
    chain = [columns, *(one.shape[-1] for one in layers)]
    fits = (
        all(one.shape == (chain[at], chain[at + 1]) for at, one in enumerate(layers))
        and chain[-1] == (1 if outputs == 2 else outputs)
        and [len(one) for one in getattr(parts["network"], "intercepts_", ())] == chain[1:]
        and getattr(parts["scale"], "n_features_in_", 0) == columns
        and axes.ndim == prototypes.ndim == 2
        and axes.shape == (columns, prototypes.shape[1])
    )
    if not fits:
        raise UnusableModel(
            f"the model does not fit {recipe.name}, which gives {columns} features for {outputs} outputs: it"
            " was learned with other code"
        )
    arrays = [*layers, *parts["network"].intercepts_, axes, prototypes, parts["scale"].mean_]
    if not all(np.isfinite(one).all() for one in (*arrays, parts["scale"].scale_)):
        raise UnusableModel("the model holds numbers that are not finite")
