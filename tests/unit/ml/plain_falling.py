"""The features of `falling` as they were first written: what the quick ones must be, bit for bit."""

import numpy as np
import numpy.typing as npt

from ml.features.falling import (
    BEFORE,
    HEAVY,
    LENGTHS,
    LIGHT,
    LIGHTER,
    RATE_HZ,
    STRETCH,
    TILT_FROM,
    TIPPED,
)
from ml.features.signals import GRAVITY, TINY

Samples = npt.NDArray[np.float64]


def compute(windows: Samples) -> npt.NDArray[np.float32]:
    """(n, 6, 75) → (n, features)."""
    acceleration, spin = windows[:, :3], windows[:, 3:]
    weight, turning = _norm(acceleration), _norm(spin)
    before = _direction(acceleration[..., :BEFORE].mean(axis=-1))
    overall = _direction(acceleration.mean(axis=-1))
    speed = np.cumsum((weight - GRAVITY)[:, ::-1], axis=1) / RATE_HZ  # m/s gained upwards since …
    columns: list[Samples] = []
    for samples in LENGTHS:
        columns += _moments(weight[:, -samples:]) + _moments(turning[:, -samples:])
        columns += [speed[:, samples - 1], np.abs(np.diff(acceleration[..., -samples:])).mean(axis=(1, 2))]
        posture = acceleration[..., -samples:].mean(axis=-1)
        columns += [_long(posture), _angle(_direction(posture), before), _angle(_direction(posture), overall)]
        drift = spin[..., -samples:].mean(axis=-1)
        columns += [*np.abs(drift).T, _long(drift)]
    columns += _tipping(acceleration, spin, before)
    columns += [weight[:, -1], turning[:, -1], *acceleration[..., -5:].mean(axis=-1).T]
    columns += [*acceleration[..., :BEFORE].mean(axis=-1).T]
    columns += [(weight[:, -25:] < LIGHT).sum(axis=1), (weight[:, -10:] < LIGHTER).sum(axis=1)]
    columns += [(weight > HEAVY).sum(axis=1)]
    return np.stack(columns, axis=1).astype(np.float32)


def _norm(vectors: Samples) -> Samples:
    """(n, axes, samples) → (n, samples)."""
    lengths: Samples = np.sqrt((vectors * vectors).sum(axis=1))
    return lengths


def _moments(signal: Samples) -> list[Samples]:
    return [signal.mean(axis=1), signal.min(axis=1), signal.max(axis=1), signal.std(axis=1)]


def _long(vectors: Samples) -> Samples:
    """(n, 3) → (n,)."""
    lengths: Samples = np.sqrt((vectors * vectors).sum(axis=1))
    return lengths


def _direction(vectors: Samples) -> Samples:
    return vectors / np.maximum(_long(vectors), TINY)[:, None]


def _angle(one: Samples, other: Samples) -> Samples:
    """Between unit vectors (n, 3), rad."""
    angle: Samples = np.arccos(np.clip((one * other).sum(axis=1), -1.0, 1.0))
    return angle


def _tipping(acceleration: Samples, spin: Samples, before: Samples) -> list[Samples]:
    """The tilt that the gyroscope has seen since the window's beginning, how fast it grew, and the lift."""
    rates = spin[..., TILT_FROM:].reshape(*spin.shape[:2], -1, STRETCH).mean(axis=-1)
    vertical, tilts = before, []
    for at in range(rates.shape[-1]):
        vertical = _turned(vertical, rates[..., at] * (-STRETCH / RATE_HZ))
        tilts.append(_angle(_direction(vertical), before))
    grown = [tilts[-1] - tilts[-1 - stretches] for stretches in TIPPED]
    return [tilts[-1], *grown, (acceleration[..., -1] * vertical).sum(axis=1)]


def _turned(vectors: Samples, rotation: Samples) -> Samples:
    """Vectors (n, 3) turned about an axis by its length in rad (Rodrigues)."""
    angle = _long(rotation)[:, None]
    axis = rotation / np.maximum(angle, TINY)
    a, b, c = axis.T
    x, y, z = vectors.T
    crossed = np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)
    cosine = np.cos(angle)
    aligned = (axis * vectors).sum(axis=1)[:, None]
    turned: Samples = vectors * cosine + crossed * np.sin(angle) + axis * (aligned * (1.0 - cosine))
    return turned
