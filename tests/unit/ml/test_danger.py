"""Danger: unknown is never fine, evidence never speaks against danger, thresholds keep their budgets."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ml.danger.baseline import FEWEST, WAITS, Baseline
from ml.danger.calibration import Calibration, load
from ml.danger.detector import DETECTORS
from ml.danger.false_alarm_budget import (
    BUDGETS,
    extrapolated,
    rate_interval,
    rule_of_three,
    share_interval,
    thresholds,
)
from ml.danger.levels import CALM_S, HOLD, RELEASE, URGENT, Level, Levels, sustained
from ml.danger.monitor import COMPARE, HARM_S, STRANGE_S, DangerMonitor, Evidence
from ml.danger.nearest_neighbours import NearestNeighbours
from ml.danger.observation import CHANNELS

PERIOD_NS = 140_000_000  # as seldom as can be: it is learned from seconds, not from rows
CALIBRATION = load()


def rows(watch: DangerMonitor, count: int, start: int = 0, **values: float) -> None:
    row = [values.get(name.replace(".", "_")) for name in CHANNELS]
    for at in range(start, start + count):
        watch.take(at * PERIOD_NS, row)


def test_a_robot_without_any_channel_is_unknown_and_never_fine() -> None:
    watch = DangerMonitor(CALIBRATION)
    rows(watch, 50)
    assert watch.verdict is not None
    assert watch.verdict.level is Level.UNKNOWN
    assert watch.verdict.number is None
    assert watch.verdict.silent == DETECTORS


def test_a_robot_of_whom_few_detectors_speak_is_not_called_fine() -> None:
    watch = DangerMonitor(CALIBRATION)
    rows(watch, 300, left_knee_temperature=30.0)
    assert watch.verdict is not None
    assert watch.verdict.number is not None
    assert watch.verdict.speaking == 1
    assert watch.verdict.level is Level.UNKNOWN


def test_a_motor_that_grows_hot_is_told_with_its_joint() -> None:
    watch = DangerMonitor(CALIBRATION)
    rows(watch, 300, left_knee_temperature=30.0)
    calm = watch.verdict
    row: list[float | None] = [None] * len(CHANNELS)
    for at in range(110):
        row[CHANNELS.index("left_knee.temperature")] = 30.0 + 8.0 * at * PERIOD_NS / 1e9
        watch.take((300 + at) * PERIOD_NS, row)
    assert calm is not None
    assert calm.number is not None
    assert watch.verdict is not None
    assert watch.verdict.number is not None
    assert watch.verdict.number > calm.number
    assert any("left knee" in why for why in watch.verdict.why)


def test_a_value_that_has_gone_stale_silences_its_detector() -> None:
    watch = DangerMonitor(CALIBRATION)
    rows(watch, 300, left_knee_temperature=30.0)
    rows(watch, 20, 300)
    assert watch.verdict is not None
    assert watch.verdict.level is Level.UNKNOWN
    assert watch.verdict.number is None


MOST = len(DETECTORS)


@given(
    st.lists(st.floats(0.0, 50.0), min_size=MOST, max_size=MOST),
    st.integers(0, MOST - 1),
    st.floats(0.0, 50.0),
)
def test_more_evidence_never_lowers_the_number(above: list[float], at: int, more: float) -> None:
    raised = list(above)
    raised[at] = min(raised[at] + more, 50.0)
    before, after = (CALIBRATION.log_odds(np.array(one)) for one in (above, raised))
    assert after >= before - 1e-9
    assert CALIBRATION.probability(after) >= CALIBRATION.probability(before) - 1e-9


def test_what_is_unknown_says_nothing() -> None:
    silent, calm = np.full(MOST, np.nan), np.zeros(MOST)
    assert CALIBRATION.log_odds(silent) == CALIBRATION.log_odds(calm)


def test_levels_rise_at_once_and_fall_after_a_calm_while() -> None:
    levels = Levels({level: float(level) for level in URGENT})
    assert [levels.take(0.04 * at, 2.5) for at in range(2)] == [Level.NONE, Level.ADVICE]
    assert levels.take(0.1, -5.0) is Level.ADVICE
    assert levels.take(0.1 + 0.5 * CALM_S, -5.0) is Level.ADVICE
    assert levels.take(0.2 + CALM_S, -5.0) is Level.NONE


def test_thresholds_rise_with_the_level_and_keep_the_budget_on_what_was_seen() -> None:
    hours, source = 20.0, np.random.default_rng(0)
    maxima = source.gumbel(0.0, 1.0, int(hours * 360))
    found = thresholds(maxima, hours)
    assert list(found.values()) == sorted(found.values())
    for level, budget in BUDGETS.items():
        assert (maxima >= found[level]).sum() <= max(budget * hours, 1)


@given(st.lists(st.floats(-3.0, 9.0), min_size=HOLD, max_size=40))
def test_a_level_begins_where_what_is_held_reaches_its_threshold(odds: list[float]) -> None:
    reached = float(sustained(np.array(odds))[HOLD - 1 :].max())
    for threshold, begins in ((reached, True), (reached + 1e-6, False)):
        levels = Levels(dict.fromkeys(URGENT, threshold))
        found = [levels.take(0.04 * at, one) for at, one in enumerate(odds)]
        assert (max(found) > Level.NONE) is begins


def test_the_tail_says_how_often_odds_beyond_all_that_was_seen_are_reached() -> None:
    hours, source = 20.0, np.random.default_rng(0)
    maxima = source.exponential(1.0, int(hours * 360))
    for beyond in (6.0, 12.0):
        assert extrapolated(maxima, hours, beyond) == pytest.approx(360.0 * math.exp(-beyond), rel=0.5)
    assert extrapolated(maxima, hours, -5.0) <= 36.0


def test_intervals_of_rates_and_shares_are_the_known_ones() -> None:
    assert rule_of_three(0, 100.0) == pytest.approx(0.02996, rel=1e-3)
    assert list(rate_interval(0, 1.0)) == pytest.approx([0.0, 3.689], rel=1e-3)
    assert list(share_interval(95, 100)) == pytest.approx([0.887, 0.984], abs=1e-3)


def test_what_is_learned_waits_until_nothing_was_wrong() -> None:
    usual = Baseline(np.array([0.1]))
    for at in range(FEWEST + WAITS + 2):
        usual.take(float(at), np.array([1.0]), quiet=True)
    assert usual.known.all()
    for at in range(5):
        usual.take(100.0 + at, np.array([9.0]), quiet=True)
    usual.take(106.0, np.array([9.0]), quiet=False)  # it was a danger
    assert float(usual.take(107.0, np.array([1.0]), quiet=True)[0]) == 0.0
    assert float(usual.take(108.0, np.array([9.0]), quiet=True)[0]) > 5.0


def test_robots_learn_nothing_of_each_other() -> None:
    one, other = DangerMonitor(CALIBRATION), DangerMonitor(CALIBRATION)
    rows(one, 300, left_knee_temperature=90.0)
    rows(other, 300, left_knee_temperature=30.0)
    alone = DangerMonitor(CALIBRATION)
    rows(alone, 300, left_knee_temperature=30.0)
    assert other.verdict == alone.verdict


def test_the_shipped_calibration_names_its_detectors_levels_and_source() -> None:
    assert isinstance(CALIBRATION, Calibration)
    assert CALIBRATION.detectors == DETECTORS
    assert min(CALIBRATION.weights) >= 0.0
    assert set(CALIBRATION.thresholds) == {level.word for level in URGENT}
    assert all(math.isfinite(one) for one in CALIBRATION.thresholds.values())
    assert "simulated" in CALIBRATION.learned_from


def test_a_level_lasts_while_its_odds_are_only_a_little_below_its_threshold() -> None:
    levels, met = Levels(CALIBRATION.by_level), CALIBRATION.by_level[Level.ALARM]
    for at_s in range(HOLD):
        levels.take(float(at_s), met)
    assert {levels.take(10.0 + at_s, met - 0.9 * RELEASE) for at_s in range(9)} == {Level.ALARM}
    assert [levels.take(20.0 + at_s, met - 1.1 * RELEASE) for at_s in range(3)][-1] < Level.ALARM


def test_a_centre_of_pressure_is_not_held_when_its_foot_is_in_the_air(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[list[float]] = []

    def take(_self: Evidence, _at_s: float, values: np.ndarray) -> np.ndarray:
        seen.append(values.tolist())
        return np.full(len(DETECTORS), np.nan)

    monkeypatch.setattr(Evidence, "take", take)
    watch = DangerMonitor(CALIBRATION)
    watch.take(0, [1.0] * len(CHANNELS))
    watch.take(40_000_000, [None] * len(CHANNELS))
    gone = {name for name, value in zip(CHANNELS, seen[1], strict=True) if math.isnan(value)}
    assert gone == {name for name in CHANNELS if ".cop_" in name}


def test_what_is_like_nothing_before_is_compared_with_nothing_for_a_while(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    evidence, nothing = Evidence(), np.full(len(CHANNELS), np.nan)
    monkeypatch.setattr(Baseline, "take", lambda _self, _at_s, numbers, **_: np.zeros(len(numbers)))
    monkeypatch.setattr(NearestNeighbours, "measure", lambda self, _now, **_: self.said)
    silent = []
    for at_s, alike in ((1.0, True), (2.0, False), (2.0 + STRANGE_S / 2, True), (2.1 + STRANGE_S, True)):
        evidence._neighbours.alike = alike
        above = evidence.take(at_s, nothing)
        silent.append({name for name, one in zip(DETECTORS, above, strict=True) if math.isnan(one)})
    assert silent == [set(), set(COMPARE), set(COMPARE), set()]


def judged(monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, Callable[..., list[Level]]]:
    """Spreads of the detectors to be set, and the levels in the next seconds, each once, while `lost` is."""
    above = np.zeros(len(DETECTORS))
    monkeypatch.setattr(Evidence, "take", lambda _self, _at_s, _values: above.copy())
    monkeypatch.setattr(Evidence, "why", lambda _self, _above: ("the left knee lags",))
    watch, stamp_ns = DangerMonitor(CALIBRATION), 0

    def levels(seconds: float, lost: str | tuple[str, ...] = "nothing") -> list[Level]:
        nonlocal stamp_ns
        found = []
        for _ in range(int(seconds * 25)):
            stamp_ns += 40_000_000
            row = [None if name.startswith(lost) else 1.0 for name in CHANNELS]
            found.append(watch.take(stamp_ns, row))
        return list(dict.fromkeys(one.level for one in found if one is not None))

    return above, levels


def levelled(monkeypatch: pytest.MonkeyPatch) -> tuple[np.ndarray, Callable[..., list[Level]]]:
    """Return the same, where the first detector's spread is the level that it just meets."""
    odds = {Level.NONE: -50.0, **CALIBRATION.by_level}
    monkeypatch.setattr(Calibration, "log_odds", lambda _self, above: odds[Level(int(above[0]))])
    return judged(monkeypatch)


def test_a_lower_level_by_what_is_still_seen_is_told_while_what_raised_a_higher_one_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A robot that was in danger still, by another joint, was of unknown danger."""
    above, levels = levelled(monkeypatch)
    above[0] = Level.STOP
    assert levels(1.0)[-1] is Level.STOP
    above[0] = Level.ALARM
    assert levels(CALM_S + 2.0, "left_knee") == [Level.STOP, Level.ALARM]
    above[0] = Level.EARLY
    assert levels(CALM_S + 2.0, "left_knee")[-1] is Level.EARLY
    above[0] = Level.NONE
    assert levels(CALM_S + 2.0, "left_knee")[-1] is Level.UNKNOWN, "the stop may last, unseen"
    assert levels(1.0) == [Level.NONE]


def test_a_lower_level_does_not_end_either_because_the_joint_that_raised_it_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was over as soon as the higher one was too old to last, by a joint of which nothing is known."""
    above, levels = levelled(monkeypatch)
    above[0] = Level.STOP
    assert levels(1.0)[-1] is Level.STOP
    above[0] = Level.ALARM
    assert levels(HARM_S - 1.0, "left_knee") == [Level.STOP, Level.ALARM]
    above[0] = Level.NONE
    assert Level.NONE not in levels(HARM_S - 1.0, ("left_knee", "right_knee"))
    assert levels(2.0, ("left_knee", "right_knee"))[-1] is Level.NONE


def test_a_level_does_not_end_because_the_joint_that_raised_it_is_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was called over: of that joint nobody knew anything any more."""
    above, levels = judged(monkeypatch)
    above[0] = 50.0
    assert levels(1.0)[-1] is Level.STOP
    above[0] = math.nan
    assert levels(10.0, "left_knee") == [Level.STOP, Level.UNKNOWN]
    above[0] = 0.0
    assert levels(1.0) == [Level.NONE]
    above[0] = 50.0
    assert levels(1.0)[-1] is Level.STOP
    above[0] = 0.0
    assert levels(5.0) == [Level.STOP, Level.NONE]
    assert levels(1.0, "left_knee") == [Level.NONE], "it was seen to be over"
    above[0] = 50.0
    assert levels(1.0)[-1] is Level.STOP
    above[0] = math.nan
    assert levels(40.0, "left_knee")[-1] is Level.NONE


def test_a_clock_that_jumps_back_silences_nobody_for_long() -> None:
    watch = DangerMonitor(CALIBRATION)
    rows(watch, 50, start=100_000, left_knee_temperature=30.0)
    rows(watch, 50, left_knee_temperature=30.0)
    assert watch.verdict is not None
    assert watch.verdict.stamp_ns == 49 * PERIOD_NS
    rows(watch, 50, start=48, left_knee_temperature=30.0)  # a row that comes late is none
    assert watch.verdict.stamp_ns >= 49 * PERIOD_NS
