"""Responses of a sweep: each metric's mean at each value with its interval, and the best value.

Values come in the order of time. So a drift looks like a response: what is proposed wants an A/B trial.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from server_gui.core.evidence.comparison import Evidence, Word
from server_gui.core.evidence.experiment import Point, Response
from server_gui.core.evidence.metrics import Better
from server_gui.core.evidence.wording import number
from server_gui.core.experiments.verdict import FEWEST, HeldPeriod, Series, all_series

CONFIDENCE: Final = 0.95
MOST_ALIKE: Final = 0.9
JUDGED: Final = "error_rms"


@dataclass(frozen=True, slots=True)
class Swept:
    """The responses, the metric that is judged, and the value that is proposed: None where none is better."""

    evidence: Evidence
    responses: tuple[Response, ...]
    judged_by: str
    proposal: float | None
    reason: str


def respond(
    periods: Sequence[HeldPeriod], joints: Sequence[str], edited: Sequence[str], original: float
) -> Swept:
    """Return the responses to the values, judged by the tracking error of the edited joints, else of all."""
    series = [one for one in all_series(joints, periods) if not one.metric.is_slope]
    responses = [found for one in series if (found := _response(one, periods)) is not None]
    wanted = [one for one in series if one.metric.key == JUDGED and one.component in (edited or joints)]
    known = {found.series: found for found in responses}
    judged = max(
        (known[one.key] for one in wanted if one.key in known and one.metric.better is Better.LESS),
        key=lambda one: max((point.mean for point in one.points), default=0.0),
        default=None,
    )
    counts = [len(held.cycles) for held in periods]
    if judged is None or len(judged.points) < 2:
        why = "no tracking error is known at two values"
        evidence = Evidence(Word.FEW if responses else Word.NO_DATA, "", (), 0, sum(counts))
        return Swept(evidence, tuple(responses), "", None, why)
    proposal, reason = _proposal(judged, original)
    word = Word.SAME if proposal is None else Word.CHANGED
    evidence = Evidence(word, "", (), 0, sum(counts))
    return Swept(evidence, tuple(responses), judged.series, proposal, reason)


def _response(one: Series, periods: Sequence[HeldPeriod]) -> Response | None:
    rows = [
        (held.value, [cycle.values[one.key] for cycle in held.of(one.leg) if one.key in cycle.values])
        for held in periods
    ]
    enough = [(value, values) for value, values in rows if len(values) >= FEWEST]
    alike = _alike([values for _, values in enough])
    points = tuple(_point(value, values, alike) for value, values in enough)
    return Response(one.key, one.title, one.metric.unit, points) if points else None


def _alike(periods: Iterable[Sequence[float]]) -> float:
    """Return the lag-1 correlation over all periods together."""
    together = power = 0.0
    for values in periods:
        level = np.asarray(values) - np.mean(values)
        together += float(level[1:] @ level[:-1])
        power += float(level @ level)
    return min(max(together / power, 0.0), MOST_ALIKE) if power > 0.0 else 0.0


def _point(value: float, values: Sequence[float], alike: float) -> Point:
    from scipy.special import stdtrit  # who only shows what is kept has no scipy

    count, mean = len(values), float(np.mean(values))
    error = float(np.std(values, ddof=1)) * math.sqrt((1.0 + alike) / (1.0 - alike) / count)
    half = float(stdtrit(count - 1, 0.5 + CONFIDENCE / 2.0)) * error
    return Point(value, count, mean, mean - half, mean + half)


def _proposal(judged: Response, original: float) -> tuple[float | None, str]:
    best = min(judged.points, key=lambda point: point.mean)
    usual = min(judged.points, key=lambda point: abs(point.value - original))
    if best is usual or best.high >= usual.low:
        return None, f"no value is surely better than {number(usual.value)} by {judged.title}"
    return best.value, "; ".join(_reasons(judged, best, usual))


def _reasons(judged: Response, best: Point, usual: Point) -> Iterator[str]:
    share = f"{best.mean / usual.mean - 1.0:+.1%}".replace("%", " %") if usual.mean else ""
    yield (
        f"least {judged.title}: {number(best.mean)} {judged.unit} "
        f"({number(best.low)} … {number(best.high)}), {share} against {number(usual.value)}"
    )
    if best in (judged.points[0], judged.points[-1]):
        yield "it is at the end of the sweep: the best one may lie beyond"
    yield "values and time went on together: try it against the present one in an A/B trial"
