"""`gwrms edits`: a table of every edit, and everything of one, for people and for machines."""

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from server_gui.cli.edits import main
from server_gui.core.evidence.comparison import compare
from server_gui.core.evidence.file import EvidenceFile, folder_beside
from tests.unit.evidence.synthetic import cycles, spell
from tests.unit.evidence.test_comparison import ERROR, times
from tests.unit.evidence.test_file import told


@pytest.fixture
def config(tmp_path: Path) -> str:
    """The server's file of a desk that has seen two edits."""
    file = tmp_path / "server.toml"
    spool = tmp_path / "spool"
    file.write_text(f"[recorder]\nspool = {json.dumps(str(spool))}\n", encoding="utf-8")
    evidence = compare(cycles(times(ERROR, 1.2)), spell(), ["left_knee"], ["left_knee"])
    EvidenceFile(folder_beside(spool), "exo-01").add(replace(told(), evidence=evidence))
    other = told(2)
    edit = replace(other.edit, robot="exo-02", id="bb02")
    EvidenceFile(folder_beside(spool), "exo-02").add(replace(other, edit=edit))
    return str(file)


def test_the_table_has_who_when_what_and_the_verdict(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--config", config]) == 0
    head, first, second = capsys.readouterr().out.splitlines()
    assert head.split() == ["ID", "WHEN", "(UTC)", "ROBOT", "WHO", "WHAT", "STATE", "VERDICT", "STRONGEST"]
    assert "left_knee.max_torque 80 → 60" in first
    assert "anna" in first
    assert "kept   worse" in first
    assert "left_knee tracking error RMS +19.2 %" in first
    assert "no difference seen  –" in second


def test_one_robots_edits_alone_and_as_json(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--config", config, "--robot", "exo-02", "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert found["edit"]["id"] == "bb02"
    assert found["evidence"]["word"] == "no difference seen"
    assert found["format"] == 1


def test_one_edit_is_shown_with_every_metric(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", told().edit.id[:6], "--config", config]) == 0
    text = capsys.readouterr().out
    assert "recording 20261121T1530" in text
    assert "worse: 48 gait cycles with it, 49 before it" in text
    row = next(line for line in text.splitlines() if "tracking error RMS" in line)
    assert row.split()[-1] == "rad"
    assert "+19.2 %  +17.5 to +20.9 %" in row
    assert "no data: " in text
    assert "not enough cycles for" not in text
    assert main(["show", "bb", "--config", config, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["edit"]["robot"] == "exo-02"


def test_an_unknown_edit_is_said(config: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "zz", "--config", config]) == 1
    assert "gwrms edits lists them" in capsys.readouterr().err


def test_a_desk_without_edits_says_how_they_come(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "server.toml"
    file.write_text(f"[recorder]\nspool = {json.dumps(str(tmp_path / 'spool'))}\n", encoding="utf-8")
    assert main(["--config", str(file)]) == 0
    assert "gwrms collect or the window records them" in capsys.readouterr().err


def test_what_could_not_be_compared_is_counted_with_its_reason(
    tmp_path: Path, config: str, capsys: pytest.CaptureFixture[str]
) -> None:
    few = replace(told(3), evidence=compare(cycles(until_s=64.0), spell(), ["left_knee"]))
    EvidenceFile(tmp_path / "edits", "exo-03").add(replace(few, edit=replace(few.edit, id="cc03")))
    assert main(["show", "cc", "--config", config]) == 0
    text = capsys.readouterr().out
    assert "not enough cycles: " in text
    assert "not enough cycles for 16 metrics: nobody walked in the same way on both sides" in text
