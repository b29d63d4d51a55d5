"""`sim-falling`: alarms before simulated falls' impacts and in stumbles, and none in between."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import metrics
from ml.benchmarks.folds import Split
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search
from ml.benchmarks.sim import (
    NOISE,
    SETTINGS,
    WHOLE,
    WHY,
    disturbed,
    in_folds,
    people,
    recipe_of,
)
from ml.errors import UnusableData
from ml.robot.learn import learn
from ml.robot.task import FALLING_TASK
from ml.training.simulated import Examples, examples

STEP: Final = 2  # grid samples: 40 ms
STEADY_SHARE: Final = 6  # every so-manieth steady decision is learned from: they are many and alike
STEADY: Final = "steady"
SURE: Final = 0.9  # of a near fall or a fall together …
DECISIONS: Final = 2  # … in so many decisions one after the other is an alarm
LONGEST_MS: Final = 1500.0  # after a stumble's beginning, in which an alarm is its own
NEVER: Final = -1
RECIPE: Final = recipe_of(FALLING_TASK, WHOLE)


@dataclass(frozen=True, slots=True)
class Event:
    """One stumble or fall: its decisions, and the first alarm within, counted from its first (or NEVER)."""

    label: str
    length: int
    alarm: int


def evaluate(path: Path, search: Search) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Folds of people, by people; then other people's noise."""
    sessions = people(path)
    whole = examples(FALLING_TASK, RECIPE, sessions, STEP)
    names = np.array([FALLING_TASK.fold.get(label, "") for label in whole.label])
    if not np.isin(("near_fall", "fall"), names).all():
        raise UnusableData(
            f"{path} needs both stumbles and falls: gwrms sim-record --scenario practice has them"
        )
    likely = _judged(whole, whole, names)
    figures = _figures(whole, names, likely)
    noisy = examples(FALLING_TASK, RECIPE, disturbed(sessions), STEP)
    other = _figures(noisy, names, _judged(whole, noisy, names))
    figures |= {f"{NOISE.name}{name}": other[name] for name in ("sensitivity", "false_alarms_per_hour")}
    by_subject = {
        str(one): _figures(*_of(whole, names, likely, whole.subject == one))
        for one in np.unique(whole.subject)
    }
    classes = FALLING_TASK.classes(RECIPE)
    known = names != ""
    truth = (names[known, None] == np.array(classes)).argmax(axis=1)
    counts = metrics.confusion(truth, likely[known].argmax(axis=1), len(classes))
    return Outcome(figures, len(by_subject), by_subject, "subject", classes, counts, SETTINGS, (WHY,))


def _judged(taught: Examples, seen: Examples, names: npt.NDArray[np.str_]) -> Any:
    """(n, 3) probabilities of steady, near fall and fall, of people not learned from."""
    taken = (names != STEADY) | (np.arange(len(names)) % STEADY_SHARE == 0)

    def fold(split: Split) -> Any:
        train, held_out = split
        rows = train[taken[train]]
        learned = learn(FALLING_TASK, RECIPE, taught.features[rows], names[rows], taught.subject[rows])
        return learned.judge(seen.features[held_out]).probabilities

    likely = np.zeros((len(names), len(FALLING_TASK.support)))
    for (_, held_out), said in in_folds(taught.subject, fold):
        likely[held_out] = said
    return likely


def _of(
    seen: Examples, names: npt.NDArray[np.str_], likely: Any, rows: npt.NDArray[np.bool_]
) -> tuple[Examples, npt.NDArray[np.str_], Any]:
    part = Examples(*(getattr(seen, name)[rows] for name in Examples.__slots__))
    return part, names[rows], likely[rows]


def _figures(seen: Examples, names: npt.NDArray[np.str_], likely: Any) -> dict[str, float]:
    alarms = _alarms(seen, likely[:, 1] + likely[:, 2])
    period_ms = float(np.median(np.diff(seen.time_ns))) / 1e6
    events = list(_events(seen, alarms, round(LONGEST_MS / period_ms)))
    falls, stumbles = ([event for event in events if event.label == label] for label in ("fall", "stumble"))
    leads = [(event.length - event.alarm) * period_ms for event in falls if event.alarm != NEVER]
    steady = names == STEADY
    false = steady & alarms & ~np.roll(alarms, 1) & ~_after(seen, names, round(LONGEST_MS / period_ms))
    hours = float(steady.sum()) * period_ms / 3.6e6
    known = names != ""
    classes = np.array(tuple(FALLING_TASK.support))
    return {
        "sensitivity": _share([event.alarm != NEVER for event in falls]),
        "median_lead_ms": float(np.median(leads)) if leads else float("nan"),
        "stumble_sensitivity": _share([event.alarm != NEVER for event in stumbles]),
        "false_alarms_per_hour": float(false.sum()) / hours if hours else float("nan"),
        "accuracy": float((classes[likely[known].argmax(axis=1)] == names[known]).mean()),
    }


def _alarms(seen: Examples, likely: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Return decisions that end `DECISIONS` sure ones of the same person."""
    alarms = likely >= SURE
    for back in range(1, DECISIONS):
        before = np.roll(likely, back) >= SURE
        before[:back] = False
        alarms = alarms & before & (np.roll(seen.subject, back) == seen.subject)
    flags: npt.NDArray[np.bool_] = alarms
    return flags


def _events(seen: Examples, alarms: npt.NDArray[np.bool_], longest: int) -> Iterator[Event]:
    """Yield every fall until its impact, and every stumble, with the first alarm within."""
    bounds = np.flatnonzero((seen.label[1:] != seen.label[:-1]) | (seen.subject[1:] != seen.subject[:-1])) + 1
    for begin, end in zip(bounds, [*bounds[1:], len(seen.label)], strict=True):
        label = str(seen.label[begin])
        if label in ("fall", "stumble"):
            last = end if label == "fall" else min(end, begin + longest)
            within = np.flatnonzero(alarms[begin:last])
            yield Event(label, int(end - begin), int(within[0]) if len(within) else NEVER)


def _after(seen: Examples, names: npt.NDArray[np.str_], longest: int) -> npt.NDArray[np.bool_]:
    """Decisions shortly after something that was not steady: an alarm then is of that."""
    after = np.zeros(len(names), dtype=bool)
    for back in range(1, longest + 1):
        after[back:] |= (names[:-back] != STEADY) & (seen.subject[:-back] == seen.subject[back:])
    return after


def _share(flags: list[bool]) -> float:
    return sum(flags) / len(flags) if flags else float("nan")
