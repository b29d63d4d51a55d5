"""Labelled recordings of a store, by wearer: what a training can learn from, and who can judge it.

What labels mean, which of them count, and what is too little is the training's own word. Here it is asked
without reading any telemetry: where rows are missing, the training has less.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.errors import UnusableData
from ml.features.recipe import Recipe
from ml.robot.task import STRIDE, TASKS, Task, recipe_named
from ml.store import StoreError
from ml.store.labels import REGRESSION, Label, LabelSource, holding, utc_ns, wearers
from ml.store.sessions import Session
from ml.store.tables import LABELS
from ml.store.translation import translated
from server_gui.core.experiments.wording import minutes
from server_gui.core.models.names import class_name

SEVERAL: Final = "labels of several wearers: not learned from"
ONLY_JUDGES: Final = "regression set: only judges"
NOTHING: Final = "labels too short, or contradicting each other: nothing is learned from them"
NO_STRIDE: Final = "too few foot contacts: a stride takes two heel strikes of each leg"
STEPS: Final = "steps"  # and what else gait_phase learns from
NO_STEPS: Final = "no steps"
SHORT_S: Final = 10.0  # below that, tenths are told


@dataclass(frozen=True, slots=True)
class Lesson:
    """Labelled sessions of one wearer; of one session, where nobody says whose it is.

    `examples` are the decisions that its labels are about, of each class, one every `every_s`; 0 of a class
    that is labelled, but too short.
    """

    who: str  # `ml.store.labels.person`, or the session
    name: str  # as it was spelled
    is_named: bool
    sessions: int
    examples: Mapping[str, int]
    every_s: float
    why_not: str = ""  # it neither teaches nor can be chosen to judge

    @property
    def said(self) -> str:
        """Return what it has, the most first."""
        most = sorted(self.examples.items(), key=lambda item: -item[1])
        return self.why_not or ", ".join(self._of(name, count) for name, count in most)

    def _of(self, name: str, count: int) -> str:
        if not count:
            return f"{class_name(name)}: {'too few foot contacts' if name == STEPS else 'too short'}"
        seconds = count * self.every_s
        return f"{class_name(name)} {f'{seconds:.1f} s' if seconds < SHORT_S else minutes(seconds)}"


@dataclass(frozen=True, slots=True)
class Judges:
    """Who judges a training, or in `problem` why there can be none; `left_out` says which classes are."""

    names: frozenset[str] = frozenset()
    problem: str = ""
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Lessons:
    """All of one task and robot, learned with one recipe; `problem` is why nothing is known of them."""

    each: tuple[Lesson, ...] = ()
    recipe: str = ""
    problem: str = ""

    def judges(self, chosen: Sequence[str] = ()) -> Judges:
        """Return who judges where these are chosen, as `gwrms train` does it."""
        from ml.training.data_split import held_out

        if self.problem:
            return Judges(problem=self.problem)
        teaching = [each for each in self.each if not each.why_not]
        able = [each for each in teaching if each.is_named] or teaching
        others = sum(each.sessions for each in teaching) - sum(each.sessions for each in able)
        try:
            held = held_out({each.who for each in able}, chosen, others)
            judging = [each for each in able if each.who in held]
            left_out = self._left_out([each for each in teaching if each not in judging])
        except UnusableData as error:
            return Judges(problem=str(error))
        return Judges(frozenset(each.name for each in judging), left_out=left_out)

    def _left_out(self, teaching: Iterable[Lesson]) -> tuple[str, ...]:
        """Return what is said of classes with too few examples.

        Raises:
            UnusableData: what is left cannot be learned from.

        """
        from ml.robot.learn import learned_classes
        from ml.training.data_split import too_few

        recipe = recipe_named(self.recipe)
        task = _task(recipe)
        examples = Counter[str]()
        for each in teaching:
            examples.update(+Counter(each.examples))
        if not task.fold:
            learned_classes(task, recipe, {STRIDE: examples[STEPS]})
            return ()
        rare = too_few(examples)
        learned_classes(task, recipe, {name: count for name, count in examples.items() if name not in rare})
        return tuple(rare.values())


@dataclass(slots=True)
class _Gathered:
    name: str = ""
    is_named: bool = False
    sessions: int = 0
    examples: Counter[str] = field(default_factory=Counter)


def lessons(url: str, task: str, robot: str = "") -> Lessons:
    """Return what is labelled for a task, of one robot or all; blocks. A broken store is its problem."""
    from ml.training.data_split import recipe_for
    from ml.training.training_sessions import Wish, material

    try:
        found = material(url, Wish(task, robot))
        with translated(f"{url}/{LABELS.name} cannot be read"):
            table = found.store.dataset(LABELS.name, found.versions[LABELS.name])
            rows = holding(table.to_table().to_pylist())
        channels = found.channels()
        recipe = recipe_for(found.task, channels)
        return Lessons(_lessons(zip(found.sessions, channels, strict=True), rows, recipe), recipe.name)
    except (StoreError, UnusableData) as error:
        return Lessons(problem=str(error))


def _lessons(
    known: Iterable[tuple[Session, Set[str]]], rows: Iterable[Mapping[str, Any]], recipe: Recipe
) -> tuple[Lesson, ...]:
    task, every_ns = _task(recipe), _every_ns(recipe)
    by_session: dict[tuple[str, str], list[Label]] = {}
    for row in rows:
        by_session.setdefault((row["robot"], row["session"]), []).append(Label.of(row))
    found: dict[tuple[str, str], _Gathered] = {}
    for session, channels in known:
        labels = by_session[session.robot, session.session]
        said = [each for each in labels if _matters(each, task)]
        if not said:
            continue
        examples = _examples(session, labels, said, recipe)
        people = wearers((each.label for each in labels), session.wearer)
        why_not = _why_not(session, channels, labels, examples, recipe)
        nobody = (session.session, [session.session])
        who, spelled = next(iter(people.items())) if len(people) == 1 else nobody
        whole = found.setdefault((who, why_not), _Gathered(spelled[0], len(people) == 1))
        whole.sessions += 1
        whole.examples.update(examples)
    return tuple(
        Lesson(who, one.name, one.is_named, one.sessions, dict(one.examples), every_ns / 1e9, why_not)
        for (who, why_not), one in sorted(found.items(), key=lambda item: item[0])
    )


def _why_not(
    session: Session, channels: Set[str], labels: Sequence[Label], examples: Mapping[str, int], recipe: Recipe
) -> str:
    """Return why it does not teach, in the order in which a training finds it; "": it does."""
    from ml.training.dataset import look_back_s

    lacking = [name for name in recipe.channels if name not in channels]
    if lacking:
        return f"it has no {', '.join(lacking)}: left out"
    length_s = session.length.total_seconds()
    if session.first is not None and length_s < look_back_s(recipe):
        return f"it lasts {length_s:.1f} s, and the model looks back {look_back_s(recipe):g} s: left out"
    if not any(examples.values()):
        return NO_STRIDE if STEPS in examples else NOTHING
    if len(wearers((each.label for each in labels), session.wearer)) > 1:
        return SEVERAL
    return ONLY_JUDGES if any(each.label == REGRESSION for each in labels) else ""


def _matters(label: Label, task: Task) -> bool:
    """Return whether the task learns from it: from a label of the kind, and not by a model's own word."""
    return _class(label, task) is not None and label.source is not LabelSource.PSEUDO


def _class(label: Label, task: Task) -> str | None:
    from ml.training.truth import STILL, STRIKES

    if task.fold:
        return task.fold.get(label.label)
    return STEPS if label.label in STRIKES else NO_STEPS if label.label in STILL else None


def _examples(
    session: Session, labels: Sequence[Label], said: Sequence[Label], recipe: Recipe
) -> Counter[str]:
    """Return the number of decisions of each class that is labelled (`said`), if no rows are missing."""
    from ml.training.dataset import truth_at
    from ml.training.truth import NOBODY, LabelSpan

    task = _task(recipe)
    spans = [LabelSpan(one.began_utc_ns, one.ended_utc_ns, one.label, one.source) for one in labels]
    truth, source = truth_at(task, spans, _decisions_ns(session, said, recipe))
    known = truth[(source != NOBODY) & (source != LabelSource.PSEUDO.value)]
    names = known.tolist()
    if not task.fold:
        names = [NO_STEPS if still else STEPS for still in np.isnan(known).any(axis=1).tolist()]
    found = Counter({name: 0 for one in said if (name := _class(one, task)) is not None})
    found.update(names)
    return found


def _decisions_ns(session: Session, said: Sequence[Label], recipe: Recipe) -> npt.NDArray[np.int64]:
    """Return the newest sample (UTC) of every decision within the recording that labels may be about."""
    from ml.training.dataset import look_back_s

    every_ns, delay_ns = _every_ns(recipe), _task(recipe).delay_ms * 1_000_000
    begin_ns = min(each.began_utc_ns for each in said) + delay_ns
    end_ns = max(each.ended_utc_ns for each in said) + delay_ns
    if session.first is not None and session.last is not None:
        whole_ns = utc_ns(session.first) + round((look_back_s(recipe) - 1.0 / recipe.rate_hz) * 1e9)
        begin_ns, end_ns = max(begin_ns, whole_ns), min(end_ns, utc_ns(session.last))
    return np.arange(-(-begin_ns // every_ns) * every_ns, end_ns, every_ns, dtype=np.int64)


def _every_ns(recipe: Recipe) -> int:
    from ml.training.dataset import EVERY_MS

    return EVERY_MS[_task(recipe).name] * 1_000_000


def _task(recipe: Recipe) -> Task:
    return TASKS[recipe.name.partition("/")[0]]
