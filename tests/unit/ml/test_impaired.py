"""`impaired-phase`: patients' recordings as they are read, groups as they are told, and what is learned."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ml.benchmarks import impaired, impaired_groups, impaired_phase, impaired_strides
from ml.benchmarks.impaired_groups import Person, figures_of, interval, rows_of
from ml.benchmarks.impaired_phase import folds_of, mixed
from ml.benchmarks.models.gait_phase import PhaseSettings
from ml.errors import UnusableData
from ml.features import features
from ml.features.foot_rates import PHASES
from server_gui.cli.evaluate import main
from tests.bench import gait_events
from tests.bench._impaired_feet import found_in
from tests.unit.ml import recordings
from tests.unit.ml.recordings import saved

QUICK = PhaseSettings(hidden=(32, 16), networks=1, first_epochs=15, epochs=15, personal_epochs=40)


# --- reading


def test_walks_are_read_with_whose_they_are(tmp_path: Path) -> None:
    walks = impaired.read(saved(tmp_path / "p.npz", recordings.patients(2, 1, trials=2, seconds=4.0)))
    assert [(walk.subject, walk.number, walk.group, walk.sensor) for walk in walks] == [
        (0, 0, "healthy", "even"),
        (0, 1, "healthy", "even"),
        (1, 0, "healthy", "odd"),
        (1, 1, "healthy", "odd"),
        (2, 0, "limping", "even"),
        (2, 1, "limping", "even"),
    ]
    assert walks[0].rates.shape == (700, 6)
    assert 5.0 < walks[0].rates.max() < 7.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"group": 0}, "nobody else"),
        ({"group": 1}, "fewer than two healthy"),
        ({"group": 7}, "does not name"),
        ({"scale": 1.0}, "other units"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_words(
    tmp_path: Path, change: dict[str, float], words: str
) -> None:
    arrays = recordings.patients(2, 1, trials=1, seconds=3.0)
    for name, value in change.items():
        arrays[name] = np.full_like(arrays[name], value)
    with pytest.raises(UnusableData, match=words):
        impaired.read(saved(tmp_path / "p.npz", arrays))


def test_somebody_in_two_groups_is_refused(tmp_path: Path) -> None:
    arrays = recordings.patients(3, 1, trials=2, seconds=3.0)
    arrays["group"][(arrays["subject"] == 0) & (arrays["trial"] == 1)] = 1
    with pytest.raises(UnusableData, match="two groups"):
        impaired.read(saved(tmp_path / "p.npz", arrays))


def test_healthy_people_say_how_much_later_each_make_of_sensor_is_labelled(tmp_path: Path) -> None:
    walks = impaired.read(saved(tmp_path / "p.npz", recordings.patients(4, 2, trials=1)))
    later = impaired.laid_later(walks)
    assert later["even"] == pytest.approx(later["odd"], abs=2)
    moved = [
        dataclasses.replace(walk, moving=tuple(np.roll(one, 12) for one in walk.moving))  # type: ignore[arg-type]
        if walk.sensor == "odd" or walk.group != impaired.HEALTHY
        else walk
        for walk in walks
    ]
    assert impaired.laid_later(moved) == {"even": later["even"], "odd": later["odd"] + 12}


def test_a_make_that_nobody_healthy_wore_is_refused(tmp_path: Path) -> None:
    arrays = recordings.patients(2, 2, trials=1, seconds=4.0)
    arrays["sensor"][:] = arrays["group"]
    with pytest.raises(UnusableData, match="no healthy person wore odd"):
        impaired_phase.evaluate(saved(tmp_path / "p.npz", arrays), False)


# --- features and strides


def test_a_foot_is_seen_alike_however_its_sensor_is_turned_about_the_pitch_axis() -> None:
    rates, _ = recordings.feet(4.0, 1.1, limps=False)
    rates[:, 0] = 0.3 * rates[:, 1]
    turned = rates.copy()
    turned[:, [0, 2]] = rates[:, [2, 0]] * (-1.0, 1.0)
    ends = np.arange(200, 600, 10)
    left, right = PHASES
    seen = features(left, rates, ends)
    assert np.allclose(seen, features(left, turned, ends), atol=1e-5)
    assert np.array_equal(seen, features(right, np.roll(rates, 3, axis=1), ends))


def test_phases_count_from_the_labels_moved_to_the_strike() -> None:
    rates, moving = recordings.feet(6.0, 1.0, limps=False)
    walk = impaired.Walk(1, 0, "healthy", "x", rates, (moving[:, 0], moving[:, 1]))
    made = impaired_strides.decisions([walk], {"x": 8}, step=1)
    strikes, others = (impaired.landings(moving[:, foot]) - 8 for foot in (0, 1))
    left = made.of(np.arange(np.ptp(strikes)))
    assert left.phase[0] == 0.0
    assert (np.diff(left.phase) > -1.0).all()
    assert (left.phase == 0.0).sum() == len(strikes) - 1
    assert len(set(made.stride.tolist())) == len(strikes) - 1 + len(others) - 1
    assert np.nanmedian(np.abs((made.hindsight - made.phase + 0.5) % 1.0 - 0.5)) < 0.02


def test_the_first_minute_ends_in_the_walk_that_completes_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(impaired_strides, "MINUTE_S", 9.0)
    rates, moving = recordings.feet(6.0, 1.0, limps=False)
    walks = [
        impaired.Walk(1, number, "healthy", "x", rates, (moving[:, 0], moving[:, 1])) for number in range(4)
    ]
    minute = impaired_strides.minutes(walks, {"x": 8})
    assert minute == {1: 1}
    late = impaired_strides.late_of(impaired_strides.decisions(walks, {"x": 8}), minute)
    assert 0.4 < late.mean() < 0.6


@given(st.lists(st.integers(1, 230), min_size=1, max_size=3), st.integers(0, 40))
def test_no_recording_of_any_length_crashes_what_is_learned(rows: list[int], later: int) -> None:
    walks = []
    for number, length in enumerate(rows):
        rates, moving = recordings.feet(5.0, 0.6, limps=False)
        rates, moving = rates[150 : 150 + length], moving[150 : 150 + length]
        walks.append(impaired.Walk(number, 0, "healthy", "x", rates, (moving[:, 0], moving[:, 1])))
    try:
        data = impaired_strides.decisions(walks, {"x": later})
        taught = impaired_strides.lessons(walks, {"x": later}, data)
    except UnusableData:
        return
    assert len(taught.phase) >= len(data.phase)
    assert ((taught.phase >= 0.0) & (taught.phase < 1.0)).all()


def test_packets_are_lost_foot_by_foot_and_never_the_first(tmp_path: Path) -> None:
    walks = impaired.read(saved(tmp_path / "p.npz", recordings.patients(2, 1, trials=1, seconds=30.0)))
    for share in (0.05, 0.2):
        for walk, whole in zip(impaired.lossy(walks, share), walks, strict=True):
            gone = np.isnan(walk.rates)
            assert not gone[0].any()
            assert (gone[:, :3].all(axis=1) == gone[:, :3].any(axis=1)).all()
            assert gone.mean() == pytest.approx(share, abs=0.03)
            assert (gone[:, 0] != gone[:, 3]).any()
            assert np.array_equal(walk.rates[~gone], whole.rates[~gone])


# --- groups


def test_mixed_models_learn_from_as_many_people_of_every_group() -> None:
    groups = dict.fromkeys(range(20), "healthy") | dict.fromkeys(range(20, 80), "b")
    groups |= dict.fromkeys(range(80, 90), "c")
    chosen = mixed(groups, 20)
    assert len(set(chosen)) == len(chosen) == 20
    assert sorted([groups[one] for one in chosen].count(name) for name in ("healthy", "b", "c")) == [6, 7, 7]


def test_everybody_is_judged_once_by_models_that_have_not_seen_him() -> None:
    groups = dict.fromkeys(range(7), "healthy") | dict.fromkeys(range(7, 20), "b")
    made = list(folds_of(groups))
    assert sorted(one for fold in made for one in fold.held_out) == list(range(20))
    for fold in made:
        healthy, both = fold.teachers
        assert not set(fold.held_out) & (set(healthy) | set(both))
        assert {groups[one] for one in healthy} == {"healthy"}
        assert len(both) == len(healthy)


def person(subject: int, group: str, rmse: float, **more: float) -> Person:
    names = ("rmse_percent", "early_rmse_percent", "later_rmse_percent", "adapted_rmse_percent")
    own = {f"{model}_{name}": rmse for model in impaired_groups.MODELS for name in names}
    own |= {
        f"{model}_{name}": 0.96
        for model in impaired_groups.MODELS
        for name in ("covered", "interval_percent")
    }
    return Person(subject, group, "x", own | {"hindsight_rmse_percent": math.nan} | more)


def test_the_worst_group_is_told_first_and_counts() -> None:
    people = [person(1, "healthy", 2.0), person(2, "a", 3.0), person(3, "b", 9.0), person(4, "b", 7.0)]
    rows = rows_of(people)
    assert list(rows) == ["b", "a", "healthy"]
    found = figures_of(people, rows)
    assert found["worst_group_healthy_rmse_percent"] == 8.0
    assert found["healthy_rmse_percent"] == pytest.approx((8.0 + 3.0 + 2.0) / 3)
    assert rows["b"]["healthy_low"] == 7.0
    assert rows["b"]["healthy_high"] == 9.0


def test_the_worst_third_is_chosen_by_the_minute_and_judged_after_it() -> None:
    people = [
        person(1, "healthy", 4.0, healthy_early_rmse_percent=9.0, healthy_adapted_rmse_percent=2.0),
        person(2, "a", 6.0),
        person(3, "a", 5.0),
    ]
    found = figures_of(people, rows_of(people))
    assert found["healthy_worst_third_adaptation_cut"] == 0.5
    assert found["healthy_adaptation_cut"] == pytest.approx(1.0 - 13.0 / 15.0)
    assert found["mixed_worst_third_adaptation_cut"] == 0.0


def test_who_does_not_walk_on_is_in_no_figure_of_the_minute() -> None:
    nothing = {
        f"{model}_{when}_rmse_percent": math.nan
        for model in impaired_groups.MODELS
        for when in ("later", "adapted")
    }
    people = [person(one, name, 3.0, **nothing) for one, name in ((1, "healthy"), (2, "a"))]
    rows = rows_of(people)
    assert rows["a"]["later_people"] == 0.0
    assert math.isnan(rows["a"]["healthy_adapted"])
    assert "healthy_adaptation_cut" not in figures_of(people, rows)


def test_an_interval_is_of_people_and_is_the_same_each_time() -> None:
    low, high = interval([1.0, 2.0, 3.0, math.nan])
    assert 1.0 <= low < 2.0 < high <= 3.0
    assert (low, high) == interval([1.0, 2.0, 3.0])
    assert math.isnan(interval([])[0])


# --- as a whole


def test_limping_people_are_followed_worse_by_models_of_healthy_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(impaired_phase, "SETTINGS", QUICK)
    monkeypatch.setattr(impaired_phase, "FOLDS", 2)
    monkeypatch.setattr(impaired_phase, "LEAST_LATER", 20)
    monkeypatch.setattr(impaired_strides, "MINUTE_S", 6.0)
    file = saved(tmp_path / "p.npz", recordings.patients(4, 4, trials=2, seconds=10.0))
    assert main(["--benchmark", "impaired-phase", "--data", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out.rstrip("\n").split("\n")[-1])
    groups = found["by_group"]
    assert found["subjects"] == 8
    assert list(groups)[:2] == ["limping", "healthy"]
    assert groups["limping"]["healthy_rmse_percent"] > 2 * groups["healthy"]["healthy_rmse_percent"]
    assert groups["limping"]["mixed_rmse_percent"] < groups["limping"]["healthy_rmse_percent"]
    assert found["mixed_gain_points"] > 0.0
    assert found["healthy_worst_third_adapted_rmse_percent"] < found["healthy_worst_third_later_rmse_percent"]
    assert groups["limping"]["healthy_covered"] < groups["healthy"]["healthy_covered"]
    whole = found["worst_group_healthy_rmse_percent"]
    assert 0.9 * whole < found["worst_group_healthy_rmse_percent_5_percent_lost"] < 1.5 * whole
    assert found["worst_group_healthy_rmse_percent_20_percent_lost"] != whole


def test_a_step_is_found_by_one_swing_and_a_swing_finds_one_step() -> None:
    steps = [(0.0, 10.0), (20.0, 30.0), (40.0, 50.0)]
    swings = [(1.0, 5.0), (6.0, 9.0), (11.0, 19.0), (22.0, 44.0), (38.0, 48.0)]
    assert list(found_in(steps, swings)) == [(0, 0), (2, 4)]
    assert list(found_in(steps, [])) == []
    assert list(found_in([], swings)) == []


def test_the_live_rule_is_judged_by_groups_the_worst_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = saved(tmp_path / "p.npz", recordings.patients(3, 2, trials=1, seconds=12.0))
    assert gait_events.main(["--data", str(file)]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.split("\n") if line.startswith("{")]
    by_group = {line["group"]: line for line in lines}
    assert set(by_group) == {"healthy", "limping"}
    f1 = [line["step F1"][0] for line in lines]
    assert f1 == sorted(f1)
    assert by_group["healthy"]["step F1"][0] > 0.9
    assert by_group["healthy"]["strike F1"][0] > 0.9
    assert by_group["healthy"]["stride ms"][0] < 20.0
