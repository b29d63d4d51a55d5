"""Rules rehearsed over recordings: how often they would have acted, and how often without cause."""

import functools
import json
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from ml.benchmarks import alarms, fall
from ml.benchmarks.models.falling import FallSettings
from ml.serving.predictor import Prediction
from server_gui.cli import predict
from server_gui.core.prediction.rehearsal import HOUR_NS, LEAD_NS, Stretch, rehearse
from server_gui.core.settings.prediction import RuleSettings
from server_gui.core.settings.server_file import SettingsError
from tests.unit.ml import recordings

MS = 1_000_000
EVERY_NS = 40 * MS
RULE = RuleSettings("falling", "near_fall", 0.9)


def stretch(*begins_ms: int, causes: list[tuple[int, int]] | None, length_ns: int = HOUR_NS // 4) -> Stretch:
    """A quarter of an hour in which near falls are foreseen at these times, for one decision each."""
    found = []
    for at in begins_ms:
        for late, probability in ((0, 1.0), (40, 0.0)):
            said = {"near_fall": probability, "steady": 1 - probability}
            found.append(Prediction("falling", "m", (at + late) * MS, "steady", 1.0, 0.0, said))
    return Stretch(found, length_ns, causes)


def test_what_has_a_cause_is_not_false() -> None:
    caused = stretch(1_000, 10_000, 20_000, causes=[(10_500 * MS, 10_600 * MS), (19_900 * MS, 21_000 * MS)])
    found = rehearse(RULE, EVERY_NS, [caused, stretch(5_000, causes=[])])
    assert (found.began, found.false, found.known) == (4, 2, True)
    assert found.hours == 0.5
    assert found.false_per_hour == 4.0


def test_too_early_is_no_foresight() -> None:
    cause = 100_000 * MS
    early = (cause - LEAD_NS) // MS - 1
    assert rehearse(RULE, EVERY_NS, [stretch(early, causes=[(cause, cause)])]).false == 1
    assert rehearse(RULE, EVERY_NS, [stretch(early + 1, causes=[(cause, cause)])]).false == 0


def test_where_nobody_knows_every_time_is_false() -> None:
    found = rehearse(RULE, EVERY_NS, [stretch(1_000, 2_000, causes=None)])
    assert (found.began, found.false, found.known) == (2, 2, False)


def test_other_tasks_and_rules_that_never_hold_count_nothing() -> None:
    other = RuleSettings("activity", "walk", 0.9)
    patient = replace(RULE, for_ms=1_000)
    for rule in (other, patient):
        assert rehearse(rule, EVERY_NS, [stretch(1_000, causes=[])]).began == 0


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "server.toml"
    file.write_text(
        '[[rules]]\ntask = "falling"\nlabel = "near_fall"\nat_least = 0.5\nfor_ms = 60\naction = "stop"\n'
        '[[rules]]\ntask = "activity"\nlabel = "turn"\nat_least = 0.6\n'
    )
    return file


def told(argv: list[str], capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    assert predict.main([*argv, "--rules", "--json"]) == 0
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)
    return found


def test_rules_are_tried_on_falls_of_people_whom_no_model_has_seen(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fall, "SETTINGS", FallSettings(rounds=8, still_share=0.5, moving_share=0.5))
    monkeypatch.setattr(alarms, "falls", functools.cache(alarms.falls))  # the same said in two forms
    file = recordings.saved(tmp_path / "falls.npz", recordings.falls(each=2))
    argv = ["--benchmark", "sisfall-prefall", "--data", str(file), "--config", str(config)]
    (found,) = told(argv, capsys)
    assert found["rule"]["label"] == "near_fall"
    assert found["began"] >= 3
    assert found["without_cause"] <= found["began"] / 2
    assert predict.main([*argv, "--rules"]) == 0
    said = capsys.readouterr().out
    assert "activity turn ≥ 0.6 for 0 ms: these recordings show nothing of it" in said
    assert "False stops: " in said


def test_a_rule_on_activity_is_tried_on_walks(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = recordings.saved(tmp_path / "gait.npz", recordings.gait())
    (found,) = told(["--benchmark", "ipol-status", "--data", str(file), "--config", str(config)], capsys)
    assert (found["rule"]["label"], found["labelled"]) == ("turn", True)
    assert found["began"] >= 3


def test_without_rules_there_is_nothing_to_try(tmp_path: Path) -> None:
    config = tmp_path / "server.toml"
    config.write_text("")
    with pytest.raises(SettingsError, match=r"there is no rule to try: write one"):
        predict.main(["--rules", "--session", "x", "--config", str(config)])


@pytest.mark.parametrize("argv", [["--rules"], ["--benchmark", "ipol-status"], []])
def test_half_a_question_is_wrong_usage(argv: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        predict.main(argv)
    assert ended.value.code == 2
