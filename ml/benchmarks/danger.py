"""`sim-danger`: dangers foreseen on simulated wearers never seen, and what that costs in false alarms."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks.danger_data import SUDDEN, WALKS, Seen, judgeable, read
from ml.benchmarks.outcome import Outcome
from ml.danger.calibration import Calibration, calibrated, evidence, fit, load, tails
from ml.danger.detector import DETECTORS
from ml.danger.false_alarm_budget import (
    BLOCK_S,
    BUDGETS,
    extrapolated,
    rate_interval,
    rule_of_three,
    share_interval,
    thresholds,
)
from ml.danger.levels import Level, Levels, sustained
from ml.danger.observation import CHANNELS
from ml.errors import UnusableData
from ml.features.recipe import Features, Recipe
from ml.features.windows import Samples

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FOLDS: Final = 4
LEAD_S: Final = 0.3  # before harm: what is said later is not foreseen
PERIOD_S: Final = 0.04
BINS: Final = 10  # of the reliability diagram
LEVELS: Final = {Level.EARLY: "early", Level.ADVICE: "advice", Level.ALARM: "alarm", Level.STOP: "stop"}
WHY: Final = (
    "synthetic: wearers of gwrms sim-record --scenario dangers, judged by weights and thresholds of others"
    " (sim-danger) or by those that ship (sim-danger-shipped,"
    " learned from 301-318 of seed 23, 401-410 of 24 and healthy days of 601-612 of 31)."
    " Foreseen: advice at least 0.3 s before harm in the simulator's truth. …_low and …_high: 95 % intervals;"
    " stops_per_100_h_upper is the one-sided 95 % bound (3 / hours where none was seen);"
    " …_extrapolated what an exponential tail of this recording's own healthy blocks makes of it."
)


@dataclass(frozen=True, slots=True)
class Event:
    """One danger: how long before harm advice came, None where it did not."""

    name: str
    subject: str
    lead_s: float | None

    @property
    def foreseen(self) -> bool:
        """Whether that was soon enough."""
        return self.lead_s is not None and self.lead_s >= LEAD_S


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """One wearer as others' calibration judges it."""

    seen: Seen
    probability: Floats
    level: npt.NDArray[np.int_]


def learn(seen: Sequence[Seen], told: str) -> Calibration:
    """Weights by all; the curve and thresholds by each wearer as the others' weights judge it.

    Raises:
        UnusableData: they show no healthy walking, or no danger.

    """
    odds = _out_of_fold(seen)
    parts = _fit(seen)
    known = [one.judged for one in seen]
    said = np.concatenate([each[rows] for each, rows in zip(odds, known, strict=True)])
    true = np.concatenate([one.coming[rows] for one, rows in zip(seen, known, strict=True)])
    knots, share = calibrated(said, true)
    maxima = np.concatenate([_maxima(one, each) for one, each in zip(seen, odds, strict=True)])
    levels = thresholds(maxima, _hours(seen))
    return Calibration(
        DETECTORS,
        *parts,
        tuple(knots),
        tuple(share),
        {level.word: value for level, value in levels.items()},
        {level.word: budget for level, budget in BUDGETS.items()},
        told,
    )


Parts = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], float]


def _fit(seen: Sequence[Seen]) -> Parts:
    """Floors, scales, weights and bias. Each danger counts alike, however long; so does each class."""
    if not any(walking(one).any() for one in seen):
        raise UnusableData("nobody walks on level ground: thresholds cannot be learned")
    if not any(_counts(one).any() for one in seen):
        raise UnusableData("nobody meets a danger that something shows before: weights cannot be learned")
    blocks = [_maxima(one, one.above[:, at]) for one in seen for at in range(len(DETECTORS))]
    maxima = np.concatenate(
        [np.stack(blocks[at : at + len(DETECTORS)], axis=1) for at in range(0, len(blocks), len(DETECTORS))]
    )
    floor, scale = tails(maxima)
    known = [walking(one) | one.coming for one in seen]
    above = np.concatenate([one.above[rows] for one, rows in zip(seen, known, strict=True)])
    coming = np.concatenate([one.coming[rows] for one, rows in zip(seen, known, strict=True)])
    counts = np.concatenate([_counts(one)[rows] for one, rows in zip(seen, known, strict=True)])
    counts[~coming] = counts[coming].sum() / max((~coming).sum(), 1)
    weights, bias = fit(evidence(above, floor, scale), coming, counts)
    return floor, scale, tuple(weights.tolist()), bias


def _counts(one: Seen) -> Floats:
    """Return the weight of each moment of a danger: its later half, one in total."""
    counts = np.zeros(len(one.danger))
    for begin, end in _spans(one.danger):
        if one.coming[begin] and one.danger[begin] in _foreseeable(one):
            middle = (begin + end) // 2
            counts[middle:end] = 1.0 / (end - middle)
    return counts


def _spans(danger: Floats) -> Iterator[tuple[int, int]]:
    """Yield where each danger begins and ends, and each time between two; not what is there first."""
    changes = (np.flatnonzero(np.diff(danger)) + 1).tolist()
    return pairwise([*changes, len(danger)])


def _foreseeable(one: Seen) -> set[float]:
    """Return the numbers of dangers that something shows before."""
    return {1.0 + at for at, name in enumerate(one.names) if name not in SUDDEN}


def _out_of_fold(seen: Sequence[Seen]) -> list[Floats]:
    odds: list[Floats] = [np.empty(0)] * len(seen)
    for fold in range(min(FOLDS, len(seen))):
        others = [one for at, one in enumerate(seen) if at % FOLDS != fold]
        known = Calibration(DETECTORS, *_fit(others or seen), (), (), {}, {}, "")
        odds[fold::FOLDS] = [known.log_odds(one.above) for one in seen[fold::FOLDS]]
    return odds


def walking(one: Seen) -> Flags:
    """Healthy moments on level ground: standing, walking, turning."""
    flags: Flags = one.healthy & np.isin(one.label, list(WALKS))
    return flags


def _maxima(one: Seen, odds: Floats) -> Floats:
    """Return the highest threshold that each block of healthy walking would have reached."""
    rows = walking(one)
    block = (one.at_s[rows] // BLOCK_S).astype(np.int_)
    said = sustained(np.nan_to_num(odds))[rows]
    return np.array([said[block == number].max() for number in np.unique(block)])


def _hours(seen: Sequence[Seen]) -> float:
    return sum(float(walking(one).sum()) for one in seen) * PERIOD_S / 3600.0


def judge(one: Seen, calibration: Calibration) -> Judged:
    """Return what was said of a wearer, moment by moment; after harm the levels begin anew."""
    odds = calibration.log_odds(one.above)
    levels, level = Levels(calibration.by_level), np.zeros(len(odds), dtype=np.int_)
    over = False
    for at, (now, value, danger) in enumerate(
        zip(one.at_s.tolist(), odds.tolist(), one.danger.tolist(), strict=True)
    ):
        if over and danger == 0.0:
            levels = Levels(calibration.by_level)
        over = danger < 0.0
        level[at] = levels.take(now, value)
    return Judged(one, calibration.probability(odds), level)


def events(judged: Judged, least: Level) -> Iterator[Event]:
    """Yield every danger that did harm, and when its level was first reached."""
    danger = judged.seen.danger
    for begin, end in _spans(danger):
        number = danger[begin]
        if number < 1.0 or number % 1.0 or end >= len(danger) or danger[end] != number + 0.5:
            continue
        reached = np.flatnonzero(judged.level[begin:end] >= least)
        lead = float(judged.seen.at_s[end] - judged.seen.at_s[begin + reached[0]]) if len(reached) else None
        yield Event(judged.seen.names[int(number) - 1], judged.seen.subject, lead)


def false_alarms(judged: Judged, least: Level, rows: Flags) -> int:
    """Return the number of new rises to a level in these moments; several within a block are one."""
    rises = np.flatnonzero((judged.level >= least) & (np.roll(judged.level, 1) < least) & rows)
    count, last = 0, -np.inf
    for at in judged.seen.at_s[rises]:
        if at - last >= BLOCK_S:
            count, last = count + 1, at
    return count


def _looked_at(windows: Samples) -> Features:
    """Return what a robot's channels are: the detectors make their own of them, row by row."""
    return windows[:, :, -1].astype(np.float32)


DANGER: Final = Recipe("danger/all", 25.0, 1, CHANNELS, _looked_at)


def evaluate(path: Path, search: bool) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Folds of wearers; weights, curve and thresholds by the others alone."""
    seen, left_out = judgeable(path, read(path))
    found = outcome(cross_judged(seen))
    return replace(found, notes=(*found.notes, *left_out))


def evaluate_shipped(path: Path, search: bool) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Judge the calibration that ships, on wearers from whom it was not learned."""
    calibration = load()
    seen, left_out = judgeable(path, read(path))
    found = outcome([judge(one, calibration) for one in seen])
    maxima = np.concatenate([_maxima(one, calibration.log_odds(one.above)) for one in seen])
    stops = 100.0 * extrapolated(maxima, _hours(seen), calibration.by_level[Level.STOP])
    figures = {**found.figures, "stops_per_100_h_extrapolated": stops}
    return replace(found, figures=figures, notes=(*found.notes, *left_out))


def cross_judged(seen: Sequence[Seen]) -> list[Judged]:
    """Return each wearer as the calibration of others judges it."""
    subjects = sorted({one.subject for one in seen}, key=int)
    folds = min(FOLDS, len(subjects))
    found = []
    for fold in range(folds):
        held = set(subjects[fold::folds])
        calibration = learn([one for one in seen if one.subject not in held], "")
        found += [judge(one, calibration) for one in seen if one.subject in held]
    return found


def outcome(judged: Sequence[Judged]) -> Outcome:
    """Return every figure."""
    found = [event for one in judged for event in events(one, Level.ADVICE)]
    seen = [event for event in found if event.name not in SUDDEN]
    figures = shares("foreseen", [event.foreseen for event in seen])
    leads = [event.lead_s for event in seen if event.lead_s is not None]
    figures |= {
        "events": float(len(seen)),
        "median_lead_s": float(np.median(leads)) if leads else float("nan"),
        "foreseen_sudden": _mean([event.foreseen for event in found if event.name in SUDDEN]),
        "told_before_harm": _mean([event.lead_s is not None for event in seen]),
    }
    figures |= _rates(judged) | _reliability(judged)
    names = sorted({event.name for event in found})
    groups = {name: of_danger([event for event in found if event.name == name]) for name in names}
    people = len({one.seen.subject for one in judged})
    return Outcome(
        figures,
        people,
        groups,
        "danger",
        settings="fixed in ml/danger; thresholds from budgets",
        notes=(WHY,),
    )


def of_danger(found: Sequence[Event]) -> dict[str, float]:
    """Return the share of these events that was foreseen, with its interval."""
    leads = [event.lead_s for event in found if event.lead_s is not None]
    low, high = share_interval(sum(event.foreseen for event in found), len(found))
    return {
        "foreseen": _mean([event.foreseen for event in found]),
        "low": low,
        "high": high,
        "median_lead_s": float(np.median(leads)) if leads else float("nan"),
        "events": float(len(found)),
    }


def _rates(judged: Sequence[Judged]) -> dict[str, float]:
    hours = _hours([one.seen for one in judged])
    found = {"healthy_hours": hours}
    for level, name in LEVELS.items():
        found |= per_hour(judged, level, name, [walking(one.seen) for one in judged])
    stops = sum(false_alarms(one, Level.STOP, walking(one.seen)) for one in judged)
    found |= {"stops": float(stops), "stops_per_100_h_upper": 100.0 * rule_of_three(stops, hours)}
    others = [one.seen.healthy & ~walking(one.seen) for one in judged]
    count = sum(false_alarms(one, Level.ADVICE, rows) for one, rows in zip(judged, others, strict=True))
    elsewhere = sum(float(rows.sum()) for rows in others) * PERIOD_S / 3600.0
    found["advice_per_hour_stairs_ramps_seat"] = count / elsewhere if elsewhere else float("nan")
    return found


def per_hour(judged: Sequence[Judged], level: Level, name: str, rows: Sequence[Flags]) -> dict[str, float]:
    """Return the rate of new rises to a level in these moments, with its interval."""
    hours = sum(float(own.sum()) for own in rows) * PERIOD_S / 3600.0
    count = sum(false_alarms(one, level, own) for one, own in zip(judged, rows, strict=True))
    low, high = rate_interval(count, hours)
    each = count / hours if hours else float("nan")
    return {f"{name}_per_hour": each, f"{name}_low": low, f"{name}_high": high}


def shares(name: str, flags: Sequence[bool]) -> dict[str, float]:
    """Return a share with its interval."""
    low, high = share_interval(sum(flags), len(flags)) if flags else (float("nan"), float("nan"))
    return {name: _mean(flags), f"{name}_low": low, f"{name}_high": high}


def _mean(flags: Sequence[bool]) -> float:
    return float(np.mean(flags)) if flags else float("nan")


def reliability(judged: Sequence[Judged]) -> list[tuple[float, float, int]]:
    """Return, by tenths of what was said, its mean, the share that came true, how many moments."""
    said, true = _said(judged)
    bins = np.minimum((BINS * said).astype(np.int_), BINS - 1)
    return [
        (float(said[bins == at].mean()), float(true[bins == at].mean()), int((bins == at).sum()))
        for at in range(BINS)
        if (bins == at).any()
    ]


def _said(judged: Sequence[Judged]) -> tuple[Floats, Floats]:
    rows = [one.seen.judged for one in judged]
    said = np.concatenate([one.probability[each] for one, each in zip(judged, rows, strict=True)])
    true = np.concatenate([one.seen.coming[each] for one, each in zip(judged, rows, strict=True)])
    return said, true.astype(np.float64)


def _reliability(judged: Sequence[Judged]) -> dict[str, float]:
    said, true = _said(judged)
    table = reliability(judged)
    error = sum(count * abs(mean - share) for mean, share, count in table) / len(said)
    return {
        "brier": float(np.mean((said - true) ** 2)),
        "calibration_error": float(error),
        "share_in_danger": float(true.mean()),
    }
