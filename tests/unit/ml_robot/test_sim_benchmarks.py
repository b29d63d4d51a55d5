"""The benchmarks on simulated people, from a file to their figures, on people made up here."""

import json
from pathlib import Path
from typing import Any

import pytest

from ml.benchmarks import BENCHMARKS, sim, sim_activity, sim_phase
from ml.errors import UnusableData
from ml.robot import learn, novelty
from server_gui.cli.evaluate import main
from tests.unit.ml_robot.recorded import written


@pytest.fixture(autouse=True)
def small_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learn, "EPOCHS", 30)  # there are few rows to learn from
    monkeypatch.setattr(learn, "FOLDS", 2)
    monkeypatch.setattr(novelty, "PROTOTYPES", 16)
    monkeypatch.setattr(novelty, "COMPONENTS", 8)
    monkeypatch.setattr(sim_activity, "VARIANTS", (sim.NO_TRUNK,))
    monkeypatch.setattr(sim_phase, "VARIANTS", (sim.HIPS,))


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("sim") / "sim.jsonl", range(1, 5), rounds=1)


def figures(capsys: pytest.CaptureFixture[str], name: str, file: Path) -> dict[str, Any]:
    """What the command prints as its last line."""
    assert main(["--benchmark", name, "--data", str(file), "--json"]) == 0
    told = capsys.readouterr().out
    assert "synthetic: simulated people" in told
    answer: dict[str, Any] = json.loads(told.rstrip("\n").split("\n")[-1])
    assert (answer["benchmark"], answer["subjects"]) == (name, 4)
    return answer


def test_activity_of_clockwork_people_is_known(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = figures(capsys, "sim-activity", file)
    assert found["macro_f1"] > 0.9
    assert found["worst_subject_macro_f1"] <= found["macro_f1"] + 0.05
    assert found["steady_macro_f1"] >= found["macro_f1"] - 0.02
    assert found["abnormal_found_fraction"] > 0.8 > 0.1 > found["abnormal_false_fraction"]
    assert 0.3 < found["noise_macro_f1"] <= found["macro_f1"] + 0.05
    assert found["calibration_error"] < 0.1
    assert found["no_trunk_macro_f1"] > 0.8


def test_phase_of_clockwork_people_is_known(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = figures(capsys, "sim-phase", file)
    assert found["rmse_percent"] < 15.0  # who says always the same has 29
    assert found["rmse_percent"] <= found["worst_subject_rmse_percent"]
    assert found["false_stride_fraction"] < 0.1
    assert found["accuracy"] > 0.3
    assert found["only_hips_rmse_percent"] < 20.0


def test_falls_of_clockwork_people_are_foreseen(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = figures(capsys, "sim-falling", file)
    assert found["sensitivity"] > 0.9
    assert found["stumble_sensitivity"] > 0.9
    assert 300.0 < found["median_lead_ms"] < 1200.0
    assert found["false_alarms_per_hour"] < 200.0  # in three minutes of steady life: a handful
    assert {"noise_sensitivity", "noise_false_alarms_per_hour"} <= set(found)


def test_two_people_are_too_few_to_judge_by(tmp_path: Path) -> None:
    file = written(tmp_path / "two.jsonl", [1, 2], rounds=1)
    with pytest.raises(UnusableData, match="holds 2 simulated people: 3 are needed"):
        BENCHMARKS["sim-phase"].run(file, False)
