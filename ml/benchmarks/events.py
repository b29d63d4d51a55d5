"""`ipol-events`: heel strikes and toe offs by the IMUs of people never seen before."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d

from ml.benchmarks import folds, ipol, losses, metrics
from ml.benchmarks.models.gait_events import EventModel, EventSettings
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.errors import UnusableData
from ml.features import Recipe, features
from ml.features.gait_events import DELAY, LEFT_EVENTS, RIGHT_EVENTS
from ml.features.gait_status import CHANNELS
from ml.features.gaps import mended

WITHIN: Final = 5  # samples: ±50 ms
STEP: Final = 2  # samples between moments that are judged
STILL: Final = 0.5  # rad/s, below which a foot rests: it neither strikes nor leaves the ground
FAR: Final = 1_000_000  # samples to an event where there is none
KINDS: Final = ("heel_strike", "toe_off")
FEET: Final = tuple(
    (recipe, [CHANNELS.index(f"{side}_foot.angular_velocity_{axis}") for axis in "xyz"])
    for side, recipe in (("left", LEFT_EVENTS), ("right", RIGHT_EVENTS))
)
SETTINGS: Final = EventSettings()
GRID: Final = (
    SETTINGS,
    EventSettings(epochs=6),
    EventSettings(width=4.0),
    EventSettings(threshold=0.45),
)
WHY: Final = (
    "seen_… is the share of labelled events at which the foot moves: no other moments are judged. There is"
    " one labelling: what two would disagree in is unknown."
)

Integers = npt.NDArray[np.int_]


@dataclass(frozen=True, slots=True, eq=False)
class Foot:
    """One foot in one trial: the moments at which it moves, and its events by kind."""

    subject: int
    features: npt.NDArray[np.float32]
    at: Integers  # samples of the moments
    true: tuple[Integers, Integers]  # samples of the labelled events
    seen: tuple[int, int]  # of these, while the foot moves

    def apart(self) -> Integers:
        """(moments, kinds): samples to the nearest event of each kind."""
        columns = [np.abs(self.at[:, None] - np.append(true, FAR)).min(axis=1) for true in self.true]
        return np.stack(columns, axis=1)


def evaluate(path: Path, search: Search) -> Outcome:
    """Leave one subject out, and judge all events of each kind together."""
    trials = ipol.read(path)
    feet = feet_of(trials)
    people = sorted({trial.subject for trial in trials})
    walks = {share: ipol.lossy(trials, share) for share in losses.SHARES}
    work = folds.over(lambda person: _fold(feet, walks, person, search), people)
    counts = {person: one for person, (one, _) in zip(people, work, strict=True)}
    return _outcome(feet, counts, told([settings for _, settings in work], search))


Key = tuple[float, str, str]  # share of lost packets, kind; hits, true or found
Counts = Mapping[Key, int]


def feet_of(trials: Sequence[ipol.Trial]) -> list[Foot]:
    """Return both feet of every trial."""
    return [
        _foot(trial, recipe, mended(trial.samples[:, spin].T), in_air)
        for trial in trials
        for (recipe, spin), in_air in zip(FEET, trial.in_air, strict=True)
    ]


def _foot(
    trial: ipol.Trial, recipe: Recipe, spin: npt.NDArray[np.float64], in_air: npt.NDArray[np.bool_]
) -> Foot:
    moves = maximum_filter1d(np.sqrt((spin * spin).sum(axis=0)), 2 * DELAY + 1) > STILL
    at = np.arange(0, len(in_air), STEP)
    at = at[moves[at]]
    columns = features(recipe, trial.samples, np.minimum(at + DELAY, len(in_air) - 1))
    strikes, offs = ipol.strikes(in_air), ipol.strikes(~in_air)
    return Foot(
        trial.subject, columns, at, (strikes, offs), (int(moves[strikes].sum()), int(moves[offs].sum()))
    )


def _fold(
    feet: Sequence[Foot], walks: Mapping[float, Sequence[ipol.Trial]], person: int, search: Search
) -> tuple[Counts, EventSettings]:
    others = [foot for foot in feet if foot.subject != person]
    groups = np.array([foot.subject for foot in others])
    settings = chosen(SETTINGS, GRID, groups, search, lambda *about: _score(others, *about))
    model = _fitted(others, settings)
    every = {0.0: [foot for foot in feet if foot.subject == person]}
    for share, trials in walks.items():
        every[share] = feet_of([trial for trial in trials if trial.subject == person])
    counts: Counter[Key] = Counter()
    for share, own in every.items():
        for foot in own:
            counts.update(_counted(model, foot, share))
    return counts, settings


def _fitted(feet: Sequence[Foot], settings: EventSettings) -> EventModel:
    if not feet:
        raise UnusableData("nobody is left to learn from")
    apart = np.concatenate([foot.apart() for foot in feet])
    model = EventModel(settings)
    rows = model.learned(apart)
    of_feet = np.split(rows, np.cumsum([len(foot.at) for foot in feet])[:-1])
    columns = np.concatenate([foot.features[own] for foot, own in zip(feet, of_feet, strict=True)])
    return model.fit(columns, apart[rows])


def _counted(model: EventModel, foot: Foot, share: float) -> Iterator[Key]:
    """Yield a key for each event: Counter counts them."""
    heights = model.heights(foot.features)
    for kind, true, height in zip(KINDS, foot.true, heights.T, strict=True):
        found = model.events(foot.at, height)
        sizes = (("hits", metrics.matches(true, found, WITHIN)), ("true", len(true)), ("found", len(found)))
        for name, size in sizes:
            yield from [(share, kind, name)] * size


def _score(feet: Sequence[Foot], settings: EventSettings, train: folds.Rows, judge: folds.Rows) -> float:
    """Return, for a search, the mean F1 of both kinds."""
    model = _fitted([feet[row] for row in train], settings)
    counts: Counter[Key] = Counter()
    for row in judge:
        counts.update(_counted(model, feet[row], 0.0))
    return float(np.mean([_f1(counts, 0.0, kind) for kind in KINDS]))


def _f1(counts: Counts, share: float, kind: str) -> float:
    hits, true, found = (counts.get((share, kind, name), 0) for name in ("hits", "true", "found"))
    return 2.0 * hits / (true + found) if true + found else float("nan")


def _outcome(feet: Sequence[Foot], counts: Mapping[int, Counts], settings: str) -> Outcome:
    total: Counter[Key] = Counter()
    for own in counts.values():
        total.update(own)
    by_subject = {
        str(person): {f"{kind}_f1": _f1(own, 0.0, kind) for kind in KINDS} for person, own in counts.items()
    }
    figures: dict[str, float] = {}
    for number, kind in enumerate(KINDS):
        figures[f"{kind}_f1"] = _f1(total, 0.0, kind)
        figures[f"worst_subject_{kind}_f1"] = min(one[f"{kind}_f1"] for one in by_subject.values())
        figures[f"seen_{kind}_fraction"] = _seen(feet, number)
    for share in losses.SHARES:
        figures |= {losses.at(f"{kind}_f1", share): _f1(total, share, kind) for kind in KINDS}
    return Outcome(figures, len(by_subject), by_subject, settings=settings, notes=(WHY,))


def _seen(feet: Sequence[Foot], kind: int) -> float:
    return sum(foot.seen[kind] for foot in feet) / max(sum(len(foot.true[kind]) for foot in feet), 1)
