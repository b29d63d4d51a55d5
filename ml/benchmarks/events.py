"""`ipol-events`: heel strikes and toe offs by the IMUs of people never seen before."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.benchmarks import folds, ipol, losses, metrics
from ml.benchmarks.models.gait_events import NONE, EventModel, EventSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.errors import UnusableData
from ml.features import features
from ml.features.gait_events import DELAY, LEFT_EVENTS, RIGHT_EVENTS
from ml.features.gait_status import CHANNELS
from ml.features.gaps import mended

WITHIN: Final = 5  # samples: ±50 ms
MEANT: Final = 10  # samples from an event within which the foot's own signal may mean it
PUSH: Final = -0.4  # rad/s of pitch, below which a foot may be pushing off
KINDS: Final = ("heel_strike", "toe_off")
FEET: Final = tuple(
    (recipe, CHANNELS.index(f"{side}_foot.angular_velocity_y"))
    for side, recipe in (("left", LEFT_EVENTS), ("right", RIGHT_EVENTS))
)
SETTINGS: Final = EventSettings()
GRID: Final = (
    SETTINGS,
    EventSettings(rounds=120),
    EventSettings(leaves=20),
    EventSettings(threshold=0.45),
)
WHY: Final = (
    "seen_… is the share of labelled events within 100 ms of which the foot's own pitch rate turns as in one:"
    " no detector that starts from it finds more. There is one labelling: what two would disagree in is"
    " unknown."
)

Integers = npt.NDArray[np.int_]


@dataclass(frozen=True, slots=True, eq=False)
class Foot:
    """One foot in one trial, and one kind of event: its moments that may be events, and those that are."""

    subject: int
    features: npt.NDArray[np.float32]
    at: Integers  # samples of the moments
    offset: Integers  # from each moment to the event that it means, or NONE
    true: Integers  # samples of the labelled events


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out, and judge all events of each kind together."""
    trials = ipol.read(path)
    feet = {0.0: feet_of(trials)}
    feet |= {share: feet_of(ipol.lossy(trials, share)) for share in losses.SHARES}
    people = sorted({trial.subject for trial in trials})
    work = folds.over(lambda person: _fold(feet, person, search), people)
    counts = {person: one for person, (one, _) in zip(people, work, strict=True)}
    return _outcome(feet[0.0], counts, told([settings for _, settings in work], search))


Key = tuple[float, str, str]  # share of lost packets, kind; hits, true or found
Counts = Mapping[Key, int]
Feet = Mapping[str, Sequence[Foot]]  # by kind


def feet_of(trials: Sequence[ipol.Trial]) -> Feet:
    """Both feet of every trial, by kind of event."""
    every: dict[str, list[Foot]] = {kind: [] for kind in KINDS}
    for trial in trials:
        for (recipe, pitch), in_air in zip(FEET, trial.in_air, strict=True):
            true = (ipol.strikes(in_air), ipol.strikes(~in_air))
            moments = candidates(mended(trial.samples[:, pitch]))
            for kind, at, labelled in zip(KINDS, moments, true, strict=True):
                ends = np.minimum(at + DELAY, len(in_air) - 1)
                columns = features(recipe, trial.samples, ends)
                every[kind].append(Foot(trial.subject, columns, at, offsets(at, labelled), labelled))
    return every


def candidates(pitch: npt.NDArray[np.float64]) -> tuple[Integers, Integers]:
    """Return candidate samples: strikes (pitch rate falls through zero) and push-offs (it is lowest)."""
    if len(pitch) < 3:
        return np.array([], dtype=np.int_), np.array([], dtype=np.int_)
    smooth = np.convolve(pitch, np.ones(3) / 3.0, mode="same")
    before, here, after = smooth[:-2], smooth[1:-1], smooth[2:]
    strikes = np.flatnonzero((smooth[:-1] > 0) & (smooth[1:] <= 0)) + 1
    return strikes, np.flatnonzero((here < before) & (here <= after) & (here < PUSH)) + 1


def offsets(at: Integers, true: Integers) -> Integers:
    """From each moment to the event that it means; each event is meant by the nearest moment alone."""
    offset = np.full(len(at), NONE)
    for event in true.tolist() if len(at) else ():
        nearest = np.abs(at - event).argmin()
        if abs(at[nearest] - event) <= min(MEANT, abs(offset[nearest])):
            offset[nearest] = event - at[nearest]
    return offset


def _fold(feet: Mapping[float, Feet], person: int, search: Search) -> tuple[Counts, EventSettings]:
    others = {kind: [foot for foot in own if foot.subject != person] for kind, own in feet[0.0].items()}
    groups = np.array([foot.subject for foot in others[KINDS[0]]])
    settings = chosen(SETTINGS, GRID, groups, search, lambda *about: _score(others, *about))
    counts: Counter[Key] = Counter()
    for kind in KINDS:
        model = _fitted(others[kind], settings)
        for share, every in feet.items():
            for foot in every[kind]:
                if foot.subject == person:
                    counts.update(_counted(model, foot, share, kind))
    return counts, settings


def _fitted(feet: Sequence[Foot], settings: EventSettings) -> EventModel:
    if not feet:
        raise UnusableData("nobody is left to learn from")
    columns = np.concatenate([foot.features for foot in feet])
    return EventModel(settings).fit(columns, np.concatenate([foot.offset for foot in feet]))


def _counted(model: EventModel, foot: Foot, share: float, kind: str) -> Iterator[Key]:
    """Yield a key for each event: Counter counts them."""
    found = model.events(foot.features, foot.at)
    sizes = (
        ("hits", metrics.matches(foot.true, found, WITHIN)),
        ("true", len(foot.true)),
        ("found", len(found)),
    )
    for name, size in sizes:
        yield from [(share, kind, name)] * size


def _score(feet: Feet, settings: EventSettings, train: folds.Rows, judge: folds.Rows) -> float:
    """For a search: the mean F1 of both kinds."""
    counts: Counter[Key] = Counter()
    for kind in KINDS:
        model = _fitted([feet[kind][row] for row in train], settings)
        for row in judge:
            counts.update(_counted(model, feet[kind][row], 0.0, kind))
    return float(np.mean([_f1(counts, 0.0, kind) for kind in KINDS]))


def _f1(counts: Counts, share: float, kind: str) -> float:
    hits, true, found = (counts.get((share, kind, name), 0) for name in ("hits", "true", "found"))
    return 2.0 * hits / (true + found) if true + found else float("nan")


def _outcome(feet: Feet, counts: Mapping[int, Counts], settings: str) -> Outcome:
    total: Counter[Key] = Counter()
    for own in counts.values():
        total.update(own)
    by_subject = {
        str(person): {f"{kind}_f1": _f1(own, 0.0, kind) for kind in KINDS} for person, own in counts.items()
    }
    figures: dict[str, float] = {}
    for kind in KINDS:
        figures[f"{kind}_f1"] = _f1(total, 0.0, kind)
        figures[f"worst_subject_{kind}_f1"] = min(one[f"{kind}_f1"] for one in by_subject.values())
        figures[f"seen_{kind}_fraction"] = _seen(feet[kind])
    for share in losses.SHARES:
        figures |= {losses.at(f"{kind}_f1", share): _f1(total, share, kind) for kind in KINDS}
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))


def _seen(feet: Sequence[Foot]) -> float:
    seen = sum(int((foot.offset != NONE).sum()) for foot in feet)
    return seen / max(sum(len(foot.true) for foot in feet), 1)
