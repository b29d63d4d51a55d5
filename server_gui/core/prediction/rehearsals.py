"""Recordings that rules are rehearsed over: sessions of the store, and the benchmarks' of people."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from ml.benchmarks import alarms
from ml.benchmarks.alarms import Told
from ml.errors import UnusableData
from ml.serving.predictor import Prediction
from server_gui.core.prediction.rehearsal import Rehearsed, Stretch, rehearse
from server_gui.core.prediction.replay import Replayed
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings

SECOND_NS: Final = 1_000_000_000
ALSO: Final[Mapping[str, frozenset[str]]] = MappingProxyType(
    {"near_fall": frozenset({"near_fall", "fall"})}  # what warns of the one is right about the other
)
Read = Callable[[Path, Path | None], list[Told]]


class Benchmark:
    """Recordings of people, with what a model says of each that has not seen that person."""

    def __init__(self, task: str, labels: Iterable[str], every_ms: int, about: str, read: Read) -> None:
        self.task = task
        self.labels = frozenset(labels)
        self.every_ns = every_ms * 1_000_000
        self.about = about
        self._read = read

    def rehearse(self, rules: Iterable[RuleSettings], data: Path, falls: Path | None) -> list[Rehearsed]:
        """Rehearse the rules of which these recordings can show anything.

        Raises:
            UnusableData: it is no such file.

        """
        told = [(one, _predictions(self.task, one)) for one in self._read(data, falls)]
        return [
            rehearse(rule, self.every_ns, [_stretch(rule.label, *one) for one in told])
            for rule in rules
            if rule.task == self.task and rule.label in self.labels
        ]


def _falls_in_walks(data: Path, falls: Path | None) -> list[Told]:
    if falls is None:
        raise UnusableData(
            "nobody falls in these walks: name recordings of falls to learn from with --falls FILE.npz"
        )
    return alarms.walks(data, falls)


BENCHMARKS: Final[Mapping[str, Benchmark]] = MappingProxyType(
    {
        "sisfall-prefall": Benchmark(
            "falling",
            ("near_fall", "fall"),
            40,
            "falls and daily life (SisFall), by models of other people",
            lambda data, _: alarms.falls(data),
        ),
        "ipol-falls": Benchmark(
            "falling",
            ("near_fall", "fall"),
            40,
            "walks (IPOL) without a fall, by a model of SisFall (--falls)",
            _falls_in_walks,
        ),
        "ipol-status": Benchmark(
            "activity",
            ("stand", "walk", "turn"),
            100,
            "walks (IPOL), by models of other people",
            lambda data, _: alarms.statuses(data),
        ),
    }
)


def of_sessions(
    rules: Iterable[RuleSettings],
    settings: PredictionSettings,
    sessions: Sequence[tuple[str, Sequence[Replayed]]],
) -> list[Rehearsed]:
    """Rehearse each rule over the sessions (robot, replay) of the robots that it concerns."""
    found = []
    for rule in rules:
        own = [
            _of_session(rule, one, settings.every_ns(rule.task))
            for robot, replayed in sessions
            if rule.concerns(robot)
            for one in replayed
            if one.model.card.task == rule.task
        ]
        found.append(rehearse(rule, settings.every_ns(rule.task), own))
    return found


def _of_session(rule: RuleSettings, replayed: Replayed, every_ns: int) -> Stretch:
    """Return the stretch of a session; if it is labelled, cause is while the rule's label was true."""
    causes = list(_causes(rule, replayed.truth)) if replayed.truth else None
    return Stretch(replayed.predictions, len(replayed.predictions) * every_ns, causes)


def _causes(rule: RuleSettings, truth: Mapping[int, str]) -> Iterator[tuple[int, int]]:
    wanted = ALSO.get(rule.label, frozenset({rule.label}))
    for true, spell in itertools.groupby(sorted(truth.items()), key=lambda one: one[1] in wanted):
        stamps = [stamp_ns for stamp_ns, _ in spell]
        if true:
            yield stamps[0], stamps[-1]


def _stretch(label: str, told: Told, predictions: Sequence[Prediction]) -> Stretch:
    causes = [(round(begin * SECOND_NS), round(end * SECOND_NS)) for begin, end in told.causes.get(label, ())]
    return Stretch(predictions, round(told.length_s * SECOND_NS), causes)


def _predictions(task: str, told: Told) -> list[Prediction]:
    names = list(told.probabilities)
    columns = zip(*(column.tolist() for column in told.probabilities.values()), strict=True)
    return [
        _prediction(task, round(at_s * SECOND_NS), dict(zip(names, row, strict=True)))
        for at_s, row in zip(told.at_s.tolist(), columns, strict=True)
    ]


def _prediction(task: str, stamp_ns: int, probabilities: dict[str, float]) -> Prediction:
    label = max(probabilities, key=probabilities.__getitem__)
    return Prediction(task, "benchmark", stamp_ns, label, probabilities[label], 0.0, probabilities)
