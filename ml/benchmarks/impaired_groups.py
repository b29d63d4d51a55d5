"""People in groups: the worst group first, never the mean alone, with intervals over people."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import losses
from ml.benchmarks.impaired import HEALTHY
from ml.robot import conformal

MODELS: Final = ("healthy", "mixed")  # what learned from healthy people alone, and from every group
WHEN: Final = ("later", "adapted")  # after the first minute: without what it taught, and with it
FEWEST: Final = 3  # people, for a row of their own
DRAWS: Final = 2000  # of people, for an interval
LEVEL: Final = 0.95
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Person:
    """One person, whom no model that judged him had seen."""

    subject: int
    group: str
    sensor: str
    figures: Mapping[str, float]  # by MODEL_FIGURE


def rows_of(people: Sequence[Person]) -> dict[str, dict[str, float]]:
    """Return each group's figures, the worst first by models of healthy people; then by make of sensor."""
    groups = {name: [one for one in people if one.group == name] for name in {one.group for one in people}}
    order = sorted(groups, key=lambda name: -_mean(groups[name], "healthy_rmse_percent"))
    rows = {name: _row(groups[name]) for name in order}
    for name in order:
        for sensor in sorted({one.sensor for one in groups[name]}):
            own = [one for one in groups[name] if one.sensor == sensor]
            if FEWEST <= len(own) < len(groups[name]):
                rows[f"{name}, {sensor}"] = _row(own)
    return rows


def figures_of(people: Sequence[Person], rows: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return the worst group's figures, what patients gain from mixed models, and what a minute gives."""
    names = {one.group for one in people}
    found: dict[str, float] = {}
    for model in MODELS:
        rmse = [rows[name][f"{model}_rmse_percent"] for name in names]
        found |= {
            f"worst_group_{model}_rmse_percent": max(rmse),
            f"{model}_rmse_percent": float(np.mean(rmse)),
            f"worst_group_{model}_kept_fraction": min(rows[name][f"{model}_kept"] for name in names),
            f"{model}_interval_percent": _mean(people, f"{model}_interval_percent"),
        }
    patients = [one for one in people if one.group != HEALTHY]
    low, high = interval([_gain(one) for one in patients])
    found |= {"mixed_gain_points": _gains(patients), "mixed_gain_low": low, "mixed_gain_high": high}
    for model in MODELS:
        found |= _adaptation(people, model)
    return found


def lost_of(people: Sequence[Person], shares: Sequence[float]) -> dict[str, float]:
    """Return the worst group's figure and the mean of the groups where packets are lost."""
    groups = [[one for one in people if one.group == name] for name in {one.group for one in people}]
    found: dict[str, float] = {}
    for model in MODELS:
        for share in shares:
            figure = losses.at(f"{model}_rmse_percent", share)
            rmse = [_mean(own, figure) for own in groups]
            found |= {f"worst_group_{figure}": max(rmse), figure: float(np.mean(rmse))}
    return found


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the middle 95 % of the means of people drawn anew; NaN of nobody."""
    known = np.array([value for value in values if not math.isnan(value)])
    if not len(known):
        return math.nan, math.nan
    random = np.random.default_rng(0)
    means = known[random.integers(0, len(known), (DRAWS, len(known)))].mean(axis=1)
    low, high = np.quantile(means, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def _row(people: Sequence[Person]) -> dict[str, float]:
    row = {"people": float(len(people)), "hindsight_rmse_percent": _mean(people, "hindsight_rmse_percent")}
    for model in MODELS:
        values = [one.figures[f"{model}_rmse_percent"] for one in people]
        low, high = interval(values)
        worst = sorted(values, reverse=True)[: math.ceil(len(values) / 3)]
        row |= {
            f"{model}_rmse_percent": float(np.mean(values)),
            f"{model}_low": low,
            f"{model}_high": high,
            f"{model}_worst_third": float(np.mean(worst)),
            f"{model}_covered": _mean(people, f"{model}_covered"),
            f"{model}_kept": float(
                np.mean([one.figures[f"{model}_covered"] >= conformal.COVERED for one in people])
            ),
        }
    later = [one for one in people if not math.isnan(one.figures["healthy_later_rmse_percent"])]
    row["later_people"] = float(len(later))
    for model in MODELS:
        for when in WHEN:
            row[f"{model}_{when}"] = _mean(later, f"{model}_{when}_rmse_percent")
    return row


def _adaptation(people: Sequence[Person], model: str) -> dict[str, float]:
    """Return the reduction of the later error by a minute: of all, and of the third that was worst in it."""
    judged = [one for one in people if not math.isnan(one.figures[f"{model}_later_rmse_percent"])]
    if not judged:
        return {}
    judged.sort(key=lambda one: -one.figures[f"{model}_early_rmse_percent"])
    found: dict[str, float] = {}
    for name, own in ((model, judged), (f"{model}_worst_third", judged[: math.ceil(len(judged) / 3)])):
        pairs = np.array([[one.figures[f"{model}_{when}_rmse_percent"] for when in WHEN] for one in own])
        low, high = _cut_interval(pairs)
        before, after = pairs.mean(axis=0).tolist()
        found |= {
            f"{name}_later_rmse_percent": before,
            f"{name}_adapted_rmse_percent": after,
            f"{name}_adaptation_cut": 1.0 - after / before,
            f"{name}_adaptation_cut_low": low,
            f"{name}_adaptation_cut_high": high,
        }
    return found


def _cut_interval(pairs: Floats) -> tuple[float, float]:
    """Return the interval of the cut, of (n, 2) errors before and after; people are drawn anew."""
    drawn = np.random.default_rng(0).integers(0, len(pairs), (DRAWS, len(pairs)))
    before, after = pairs[drawn].mean(axis=1).T
    low, high = np.quantile(1.0 - after / before, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def _gain(person: Person) -> float:
    return person.figures["healthy_rmse_percent"] - person.figures["mixed_rmse_percent"]


def _gains(people: Sequence[Person]) -> float:
    return float(np.mean([_gain(one) for one in people]))


def _mean(people: Sequence[Person], figure: str) -> float:
    """Return the mean over those of whom it is known; NaN of nobody."""
    known = [value for one in people if not math.isnan(value := one.figures[figure])]
    return float(np.mean(known)) if known else math.nan
