"""Predictions as text: of a robot that is followed, and of a session that was predicted again."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Final

from gateway.amounts import NONE, age
from gateway.cli.text import table
from gateway.client import ConnectionState
from ml.registry.card import Card, age_days
from ml.robot.task import ABNORMAL, TASKS, UNKNOWN
from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from server_gui.core.prediction.live import Watched
from server_gui.core.prediction.newest_predictions import NewestPrediction
from server_gui.core.prediction.replay import Replayed
from server_gui.core.prediction.state import WITHIN_DAYS, Quality

HEADER: Final = (
    "TASK",
    "SAYS".ljust(len("stride left 0.00 right 0.00")),
    "PROB",
    "   AGE",
    "NOVELTY",
    "TRUST",
)
RIGHT: Final = (2, 3, 4)
MODELS: Final = ("MODEL", "MADE", "LEARNED FROM")
SPELLS: Final = 40  # lines of what followed what


def told(name: str, watched: Watched) -> str:
    """Return a robot now: what its models say and how far to believe it; faults and rules beside."""
    known = watched.predictions
    shown = [known.by_task[task] for task in TASKS if task in known.by_task]
    lines = [f"{name}: {link(watched)}"]
    if shown:
        lines += [table(HEADER, map(_row, shown), RIGHT), table(MODELS, map(_model, shown)).rstrip()]
    lines += [f"{task}: {why}" for task, why in known.why.items()] or [known.problem] * (not shown)
    lines += _right(shown)
    if known.danger is not None or known.foresees:
        danger = "unknown: nothing has been said" if known.danger is None else known.danger.text
        lines.append(f"DANGER {danger}")
    lines += [f"RULE {rule.text}" for rule in known.rules]
    drifted = {channel for one in shown for channel in one.predicted.trust.drifted}
    lines += [
        f"DRIFT {channel} has values that its model has not learned from" for channel in sorted(drifted)
    ]
    lines += [f"FAULT {part.name} {part.state}: {part.problem or NONE}" for part in watched.robot.not_ok()]
    return "\n".join(lines) + "\n"


def link(watched: Watched) -> str:
    """Return how a robot is reached, and how much comes from it."""
    link = watched.robot.link
    if link.state is ConnectionState.CONNECTED:
        age_s = watched.robot.age_s()
        return "no row yet" if age_s is None else f"{watched.robot.rate_hz():.0f} rows/s, {age(age_s)} old"
    return f"{link.state.value}: {link.problem}" if link.problem else link.state.value


def _row(shown: NewestPrediction) -> tuple[str, ...]:
    prediction = shown.predicted.prediction
    return (
        prediction.task,
        NONE if shown.is_stale() else said(prediction),
        NONE if shown.is_stale() else f"{prediction.probability:.2f}",
        age(shown.age_s()),
        f"{prediction.novelty:.2f}",
        shown.predicted.trust.level.value,
    )


def _model(shown: NewestPrediction) -> tuple[str, ...]:
    card = shown.predicted.card
    return card.id, made(card), card.source.value


def _right(found: Iterable[NewestPrediction]) -> Iterator[str]:
    """Yield how right models were of late, by labels."""
    told = [(shown.predicted.prediction.task, shown.predicted.quality) for shown in found]
    lines = [f"{task}: {quality.last_week}" for task, quality in told if quality is not None]
    if lines:
        yield f"by labels of the last {WITHIN_DAYS} days:"
    yield from lines


def said(prediction: Prediction) -> str:
    """Return the label, and further values where it says anything."""
    values = {} if prediction.label in (UNKNOWN, ABNORMAL) else prediction.values
    return " ".join([prediction.label, *(f"{name} {value:.2f}" for name, value in values.items())])


def made(card: Card) -> str:
    """Return how old a model is."""
    days = round(age_days(card))
    return f"{days} day{'s' * (days > 1)} ago" if days else "today"


# --- a session


def replay_told(found: Replayed) -> str:
    """Return one task of a session."""
    card, predictions = found.model.card, found.predictions
    lines = [f"{card.task}: {card.id}, made {made(card)}, {card.source.value}; {len(predictions)} decisions"]
    if predictions:
        lines += [f"trust: {_trust(found.trust)}", "", _labels(predictions)]
    if found.live.decisions:
        lines.append(f"said live: {found.live.decisions}, of which {found.live.same} are the same here\n")
    if found.quality is not None:
        lines.append(_quality(found.quality, flattered=found.flattered))
    lines += _spells(found) if found.model.learned.task.fold else []
    return "\n".join(lines) + "\n"


def _trust(trust: Trust) -> str:
    drifted = f"; other values than it has learned from: {', '.join(trust.drifted)}" if trust.drifted else ""
    return (
        f"{trust.level.value} (last minute: {100 * trust.abnormal:.0f} % abnormal,"
        f" {100 * trust.unknown:.0f} % unknown, novelty {trust.novelty:.2f}){drifted}"
    )


def _labels(predictions: Sequence[Prediction]) -> str:
    by_label: dict[str, list[float]] = {}
    for one in predictions:
        by_label.setdefault(one.label, []).append(one.probability)
    rows = [
        (
            label,
            str(len(found)),
            f"{100 * len(found) / len(predictions):.1f} %",
            f"{sum(found) / len(found):.2f}",
        )
        for label, found in sorted(by_label.items(), key=lambda item: -len(item[1]))
    ]
    return table(("SAYS", "DECISIONS", "SHARE", "PROBABILITY"), rows, (1, 2, 3))


def _quality(quality: Quality, *, flattered: bool) -> str:
    columns = sorted({label for row in quality.confusion.values() for label in row})
    rows = [
        (was, *(str(row.get(label, 0)) for label in columns))
        for was, row in sorted(quality.confusion.items())
    ]
    but = "; the model has learned from this session, which flatters it" if flattered else ""
    return f"labels: {quality.text}{but}\n" + table(
        ("WAS", *(f"SAYS {label}" for label in columns)), rows, range(1, len(columns) + 1)
    )


def _spells(found: Replayed) -> Iterator[str]:
    """Yield the sequence of predictions."""
    both = zip(found.predictions, found.utc_ns, strict=True)
    spells = [list(spell) for _, spell in itertools.groupby(both, key=lambda one: one[0].label)]
    rows = [(_time(spell[0][1]), _time(spell[-1][1]), spell[0][0].label, str(len(spell))) for spell in spells]
    yield table(("FROM (UTC)", "TO", "SAYS", "DECISIONS"), rows[:SPELLS], (3,)).rstrip()
    if len(rows) > SPELLS:
        yield f"… and {len(rows) - SPELLS} more (--json has every decision)"


def _time(utc_ns: int) -> str:
    return f"{datetime.fromtimestamp(utc_ns / 1e9, UTC):%H:%M:%S.%f}"[:-5]
