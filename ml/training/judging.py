"""A new model against the one that serves: on people neither may know, and on a fixed regression set.

It is better where its figure over the held-out decisions is; it is much worse somewhere where one class or
one person loses more than is allowed, there or in the regression set. Both judge the same decisions. Where no
model serves that can judge them, it is not compared, and never called better; it may serve all the same
where it knows more than saying always the same.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from msgspec.structs import replace

from ml.registry.card import Metrics
from ml.registry.classifier_scores import calibrated, judged
from ml.robot.learned import ABNORMAL_FROM, NONE, Learned, Verdicts
from ml.robot.task import Task
from ml.store.labels import LabelSource
from ml.training.dataset import SessionDecisions

FEW: Final = 20  # decisions; a class or person with fewer is no reason
MOST_LOST: Final = 0.05  # of a class's or a person's F1, or of the calibration
MOST_LOST_PERCENT: Final = 1.0  # of the cycle, of a person's error
MOST_ABSTAINED: Final = 0.1  # more than the serving model
NONE_SERVES: Final = "not compared with another: no promoted model serves yet"
FEW_JUDGES: Final = 2
NAMED: Final = 3  # channels that are told
WITHIN: Final = 0.1  # of the cycle: a phase that is right


@dataclass(frozen=True, slots=True)
class Judged:
    """One set of decisions, judged by the new and, where there is one, by the serving model."""

    name: str
    decisions: int
    new: Metrics
    serving: Metrics | None
    people: Mapping[str, int] = field(default_factory=dict)  # decisions of each


class Verdict(Enum):
    """What came of a judgement; its words are those of commands and window."""

    BETTER = "better"
    NOT_BETTER = "not better"
    NOT_COMPARED = "not compared"  # nothing serves that could be judged by the same decisions


@dataclass(frozen=True, slots=True)
class Decision:
    """What the new model is, and why, in sentences."""

    verdict: Verdict
    why: tuple[str, ...]

    @property
    def better(self) -> bool:
        """Whether it is than what serves."""
        return self.verdict is Verdict.BETTER

    @property
    def may_serve(self) -> bool:
        """Whether it may be promoted without somebody who knows better."""
        return self.verdict is not Verdict.NOT_BETTER


def judge(
    name: str,
    new: Learned,
    parts: Sequence[SessionDecisions],
    serving: Learned | None,
    its: Sequence[SessionDecisions],
) -> Judged:
    """Both models on the same decisions; `its` are the parts with the serving model's features, if it has."""
    parts = [_by_people(each) for each in parts]
    if serving is not None:
        parts, its = _common(parts, its)
    classes = _classes(new, parts, serving)
    metrics = _metrics(new, parts, classes)
    other = None if serving is None else _metrics(serving, its, classes)
    return Judged(name, sum(len(each.truth) for each in parts), metrics, other, _people(parts))


def decide(task: Task, held_out: Judged, regression: Judged | None, lacking: Sequence[str] = ()) -> Decision:
    """Better on the held-out decisions, and nowhere much worse.

    `lacking` are channels of a shipped model that the sessions do not have, so that it cannot judge them.
    """
    if not held_out.decisions:
        return Decision(
            Verdict.NOT_BETTER, ("no decision of the held-out people can be judged by both models",)
        )
    figure = "macro_f1" if task.fold else "rmse_percent"
    new = held_out.new.figures[figure]
    if held_out.serving is None:
        return _without_serving(task, held_out, figure, lacking)
    old = held_out.serving.figures[figure]
    gain = new - old if task.fold else old - new
    ours, its = _percents(task, new, old)
    reasons = [
        f"{figure} on {held_out.name}: {ours}, the serving model's {its}"
        + ("" if gain > 0 else ": not better")
    ]
    losses = [loss for each in (held_out, regression) if each is not None for loss in _losses(task, each)]
    is_better = gain > 0 and not losses
    return Decision(Verdict.BETTER if is_better else Verdict.NOT_BETTER, (*reasons, *losses))


def _without_serving(task: Task, held_out: Judged, figure: str, lacking: Sequence[str]) -> Decision:
    """Nothing serves: so it must know more than saying always the same, which makes it no better model."""
    new, idle = held_out.new.figures[figure], held_out.new.figures["idle"]
    knows = new > idle if task.fold else new < idle
    ours, its = _percents(task, new, idle)
    told = f"{figure} {ours} on {_judges(held_out)} (always guessing the same: {its})"
    verdict = Verdict.NOT_COMPARED if knows else Verdict.NOT_BETTER
    return Decision(verdict, (told, _unable(lacking) if lacking else NONE_SERVES))


def _judges(found: Judged) -> str:
    """Return whom it was judged by: one or two by name, as their figure says less of others."""
    who = sorted(found.people)
    if not 0 < len(who) <= FEW_JUDGES:
        return "wearers it has not seen"
    return f"{' and '.join(who)} alone, whom it has not seen"


def _unable(lacking: Sequence[str]) -> str:
    """Return why the model that came with GWRMS is not compared."""
    named = f"{', '.join(lacking[:NAMED])}{', …' if len(lacking) > NAMED else ''}"
    return (
        "not compared with the model that came with GWRMS: these sessions lack "
        f"{len(lacking)} of its channels ({named})"
    )


def _losses(task: Task, found: Judged) -> Iterator[str]:
    """Yield where the new model is much worse."""
    new, old = found.new, found.serving
    if old is None:
        return
    for name, score in old.per_class.items():
        lost = score.f1 - new.per_class[name].f1
        if score.support >= FEW and lost > MOST_LOST:
            yield f"much worse in the {found.name}: F1 of {name} falls by {100 * lost:.1f} points"
    for who, before in old.per_subject.items():
        lost = before - new.per_subject[who] if task.fold else new.per_subject[who] - before
        if found.people[who] >= FEW and lost > (MOST_LOST if task.fold else MOST_LOST_PERCENT):
            yield f"much worse in the {found.name}: {who} loses {_points(task, lost)}"
    for name, most in (("calibration_error", MOST_LOST), ("abstained", MOST_ABSTAINED)):
        lost = _figure(new, name) - _figure(old, name)
        if lost > most:
            yield f"much worse in the {found.name}: {name} rises by {100 * lost:.1f} points"


def _percents(task: Task, *figures: float) -> list[str]:
    """Return it as tables show them, `95.2 %`; with more digits where else they would look alike."""
    scale = 100.0 if task.fold else 1.0  # an error of the stride is in percent already
    for digits in range(1, 4):
        told = [f"{scale * figure:.{digits}f} %" for figure in figures]
        if len(set(told)) == len(set(figures)):
            break
    return told


def _points(task: Task, lost: float) -> str:
    """Return how much is lost, on the same scale, in words."""
    return f"{100 * lost if task.fold else lost:.1f} points"


def _figure(metrics: Metrics, name: str) -> float:
    return metrics.calibration_error or 0.0 if name == "calibration_error" else metrics.figures[name]


# --- decisions


def _by_people(part: SessionDecisions) -> SessionDecisions:
    """Return what people, the simulator or sensors say: nobody is judged by what a model said."""
    return part.of(part.source != LabelSource.PSEUDO.value)


def _common(
    parts: Sequence[SessionDecisions], its: Sequence[SessionDecisions]
) -> tuple[list[SessionDecisions], list[SessionDecisions]]:
    """Return the decisions, session by session, that both have features for."""
    others = {(each.ask.robot, each.ask.session): _by_people(each) for each in its}
    mine, theirs = [], []
    for each in parts:
        other = others.get((each.ask.robot, each.ask.session))
        if other is not None:
            _, ours, others_ = np.intersect1d(each.stamps_ns, other.stamps_ns, return_indices=True)
            mine.append(each.of(ours))
            theirs.append(other.of(others_))
    return mine, theirs


def _people(parts: Sequence[SessionDecisions]) -> dict[str, int]:
    counts: Counter[str] = Counter()
    for each in parts:
        counts[each.group] += len(each.truth)
    return counts


def _classes(new: Learned, parts: Sequence[SessionDecisions], serving: Learned | None) -> tuple[str, ...]:
    """Return the new model's, and then those that it does not know, but the other one or somebody does."""
    others = {str(name) for each in parts if new.task.fold for name in np.unique(each.truth)}
    others |= set(() if serving is None else serving.classes)
    return (*new.classes, *sorted(others - set(new.classes)))


def _metrics(learned: Learned, parts: Sequence[SessionDecisions], classes: Sequence[str]) -> Metrics:
    """Return the figures in terms of these classes."""
    parts = [each for each in parts if len(each.truth)]
    if not parts:
        return Metrics()
    truth = np.concatenate([each.truth for each in parts])
    verdicts = [learned.judge(each.features) for each in parts]
    people = np.concatenate([np.full(len(each.truth), each.group) for each in parts])
    if learned.task.fold:
        found = _of_classes(learned.classes, classes, truth, verdicts, people)
        covered = _in_sets(learned, verdicts, truth)
    else:
        found, covered = _of_phases(truth, verdicts, people)
    return replace(found, figures=found.figures | _coverage(learned, covered, people))


def _in_sets(
    learned: Learned, verdicts: Sequence[Verdicts], truth: npt.NDArray[Any]
) -> npt.NDArray[np.bool_]:
    """(n,) whether the set of each decision holds its truth: never that of a class that it does not know."""
    sets = np.concatenate([learned.together(one.probabilities) for one in verdicts])
    within: npt.NDArray[np.bool_] = (sets & (truth[:, None] == np.array(learned.classes))).any(axis=1)
    return within


def _coverage(learned: Learned, covered: npt.NDArray[np.bool_], people: npt.NDArray[Any]) -> dict[str, float]:
    """Return the share of decisions, and of the worst person's, whose truth is within.

    Beside what is promised.
    """
    found = {
        "covered": float(covered.mean()),
        "worst_subject_covered": min(float(covered[people == one].mean()) for one in np.unique(people)),
    }
    promised = {"promised_covered": "covered", "promised_wearers": "wearers"}
    return found | {
        name: learned.numbers[number] for name, number in promised.items() if number in learned.numbers
    }


def _label(verdicts: Sequence[Verdicts]) -> npt.NDArray[np.int_]:
    """Return what is said: nothing of what it does not know."""
    return np.concatenate([np.where(one.novelty < ABNORMAL_FROM, one.label, NONE) for one in verdicts])


def _of_classes(
    known: Sequence[str],
    every: Sequence[str],
    truth: npt.NDArray[Any],
    verdicts: Sequence[Verdicts],
    people: npt.NDArray[Any],
) -> Metrics:
    """Return its probabilities of these classes; a class that the model does not know, it never says."""
    place = np.array([*(every.index(name) for name in known), NONE])
    probabilities = np.zeros((len(truth), len(every)))
    probabilities[:, place[:-1]] = np.concatenate([one.probabilities for one in verdicts])
    index = (truth[:, None] == np.array(every)).argmax(axis=1)
    found = judged(every, index, probabilities, place[_label(verdicts)], people.tolist())
    usual = np.full(len(index), np.bincount(index).argmax())
    idle = judged(every, index, np.eye(len(every))[usual], usual, people.tolist())
    return replace(found, figures=found.figures | {"idle": idle.figures["macro_f1"]})


def _of_phases(
    truth: npt.NDArray[Any], verdicts: Sequence[Verdicts], people: npt.NDArray[Any]
) -> tuple[Metrics, npt.NDArray[np.bool_]]:
    """Errors over both legs where they step, and whether it says so where they do not; what is not wrong."""
    steps = ~np.isnan(truth).any(axis=1)
    said = _label(verdicts) != NONE
    phases = np.concatenate(
        [np.stack([one.values[side] for side in ("left", "right")], axis=1) for one in verdicts]
    )
    error = np.abs((phases - np.where(steps[:, None], truth, 0.0) + 0.5) % 1.0 - 0.5)
    right = steps & (error <= WITHIN).all(axis=1)
    sure = np.concatenate([one.probabilities[:, 0] for one in verdicts])
    calibration = calibrated(np.stack([sure, np.zeros_like(sure)], axis=1), np.where(right, 0, 1))
    figures = {
        "rmse_percent": _rmse(error[steps]),
        "abstained": float((~said)[steps].mean()) if steps.any() else 0.0,
        "stepping_where_none_steps": float(said[~steps].mean()) if (~steps).any() else 0.0,
        "idle": 100.0 / math.sqrt(12.0),  # of a phase that is anything
    }
    walkers = np.unique(people[steps])
    found = Metrics(
        figures=figures,
        per_subject={str(one): _rmse(error[steps & (people == one)]) for one in walkers},
        calibration=calibration,
        calibration_error=sum(abs(one.said - one.right) * one.count for one in calibration) / len(truth),
    )
    return found, right | ~said


def _rmse(error: npt.NDArray[np.float64]) -> float:
    """In percent of the cycle; of nothing, the worst there is."""
    return 100.0 * float(np.sqrt(np.mean(error * error))) if len(error) else 50.0
