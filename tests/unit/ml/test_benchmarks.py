"""The benchmarks from a file to their figures, on people made up here; and files that cannot be used."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.benchmarks import BENCHMARKS, adapt, fall, ipol, losses, metrics, phase, strides
from ml.benchmarks.models.falling import FallSettings
from ml.benchmarks.models.gait_phase import PhaseSettings
from ml.benchmarks.sisfall import Recording
from ml.errors import UnusableData
from server_gui.cli.evaluate import main
from tests.unit.ml import recordings
from tests.unit.ml.recordings import Arrays, saved

QUICK = PhaseSettings(hidden=(24, 12), networks=1, first_epochs=30, epochs=40, personal_epochs=5)


@pytest.fixture(autouse=True)
def small_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phase, "SETTINGS", QUICK)
    monkeypatch.setattr(adapt, "SETTINGS", QUICK)
    monkeypatch.setattr(fall, "SETTINGS", FallSettings(rounds=8, still_share=0.5, moving_share=0.5))


def figures(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """What the command prints as its last line."""
    assert main([*arguments, "--json"]) == 0
    last = capsys.readouterr().out.rstrip("\n").split("\n")[-1]
    answer: dict[str, Any] = json.loads(last)
    return answer


def test_status_of_clockwork_people_is_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = saved(tmp_path / "gait.npz", recordings.gait())
    report = tmp_path / "report.html"
    found = figures(capsys, "--benchmark", "ipol-status", "--data", str(file), "--report", str(report))
    assert found["subjects"] == 3
    assert found["macro_f1"] > 0.85
    assert found["worst_subject_macro_f1"] <= found["macro_f1"] <= found["steady_macro_f1"] + 0.05
    assert found["accuracy"] > 0.9
    assert found[losses.at("macro_f1", 0.2)] > 0.7
    assert found["seconds"] > 0
    page = report.read_text()
    assert page.count("<svg") == 2
    assert "stand" in page
    assert "http" not in page


def test_phase_and_adaptation_of_clockwork_people(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = saved(tmp_path / "gait.npz", recordings.gait(subjects=2, trials=4, seconds=21.0))
    found = figures(capsys, "--benchmark", "ipol-phase", "--data", str(file))
    assert found["rmse_percent"] < 10.0
    assert found["rmse_percent"] <= found["worst_subject_rmse_percent"]
    assert found["in_step_fraction"] > 0.9
    assert found["rmse_percent"] - 1.0 < found[losses.at("rmse_percent", 0.2)] < 15.0
    assert found["hindsight_rmse_percent"] < 10.0
    adapted = figures(capsys, "--benchmark", "ipol-adapt", "--data", str(file))
    assert adapted["subjects"] == 2
    cut = 1 - adapted["adapted_rmse_percent"] / adapted["rmse_percent"]
    assert adapted["adaptation_cut"] == pytest.approx(cut)
    assert losses.at("adaptation_cut", 0.05) in adapted


def test_labels_that_drift_away_are_told_by_the_feet_themselves(tmp_path: Path) -> None:
    arrays = recordings.gait(subjects=2, trials=2, seconds=12.0)
    drifts = (arrays["subject"] == 1) & (arrays["trial"] == 1)
    for side in ("left_event", "right_event"):
        arrays[side][drifts] = np.roll(arrays[side][drifts], 35)
    data = strides.decisions(ipol.read(saved(tmp_path / "gait.npz", arrays)))
    drifts = (data.subject == 1) & (data.trial == 1)
    assert not data.in_step[drifts].any()
    assert data.in_step[~drifts].mean() > 0.85
    error = np.abs(metrics.circular_error(data.hindsight, data.phase))
    assert np.nanmedian(error[~drifts]) < 0.05
    assert np.nanmedian(error[drifts]) > 0.25


def test_falls_are_foreseen_and_daily_life_is_not_a_fall(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = saved(tmp_path / "falls.npz", recordings.falls())
    found = figures(capsys, "--benchmark", "sisfall-prefall", "--data", str(file))
    assert found["subjects"] == 4
    assert found["sensitivity"] > 0.9
    assert 0 < found["median_lead_ms"] <= 600
    assert found["false_alarm_fraction"] <= 0.1
    assert found["early_alarm_fraction"] == 0.0
    assert found["stumble_alarm_fraction"] is not None
    assert found[losses.at("sensitivity", 0.2)] > 0.8


def test_ground_of_clockwork_people_is_known_and_their_yaw_is_no_feature(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arrays = recordings.ground()
    here = figures(capsys, "--benchmark", "aust-mode", "--data", str(saved(tmp_path / "a.npz", arrays)))
    assert here["macro_f1"] > 0.9
    assert here["sector_macro_f1"] > 0.9
    assert here[losses.at("macro_f1", 0.05)] > 0.9
    assert here["subjects"] is None
    arrays["x"][..., 12] += 3.0  # within the same sectors
    there = figures(capsys, "--benchmark", "aust-mode", "--data", str(saved(tmp_path / "b.npz", arrays)))
    assert {**here, "seconds": 0} == {**there, "seconds": 0}


def test_a_search_says_what_it_chose(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(phase, "GRID", (QUICK, replace(QUICK, epochs=1, first_epochs=1)))
    file = saved(tmp_path / "gait.npz", recordings.gait(subjects=3, trials=1, seconds=8.0))
    assert main(["--benchmark", "ipol-phase", "--data", str(file), "--search"]) == 0
    assert "searched: PhaseSettings(" in capsys.readouterr().out


def test_an_alarm_counts_by_when_it_came() -> None:
    fallen = Recording("S", "F01", np.zeros((400, 6)), impact=300)
    in_time, at_impact, early, none = (fall.Alarm.of(fallen, first) for first in (225, 300, 224, fall.NEVER))
    assert (in_time.detected, in_time.early, in_time.lead) == (True, False, 75)
    assert (at_impact.detected, at_impact.lead) == (True, 0)
    assert (early.detected, early.early) == (False, True)
    assert (none.detected, none.early, none.came) == (False, False, False)


WRONG = [
    ("ipol-status", {"x": np.full((5, 18), 5700)}, r"'(status|subject)' has the shape"),
    ("ipol-status", {"rate": np.array(50)}, "was sampled at 50 Hz"),
    ("ipol-status", {"scale": np.full(18, 0.1)}, "seems to be in other units"),
    ("ipol-status", {"scale": np.full(18, np.nan)}, "samples that are not finite"),
    ("ipol-status", {"scale": np.full(3, 0.001)}, r"'scale' has the shape \(3,\)"),
    ("ipol-status", {"status_names": np.array(["sit", "walk", "turn"])}, "names the states sit, walk, turn"),
    (
        "ipol-status",
        {"channels": np.array([f"c{at}" for at in range(18)])},
        "lacks the channels lowback_acc_x",
    ),
    ("sisfall-prefall", {"rec_len": np.full(36, 10_000)}, "end outside of its samples"),
    ("sisfall-prefall", {"rec_subject": np.full(36, "S1")}, "fewer than 3 subjects"),
    ("sisfall-prefall", {"rec_activity": np.full(36, "D01")}, "needs both falls"),
    ("sisfall-prefall", {"rec_peak_acc_index": np.full(36, 250)}, "impact 250 is outside of it"),
    ("aust-mode", {"names": np.array(["level", "stair_up", "a", "b", "c"])}, "knows no stair_down"),
    ("aust-mode", {"y": np.zeros(96, dtype=np.int8)}, "fewer than 5 windows of stair_up"),
]
GOOD: dict[str, Callable[[], Arrays]] = {
    "ipol-status": recordings.gait,
    "sisfall-prefall": recordings.falls,
    "aust-mode": recordings.ground,
}


@pytest.mark.parametrize(("name", "change", "says"), WRONG, ids=lambda value: str(value)[:40])
def test_a_file_that_cannot_be_used_is_refused_in_words(
    tmp_path: Path, name: str, change: Arrays, says: str
) -> None:
    arrays = {**GOOD[name](), **change}
    with pytest.raises(UnusableData, match=says):
        BENCHMARKS[name].run(saved(tmp_path / "data.npz", arrays), False)


def test_an_array_that_is_missing_is_named(tmp_path: Path) -> None:
    arrays = recordings.falls()
    del arrays["rec_len"]
    with pytest.raises(UnusableData, match="has no array 'rec_len'; it has channels, rate, rec_activity"):
        BENCHMARKS["sisfall-prefall"].run(saved(tmp_path / "falls.npz", arrays), False)


def test_one_subject_alone_is_refused(tmp_path: Path) -> None:
    file = saved(tmp_path / "gait.npz", recordings.gait(subjects=1))
    for name in ("ipol-status", "ipol-phase", "ipol-adapt"):
        with pytest.raises(UnusableData, match="one subject alone"):
            BENCHMARKS[name].run(file, False)


def test_nobody_who_walks_for_longer_than_the_minute_is_refused(tmp_path: Path) -> None:
    file = saved(tmp_path / "gait.npz", recordings.gait(subjects=2, trials=2))
    with pytest.raises(UnusableData, match="nobody walks on in a later trial"):
        BENCHMARKS["ipol-adapt"].run(file, False)


def test_what_is_no_npz_file_or_has_objects_in_it_is_refused(tmp_path: Path) -> None:
    text, objects = tmp_path / "text.npz", tmp_path / "objects.npz"
    text.write_text("subject;status")
    np.savez(objects, x=np.array([{"a": 1}], dtype=object), allow_pickle=True)
    for file in (text, objects):
        with pytest.raises(UnusableData, match=r"is no \.npz file of plain arrays"):
            BENCHMARKS["aust-mode"].run(file, False)
