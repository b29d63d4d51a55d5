"""One probability from all detectors: calibrated log odds, which evidence of danger can only raise."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

from ml.danger.detector import DETECTORS
from ml.danger.levels import URGENT, Level
from ml.danger.observation import or_zero
from ml.errors import UnusableModel

Floats = npt.NDArray[np.float64]

SHIPPED: Final = Path(__file__).with_name("calibration.json")
RARE: Final = 0.1  # of the healthy blocks
LEAST_SCALE: Final = 0.5  # spreads
BALANCED: Final = 0.1  # regularisation of the weights


class Calibration(msgspec.Struct, frozen=True):
    """The parameters that were fitted to simulated wearers.

    `floor` and `scale` of each detector turn its spreads into evidence; `weights` of the largest and the
    second largest, and `bias`, turn evidence into log odds; `odds` → `share` maps those to the share of harm.
    `thresholds` are log odds by level's name, `budgets` the false alarms an hour that they allow. `seal` is
    of all the others: a file in which one digit has changed looks like any other.
    """

    detectors: tuple[str, ...]
    floor: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    bias: float
    odds: tuple[float, ...]
    share: tuple[float, ...]
    thresholds: dict[str, float]
    budgets: dict[str, float]
    learned_from: str
    seal: str = ""

    @property
    def sealed(self) -> "Calibration":
        """The same, as it may be written into a file."""
        told = msgspec.json.encode(msgspec.structs.replace(self, seal=""))
        return msgspec.structs.replace(self, seal=hashlib.sha256(told).hexdigest())

    def log_odds(self, above: Floats) -> Floats:
        """Return the log odds (…,) of spreads above normal (…, detectors), NaN without data."""
        odds: Floats = evidence(above, self.floor, self.scale) @ np.array(self.weights) + self.bias
        return odds

    def probability(self, odds: Floats | float) -> Floats:
        """Return the share of samples with such odds that ended in harm."""
        share: Floats = np.asarray(np.interp(odds, self.odds, self.share))
        return share

    @property
    def by_level(self) -> Mapping[Level, float]:
        """The thresholds by level."""
        return {level: self.thresholds[level.word] for level in URGENT}


def evidence(above: Floats, floor: Sequence[float], scale: Sequence[float]) -> Floats:
    """Return the evidence of the two most deviating detectors, (…, n) → (…, 2); NaN counts as none.

    Spreads below `floor`, which a tenth of all healthy blocks exceeds, are no evidence; the rest is divided
    by `scale`, the mean excess of these blocks, so that the numbers of all detectors are comparable.
    """
    beyond = np.maximum((or_zero(above) - np.array(floor)) / np.array(scale), 0.0)
    worst: Floats = np.partition(beyond, -2, axis=-1)[..., :-3:-1]
    return worst


def tails(maxima: Floats) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return floor and scale of each detector from the maxima of healthy blocks, (blocks, detectors)."""
    spreads = np.nan_to_num(maxima)
    floor = np.quantile(spreads, 1.0 - RARE, axis=0)
    beyond = [column[column >= low] - low for column, low in zip(spreads.T, floor, strict=True)]
    scale = [max(float(part.mean()), LEAST_SCALE) for part in beyond]
    return tuple(floor.tolist()), tuple(scale)


def fit(x: Floats, danger: npt.NDArray[np.bool_], counts: Floats) -> tuple[Floats, float]:
    """Fit a logistic regression, its rows weighted by `counts`; return weights (never negative) and bias."""
    from scipy.optimize import minimize  # here: serving does not need it

    weight = counts / counts.sum()
    sign = np.where(danger, 1.0, -1.0)

    def loss(theta: Floats) -> tuple[float, Floats]:
        margin = sign * (x @ theta[:-1] + theta[-1])
        off = -sign * weight / (1.0 + np.exp(np.clip(margin, -50, 50)))
        ridge = BALANCED * 1e-3 * theta[:-1]
        value = float(weight @ np.logaddexp(0.0, -margin) + 0.5 * ridge @ theta[:-1])
        return value, np.concatenate([x.T @ off + ridge, [off.sum()]])

    bounds = [(0.0, None)] * x.shape[1] + [(None, None)]
    found = minimize(loss, np.zeros(x.shape[1] + 1), jac=True, method="L-BFGS-B", bounds=bounds).x
    return found[:-1], float(found[-1])


def calibrated(odds: Floats, danger: npt.NDArray[np.bool_]) -> tuple[Sequence[float], Sequence[float]]:
    """Return the knots of an isotonic regression from log odds to the share that ended in harm."""
    from sklearn.isotonic import IsotonicRegression

    low, high = np.quantile(odds, [0.0, 1.0])
    grid = np.unique(np.concatenate([np.quantile(odds, np.linspace(0.0, 1.0, 60)), [low, high]]))
    fitted = IsotonicRegression(y_min=0.0, y_max=1.0, out_of_bounds="clip").fit(odds, danger.astype(float))
    return tuple(grid.tolist()), tuple(fitted.predict(grid).tolist())


def load(path: Path = SHIPPED) -> Calibration:
    """Load a calibration, by default the shipped one.

    Raises `UnusableModel` if the file is damaged, or was fitted for other detectors.
    """
    try:
        found = msgspec.json.decode(path.read_bytes(), type=Calibration)
    except (OSError, ValueError, msgspec.DecodeError) as error:
        raise UnusableModel(f"{path}: the calibration of danger cannot be read: {error}") from error
    for why in _unfit(found):
        raise UnusableModel(f"{path}: the calibration of danger cannot be used: {why}")
    return found


def _unfit(one: Calibration) -> Iterator[str]:
    """Yield the reasons why a calibration cannot be used."""
    if one.detectors != DETECTORS:
        yield f"it is of the detectors {', '.join(one.detectors)}, and these are {', '.join(DETECTORS)}"
    if not len(one.floor) == len(one.scale) == len(DETECTORS) or len(one.weights) != 2:
        yield "it does not have a floor and a scale of each detector, and the two weights of the worst"
    if min(one.weights, default=-1.0) < 0.0 or min(one.scale, default=0.0) <= 0.0:
        yield "a weight is negative, or a scale not above 0: evidence would not speak for danger"
    if not one.odds or len(one.odds) != len(one.share):
        yield "it does not say which odds came true how often"
    missing = [level.word for level in URGENT if level.word not in one.thresholds]
    if missing:
        yield f"no threshold of {', '.join(missing)}"
    given = [one.thresholds[level.word] for level in URGENT if level.word in one.thresholds]
    if given != sorted(given):
        yield "a more urgent level has a lower threshold than one before it"
    if one.seal != one.sealed.seal:
        yield "it is damaged, or was changed by hand: its seal is of other numbers"
