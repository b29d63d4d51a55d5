"""`sim-activity`: what simulated wearers do, and whether a model knows what it does not know."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import coverage, metrics
from ml.benchmarks.folds import Split
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search
from ml.benchmarks.sim import (
    HIPS_TRUNK,
    NO_FEET,
    NO_TRUNK,
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
from ml.robot.learn import learn
from ml.robot.learned import ABNORMAL_FROM, NONE
from ml.robot.task import ACTIVITY
from ml.training.simulated import LOST, Examples

STEP: Final = 10  # grid samples: 200 ms
NEAR_NS: Final = 500_000_000  # around a change that is not steady
VARIANTS: Final = (NO_FEET, NO_TRUNK, HIPS_TRUNK)
OTHER: Final = -1  # the truth of what is no class


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Judgement of people unseen in training; arrays have a row each."""

    classes: tuple[str, ...]
    truth: npt.NDArray[np.int_]  # index into the classes, or OTHER
    probabilities: npt.NDArray[np.float64]
    label: npt.NDArray[np.int_]
    novelty: npt.NDArray[np.float64]
    covered: npt.NDArray[np.bool_]  # the truth is in the conformal set

    @property
    def known(self) -> npt.NDArray[np.bool_]:
        known: npt.NDArray[np.bool_] = self.truth != OTHER
        return known

    @property
    def likeliest(self) -> npt.NDArray[np.int_]:
        likeliest: npt.NDArray[np.int_] = self.probabilities.argmax(axis=1)
        return likeliest

    def macro_f1(self, rows: npt.NDArray[np.bool_]) -> float:
        rows = rows & self.known
        return metrics.macro_f1(self.truth[rows], self.likeliest[rows], len(self.classes))

    def sets(self, rows: npt.NDArray[np.bool_]) -> dict[str, float]:
        """Return figures of these rows' conformal sets."""
        right = self.likeliest == self.truth
        return coverage.of_rows(self.covered, self.label != NONE, right, rows & self.known)


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Folds of people, by people; then robots that lack sensors, and other people's noise."""
    sessions = people(path)
    every, variants = robot(sessions, VARIANTS)
    whole = examples_of(ACTIVITY, every, sessions, STEP)
    judged = _judged(every, whole, whole)
    noisy = examples_of(ACTIVITY, replace(every, noisy=True), sessions, STEP)
    others = {NOISE.name: _judged(every, whole, noisy)}
    for variant in variants:
        seen = examples_of(ACTIVITY, variant, sessions, STEP)
        others[variant.name] = _judged(variant, seen, seen)
    everything = np.ones(len(whole.subject), dtype=bool)
    figures = _figures(judged, whole)
    figures |= {f"{name}macro_f1": one.macro_f1(everything) for name, one in others.items()}
    by_subject = {
        str(one): {"macro_f1": judged.macro_f1(whole.subject == one)} | judged.sets(whole.subject == one)
        for one in np.unique(whole.subject)
    }
    figures["worst_subject_macro_f1"] = min(one["macro_f1"] for one in by_subject.values())
    figures |= coverage.figures(by_subject)
    counts = metrics.confusion(
        judged.truth[judged.known], judged.likeliest[judged.known], len(judged.classes)
    )
    walks = by_walks(
        whole,
        lambda rows: {"macro_f1": judged.macro_f1(rows)} | judged.sets(rows),
    )
    if walks:
        figures["worst_walks_macro_f1"] = min(one["macro_f1"] for one in walks.values())
    groups, by = (walks, "walks") if walks else (by_subject, "subject")
    return Outcome(figures, len(by_subject), groups, by, judged.classes, counts, SETTINGS, (WHY,))


def _judged(variant: Variant, taught: Examples, seen: Examples) -> Judged:
    """Learn from some people's rows of `taught`, judge the other people's of `seen`, by turns."""
    recipe = recipe_of(ACTIVITY, variant)
    names = np.array([ACTIVITY.fold.get(label, "") for label in taught.label])

    def fold(split: Split) -> tuple[Any, ...]:
        train, held_out = split
        learned = learn(ACTIVITY, recipe, taught.features[train], names[train], taught.subject[train])
        said = learned.judge(seen.features[held_out])
        sets = learned.together(said.probabilities)
        within = (sets & (names[held_out, None] == np.array(learned.classes))).any(axis=1)
        return learned.classes, said.probabilities, said.label, said.novelty, within

    classes = ACTIVITY.classes(recipe)
    place = {name: number for number, name in enumerate(classes)}
    truth = np.array([place.get(name, OTHER) for name in names])
    probabilities = np.zeros((len(truth), len(classes)))
    label, novelty = np.full(len(truth), NONE), np.zeros(len(truth))
    covered = np.zeros(len(truth), dtype=bool)
    for (_, held_out), (told, likely, said, strange, within) in in_folds(taught.subject, fold):
        columns = np.array([place[name] for name in told])
        probabilities[np.ix_(held_out, columns)] = likely
        label[held_out] = np.where(said == NONE, NONE, columns[said])
        novelty[held_out], covered[held_out] = strange, within
    return Judged(classes, truth, probabilities, label, novelty, covered)


def _figures(judged: Judged, seen: Examples) -> dict[str, float]:
    known = judged.known
    strange = judged.novelty >= ABNORMAL_FROM
    lost = np.isin(seen.label, list(LOST))
    bins = calibrated(judged.probabilities[known], judged.truth[known])
    return {
        "macro_f1": judged.macro_f1(known),
        "worst_subject_macro_f1": float("nan"),
        "steady_macro_f1": judged.macro_f1(_steady(seen)),
        "accuracy": metrics.accuracy(judged.truth[known], judged.likeliest[known]),
        **judged.sets(known),
        "calibration_error": sum(abs(one.said - one.right) * one.count for one in bins) / int(known.sum()),
        "abnormal_false_fraction": float(strange[known].mean()),
        "abnormal_found_fraction": float(strange[lost].mean()) if lost.any() else float("nan"),
    }


def _steady(seen: Examples) -> npt.NDArray[np.bool_]:
    """Return decisions about moments that are no change's: those of one person in time's order."""
    changes = np.flatnonzero((seen.label[1:] != seen.label[:-1]) | (seen.subject[1:] != seen.subject[:-1]))
    steady = np.ones(len(seen.label), dtype=bool)
    reach = max(1, round(NEAR_NS / float(np.median(np.diff(seen.time_ns)))))
    for change in changes:
        steady[max(change + 1 - reach, 0) : change + 1 + reach] = False
    return steady
