"""Accuracy of the last days' predictions, by labels in the store."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from datetime import UTC, datetime, timedelta
from typing import Final, NamedTuple

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset

from ml.registry.registry import Registry
from ml.robot.task import TASKS
from ml.store import NoSuchTable, Store
from ml.store.fragments import DataFile, data_files
from ml.store.labels import ACTIVITIES, INSTANTS, Label, holding
from ml.store.tables import LABELS, PREDICTIONS, Table
from ml.store.translation import translated
from ml.training.recorded import Recorded
from server_gui.core.prediction.scoring import (
    Counts,
    Decisions,
    compared,
    counted,
    labelled_seconds,
    proven_classes,
    quality,
)
from server_gui.core.prediction.state import WITHIN_DAYS, Figures

Key = tuple[str, str, str]  # robot, task, model
DELAY: Final = timedelta(milliseconds=max(task.delay_ms for task in TASKS.values()))
_COLUMNS: Final = ["utc", "stamp_ns", "task", "model", "label", "values"]
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_field = pyarrow.dataset.field


class Stretch(NamedTuple):
    """A labelled part of a session, and the files of its predictions: while these stay, counts do."""

    labels: tuple[Label, ...]
    begin: datetime
    end: datetime
    files: tuple[str, ...]


class Compared(NamedTuple):
    """Decisions of a recording of which the truth is known, and in how many seconds they are."""

    counts: Counts
    seconds: int


class TrackRecord:
    """Track record in one store; for one thread at a time. It rereads only changed data."""

    def __init__(self, store_url: str) -> None:
        self._store = Store.existing(store_url)
        self._registry = Registry(store_url)
        self._seen: object = None  # what `_figures` are of
        self._figures: Figures = {}
        self._labelled: tuple[object, list[Label]] = None, []  # of what, session by session
        self._counts: Mapping[Stretch, Mapping[Key, Compared]] = {}

    def figures(self, robots: Set[str], now: datetime, ending: Callable[[], bool] = lambda: False) -> Figures:
        """Return the predictions about these robots of the last days; nothing new while it is `ending`.

        A session that a model has learned from proves nothing of it, and is left out.

        Raises:
            StoreError: the store cannot be read.

        """
        since = now.replace(minute=0, second=0, microsecond=0) - timedelta(days=WITHIN_DAYS)
        labels, said = self._version(LABELS), self._version(PREDICTIONS)
        if (robots, since, labels, said) == self._seen:
            return self._figures
        counts: dict[Stretch, Mapping[Key, Compared]] = {}
        if labels is not None and said is not None:
            for stretch in self._stretches(robots, since, labels, said):
                if ending():
                    return self._figures
                known = self._counts.get(stretch)
                counts[stretch] = self._compared(stretch, said) if known is None else known
        self._seen, self._counts = (robots, since, labels, said), counts
        self._figures = _figures(counts.values())
        return self._figures

    def _version(self, table: Table) -> int | None:
        try:
            return self._store.table(table.name).version()
        except NoSuchTable:
            return None

    def _stretches(self, robots: Set[str], since: datetime, labels: int, said: int) -> Iterator[Stretch]:
        """Yield a stretch a session, from its first label to its last."""
        delta = self._store.table(PREDICTIONS.name, said)
        with translated(f"{self._store.url}/{PREDICTIONS.name} cannot be read"):
            files = list(data_files(delta, PREDICTIONS.name))
        for _, each in itertools.groupby(self._labels(robots, since, labels), _session):
            own = tuple(each)
            begin = max(since, _utc(min(one.began_utc_ns for one in own)))
            end = _utc(max(one.ended_utc_ns for one in own)) + DELAY
            yield Stretch(own, begin, end, tuple(sorted(_between(files, begin, end))))

    def _labels(self, robots: Set[str], since: datetime, version: int) -> list[Label]:
        if self._labelled[0] != (robots, since, version):
            self._labelled = (robots, since, version), self._read_labels(robots, since, version)
        return self._labelled[1]

    def _read_labels(self, robots: Set[str], since: datetime, version: int) -> list[Label]:
        wanted = (
            _field("robot").isin(list(robots))
            & _field("label").isin([*ACTIVITIES, *INSTANTS])
            & (_field("ended") >= since)
        )
        with translated(f"{self._store.url}/{LABELS.name} cannot be read"):
            rows = self._store.dataset(LABELS.name, version).to_table(filter=wanted).to_pylist()
        return sorted((Label.of(row) for row in holding(rows)), key=_session)

    def _compared(self, stretch: Stretch, version: int) -> Mapping[Key, Compared]:
        """Count predictions in a stretch against its labels, by robot, task and model."""
        robot, session = _session(stretch.labels[0])
        rows = self._said(stretch, version)
        clock = Recorded(
            rows["stamp_ns"].to_numpy(),
            pc.cast(rows["utc"], pa.int64()).to_numpy() * 1000,
            np.empty((len(rows), 0)),
        )
        found = {}
        for one in rows.group_by(["task", "model"]).aggregate([]).to_pylist():
            task, model = one["task"], one["model"]
            if classes := proven_classes(self._registry, model, session):
                said = _decisions(rows.filter((_field("task") == task) & (_field("model") == model)))
                was, said_then = compared(stretch.labels, clock, TASKS[task], classes, said)
                seconds = labelled_seconds(was, said.stamps_ns)
                found[robot, task, model] = Compared(counted(was, said_then), seconds)
        return found

    def _said(self, stretch: Stretch, version: int) -> pa.Table:
        robot, session = _session(stretch.labels[0])
        wanted = (
            (_field("robot") == robot)
            & (_field("session") == session)
            & (_field("utc") >= stretch.begin)
            & (_field("utc") <= stretch.end)
            & _field("task").isin(list(TASKS))
        )
        with translated(f"{self._store.url}/{PREDICTIONS.name} cannot be read"):
            rows = self._store.dataset(PREDICTIONS.name, version).to_table(columns=_COLUMNS, filter=wanted)
        return rows.sort_by("stamp_ns")


def _decisions(rows: pa.Table) -> Decisions:
    values = [msgspec.json.decode(text or "{}", type=dict[str, float]) for text in rows["values"].to_pylist()]
    return Decisions(rows["stamp_ns"].to_numpy(), rows["label"].to_pylist(), values)


def _session(label: Label) -> tuple[str, str]:
    return label.robot, label.session


def _utc(utc_ns: int) -> datetime:
    return _EPOCH + timedelta(microseconds=utc_ns // 1000)


def _between(files: Sequence[DataFile], begin: datetime, end: datetime) -> Iterator[str]:
    for file in files:
        if (file.first is None or file.first <= end) and (file.last is None or file.last >= begin):
            yield file.path


def _figures(found: Iterable[Mapping[Key, Compared]]) -> Figures:
    by_key: dict[Key, list[Compared]] = {}
    for recording in found:
        for key, one in recording.items():
            if one.counts:
                by_key.setdefault(key, []).append(one)
    figures: Figures = {}
    for (robot, task, model), each in sorted(by_key.items()):
        counts = sum((one.counts for one in each), Counts())
        seconds = sum(one.seconds for one in each)
        figures.setdefault(robot, {}).setdefault(task, {})[model] = quality(counts, seconds, len(each))
    return figures
