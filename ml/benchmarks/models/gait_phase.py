"""The gait phase of a foot: small neural networks that point round the cycle and learn a wearer's walk."""

import copy
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import Pipeline

from ml.benchmarks.models.quick import outputs, scaled_rows
from ml.neural import scaled

Features = npt.NDArray[np.float32]
Phases = npt.NDArray[np.float64]

BATCH: Final = 256  # rows a step


@dataclass(frozen=True, slots=True)
class PhaseSettings:
    """Tuned settings."""

    hidden: tuple[int, int] = (96, 48)
    penalty: float = 1e-3
    networks: int = 4
    first_epochs: int = 5  # on every stride
    epochs: int = 8  # on those that are not doubtful
    doubtful: float = 0.15  # cycles: a stride with a larger mean error is not believed
    personal_epochs: int = 12
    general_share: float = 0.5  # of samples of other people beside each personal one
    trust: float = 0.75  # in what the networks have become: how far they go there from the general ones


class PhaseModel(RegressorMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn ships no types
    """Features of `LEFT_PHASE` or `RIGHT_PHASE` → phase of that foot, 0 (heel strike) to 1.

    Labels can be wrong for whole strides; those that a first look cannot follow are left out of the second.
    """

    def __init__(self, settings: PhaseSettings | None = None) -> None:
        self.settings = settings or PhaseSettings()

    def fit(self, x: Features, phase: Phases, stride: npt.NDArray[np.int_]) -> Self:
        """Learn from rows of which those of one stride have one number."""
        tuned = self.settings
        self.scale_: Pipeline = scaled()
        inputs, targets = self.scale_.fit_transform(x), _on_circle(phase)
        self.networks_ = [_network(tuned, seed) for seed in range(tuned.networks)]
        _train(self.networks_, inputs, targets, tuned.first_epochs)
        self.kept_ = self._believed(x, phase, stride)
        _train(self.networks_, inputs[self.kept_], targets[self.kept_], tuned.epochs)
        self.sample_ = (inputs[self.kept_], targets[self.kept_])
        return self

    def predict(self, x: Features) -> Phases:
        """Phases from 0 up to 1."""
        inputs = scaled_rows(self.scale_, x)
        cosine, sine = np.sum([outputs(network, inputs) for network in self.networks_], axis=0).T
        phase: Phases = np.arctan2(sine, cosine) / (2 * np.pi) % 1.0
        return phase

    def personal(self, x: Features, phase: Phases, stride: npt.NDArray[np.int_]) -> "PhaseModel":
        """Return a copy that has also learned from these rows of one wearer."""
        own = copy.deepcopy(self)
        believed = self._believed(x, phase, stride)
        inputs, targets = self.scale_.transform(x[believed]), _on_circle(phase[believed])
        others = int(len(inputs) * self.settings.general_share)
        random = np.random.default_rng(0)
        for _ in range(self.settings.personal_epochs if len(inputs) else 0):
            rows = random.choice(len(self.sample_[0]), min(others, len(self.sample_[0])), replace=False)
            order = random.permutation(len(inputs) + len(rows))
            mixed = [
                np.concatenate([mine, general[rows]])[order]
                for mine, general in zip((inputs, targets), self.sample_, strict=True)
            ]
            for network in own.networks_:
                network.set_params(batch_size=min(BATCH, len(mixed[0]))).partial_fit(*mixed)
        for network, general in zip(own.networks_, self.networks_, strict=True):
            _come_back(network, general, 1.0 - self.settings.trust)
        return own

    def _believed(self, x: Features, phase: Phases, stride: npt.NDArray[np.int_]) -> npt.NDArray[np.bool_]:
        """Return the rows of strides that this can follow; all of them where it can follow none."""
        error = np.abs((self.predict(x) - phase + 0.5) % 1.0 - 0.5)
        _, number = np.unique(stride, return_inverse=True)
        mean = np.bincount(number, error) / np.bincount(number)
        believed: npt.NDArray[np.bool_] = mean[number] <= self.settings.doubtful
        return believed if believed.any() else np.ones_like(believed)


def _network(settings: PhaseSettings, seed: int) -> Any:
    return MLPRegressor(
        hidden_layer_sizes=settings.hidden,
        alpha=settings.penalty,
        random_state=seed,
        warm_start=True,
    )


def _train(networks: list[Any], inputs: Features, targets: Features, epochs: int) -> None:
    for network in networks:
        network.set_params(max_iter=epochs, batch_size=min(BATCH, len(inputs))).fit(inputs, targets)


def _come_back(network: Any, general: Any, share: float) -> None:
    """Move a network's weights that share of the way back to what they were."""
    for now, then in ((network.coefs_, general.coefs_), (network.intercepts_, general.intercepts_)):
        for weights, before in zip(now, then, strict=True):
            weights += share * (before - weights)


def _on_circle(phase: Phases) -> Features:
    angle = 2 * np.pi * phase
    return np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(np.float32)
