"""(b) Unexplained torque: the residual of a regression of torque on this robot's own motion."""

from typing import Final

import numpy as np

from ml.danger.detector import Floats
from ml.danger.observation import JOINTS, Observation, or_zero, readable_name

TERMS: Final = 8
SOLVE_EVERY: Final = 125  # samples
FEWEST: Final = 500  # samples before the first prediction
RIDGE: Final = 1.0
FAST, SLOW = 0.45, 0.04  # of the newest sample: over 70 ms, and over a second
SLOWEST: Final = 0.15  # rad/s: scale of the change of friction's sign
LEG: Final = np.array([0, 0, 0, 1, 1, 1])


class Torque:
    """Torque by angle, velocity, acceleration, friction's sign, and the foot's load with its lever."""

    name = "torque"
    keys = (
        *(f"{joint}.peak" for joint in JOINTS),
        *(f"{joint}.lasting" for joint in JOINTS),
        *(f"{joint}.trembling" for joint in JOINTS),
    )
    least = np.repeat([1.0, 0.4, 0.3], 6)  # N·m, N·m, rad/s
    needs = "position, velocity and torque of a joint"

    def __init__(self) -> None:
        self._gram = np.tile(RIDGE * np.eye(TERMS), (6, 1, 1))
        self._moment = np.zeros((6, TERMS))
        self._weights = np.zeros((6, TERMS))
        self._samples = np.zeros(6)
        self._until = SOLVE_EVERY
        self._before = np.full((2, 6), np.nan)  # velocities
        self._residual = np.zeros((2, 6))
        self._trembling = np.zeros(6)

    def measure(self, now: Observation, *, learn: bool) -> Floats:
        position, velocity, torque = now.joint[:3]
        change = velocity - self._before[0]
        jerk = change - (self._before[0] - self._before[1])
        self._before[1], self._before[0] = self._before[0], velocity
        terms = self._terms(now, position, velocity, change / now.step_s if now.step_s else np.zeros(6))
        whole = np.isfinite(torque) & np.isfinite(terms).all(axis=1)
        left = np.where(whole, torque - (terms * self._weights).sum(axis=1), 0.0)
        if learn:
            self._learn(terms, torque, whole)
        self._residual[0] += FAST * (np.abs(left) - self._residual[0])
        self._residual[1] += SLOW * (np.abs(left) - self._residual[1])
        trembles = np.isfinite(jerk) & (now.step_s > 0.0)
        self._trembling += FAST * (np.where(trembles, np.abs(jerk), self._trembling) - self._trembling)
        known = whole & (self._samples >= FEWEST)
        found: Floats = np.concatenate(
            [
                np.where(known, self._residual[0], np.nan),
                np.where(known, self._residual[1], np.nan),
                np.where(trembles, self._trembling, np.nan),
            ]
        )
        return found

    @staticmethod
    def _terms(now: Observation, position: Floats, velocity: Floats, acceleration: Floats) -> Floats:
        load = or_zero(now.foot[0][LEG]) / 1000.0
        lever = or_zero(now.foot[1][LEG]) * 10.0
        sine = np.sin(position)
        terms: Floats = np.stack(
            [
                np.ones(6),
                sine,
                velocity,
                acceleration / 10.0,
                np.tanh(velocity / SLOWEST),
                load,
                load * sine,
                load * lever,
            ],
            axis=1,
        )
        return terms

    def _learn(self, terms: Floats, torque: Floats, whole: Floats) -> None:
        taken = np.where(whole[:, None], terms, 0.0) if not whole.all() else terms
        self._gram += taken[:, :, None] * taken[:, None, :]
        self._moment += taken * np.where(whole, torque, 0.0)[:, None]
        self._samples += whole
        self._until -= 1
        if self._until <= 0:
            self._until = SOLVE_EVERY
            self._weights[:] = np.linalg.solve(self._gram, self._moment[:, :, None])[:, :, 0]

    def words(self, key: str) -> str:
        joint, _, what = key.partition(".")
        if what == "trembling":
            return f"{readable_name(joint)}: trembles faster than anybody moves"
        lasting = "takes more torque, stride by stride," if what == "lasting" else "takes a torque"
        return f"{readable_name(joint)}: {lasting} that its motion does not explain"
