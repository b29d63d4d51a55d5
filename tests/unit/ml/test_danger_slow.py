"""Dangers that come slowly: each detector sees its own, and a new activity is not taken for one."""

import copy
import math
from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from ml.danger.encoder_slip import EncoderSlip
from ml.danger.nearest_neighbours import LOOKS, NearestNeighbours, _alone
from ml.danger.observation import CHANNELS, Observation
from ml.danger.support import Support

Floats = npt.NDArray[np.float64]
Change = Callable[[float, dict[str, float]], None]
Detector = Callable[[], NearestNeighbours | EncoderSlip]

STEP_S = 0.08
LEARNED_S = 110.0


def walking(at_s: float) -> dict[str, float]:
    """Somebody who walks, a stride in 1.2 s, by channels; no two strides are alike."""
    angle, row = math.tau * at_s / 1.2, {}
    size = 1.0 + 0.05 * math.sin(0.7 * at_s)
    for side, phase in (("left", angle), ("right", angle + math.pi)):
        for joint, reach in (("hip", 0.35), ("knee", 0.45), ("ankle", 0.15)):
            name = f"{side}_{joint}"
            row[f"{name}.position"] = size * reach * math.sin(phase)
            row[f"{name}.velocity"] = size * reach * math.tau / 1.2 * math.cos(phase)
            row[f"{name}.torque"] = 20.0 * math.cos(phase)
            row[f"{name}.following_error"] = 0.0
        row[f"{side}_insole.force"] = 400.0 * (1.0 + math.sin(phase))
    row["trunk.tilt_forward"] = 0.05 + 0.02 * math.sin(2.0 * angle)
    return row


def moment(at_s: float, row: dict[str, float], now: Observation) -> Observation:
    now.take(at_s, np.array([row.get(name, math.nan) for name in CHANNELS]))
    return now


@cache
def learned(kind: Detector) -> tuple[NearestNeighbours | EncoderSlip, Observation, Floats]:
    """A detector that knows somebody who walks, and its numbers of the last seconds (n, keys)."""
    detector, now = kind(), Observation()
    times = np.arange(0.0, LEARNED_S, STEP_S).tolist()
    found = [detector.measure(moment(at_s, walking(at_s), now), learn=True) for at_s in times]
    return detector, now, np.array(found[-100:])


def seen(kind: Detector, key: str, change: Change, seconds: float = 4.0) -> tuple[float, Floats]:
    """The largest number of a key before a change, and its numbers after it began, NaN where unknown."""
    detector, now, before = copy.deepcopy(learned(kind))
    at, after = list(detector.keys).index(key), []
    for since_s in np.arange(0.0, seconds, STEP_S).tolist():
        row = walking(LEARNED_S + since_s)
        change(since_s, row)
        after.append(detector.measure(moment(LEARNED_S + since_s, row, now), learn=False)[at])
    return float(before[:, at].max()), np.array(after)


def runs_away(since_s: float, row: dict[str, float]) -> None:
    row["left_knee.position"] += 0.15 * since_s


def new_activity(since_s: float, row: dict[str, float]) -> None:
    for name in row:
        if name.endswith(".position"):
            row[name] += 0.5


def slips(since_s: float, row: dict[str, float]) -> None:
    row["trunk.tilt_forward"] += 0.03 * since_s


def dies(since_s: float, row: dict[str, float]) -> None:
    row["right_insole.force"] *= max(1.0 - 0.15 * since_s, 0.0)


def fades(since_s: float, row: dict[str, float]) -> None:
    row["left_hip.torque"] /= max(1.0 - 0.12 * since_s, 0.1)


def all_go_elsewhere(since_s: float, row: dict[str, float]) -> None:
    for name in row:
        if name.endswith(".position"):
            row[name] += 0.05 * since_s


def told(change: Change, key: str, least: float = 2.0) -> None:
    usual, after = seen(NearestNeighbours, key, change)
    assert np.nanmax(after) > least * usual


def test_a_set_point_that_runs_away_is_told_of_its_joint_alone() -> None:
    told(runs_away, "left_knee.target", 5.0)
    _, own = seen(NearestNeighbours, "left_knee.target", runs_away)
    _, other = seen(NearestNeighbours, "right_hip.target", runs_away)
    assert np.nanmax(other) < 0.3 * np.nanmax(own)


def test_till_it_has_looked_for_long_enough_nothing_is_told() -> None:
    memory, now = NearestNeighbours(), Observation()
    found = np.array(
        [memory.measure(moment(at_s, walking(at_s), now), learn=True) for at_s in 0.08 * np.arange(LOOKS + 1)]
    )
    assert np.isnan(found[:-1]).all()
    assert np.isfinite(found[-1]).any()


def test_an_imu_that_slips_is_told() -> None:
    told(slips, "lean", 5.0)


def test_an_insole_whose_cells_die_is_told() -> None:
    told(dies, "right load")


def test_torque_that_fades_is_told() -> None:
    told(fades, "left_hip.torque")


def test_a_set_point_is_told_where_it_goes_its_own_way_and_not_where_all_do() -> None:
    _, alone = seen(NearestNeighbours, "left_knee.target", runs_away, 1.0)
    _, together = seen(NearestNeighbours, "left_knee.target", all_go_elsewhere, 3.0)
    assert np.nanmax(together, initial=0.0) < 0.2 * np.nanmax(alone)


def test_of_a_new_activity_nobody_can_say() -> None:
    for key in ("left_knee.target", "lean", "right load"):
        usual, after = seen(NearestNeighbours, key, new_activity, 2.0)
        assert math.isfinite(usual)
        assert np.isnan(after).all()


def test_a_robot_that_loses_a_joint_is_compared_with_nothing() -> None:
    def lost(since_s: float, row: dict[str, float]) -> None:
        del row["left_hip.velocity"]

    _, after = seen(NearestNeighbours, "lean", lost, 1.0)
    assert np.isnan(after).all()


def walked(change: Change, seconds: float) -> Floats:
    """All numbers of a walk in which a row may lack something, from the first moment on (n, keys)."""
    memory, now, found = NearestNeighbours(), Observation(), []
    for at_s in np.arange(0.0, seconds, STEP_S).tolist():
        row = walking(at_s)
        change(at_s, row)
        found.append(memory.measure(moment(at_s, row, now), learn=True))
    return np.array(found)


def test_of_a_single_joint_nobody_can_say_where_it_should_be_led() -> None:
    def alone(_at_s: float, row: dict[str, float]) -> None:
        for name in [name for name in row if "insole" not in name and not name.startswith("left_hip")]:
            del row[name]

    found = walked(alone, LEARNED_S)[-100:]
    assert np.isnan(found[:, 0]).all()
    assert np.isfinite(found[:, NearestNeighbours.keys.index("left_hip.torque")]).any()


def test_what_a_joint_is_looked_up_by_is_there() -> None:
    distance, there = np.array([1.0, 2.0, 9.0, 3.0, 4.0, 9.0]), np.array([1, 1, 0, 1, 1, 0], dtype=bool)
    assert _alone(distance, there)[[0, 1, 3, 4]] == pytest.approx([1 - 1 / 3, 1 - 2 / 3, 0.0, 0.0])


def test_what_was_missing_at_first_is_compared_once_it_is_there() -> None:
    def late(at_s: float, row: dict[str, float]) -> None:
        if at_s < 40.0:
            row["left_hip.torque"] = row["left_insole.force"] = math.nan

    found = walked(late, 90.0)[-100:]
    assert np.isfinite(
        found[:, [NearestNeighbours.keys.index("left_hip.torque"), NearestNeighbours.keys.index("left load")]]
    ).all()


def test_what_is_wrong_is_not_remembered() -> None:
    memory, now = NearestNeighbours(), Observation()
    for count in range(300):
        at_s = count * STEP_S
        assert np.isnan(memory.measure(moment(at_s, walking(at_s), now), learn=False)).all()


def test_an_encoder_that_slips_again_and_again_creeps() -> None:
    def encoder(since_s: float, row: dict[str, float]) -> None:
        row["left_knee.position"] += 0.012 * int(since_s / 0.5)

    usual, after = seen(EncoderSlip, "left_knee", encoder)
    assert np.nanmax(after) > 0.05
    assert usual < 0.02
    usual, after = seen(EncoderSlip, "right_knee", encoder)
    assert np.nanmax(after) < 0.02


def feet(at_s: float, forward_m: float) -> dict[str, float]:
    """Somebody who walks, whose centre of pressure is so far forward from the heel's under either foot."""
    row = {"trunk.tilt_forward": 0.0}
    for side, phase in (("left", 0.0), ("right", math.pi)):
        row[f"{side}_insole.force"] = 400.0 * (1.0 + math.sin(math.tau * at_s / 1.2 + phase))
        row[f"{side}_insole.cop_x"] = forward_m
        row[f"{side}_insole.cop_y"] = 0.0
    return row


def test_a_foot_put_down_as_it_stands_is_a_halt_and_elsewhere_is_told() -> None:
    support, now = Support(), Observation()
    stands = {"left_insole.force": 400.0, "right_insole.force": 400.0}
    stands |= {f"{side}_insole.cop_{way}": 0.1 * (way == "x") for side in ("left", "right") for way in "xy"}
    for at_s in np.arange(0.0, 10.0, STEP_S).tolist():
        support.measure(moment(at_s, stands, now), learn=True)
    for at_s in np.arange(10.0, 60.0, STEP_S).tolist():
        support.measure(moment(at_s, feet(at_s, 0.0), now), learn=True)
    worst = {}
    for forward_m in (0.0, 0.1, 0.2):
        own, then = copy.deepcopy((support, now))
        found = [
            own.measure(moment(at_s, feet(at_s, forward_m), then), learn=False)[:2]
            for at_s in np.arange(60.0, 61.0, STEP_S).tolist()
        ]
        worst[forward_m] = float(np.nanmax(found))
    assert worst[0.1] < 2.0 < worst[0.2]
    assert worst[0.0] < 2.0
