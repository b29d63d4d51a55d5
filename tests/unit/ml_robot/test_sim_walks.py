"""People who walk differently, and robots on one leg: what the benchmarks say of each group of walks."""

import json
from pathlib import Path
from typing import Any

import pytest

from hil_sim.channels import UNITS
from ml.benchmarks import BENCHMARKS, sim, sim_activity, sim_phase, sim_walks
from ml.errors import UnusableData
from ml.robot import learn, novelty
from ml.robot.task import ACTIVITY, FALLING_TASK, GAIT_PHASE
from ml.training import adapting
from server_gui.cli.evaluate import main
from tests.unit.ml_robot.recorded import written


@pytest.fixture(autouse=True)
def small_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(learn, "EPOCHS", 4)
    monkeypatch.setattr(learn, "FOLDS", 2)
    monkeypatch.setattr(novelty, "PROTOTYPES", 16)
    monkeypatch.setattr(novelty, "COMPONENTS", 8)
    monkeypatch.setattr(adapting, "EPOCHS", 5)
    monkeypatch.setattr(sim_walks, "STEPS", {"activity": 25, "gait_phase": 6})
    monkeypatch.setattr(sim_phase, "STEP", 25)
    monkeypatch.setattr(sim_activity, "STEP", 25)
    for benchmark in (sim_activity, sim_phase):
        monkeypatch.setattr(benchmark, "VARIANTS", (sim.NO_FEET,))


def printed(capsys: pytest.CaptureFixture[str], name: str, file: Path) -> tuple[str, dict[str, Any]]:
    assert main(["--benchmark", name, "--data", str(file), "--json"]) == 0
    told = capsys.readouterr().out
    answer: dict[str, Any] = json.loads(told.rstrip("\n").split("\n")[-1])
    return told, answer


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = written(tmp_path_factory.mktemp("walks") / "walks.jsonl", [101, 102, 103], rounds=1)
    return written(file, [101], rounds=1, walks="crouch")


@pytest.mark.parametrize(("name", "figure"), [("sim-phase", "rmse_percent"), ("sim-activity", "macro_f1")])
def test_a_recording_of_several_walks_is_judged_by_each_and_by_the_worst(
    name: str, figure: str, walks: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told, answer = printed(capsys, name, walks)
    assert answer["subjects"] == 3
    table = [line.split() for line in told.splitlines()]
    assert ["WALKS", figure, "covered", "unknown_fraction", "said_accuracy"] in table
    rows = {row[0]: float(row[1]) for row in table if row and row[0] in ("crouch", "ordinary")}
    assert len(rows) == 2
    worst = max(rows.values()) if name == "sim-phase" else min(rows.values())
    assert answer[f"worst_walks_{figure}"] == pytest.approx(worst, rel=0.01)
    assert answer["by_walks"]["crouch"][figure] == pytest.approx(rows["crouch"], rel=0.01)


def test_the_shipped_models_are_judged_by_walks_and_after_a_minute_of_the_wearer(tmp_path: Path) -> None:
    file = written(tmp_path / "walks.jsonl", [101], rounds=3)
    outcome = BENCHMARKS["sim-walks"].run(written(file, [102], rounds=3, walks="slow"), False)
    assert set(outcome.by_group) == {"ordinary", "slow"}
    # Clockwork people are nothing like the simulated ones: the models are lost, and a minute helps greatly.
    assert outcome.figures["worst_third_later_rmse_percent"] > 10.0
    assert outcome.figures["worst_third_adaptation_cut"] > 0.3
    errors = [one["rmse_percent"] for one in outcome.by_group.values()]
    assert outcome.figures["worst_walks_rmse_percent"] == max(errors)


def test_too_short_a_recording_says_nothing_of_adaptation(tmp_path: Path) -> None:
    outcome = BENCHMARKS["sim-walks"].run(written(tmp_path / "walks.jsonl", [101], rounds=1), False)
    assert not [name for name in outcome.figures if "adapt" in name]
    assert outcome.by_group["ordinary"]["adapted_rmse_percent"] != outcome.figures["rmse_percent"]


@pytest.mark.parametrize("known", [3, 29])  # an ordinary wearer, one in crouch
def test_people_whom_the_shipped_models_know_are_refused(known: int, tmp_path: Path) -> None:
    with pytest.raises(UnusableData, match=f"has learned from simulated people {known}: record others"):
        sim_walks.evaluate(written(tmp_path / "walks.jsonl", [known, 101], rounds=1), False)


def test_a_robot_on_one_leg_is_offered_nothing_that_needs_both() -> None:
    one_leg = {name for name in UNITS if not (name.startswith("right_") and "insole" not in name)}
    assert _names(one_leg) == {"activity/feet+trunk", "gait_phase/feet+trunk", "falling/trunk"}
    recipe = ACTIVITY.recipe(one_leg)
    assert recipe is not None
    assert ACTIVITY.classes(recipe) == ("stand", "walk", "turn")
    one_insole = {name for name in one_leg if not name.startswith("right_")}
    assert _names(one_insole) == {"activity/trunk", "falling/trunk"}
    assert not _names(one_insole - {name for name in one_leg if name.startswith("trunk")})


def _names(channels: set[str]) -> set[str]:
    recipes = (task.recipe(channels) for task in (ACTIVITY, GAIT_PHASE, FALLING_TASK))
    return {recipe.name for recipe in recipes if recipe is not None}


def test_a_recording_of_a_robot_on_one_leg_is_judged_by_what_it_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / "one.jsonl", [101, 102, 103], rounds=1, lacks="right")
    _, answer = printed(capsys, "sim-phase", file)
    assert answer["rmse_percent"] is not None
    assert "no_feet_rmse_percent" not in answer
