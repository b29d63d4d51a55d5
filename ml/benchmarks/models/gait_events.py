"""Gait events of a foot: small networks draw a bump over time at each event; the tops of bumps are events."""

from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import Pipeline

from ml.benchmarks.models.quick import outputs, scaled_rows
from ml.errors import UnusableData
from ml.neural import scaled

Features = npt.NDArray[np.float32]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int_]

BATCH: Final = 256  # rows a step
NEAR: Final = 20  # samples from an event, within which every moment is learned from
APART: Final = 30  # samples: a foot has no two events of a kind closer than that
TOP: Final = 6  # samples around a bump's top, of which none is higher


@dataclass(frozen=True, slots=True)
class EventSettings:
    """Tuned settings."""

    hidden: tuple[int, int] = (96, 48)
    penalty: float = 1e-3
    networks: int = 3
    epochs: int = 10
    width: float = 3.0  # samples: a bump's standard deviation
    elsewhere: float = 0.4  # of the moments far from any event: the share that is learned from
    threshold: float = 0.35  # of a bump's height, which is 1 where a network is sure


class EventModel:
    """Features of `LEFT_EVENTS` or `RIGHT_EVENTS` at moments → how high a bump is there, of each kind."""

    def __init__(self, settings: EventSettings | None = None) -> None:
        self.settings = settings or EventSettings()

    def learned(self, apart: Integers) -> npt.NDArray[np.bool_]:
        """Return the moments for training, by the distance `apart` (n, kinds) of the nearest events.

        Raises:
            UnusableData: none of them is near an event.

        """
        near: npt.NDArray[np.bool_] = np.asarray((apart <= NEAR).any(axis=1))
        if not near.any():
            raise UnusableData("too few feet step: some have nobody to learn from")
        near |= np.random.default_rng(0).random(len(apart)) < self.settings.elsewhere
        return near

    def fit(self, x: Features, apart: Integers) -> Self:
        """Learn from the moments that were chosen."""
        tuned = self.settings
        self.scale_: Pipeline = scaled()
        inputs = self.scale_.fit_transform(x)
        bumps = np.exp(-0.5 * (apart / tuned.width) ** 2).astype(np.float32)
        self.networks_ = [
            _network(tuned, seed, len(inputs)).fit(inputs, bumps) for seed in range(tuned.networks)
        ]
        return self

    def heights(self, x: Features) -> Floats:
        """(n, kinds), about 1 at an event and 0 far from one."""
        inputs = scaled_rows(self.scale_, x)
        heights: Floats = np.mean([outputs(one, inputs) for one in self.networks_], axis=0)
        return heights

    def events(self, at: Integers, height: Floats) -> Integers:
        """Return the samples of one foot's events of a kind, in time's order; `height` (n,) is of `at`.

        A top is known once TOP samples have shown nothing higher.
        """
        found: list[int] = []
        for place in np.flatnonzero(height >= self.settings.threshold).tolist():
            begin, end = np.searchsorted(at, (at[place] - TOP, at[place] + TOP + 1))
            if height[place] >= height[begin:end].max():
                top = _top(at, height, place)
                if not found or top - found[-1] > APART:
                    found.append(top)
        return np.array(found, dtype=np.int_)


def _network(settings: EventSettings, seed: int, rows: int) -> Any:
    return MLPRegressor(
        hidden_layer_sizes=settings.hidden,
        alpha=settings.penalty,
        batch_size=min(BATCH, rows),
        max_iter=settings.epochs,
        random_state=seed,
    )


def _top(at: Integers, height: Floats, place: int) -> int:
    """Return the sample of the highest point of a parabola through a moment and its two neighbours."""
    before, after = at[place] - at[max(place - 1, 0)], at[min(place + 1, len(at) - 1)] - at[place]
    if before != after or not before:
        return int(at[place])
    left, top, right = height[place - 1 : place + 2]
    bend = left - 2.0 * top + right
    return int(np.rint(at[place] + (before * 0.5 * (left - right) / bend if bend < 0 else 0.0)))
