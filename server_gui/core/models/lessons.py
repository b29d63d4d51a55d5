"""Labelled recordings of a store, by wearer: what a training can learn from, and who can judge it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC
from typing import Any, Final

from gateway.amounts import counted
from ml.errors import UnusableData
from ml.robot.task import TASKS
from ml.store import NoSuchTable, Store, StoreError
from ml.store.labels import INSTANTS, REGRESSION, LabelSource, holding, wearers
from ml.store.sessions import Session, sessions
from ml.store.tables import LABELS
from ml.store.translation import translated
from server_gui.core.models.names import class_name

SEVERAL: Final = "labels of several wearers: not learned from"
ONLY_JUDGES: Final = "regression set: only judges"


@dataclass(frozen=True, slots=True)
class Lesson:
    """Labelled sessions of one wearer; of one session, where nobody says whose it is.

    `seconds` are labelled with each class, in the labels' own words; of the gait phase `instants` are known.
    """

    who: str  # `ml.store.labels.person`, or the session
    name: str  # as it was spelled
    is_named: bool
    sessions: int
    seconds: Mapping[str, float]
    instants: int
    why_not: str = ""  # it neither teaches nor can be chosen to judge

    @property
    def said(self) -> str:
        """Return what it has, the most first."""
        if self.why_not:
            return self.why_not
        longest = sorted(self.seconds.items(), key=lambda item: -item[1])
        parts = [f"{class_name(label)} {_clock(seconds)}" for label, seconds in longest]
        parts += [counted(self.instants, "foot contact")] if self.instants else []
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class Lessons:
    """All of one task and robot; `usual` judge where nobody chooses, `problem` is why none can."""

    each: tuple[Lesson, ...] = ()
    usual: frozenset[str] = frozenset()
    problem: str = ""


@dataclass(slots=True)
class _Gathered:
    name: str = ""
    is_named: bool = False
    sessions: int = 0
    spans: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    instants: int = 0


def lessons(url: str, task: str, robot: str = "") -> Lessons:
    """Return what is labelled for a task, of one robot or all; blocks. A broken store is its problem."""
    try:
        store = Store.existing(url)
        with translated(f"{url}/{LABELS.name} cannot be read"):
            rows = store.dataset(LABELS.name).to_table().to_pylist()
        known = [each for each in sessions(store, robot or None) if each.rows]
    except NoSuchTable:
        rows, known = [], []
    except StoreError as error:
        return Lessons(problem=str(error))
    found = _lessons(known, holding(rows), task)
    usual, problem = _usual(found)
    return Lessons(found, usual, problem)


def _lessons(known: Iterable[Session], rows: Iterable[Mapping[str, Any]], task: str) -> tuple[Lesson, ...]:
    by_session: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        by_session.setdefault((row["robot"], row["session"]), []).append(row)
    found: dict[tuple[str, str], _Gathered] = {}
    for session in known:
        said = by_session.get((session.robot, session.session), [])
        if not any(_matters(row, task) for row in said):
            continue
        people = wearers((row["label"] for row in said), session.wearer)
        why_not = SEVERAL if len(people) > 1 else ""
        if any(row["label"] == REGRESSION for row in said):
            why_not = ONLY_JUDGES
        nobody = (session.session, [session.session])
        who, spelled = next(iter(people.items())) if len(people) == 1 else nobody
        whole = found.setdefault((who, why_not), _Gathered(spelled[0], len(people) == 1))
        whole.sessions += 1
        _gather(whole, said, task)
    return tuple(
        Lesson(
            who,
            one.name,
            one.is_named,
            one.sessions,
            {label: _union_s(spans) for label, spans in one.spans.items()},
            one.instants,
            why_not,
        )
        for (who, why_not), one in sorted(found.items(), key=lambda item: item[0])
    )


def _matters(row: Mapping[str, Any], task: str) -> bool:
    """Return whether the task learns from it: from a label of the kind, and not by a model's own word."""
    fold = TASKS[task].fold
    return row["label"] in (fold or INSTANTS) and row["source"] != LabelSource.PSEUDO.value


def _gather(into: _Gathered, said: Iterable[Mapping[str, Any]], task: str) -> None:
    for row in said:
        label = row["label"]
        if not _matters(row, task):
            continue
        if label in INSTANTS:
            into.instants += 1
        else:
            begin, end = (row[name].replace(tzinfo=UTC).timestamp() for name in ("utc", "ended"))
            into.spans.setdefault(label, []).append((begin, end))


def _union_s(spans: list[tuple[float, float]]) -> float:
    """Return how long these are together; what several have labelled counts once."""
    whole, until = 0.0, float("-inf")
    for begin, end in sorted(spans):
        whole += max(0.0, end - max(begin, until))
        until = max(until, end)
    return whole


def _usual(found: Iterable[Lesson]) -> tuple[frozenset[str], str]:
    """Return who judges where nobody is chosen, as `gwrms train` does it; or why nothing can be trained."""
    from ml.training.data_split import held_out

    teaching = [each for each in found if not each.why_not]
    able = [each for each in teaching if each.is_named] or teaching
    others = sum(each.sessions for each in teaching) - sum(each.sessions for each in able)
    names = {each.who: each.name for each in able}
    try:
        return frozenset(names[who] for who in held_out(names, (), others)), ""
    except UnusableData as error:
        return frozenset(), str(error)


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02}"
