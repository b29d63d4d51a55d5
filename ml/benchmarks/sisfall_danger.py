"""`sisfall-danger`: falls of real people foreseen by the danger number, and advice in their daily life."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np

from ml.benchmarks import danger_trunk, sisfall
from ml.benchmarks.danger import Event, Judged, events, false_alarms, of_danger, shares
from ml.benchmarks.danger_data import HEALTHY
from ml.benchmarks.danger_trunk import Person
from ml.benchmarks.outcome import Outcome
from ml.danger.calibration import Calibration, load
from ml.danger.levels import Level
from ml.features.falling import RATE_HZ

AXES: Final = ((0, 0, 1), (-1, 0, 0), (0, -1, 0))  # forward, left, up: its x points right, its y down
KNOWN: Final = ("D01", "D02")  # walking slowly and quickly: what each person is known by
LEAD_IN_S: Final = 3.0  # of each recording's beginning, but for a fall, are played backwards before it
LEAD_IN: Final = ""  # the label of these
BACKWARDS: Final = np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0])  # accelerations stay, rates turn round
FALL_S: Final = 1.5  # before the impact: what is said sooner is of something else
WHY: Final = (
    "Each person walks slowly (D01) and quickly (D02); all other recordings begin anew from there, as nobody"
    " learns from the fall before; the first 3 s are played backwards before, so that no posture"
    " jumps, and are not judged then. Foreseen: advice begins between 1.5 and 0.3 s before the impact, the"
    " largest acceleration; already_said: it stood before that. Stumbles (D18) and jumps (D19) are counted"
    " among daily activities."
)


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """Judgement of one recording."""

    activity: str
    judged: Judged

    @property
    def rows(self) -> danger_trunk.Flags:
        """The moments of daily life that count."""
        counts: danger_trunk.Flags = self.judged.seen.healthy & (self.judged.seen.label != LEAD_IN)
        return counts

    @property
    def advised(self) -> bool:
        """Whether advice was given in moments that count."""
        return false_alarms(self.judged, Level.ADVICE, self.rows) > 0


def evaluate(path: Path, search: bool) -> Outcome:  # noqa: ARG001 - there is nothing to choose
    """Everybody's recordings after his own walking."""
    recordings, calibration = sisfall.read(path), load()
    people = groupby(sorted(recordings, key=lambda one: one.subject), key=lambda one: one.subject)
    return outcome([found for _, own in people for found in watched(list(own), calibration)])


def watched(own: Sequence[sisfall.Recording], calibration: Calibration) -> Iterator[Watched]:
    """Yield what is said of one person's recordings, who is known by his walking.

    Nothing where he has none.
    """
    known = sorted((one for one in own if one.activity in KNOWN), key=lambda one: one.activity)
    if not known:
        return
    person = Person.of(own[0].subject, calibration)
    for one in known:
        yield Watched(one.activity, _taken(person, one, known[0]))
    for one in own:
        if one.activity not in KNOWN:
            yield Watched(one.activity, _taken(person.again(), one, known[0]))


def _taken(person: Person, one: sisfall.Recording, walking: sisfall.Recording) -> Judged:
    # What is said after the impact changes no figure.
    samples = one.samples if one.impact is None else one.samples[: one.impact + 1]
    trunk = danger_trunk.upright(samples, walking.samples, AXES)
    calm = len(trunk) - 1 if one.impact is None else one.impact - int(FALL_S * RATE_HZ)
    before = max(min(int(LEAD_IN_S * RATE_HZ), calm), 0)
    trunk = np.concatenate([trunk[before:0:-1] * BACKWARDS, trunk])
    label = np.repeat([LEAD_IN, one.activity], [before, len(samples)])
    impact_s = person.at_s + danger_trunk.PAUSE_S + (len(trunk) - 1) / RATE_HZ
    judged = person.take(danger_trunk.channels(trunk, RATE_HZ), RATE_HZ, label)
    return judged if one.impact is None else fallen(judged, impact_s)


def fallen(judged: Judged, impact_s: float) -> Judged:
    """Return the same with a fall as a danger that does harm at its impact.

    Advice that stood before it is none.
    """
    comes = judged.seen.at_s > impact_s - FALL_S
    danger, first = np.where(comes, 1.0, HEALTHY), int(np.argmax(comes))
    danger[[0, -1]] = HEALTHY, 1.5  # however short it is, it begins and ends
    level = judged.level.copy()
    if level[max(first - 1, 0)] >= Level.ADVICE:
        calm = np.flatnonzero(level[first:] < Level.ADVICE)
        level[first : first + calm[0] if len(calm) else None] = Level.UNKNOWN
    seen = replace(judged.seen, names=(str(judged.seen.label[-1]),), danger=danger)
    return replace(judged, seen=seen, level=level)


def _stood(one: Watched) -> bool:
    """Return whether advice stood when the fall began."""
    first = int(np.argmax(one.judged.seen.danger > HEALTHY))
    return bool(one.judged.level[max(first - 1, 0)] >= Level.ADVICE)


def outcome(found: Sequence[Watched]) -> Outcome:
    """Return every figure."""
    falls = [one for one in found if one.activity.startswith("F")]
    daily = [one for one in found if not one.activity.startswith("F")]
    said = [event for one in falls for event in events(one.judged, Level.ADVICE)]
    leads = [event.lead_s for event in said if event.lead_s is not None]
    figures = shares("foreseen", [event.foreseen for event in said])
    figures |= shares("told_before_impact", [event.lead_s is not None for event in said])
    figures |= shares("already_said", [_stood(one) for one in falls])
    figures |= {"falls": float(len(said)), "median_lead_s": float(np.median(leads)) if leads else np.nan}
    figures |= shares("daily_recordings_with_advice", [one.advised for one in daily])
    figures |= _daily(daily)
    groups = {}
    for activity in sorted({one.activity for one in found}):
        own = [one for one in found if one.activity == activity]
        groups[activity] = _fall(own) if own[0] in falls else _activity(own)
    people = len({one.judged.seen.subject for one in found})
    notes = (danger_trunk.NOTE, WHY)
    return Outcome(figures, people, groups, "activity", settings="fixed; as shipped", notes=notes)


def _daily(own: Sequence[Watched]) -> dict[str, float]:
    return danger_trunk.figures([one.judged for one in own], [one.rows for one in own])


def _fall(own: Sequence[Watched]) -> dict[str, float]:
    """Return the figures of a kind of fall; `told` is the share that was detected."""
    said: list[Event] = [event for one in own for event in events(one.judged, Level.ADVICE)]
    found = of_danger(said)
    return {"told": found.pop("foreseen"), "advice_per_hour": np.nan} | found


def _activity(own: Sequence[Watched]) -> dict[str, float]:
    """Return the figures of a daily activity; `told` is the share of recordings with advice."""
    found = shares("told", [one.advised for one in own])
    return {
        "told": found["told"],
        "advice_per_hour": _daily(own)["advice_per_hour"],
        "low": found["told_low"],
        "high": found["told_high"],
        "median_lead_s": np.nan,
        "events": float(len(own)),
    }
