"""Friction, load and cogging from runs at constant speeds, there and back over the same angles.

At one speed the motor's torque is load + friction one way, and load − friction the other: half their
difference at the same angle is friction, half their sum is the load (gravity, springs). Friction over speed
is a straight line, Coulomb + viscous · |speed|. What is left of the slowest runs, by the motor's angle, is
cogging. All is seen where the drive measures its torque, so that what the gear loses counts as friction.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.optimize import lsq_linear

from server_gui.core.joint_tests.file import Samples, Test
from server_gui.core.joint_tests.measures import Curve, JointTestResult, Measure, unknown

EDGES: Final = 0.15  # of a run, at either end, in which it gets up to speed and slows down
LEAST_SAMPLES: Final = 20  # of a run
LEAST_LEVELS: Final = 3  # of speed, for a line
SAME_SPEED: Final = 0.2  # a share by which the speeds of one level may differ
BINS: Final = 12  # of angle
ORDERS: Final = 36  # of a motor's turn, that are looked for
LEAST_TURNS: Final = 1.0  # of the motor
SURE: Final = 4.0  # times the usual amplitude of all orders


@dataclass(frozen=True, slots=True)
class Run:
    """One run at constant speed (rad/s, signed): angles and torques, each (n,)."""

    speed: float
    angles: Samples
    torques: Samples


def friction(test: Test) -> JointTestResult:
    """Analyse a friction test."""
    runs = _runs(test)
    pairs = [found for there, back in pairwise(runs) if (found := _pair(there, back)) is not None]
    if not pairs:
        why = "no speed was run both ways over the same angles"
        names = (("coulomb", "N·m"), ("viscous", "N·m·s/rad"), ("load_swing", "N·m"), ("cogging", "N·m"))
        return JointTestResult([unknown(name, unit, why) for name, unit in names], [])
    speeds = np.array([speed for speed, _, _, _ in pairs])
    losses = np.array([loss for _, loss, _, _ in pairs])
    coulomb, viscous = _line(speeds, losses)
    _, _, angles, loads = min(pairs, key=lambda one: one[0])
    cogging, spectrum = _cogging(test, runs)
    order = np.argsort(speeds)
    return JointTestResult(
        [
            coulomb,
            viscous,
            Measure("load_mean", float(np.mean(loads)), "N·m"),
            Measure("load_swing", float(np.ptp(loads)), "N·m"),
            *cogging,
        ],
        [
            Curve("friction", speeds[order].tolist(), losses[order].tolist(), "rad/s", "N·m"),
            Curve("load", np.degrees(angles).tolist(), loads.tolist(), "°", "N·m"),
            *spectrum,
        ],
    )


def _runs(test: Test) -> list[Run]:
    """Return the stretches in which the target goes on evenly, their edges cut off."""
    target, times, period = test["target"], test.times, test.head.period_s
    if len(target) < LEAST_SAMPLES or not np.isfinite(test["torque"]).all():
        return []
    speed = np.diff(target) / period
    even = np.abs(np.diff(speed)) <= 1e-6 + 1e-3 * np.abs(speed[1:])
    moving = even & (np.abs(speed[1:]) > 1e-6)
    runs = []
    for begin, end in _stretches(moving):
        cut = round(EDGES * (end - begin))
        part = slice(begin + 1 + cut, end + 1 - cut)
        if part.stop - part.start >= LEAST_SAMPLES:
            angles = test["position"][part]
            slope = float(np.polyfit(times[part], angles, 1)[0])
            runs.append(Run(slope, angles, test["torque"][part]))
    return runs


def _stretches(wanted: "np.typing.NDArray[np.bool_]") -> list[tuple[int, int]]:
    """Beginning and end of each stretch of `True`."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], wanted, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _pair(there: Run, back: Run) -> tuple[float, float, Samples, Samples] | None:
    """Speed, friction, and load over angle; `None` where these two are no pair."""
    low = max(there.angles.min(), back.angles.min())
    high = min(there.angles.max(), back.angles.max())
    differ = abs(there.speed + back.speed) > SAME_SPEED * abs(there.speed)
    if there.speed * back.speed >= 0.0 or differ or low >= high:
        return None
    edges = np.linspace(low, high, BINS + 1)
    forth, back_ = _binned(there, edges), _binned(back, edges)
    if there.speed < 0.0:
        forth, back_ = back_, forth
    known = np.isfinite(forth) & np.isfinite(back_)
    if not known.any():
        return None
    centres = (edges[:-1] + edges[1:]) / 2.0
    speed = (abs(there.speed) + abs(back.speed)) / 2.0
    loss = float(np.mean((forth - back_)[known]) / 2.0)
    return speed, loss, centres[known], ((forth + back_) / 2.0)[known]


def _binned(run: Run, edges: Samples) -> Samples:
    """Mean torque of each bin of angle; NaN where it has no sample."""
    place = np.clip(np.digitize(run.angles, edges) - 1, -1, BINS)
    inside = (run.angles >= edges[0]) & (run.angles <= edges[-1]) & (place < BINS)
    count = np.bincount(place[inside], minlength=BINS).astype(np.float64)
    total = np.bincount(place[inside], weights=run.torques[inside], minlength=BINS)
    means: Samples = np.divide(total, count, out=np.full(BINS, np.nan), where=count > 0)
    return means


def _line(speeds: Samples, losses: Samples) -> tuple[Measure, Measure]:
    if len(speeds) < LEAST_LEVELS:
        why = f"{LEAST_LEVELS} speeds are needed, {len(speeds)} could be used"
        return unknown("coulomb", "N·m", why), unknown("viscous", "N·m·s/rad", why)
    matrix = np.column_stack([np.ones_like(speeds), speeds])
    found = lsq_linear(matrix, losses)
    freedom = max(1, len(speeds) - 2)
    error = float(np.sum((matrix @ found.x - losses) ** 2)) / freedom
    spread = np.sqrt(np.diag(error * np.linalg.pinv(matrix.T @ matrix)))
    return (
        Measure("coulomb", float(found.x[0]), "N·m", float(spread[0])),
        Measure("viscous", float(found.x[1]), "N·m·s/rad", float(spread[1])),
    )


def _cogging(test: Test, runs: Sequence[Run]) -> tuple[list[Measure], list[Curve]]:
    """Return the strongest order of the motor's turn, of the slowest pair of runs."""
    slow = min(abs(run.speed) for run in runs)
    chosen = [run for run in runs if abs(run.speed) <= slow * (1.0 + SAME_SPEED)]
    gear = float(test.head.drive["gear_ratio"])
    turns = min(float(np.ptp(run.angles)) for run in chosen) * gear / (2.0 * np.pi)
    if turns < LEAST_TURNS:
        why = f"the motor made {turns:.1f} turns at the lowest speed, {LEAST_TURNS:g} are needed"
        return [unknown("cogging", "N·m", why), unknown("cogging_order", "", why)], []
    angles = np.concatenate([run.angles for run in chosen])
    rest = np.concatenate([_flattened(run) for run in chosen])
    orders = np.arange(1, min(ORDERS, len(rest) // 8) + 1)
    phases = np.outer(angles * gear, orders)
    matrix = np.hstack([np.cos(phases), np.sin(phases)])
    found = np.linalg.lstsq(matrix, rest, rcond=None)[0]
    sizes = np.hypot(found[: len(orders)], found[len(orders) :])
    strongest = int(np.argmax(sizes))
    curve = Curve("cogging by order", list(map(float, orders)), sizes.tolist(), "1/turn", "N·m")
    floor = max(float(np.median(sizes)), _resolution(test["torque"]) / SURE)
    if sizes[strongest] < SURE * floor:
        why = f"no order stands out of the noise, {floor:.2g} N·m"
        return [unknown("cogging", "N·m", why), unknown("cogging_order", "", why)], [curve]
    return [
        Measure("cogging", float(sizes[strongest]), "N·m", floor),
        Measure("cogging_order", float(orders[strongest]), "1/turn"),
        Measure("cogging_seen_at", float(orders[strongest]) * gear * slow / (2.0 * np.pi), "Hz"),
    ], [curve]


def _resolution(torques: Samples) -> float:
    """Return the least that two of the drive's figures differ by."""
    steps = np.diff(np.unique(np.round(torques, 9)))
    return float(steps.min()) if len(steps) else 0.0


def _flattened(run: Run) -> Samples:
    """Without friction and load: what changes slowly over the angle."""
    middle = (run.angles - run.angles.mean()) / max(float(np.ptp(run.angles)), 1e-9)
    return run.torques - np.polyval(np.polyfit(middle, run.torques, 3), middle)
