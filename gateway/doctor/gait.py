"""Gait as the doctor sees it: each joint over the stride of its own foot, beside how people walk."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import fmean

from gateway.doctor.observations import Observations

BINS = 20
LIKE = 0.6  # from which correlation on a curve is like another
LEAST_STRIDES = 5
LEAST_SECONDS = 8.0
SHORTEST_S, LONGEST_S = 0.6, 3.0  # of a stride
LOADED = 0.25  # of the most, from which a foot stands
LEAST_LOAD = 1.3  # times its mean: the most under a foot that is lifted in between
HOW = "walk evenly for 20 s meanwhile"

# Level walking at the usual pace (degrees; a twentieth of a stride each, from the landing of the own foot),
# as textbooks of gait analysis draw it. Only shapes, means and ranges are used, and none to a degree.
NORMAL = {
    "hip": (30, 29, 27, 23, 18, 12, 7, 2, -3, -7, -9, -8, -2, 7, 16, 24, 30, 32, 32, 31),
    "knee": (5, 11, 16, 17, 15, 12, 9, 7, 6, 8, 14, 25, 40, 54, 58, 54, 42, 26, 10, 4),
    "ankle": (-1, -5, -3, 0, 3, 5, 7, 8, 10, 11, 9, 1, -12, -17, -11, -5, -1, 0, 1, 0),
}
SIDES = ("left", "right")


def other(side: str) -> str:
    return SIDES[side == "left"]


@dataclass(frozen=True, slots=True)
class Match:
    """Similarity of a joint's curve with the normal one (−1 … 1): as it is, and half a stride later."""

    own: float
    half: float


@dataclass(frozen=True, slots=True)
class Gait:
    """The joints by kind and side; joints that do not move as legs do are not in it."""

    matches: dict[tuple[str, str], Match]
    load: list[float]  # left foot's less right foot's, in shares of their most


def joint_of(side: str, kind: str) -> str:
    return f"{side}_{kind}"


def insole_of(seen: Observations, side: str) -> str | None:
    """Return the insole of a foot."""
    tables = seen.config.insole.items()
    return next((name for name, table in tables if str(table.side(name)) == side), None)


def force(seen: Observations, side: str) -> list[float] | None:
    insole = insole_of(seen, side)
    return None if insole is None else seen.column(f"{insole}.force")


def gait(seen: Observations) -> Gait | str:
    """Return the gait in the samples, or why there is none that could be judged."""
    forces = {side: force(seen, side) for side in SIDES}
    if any(one is None for one in forces.values()):
        return "it needs both insoles, and they said nothing"
    landings = {side: _landings(one or [], seen.samples.period_s) for side, one in forces.items()}
    if any(len(one) <= LEAST_STRIDES for one in landings.values()):
        return f"there were too few strides: {HOW}"
    shares = {side: [value / max(one or [1.0]) for value in one or []] for side, one in forces.items()}
    matches = {}
    for kind in NORMAL:
        for side in SIDES:
            values = seen.column(f"{joint_of(side, kind)}.position")
            if values is not None and len(values) == len(forces[side] or []):
                matches[kind, side] = _match(folded(values, landings[side]), kind)
    load = [left - right for left, right in zip(shares["left"], shares["right"], strict=False)]
    return Gait(matches, load)


def is_flipped(match: Match) -> bool:
    """Return whether a joint bends where it should stretch."""
    return -match.own > LIKE


def swapped_kinds(found: Gait) -> list[str]:
    """Kinds of joints of which both legs' move as the other leg's should."""
    matches = found.matches
    return [kind for kind in NORMAL if all(_is_of_other_leg(matches.get((kind, side))) for side in SIDES)]


def _is_of_other_leg(match: Match | None) -> bool:
    return match is not None and match.half > LIKE and match.half > match.own


def _landings(values: Sequence[float], period_s: float) -> list[int]:
    """Return the samples at which a foot begins to stand, whatever its scale."""
    most = percentile(values, 0.98)
    if most <= 0.0 or most < LEAST_LOAD * fmean(values):
        return []
    landings: list[int] = []
    lifted = False
    for at, value in enumerate(values):
        if value < LOADED * most / 2:
            lifted = True
        elif lifted and value > LOADED * most:
            lifted = False
            landings.append(at)
    return (
        landings if all(SHORTEST_S <= (b - a) * period_s <= LONGEST_S for a, b in pairwise(landings)) else []
    )


def folded(values: Sequence[float], landings: Sequence[int]) -> list[float]:
    """Return a joint over the stride, on average."""
    sums, counts = [0.0] * BINS, [0] * BINS
    for begin, end in pairwise(landings):
        for at in range(begin, end):
            place = (at - begin) * BINS // (end - begin)
            sums[place] += values[at]
            counts[place] += 1
    return [total / count if count else 0.0 for total, count in zip(sums, counts, strict=True)]


def _match(curve: Sequence[float], kind: str) -> Match:
    normal = NORMAL[kind]
    half = (*normal[BINS // 2 :], *normal[: BINS // 2])
    return Match(correlation(curve, normal), correlation(curve, half))


def correlation(one: Sequence[float], two: Sequence[float]) -> float:
    """Pearson's, 0 where one of both does not change."""
    mean_one, mean_two = fmean(one), fmean(two)
    a, b = [value - mean_one for value in one], [value - mean_two for value in two]
    size = math.sqrt(sum(value * value for value in a) * sum(value * value for value in b))
    return sum(x * y for x, y in zip(a, b, strict=True)) / size if size > 1e-12 else 0.0


def percentile(values: Sequence[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else 0.0


def span(values: Sequence[float]) -> float:
    """Return the range of the values, without outliers."""
    return percentile(values, 0.95) - percentile(values, 0.05)


def normal_span(kind: str) -> float:
    return math.radians(max(NORMAL[kind]) - min(NORMAL[kind]))


def normal_mean(kind: str) -> float:
    return math.radians(fmean(NORMAL[kind]))
