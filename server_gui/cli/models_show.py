"""One model for people: from what it was learned, how well it was judged, on whom, and where it serves."""

from collections.abc import Iterator, Sequence
from typing import Final

from gateway.amounts import NONE, percent
from gateway.cli.text import table
from ml.registry.card import Card, Metrics, age_days
from server_gui.cli.cloud_options import when

SHOWN: Final = 6  # sessions by name; the rest is counted
UNKNOWN: Final = "unknown"


def told(card: Card, serves: str, problem: str, *, shipped: bool) -> Iterator[str]:
    """Yield lines for `gwrms models show`."""
    facts = {
        "task": card.task,
        "recipe": card.recipe,
        "classes": ", ".join(card.classes),
        "made": f"{when(card.made)} UTC, {age_days(card):.1f} days ago",
        "from": f"{card.source.value}{', comes with GWRMS' if shipped else ''}",
        "for": card.robot or "every robot with these channels",
        "serves": serves or "nobody",
        "adapted from": card.parent,
        "learned from": _sessions(card.learned),
        "never saw": _sessions(card.held_out),
        "tables": ", ".join(f"{one.location} version {one.version}" for one in card.tables),
        "software": ", ".join(f"{name} {version}" for name, version in card.versions.items()),
        "seed": str(card.seed),
        "notes": card.notes,
        "CANNOT SERVE": problem,
    }
    yield f"model {card.id}"
    yield from (f"  {name:<14} {value}" for name, value in facts.items() if value)
    yield ""
    yield table(("CHANNEL", "UNIT", "FROM", "TO"), [_channel(card, name) for name in card.channels], (2, 3))
    yield from _judged(card.classes, card.metrics)


def _channel(card: Card, name: str) -> tuple[str, ...]:
    low, high = (f"{limit:.4g}" for limit in card.ranges[name]) if name in card.ranges else (NONE, NONE)
    return name, card.units.get(name, ""), low, high


def _sessions(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more


def _judged(classes: Sequence[str], metrics: Metrics) -> Iterator[str]:
    """Yield the tables that there are."""
    if metrics.figures:
        rows = [(name, f"{value:.4g}") for name, value in metrics.figures.items()]
        yield table(("ON DATA NEVER SEEN", ""), rows, (1,))
    if metrics.per_class:
        yield table(
            ("CLASS", "PRECISION", "RECALL", "F1", "DECISIONS"),
            [
                (name, f"{one.precision:.3f}", f"{one.recall:.3f}", f"{one.f1:.3f}", str(one.support))
                for name, one in metrics.per_class.items()
            ],
            range(1, 5),
        )
    if metrics.per_subject:
        rows = [(name, f"{value:.4g}") for name, value in metrics.per_subject.items()]
        yield table(("SUBJECT", "SCORE"), rows, (1,))
    if metrics.confusion:
        header = ("TRUTH, AND WHAT WAS SAID", *classes, UNKNOWN)
        counts = zip(classes, metrics.confusion, strict=False)
        yield table(header, [(name, *map(str, row)) for name, row in counts], range(1, len(header)))
    if metrics.calibration:
        bins = [
            (percent(100 * one.said), percent(100 * one.right), str(one.count)) for one in metrics.calibration
        ]
        yield table(("PROBABILITY SAID", "RIGHT", "DECISIONS"), bins, (0, 1, 2))
    if metrics.calibration_error is not None:
        yield f"probabilities are off by {percent(100 * metrics.calibration_error)} on average\n"
