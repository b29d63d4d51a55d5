"""A recording is read whatever has become of it, and is set beside the last one of the same joint."""

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.joint_test.recording import COLUMNS, JointTestRecording, Row
from gateway.main import main
from server_gui.core.joint_tests.comparing import analysed, differences, last_before
from server_gui.core.joint_tests.file import NotReadable, read

ROW: Row = (0, 1, 0.0, 0.0, 0.0, None, 0.0, 0x27)


def head(**more: Any) -> dict[str, Any]:
    wish = {"kind": "step", "amplitude": 0.02}
    told = {
        "robot": "exo",
        "joint": "left_knee",
        "test": "step",
        "began": "2026-11-23T10:00:00Z",
        "who": "Ada",
    }
    numbers = {
        "began": "2026-11-23T10:00:00Z",
        "wish": wish,
        "limits": {"torque": 40.0},
        "period_s": 0.01,
        "angle": 0.0,
    }
    return {
        **told,
        **numbers,
        "drive": {"gear_ratio": 100.0},
        "guard": [],
        "parameters": {"0x2030:1": 3000},
        **more,
    }


def rows(count: int = 400) -> list[Row]:
    found: list[Row] = []
    for at in range(count):
        target = 0.02 if at >= 100 else 0.0
        position = 0.02 if at >= 105 else 0.0
        found.append((at * 10_000_000, at * 10_000_000, target, position, 0.0, None, 0.0, 0x27))
    return found


def kept(path: Path, *, ended: bool = True, **more: Any) -> Path:
    with JointTestRecording(path, head(**more), by_torque=False) as recording:
        recording.add(rows())
        if ended:
            recording.end(problem=None, off=True, state="switch on disabled", late_s=0.0)
    return path


def test_what_was_recorded_is_read(tmp_path: Path) -> None:
    test = read(kept(tmp_path / "exo.left_knee.step.1.jsonl"))
    assert test.problem is None
    assert list(test.columns) == list(COLUMNS)
    assert test["position"][-1] == 0.02
    assert str(test["torque"][0]) == "nan", "what was not brought is no zero"


def test_one_that_was_cut_off_anywhere_says_so(tmp_path: Path) -> None:
    whole = kept(tmp_path / "whole.jsonl").read_bytes()
    for size in (len(whole) - 5, len(whole) // 2, len(whole) // 2 + 7):
        cut = tmp_path / "cut.jsonl"
        cut.write_bytes(whole[:size])
        assert "cut off" in (read(cut).problem or "")


@pytest.mark.parametrize("text", ["", "{}", "[1, 2]", "\x00\x01", '{"format": 1}'])
def test_another_file_is_named_as_none(tmp_path: Path, text: str) -> None:
    (tmp_path / "other.jsonl").write_text(text)
    with pytest.raises(NotReadable):
        read(tmp_path / "other.jsonl")


@pytest.mark.parametrize(
    ("line", "so"),
    [
        ("x0, 1, 0.0, 0.0, 0.0, null, 0.0, 39]", "line 200 is no sample"),
        ("[0, 1, 0.0]", "line 200 is no sample"),
        ("[0, 1, 0.0, 0.0, 0.0, NaN, 0.0, 39]", "line 200 is no sample"),
        ("[0, 1, 0.0, 0.0, 0.0, 1e999, 0.0, 39]", "line 200 is no sample"),
        ("[" * 100_000, "line 200 is no sample"),
        ('{"ended": {"problem": null, "off": true, "state": "off"}}', "line 201 is no sample"),
        ("[1980000000, 1, 0.0, null, 0.0, null, 0.0, 39]", "samples without position"),
        ("[0, 1, 0.0, 0.0, 0.0, null, 0.0, 39]", "not in the order of time"),
    ],
)
def test_one_that_is_damaged_shows_nothing(tmp_path: Path, line: str, so: str) -> None:
    path = kept(tmp_path / "exo.left_knee.step.1.jsonl")
    lines = path.read_text(encoding="utf-8").split("\n")
    lines[199] = line
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(NotReadable, match=so):
        read(path)


def test_another_drive_is_called_so(tmp_path: Path) -> None:
    before = read(kept(tmp_path / "1.jsonl", parameters={"0x1018:4": 7}))
    now = read(kept(tmp_path / "2.jsonl", parameters={"0x1018:4": 8}))
    assert list(differences(now, before)) == ["another drive: its serial number: 7, now 8"]


def test_the_last_one_stands_beside_it_with_what_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kept(tmp_path / "exo.left_knee.step.1.jsonl", began="2026-11-20T10:00:00Z", parameters={"0x2030:1": 2000})
    kept(tmp_path / "exo.left_knee.step.2.jsonl", began="2026-11-21T10:00:00Z", ended=False)
    kept(tmp_path / "exo.right_knee.step.3.jsonl", began="2026-11-22T10:00:00Z", joint="right_knee")
    now = analysed(kept(tmp_path / "exo.left_knee.step.4.jsonl"))
    last = last_before(now.test)
    assert last is not None
    assert last.name == "exo.left_knee.step.1.jsonl", "one that was cut off, or is another joint's, is none"
    assert list(differences(now.test, read(last))) == ["parameters 0x2030:1: 2000, now 3000"]
    assert main(["joint-test", "show", str(now.test.path)]) == 0
    assert "not the same: parameters 0x2030:1: 2000, now 3000" in capsys.readouterr().out
    assert main(["joint-test", "show", "--json", str(now.test.path)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["last"]["began"] == "2026-11-20T10:00:00Z"
    assert told["curves"][0]["x"]


def test_a_test_that_ended_early_tells_one_reason_once_and_the_cause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = kept(tmp_path / "exo.left_knee.step.1.jsonl")
    lines = path.read_text(encoding="utf-8").split("\n")
    end = {"problem": "a cycle came 105 ms late", "off": True, "state": "SWITCH_ON_DISABLED"}
    path.write_text("\n".join([*lines[:60], json.dumps({"ended": end}), ""]), encoding="utf-8")
    assert main(["joint-test", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert shown.count("unknown: ") == 1
    assert "all figures: unknown: the joint did not follow its target, or the test ended before" in shown
    assert "The test ended early: a cycle came 105 ms late" in shown


def test_what_cannot_be_shown_is_told_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["joint-test", "show", str(tmp_path / "none.jsonl")]) == 1
    assert main(["joint-test", "wiggle"]) == 2
    assert "'wiggle' is none of step" in capsys.readouterr().err
