"""Truth at each instant, by a session's labels: an activity, or the phase of each leg.

Of labels about one instant the most trusted source's count; where two authors of one source differ, nobody
knows. A leg's phase goes evenly from one heel strike to its next.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.windows import Samples
from ml.store.labels import ACTIVITIES, LabelSource

Instants = npt.NDArray[np.int64]
Names = npt.NDArray[np.str_]

NOBODY: Final = ""  # the name where nobody knows
STRIDE_S: Final = (0.5, 2.5)  # shorter and longer ones are no strides, or a strike between them was missed
STILL: Final = ("stand", "sit", "sit_to_stand", "stand_to_sit")  # in which no leg steps
LOST: Final = ("fall", "lying", "get_up")  # in which a phase means nothing
STRIKES: Final = ("left_heel_strike", "right_heel_strike")
_NAME: Final = np.array(ACTIVITIES).dtype


@dataclass(frozen=True, slots=True)
class LabelSpan:
    """A label on the robot's clock; an instant begins and ends at one time."""

    begin_ns: int
    end_ns: int
    label: str
    source: LabelSource


def activities(said: Sequence[LabelSpan], at_ns: Instants) -> tuple[Names, Names]:
    """Return the activity of instants (n,) in order, and its label's source; NOBODY without a label."""
    names, sources = np.full(len(at_ns), NOBODY, _NAME), np.full(len(at_ns), NOBODY, "U16")
    for source in LabelSource:
        own, told = _of_source([each for each in said if each.source is source], at_ns)
        new = told & (sources == NOBODY)
        names[new], sources[new] = own[new], source.value
    sources[names == NOBODY] = NOBODY
    return names, sources


def _of_source(said: Iterable[LabelSpan], at_ns: Instants) -> tuple[Names, npt.NDArray[np.bool_]]:
    names, told = np.full(len(at_ns), NOBODY, _NAME), np.zeros(len(at_ns), np.bool_)
    disputed = told.copy()
    for each in said:
        if each.label in ACTIVITIES:
            rows = slice(*np.searchsorted(at_ns, [each.begin_ns, each.end_ns]))
            disputed[rows] |= told[rows] & (names[rows] != each.label)
            names[rows], told[rows] = each.label, True
    names[disputed] = NOBODY
    return names, told


def phases(said: Sequence[LabelSpan], at_ns: Instants) -> tuple[Samples, Names]:
    """Return the phases (n, 2) of the left and the right leg at instants (n,), and the labels' source.

    NaN, NaN where no leg steps; the source is NOBODY where that is not known, or of one leg alone.
    """
    legs, by = zip(*(_leg(said, strike, at_ns) for strike in STRIKES), strict=True)
    found = np.stack(legs, axis=1)
    names, sources = activities(said, at_ns)
    steps = ~np.isnan(found).any(axis=1) & ~np.isin(names, LOST)
    still = np.isnan(found).all(axis=1) & np.isin(names, STILL)
    least_trusted = max(by, key=list(LabelSource).index).value
    return found, np.where(steps, least_trusted, np.where(still, sources, NOBODY))


def _leg(
    said: Sequence[LabelSpan], strike: str, at_ns: Instants
) -> tuple[npt.NDArray[np.float64], LabelSource]:
    """Return a leg's phase, by the most trusted source that has seen two strikes."""
    for source in LabelSource:
        strikes = np.unique([e.begin_ns for e in said if e.label == strike and e.source is source])
        if len(strikes) > 1:
            return _between(strikes.astype(np.int64), at_ns), source
    return np.full(len(at_ns), np.nan), LabelSource.PERSON


def _between(strikes_ns: Instants, at_ns: Instants) -> npt.NDArray[np.float64]:
    last = np.searchsorted(strikes_ns, at_ns, side="right") - 1
    inside = (last >= 0) & (last < len(strikes_ns) - 1)
    begin_ns = strikes_ns[np.where(inside, last, 0)]
    length_ns = strikes_ns[np.where(inside, last + 1, 1)] - begin_ns
    shortest_ns, longest_ns = (seconds * 1e9 for seconds in STRIDE_S)
    known = inside & (length_ns >= shortest_ns) & (length_ns <= longest_ns)
    return np.where(known, (at_ns - begin_ns) / length_ns, np.nan)
