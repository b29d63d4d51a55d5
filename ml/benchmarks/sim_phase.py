"""`sim-phase`: where in the stride simulated legs are, and whether a model knows when they do not step."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import coverage, metrics
from ml.benchmarks.folds import Split
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.phase import WITHIN, percent
from ml.benchmarks.search import Search
from ml.benchmarks.sim import (
    HIPS,
    NO_FEET,
    NOISE,
    SETTINGS,
    WHY,
    Variant,
    by_walks,
    examples_of,
    in_folds,
    people,
    recipe_of,
    robot,
)
from ml.registry.classifier_scores import calibrated
from ml.robot import learn
from ml.robot.learned import NONE
from ml.robot.task import GAIT_PHASE, SIDES
from ml.training.simulated import Examples, stepping

STEP: Final = 10  # grid samples: 200 ms
VARIANTS: Final = (NO_FEET, HIPS)

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Folds of people, by people; then robots that lack sensors, and other people's noise."""
    sessions = people(path)
    every, variants = robot(sessions, VARIANTS)
    whole = examples_of(GAIT_PHASE, every, sessions, STEP)
    truth, known = stepping(whole.label, whole.phase)
    steps = known & ~np.isnan(truth).any(axis=1)
    error, sure, said = _judged(every, whole, whole, truth, known)
    figures = _figures(error, sure, said, steps, known)
    noise = replace(every, noisy=True)
    noisy = _judged(noise, whole, examples_of(GAIT_PHASE, noise, sessions, STEP), truth, known)[0]
    figures[f"{NOISE.name}rmse_percent"] = percent(noisy[steps].ravel())
    for variant in variants:
        seen = examples_of(GAIT_PHASE, variant, sessions, STEP)
        figures[f"{variant.name}rmse_percent"] = percent(
            _judged(variant, seen, seen, truth, known)[0][steps].ravel()
        )
    right = steps & (np.abs(error) <= learn.WITHIN).all(axis=1)

    def of_rows(rows: Flags) -> dict[str, float]:
        sets = coverage.of_rows(right | ~said, said, right, rows & known)
        unsaid = {"unknown_fraction": float(1.0 - said[steps & rows].mean())}
        return {"rmse_percent": percent(error[steps & rows].ravel())} | sets | unsaid

    by_subject = {str(one): of_rows(whole.subject == one) for one in np.unique(whole.subject)}
    figures["worst_subject_rmse_percent"] = max(one["rmse_percent"] for one in by_subject.values())
    figures |= coverage.figures(by_subject)
    walks = by_walks(whole, of_rows)
    if walks:
        figures["worst_walks_rmse_percent"] = max(one["rmse_percent"] for one in walks.values())
    groups, by = (walks, "walks") if walks else (by_subject, "subject")
    return Outcome(figures, len(by_subject), groups, by, settings=SETTINGS, notes=(WHY,))


def _judged(
    variant: Variant, taught: Examples, seen: Examples, truth: Floats, known: Flags
) -> tuple[Floats, Floats, Flags]:
    """Errors (n, 2), probability (n,) and whether a phase was said (n,), of people not learned from."""
    recipe = recipe_of(GAIT_PHASE, variant)

    def fold(split: Split) -> tuple[Any, ...]:
        train, held_out = split
        rows = train[known[train]]
        learned = learn.learn(GAIT_PHASE, recipe, taught.features[rows], truth[rows], taught.subject[rows])
        verdicts = learned.judge(seen.features[held_out])
        phases = np.stack([verdicts.values[side] for side in SIDES], axis=1)
        return phases, verdicts.probabilities[:, 0], verdicts.label != NONE

    error, sure, said = np.zeros_like(truth), np.zeros(len(truth)), np.zeros(len(truth), dtype=bool)
    for (_, held_out), (phases, likely, told) in in_folds(taught.subject, fold):
        error[held_out] = metrics.circular_error(phases, truth[held_out])
        sure[held_out], said[held_out] = likely, told
    return error, sure, said


def _figures(error: Floats, sure: Floats, said: Flags, steps: Flags, known: Flags) -> dict[str, float]:
    right = steps & (np.abs(error) <= learn.WITHIN).all(axis=1)
    # Of the one class, its probability; of the other one, what is left of it.
    both = np.stack([sure, 1.0 - sure], axis=1)[known]
    bins = calibrated(both, np.where(right[known], 0, 1))
    return {
        "rmse_percent": percent(error[steps].ravel()),
        "worst_subject_rmse_percent": float("nan"),
        "accuracy": float((np.abs(error[steps]) <= WITHIN).mean()),
        "said_accuracy": float(right[known & said].mean()) if (known & said).any() else float("nan"),
        "unknown_fraction": float(1.0 - said[steps].mean()),
        "false_stride_fraction": float(said[known & ~steps].mean()),
        "calibration_error": sum(abs(one.said - one.right) * one.count for one in bins) / int(known.sum()),
    }
