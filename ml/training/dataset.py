"""A session → decisions to learn from or to be judged by: a pure function of what it is asked.

What is asked is plain data without any key, so that it can be asked on another computer: that one reaches the
store by its own environment.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow.dataset
from msgspec import Struct, json

from ml.errors import UnusableData
from ml.features.recipe import Features, Recipe, features
from ml.features.windows import Samples
from ml.registry.registry import Registry
from ml.robot.groups import unit
from ml.robot.learned import ABNORMAL_FROM, NONE, Learned
from ml.robot.task import TASKS, Task, recipe_named
from ml.serving.grid import on_grid
from ml.store import NoSuchTable, Store
from ml.store.labels import REGRESSION, Label, LabelSource, holding, wearers
from ml.store.sessions import newest
from ml.store.tables import LABELS, SESSIONS, TELEMETRY, Table
from ml.store.translation import translated
from ml.training.recorded import Recorded, recorded
from ml.training.truth import NOBODY, Instants, LabelSpan, Names, activities, phases

EVERY_MS: Final[Mapping[str, int]] = {"activity": 100, "gait_phase": 60, "falling": 40}  # between decisions
RANGE: Final = (0.001, 0.999)  # quantiles of what a channel showed


class Ask(Struct, frozen=True):
    """One session, as the tables were at these versions (by location), with this recipe's features.

    With a `teacher`, a model of the same task, decisions that nobody has labelled are labelled by it where it
    is as sure as `least`.
    """

    store: str
    versions: dict[str, int]
    robot: str
    session: str
    recipe: str
    teacher: str = ""
    least: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class SessionDecisions:
    """A session's decisions of which something is known; a row each, in time's order.

    `truth` is (n,) names of classes or, for gait_phase, (n, 2) phases; `source` (n,) who says so, as in
    `ml.store.labels.Source`. `ranges` is (channels, 2).
    """

    ask: Ask
    group: str  # the wearer, as `ml.store.labels.person`, where it is known; else the session's name
    regression: bool  # never learned from: each model is judged by it
    features: Features
    truth: npt.NDArray[Any]
    source: Names
    stamps_ns: Instants  # (n,) of the newest sample
    ranges: Samples
    named: bool = True  # whether somebody has said who the wearer was

    def of(self, rows: npt.NDArray[Any]) -> "SessionDecisions":
        """Return some of its decisions."""
        return SessionDecisions(
            self.ask,
            self.group,
            self.regression,
            self.features[rows],
            self.truth[rows],
            self.source[rows],
            self.stamps_ns[rows],
            self.ranges,
            self.named,
        )


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A session of which nothing can be had, and why."""

    ask: Ask
    why: str


def part(ask: Ask) -> SessionDecisions | LeftOut:
    """Return the session's decisions.

    Raises:
        StoreError: the store cannot be read.
        UnusableModel: the teacher cannot be used.

    """
    try:
        return _part(ask)
    except UnusableData as error:
        return LeftOut(ask, str(error))


def _part(ask: Ask) -> SessionDecisions:
    store, recipe = Store.existing(ask.store), recipe_named(ask.recipe)
    _check_units(store, ask, recipe)
    rows = recorded(store, ask.robot, ask.session, recipe.channels, _version(store, ask))
    found, stamps_ns, ranges = _decisions(recipe, rows)
    labels = _labels(store, ask)
    truth, source = truth_at(_task(recipe), _said(labels, rows), stamps_ns)
    if ask.teacher:
        _teach(ask, store, (truth, source), stamps_ns)
    known = source != NOBODY
    if not known.any():
        raise UnusableData("nobody has said what robot or wearer did in it (gwrms label)")
    regression = any(each.label == REGRESSION for each in labels)
    who = _wearer(labels, _recorded_wearer(store, ask))
    whole = SessionDecisions(
        ask, who or ask.session, regression, found, truth, source, stamps_ns, ranges, named=bool(who)
    )
    return whole.of(known)


# --- samples


def _decisions(recipe: Recipe, rows: Recorded) -> tuple[Features, Instants, Samples]:
    """Return features of every full window that a decision is due about, its newest stamp, and the ranges."""
    _check_rows(recipe, rows)
    every_ns = EVERY_MS[_task(recipe).name] * 1_000_000
    parts, stamps, seen = [], [], []
    for grid_ns, samples in on_grid(recipe, rows.stamps_ns, rows.values):
        ends = np.flatnonzero(grid_ns % every_ns == 0)
        ends = ends[ends >= recipe.look_back - 1]
        if len(ends):
            parts.append(features(recipe, samples, ends))
            stamps.append(grid_ns[ends])
            seen.append(samples)
    if not parts:
        raise UnusableData(
            f"no {look_back_s(recipe):g} s of it are without a gap: {_worst(recipe, rows.values)}"
        )
    ranges = np.quantile(np.concatenate(seen), RANGE, axis=0).T
    return np.concatenate(parts), np.concatenate(stamps), ranges


def _check_rows(recipe: Recipe, rows: Recorded) -> None:
    if not len(rows.stamps_ns):
        raise UnusableData("it has no telemetry")
    empty = np.flatnonzero(~np.isfinite(rows.values).any(axis=0))
    if len(empty):
        missing = ", ".join(recipe.channels[at] for at in empty)
        raise UnusableData(f"it has no value of {missing}, which {recipe.name} needs")
    length_s = (rows.stamps_ns[-1] - rows.stamps_ns[0]) / 1e9
    if length_s < look_back_s(recipe):
        raise UnusableData(f"it lasts {length_s:.1f} s: {recipe.name} looks back {look_back_s(recipe):g} s")


def look_back_s(recipe: Recipe) -> float:
    """Return how much of a recording comes before its first decision."""
    return recipe.look_back / recipe.rate_hz


def _worst(recipe: Recipe, values: Samples) -> str:
    missing = 1.0 - np.isfinite(values).mean(axis=0)
    at = int(missing.argmax())
    return f"{recipe.channels[at]} is missing in {100 * missing[at]:.0f} % of the rows"


def _check_units(store: Store, ask: Ask, recipe: Recipe) -> None:
    """Check units by the robot's description at the session's start, else by the table's columns."""
    units = store.units(TELEMETRY.location(ask.robot, store.about.shards))
    for row in newest(_rows(store, SESSIONS, ask)):
        units |= json.decode(row["units"] or "{}")
    for name in recipe.channels:
        if name in units and units[name] != unit(name):
            given = units[name] or "a unit that nobody knows"
            raise UnusableData(f"{name} is in {given}; models learn from {unit(name)}")


# --- labels


def _labels(store: Store, ask: Ask) -> list[Label]:
    return [Label.of(row) for row in holding(_rows(store, LABELS, ask))]


def _said(labels: Sequence[Label], rows: Recorded) -> list[LabelSpan]:
    """Return the labels on the robot's clock."""
    times = np.array([(each.began_utc_ns, each.ended_utc_ns) for each in labels], np.int64).reshape(-1, 2)
    begins, ends = (rows.at_utc(column).tolist() for column in times.T)
    return [
        LabelSpan(begin, end, each.label, each.source)
        for begin, end, each in zip(begins, ends, labels, strict=True)
    ]


def truth_at(task: Task, said: Sequence[LabelSpan], stamps_ns: Instants) -> tuple[npt.NDArray[Any], Names]:
    """Return truth and source, as in `SessionDecisions`, of decisions by their newest stamps (n,)."""
    about_ns = stamps_ns - task.delay_ms * 1_000_000
    if not task.fold:
        return phases(said, about_ns)
    names, sources = activities(said, about_ns)
    classes = np.array([*task.support, NOBODY])
    folded = np.full(len(names), NOBODY, classes.dtype)
    for name in np.unique(names):
        folded[names == name] = task.fold.get(str(name), NOBODY)
    return folded, np.where(np.isin(names, list(task.fold)), sources, NOBODY)


def _task(recipe: Recipe) -> Task:
    return TASKS[recipe.name.partition("/")[0]]


def _recorded_wearer(store: Store, ask: Ask) -> str:
    """Return the wearer as named in the recording."""
    return "".join(row.get("wearer") or "" for row in newest(_rows(store, SESSIONS, ask)))


def _wearer(labels: Sequence[Label], recorded: str) -> str:
    """Return the wearer, however spelled; "" without a name."""
    people = wearers((each.label for each in labels), recorded)
    if len(people) > 1:
        names = sorted(name for spelled in people.values() for name in spelled)
        raise UnusableData(f"it has labels of several wearers: {', '.join(names)}; take all but one back")
    return "".join(people)


def _teach(ask: Ask, store: Store, known: tuple[npt.NDArray[Any], Names], stamps_ns: Instants) -> None:
    """Fill in what nobody has said and the teacher is sure of, marked as such."""
    card, state = Registry(ask.store).load(ask.teacher)
    teacher, (truth, source) = Learned.restored(state), known
    rows = recorded(store, ask.robot, ask.session, card.channels, _version(store, ask))
    found, its_stamps_ns, _ = _decisions(teacher.recipe, rows)
    verdicts = teacher.judge(found)
    sure = (verdicts.label != NONE) & (verdicts.novelty < ABNORMAL_FROM)
    sure &= verdicts.probabilities.max(axis=1) >= ask.least
    _, mine, its = np.intersect1d(stamps_ns, its_stamps_ns[sure], return_indices=True)
    free = source[mine] == NOBODY
    truth[mine[free]] = np.array(teacher.classes)[verdicts.label[sure][its[free]]]
    source[mine[free]] = LabelSource.PSEUDO.value


# --- tables


def _version(store: Store, ask: Ask) -> int:
    return ask.versions[TELEMETRY.location(ask.robot, store.about.shards)]


def _rows(store: Store, table: Table, ask: Ask) -> list[dict[str, Any]]:
    """Return those of the session; none where the table was not there yet."""
    if table.name not in ask.versions:
        return []
    field = pyarrow.dataset.field
    mine = (field("robot") == ask.robot) & (field("session") == ask.session)
    with translated(f"{ask.store}/{table.name} cannot be read"):
        rows = store.dataset(table.name, ask.versions[table.name]).to_table(filter=mine)
    found: list[dict[str, Any]] = rows.to_pylist()
    return found


def versions(store: Store, robots: Sequence[str]) -> dict[str, int]:
    """Return the versions of now, of all tables that are needed for these robots' sessions, by location."""
    shards = store.about.shards
    wanted = {*(TELEMETRY.location(robot, shards) for robot in robots), SESSIONS.name, LABELS.name}
    found: dict[str, int] = {}
    for location in sorted(wanted):
        try:
            found[location] = store.table(location).version()
        except NoSuchTable:
            continue
    return found
