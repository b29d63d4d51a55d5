"""One model beside another: figures, classes and wearers, each with which of the two is better."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from gateway.amounts import NONE, counted
from gateway.units import with_minus
from ml.registry.card import Card, Metrics
from server_gui.core.models.catalogue import Catalogue, Entry
from server_gui.core.models.names import class_name
from server_gui.core.prediction.state import TOO_LITTLE, WITHIN_DAYS, Quality

OTHERS: Final = "not comparable"  # the verdict where each was judged by its own
UNKNOWN: Final = "not labelled"
PLACES: Final = 1  # of a percentage for people
ALIKE: Final = 0.05  # percent: a difference that is not shown is none


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a card: its words, what makes a percent of it, and whether more is better."""

    words: str
    scale: float
    more_is_better: bool


FIGURES: Final[Mapping[str, Figure]] = {
    "macro_f1": Figure("F1, mean over classes", 100.0, True),
    "accuracy": Figure("Right", 100.0, True),
    "rmse_percent": Figure("Error, of the gait cycle", 1.0, False),
    "abstained": Figure("Says “unknown”", 100.0, False),
    "stepping_where_none_steps": Figure("Says steps where nobody steps", 100.0, False),
    "covered": Figure("The truth is among what it names", 100.0, True),
    "worst_subject_covered": Figure("The same, for the worst wearer", 100.0, True),
}
OF_WORST: Final = "worst_"  # how a figure's name begins that is of one of several wearers
F1: Final = Figure("F1", 100.0, True)
CALIBRATION: Final = Figure("Probabilities are off by", 100.0, False)


@dataclass(frozen=True, slots=True)
class Row:
    """A figure of both, in percent; None where one has none. `decisions` are those behind it, where known."""

    group: str
    name: str
    one: float | None
    other: float | None
    more_is_better: bool
    decisions: int | None = None
    is_verdict: bool = True  # both were judged by the same sessions

    @property
    def difference(self) -> float | None:
        """One less the other as both are shown, in percent points; none where of other sessions."""
        if not self.is_verdict or self.one is None or self.other is None:
            return None
        return round(self.one, PLACES) - round(self.other, PLACES)

    @property
    def verdict(self) -> str:
        """Return whether the one is better or worse than the other; nothing where that cannot be said.

        That is for training to say where each was judged by sessions of its own.
        """
        difference = self.difference
        if not self.is_verdict and self.one is not None and self.other is not None:
            return OTHERS
        if difference is None:
            return ""
        if abs(difference) < ALIKE:
            return "alike"
        return "better" if (difference > 0) == self.more_is_better else "worse"


def rows(one: Card, other: Card | None) -> list[Row]:
    """Return everything by which the two were judged, each on people whom it had never seen."""
    mine, its = one.metrics, Metrics() if other is None else other.metrics
    found = [*_overall(mine, its), *_classes(mine, its), *_wearers(one, other)]
    alike = other is None or set(one.held_out) == set(other.held_out)
    return found if alike else [dataclasses.replace(row, is_verdict=False) for row in found]


def notes(one: Entry, other: Entry | None) -> Iterator[str]:
    """Yield notes on such a comparison."""
    if other is not None and set(one.card.held_out) != set(other.card.held_out):
        yield "Each was judged on sessions of its own, so no verdict; training judges both on the same."
    if other is not None and (known := set(other.card.learned) & set(one.card.held_out)):
        yield f"{other.name} has learned from {counted(len(known), 'session')} that judged the other."


def unknown_to(one: Card, others: Iterable[Card], whose: str) -> str:
    """Return the classes that others know and this one does not, in a sentence; "" where there is none."""
    known = dict.fromkeys(name for other in others for name in other.classes)
    lost = [class_name(name) for name in known if name not in one.classes]
    if not lost or not one.classes:
        return ""
    return f"It does not know {', '.join(lost)}; {whose} does. It calls these something else, or unknown."


def last_week(entry: Entry) -> str:
    """Return the share of its recent correct predictions, in words; without labels, no number."""
    if not entry.hits:
        return f"not known: nobody has labelled any of what it said within {WITHIN_DAYS} days"
    return "; ".join(
        f"{robot}: {quality.last_week}{_but(entry, quality)}" for robot, quality in sorted(entry.hits.items())
    )


def week_short(entry: Entry) -> str:
    """Return the same for a narrow place."""
    told = [(robot, _week_of(entry, quality)) for robot, quality in sorted(entry.hits.items())]
    return told[0][1] if len(told) == 1 else ", ".join(f"{robot} {said}" for robot, said in told) or UNKNOWN


def _week_of(entry: Entry, quality: Quality) -> str:
    """Return how right it is; where all labels are of one class that proves nothing of the others."""
    if (lone := quality.lone_class(entry.card.classes)) is not None:
        return f"only {class_name(lone)} labelled"
    return f"{quality.shares[0]} of {quality.duration}" if quality.is_enough else TOO_LITTLE


def _but(entry: Entry, quality: Quality) -> str:
    """Return which classes were not among the labels, so that nothing is known of them."""
    if not quality.confusion or not quality.is_enough:
        return ""  # nothing is known of any then
    missing = [class_name(name) for name in entry.card.classes if name not in quality.confusion]
    return f"; no label says {', '.join(missing)}" if missing else ""


def usual_other(entry: Entry, found: Catalogue) -> Entry | None:
    """Return the default model for comparison: the one that serves in its place, else the newest other."""
    if entry.serving and entry.serving != entry.card.id:
        return found.find(entry.serving)
    beside = (each for each in found.entries if each.card.task == entry.card.task and each is not entry)
    return next(beside, None)


def percent(value: float | None) -> str:
    """Return a percentage for people."""
    return NONE if value is None else f"{value:.{PLACES}f} %"


def signed(value: float | None) -> str:
    """Return a difference in percent points."""
    if value is None:
        return NONE
    return "±0.0" if abs(value) < ALIKE else with_minus(f"{value:+.{PLACES}f}")


def headline(card: Card) -> str:
    """Return the figure that people ask for first."""
    for name in ("macro_f1", "rmse_percent"):
        if name in card.metrics.figures:
            figure = FIGURES[name]
            short = "F1" if name == "macro_f1" else "error"
            return f"{short} {percent(card.metrics.figures[name] * figure.scale)}"
    return NONE


def _overall(mine: Metrics, its: Metrics) -> Iterator[Row]:
    for name, figure in FIGURES.items():
        one, other = (_scaled(metrics.figures.get(name), figure) for metrics in (mine, its))
        if name.startswith(OF_WORST):  # of one wearer alone it is the figure above once more
            one, other = (
                value if len(metrics.per_subject) > 1 else None
                for value, metrics in ((one, mine), (other, its))
            )
        if one is not None or other is not None:
            yield Row("On people never seen", figure.words, one, other, figure.more_is_better)
    one, other = (_scaled(metrics.calibration_error, CALIBRATION) for metrics in (mine, its))
    if one is not None or other is not None:
        yield Row("On people never seen", CALIBRATION.words, one, other, CALIBRATION.more_is_better)


def _classes(mine: Metrics, its: Metrics) -> Iterator[Row]:
    for name in dict.fromkeys((*mine.per_class, *its.per_class)):
        one, other = mine.per_class.get(name), its.per_class.get(name)
        yield Row(
            "By class, F1",
            class_name(name),
            None if one is None or not one.support else one.f1 * F1.scale,
            None if other is None or not other.support else other.f1 * F1.scale,
            F1.more_is_better,
            None if one is None else one.support,
        )


def _wearers(one: Card, other: Card | None) -> Iterator[Row]:
    figure = FIGURES["rmse_percent" if "rmse_percent" in one.metrics.figures else "macro_f1"]
    mine = one.metrics.per_subject
    its = {} if other is None else other.metrics.per_subject
    unit = "error" if not figure.more_is_better else "F1"
    for name in dict.fromkeys((*mine, *its)):
        first, second = (_scaled(found.get(name), figure) for found in (mine, its))
        yield Row(f"By wearer, {unit}", name, first, second, figure.more_is_better)


def _scaled(value: float | None, figure: Figure) -> float | None:
    return None if value is None else value * figure.scale
