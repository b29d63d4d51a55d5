"""`gwrms set --trial` and `gwrms journal`, as a person meets them."""

import io
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.main import main
from gateway.records.journal import Journal, Sizes, read_verified
from tests.fake_robot import FakeRobot, Refusal
from tests.support.waiting import WAIT_S


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> Iterator[io.TextIOWrapper]:
    """Standard input as a pipe; what is written here is typed there."""
    reading, writing = os.pipe()
    with os.fdopen(reading) as keyboard, os.fdopen(writing, "w") as typist:
        monkeypatch.setattr("sys.stdin", keyboard)
        yield typist


def test_a_trial_is_kept_by_a_line(
    robot: FakeRobot, typed: io.TextIOWrapper, capsys: pytest.CaptureFixture[str]
) -> None:
    typed.write("\n")
    typed.flush()
    assert main(["set", "--trial", "30", "gait.step_length=0.42", "--robot", robot.address]) == 0
    assert [call["trial_s"] for call in robot.called("parameter.write")] == [30.0]
    assert len(robot.called("parameter.confirm")) == 1
    assert robot.parameters["gait.step_length"] == 0.42
    said = capsys.readouterr().out
    assert "kept" in said
    assert "nobody else can write meanwhile" in said
    assert len(robot.called("control.release")) == 1


def test_a_trial_that_nobody_keeps_is_taken_back(
    robot: FakeRobot, typed: io.TextIOWrapper, capsys: pytest.CaptureFixture[str]
) -> None:
    typed.close()
    assert main(["set", "--trial", "0.3", "gait.step_length=0.42", "--robot", robot.address]) == 1
    assert robot.called("parameter.confirm") == []
    assert len(robot.called("parameter.revert")) == 1
    assert "gait.step_length = 0.4: taken back" in capsys.readouterr().out


def test_a_trial_that_the_robot_has_ended_is_said(
    robot: FakeRobot, typed: io.TextIOWrapper, capsys: pytest.CaptureFixture[str]
) -> None:
    robot.overrides["robot.describe"] = lambda _params: robot.describe() | {"trials": []}
    robot.overrides["parameter.revert"] = _ended
    assert main(["set", "--trial", "30", "gait.step_length=0.42", "--robot", robot.address]) == 1
    said = capsys.readouterr().out
    assert "gait.step_length: it was taken back: the guard" in said
    assert "not on trial" not in said


def _ended(_params: object) -> object:
    raise Refusal(-32001, "write 1 is not on trial: it was taken back: the guard", kind="unknown_name")


def test_a_journal_command_that_is_none_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["journal", "tial"]) == 2
    assert "usage: gwrms journal COMMAND" in capsys.readouterr().err


@pytest.mark.parametrize("seconds", ["0", "-1", "301", "nan", "soon"])
def test_an_absurd_time_is_refused(seconds: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["set", f"--trial={seconds}", "a.b=1"])
    assert "at most 300 seconds" in capsys.readouterr().err


def test_the_journals_tail_is_a_table_or_lines(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    entry = {"n": 3, "utc_ns": 1_700_000_000_000_000_000, "who": "gwrms set", "what": "write done"}
    robot.overrides["journal.tail"] = lambda params: {"entries": [entry | {"after": {"a.b": params["n"]}}]}
    assert main(["journal", "tail", "-n", "7", "--robot", robot.address]) == 0
    assert "3  2023-11-14 22:13:20.000  gwrms set  write done  after=a.b: 7" in capsys.readouterr().out
    assert main(["journal", "tail", "--json", "--robot", robot.address]) == 0
    assert '"after":{"a.b":20}' in capsys.readouterr().out


def test_a_tail_that_was_cut_says_so(robot: FakeRobot, capsys: pytest.CaptureFixture[str]) -> None:
    robot.overrides["journal.tail"] = lambda _params: {"entries": [], "cut": "these 0 of 20 fill the answer"}
    assert main(["journal", "tail", "--robot", robot.address]) == 0
    assert "there is more: these 0 of 20 fill the answer" in capsys.readouterr().err


def test_a_journal_in_pieces_is_verified_and_what_was_removed_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, "boot", sizes=Sizes(piece=1000, kept=3000))
    for _ in range(40):
        journal.append("tester", "note").result(WAIT_S)
    journal.close()
    removed = read_verified(path)[0]["n"] - 1
    assert main(["journal", "verify", str(tmp_path)]) == 3
    assert f"entries 1 to {removed} could not be seen" in capsys.readouterr().out
    assert main(["journal", "verify", str(tmp_path), "--json"]) == 3
    assert f'"removed":{removed}' in capsys.readouterr().out
    min(tmp_path.glob("journal.jsonl.0*")).unlink()
    assert main(["journal", "verify", str(tmp_path)]) == 1
    assert "does not say that it removed them" in capsys.readouterr().err


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    journal = Journal(tmp_path / "journal.jsonl", "boot")
    journal.append("tester", "write", after={"a.b": 1.0})
    journal.append("tester", "write done", after={"a.b": 1.0})
    journal.close()
    return tmp_path


def test_a_journal_that_nobody_else_has_seen_is_unproven(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was called intact before: whoever may write it can make such a chain."""
    assert main(["journal", "verify", str(folder)]) == 3
    assert "is unproven at 1: its 2 entries follow each other unaltered" in capsys.readouterr().out


def test_one_altered_byte_fails(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "journal.jsonl"
    path.write_bytes(path.read_bytes().replace(b'"a.b":1.0', b'"a.b":2.0', 1))
    assert main(["journal", "verify", str(path)]) == 1
    assert "is BROKEN at 1: line 1 was altered" in capsys.readouterr().err


def test_a_robots_file_names_its_journal(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = folder / "robot.toml"
    robot.write_text('[robot]\nname = "exo"\n[gateway]\nrecords = "."\n')
    assert main(["journal", "verify", str(robot), "--json"]) == 3
    assert '"verdict":"unproven"' in capsys.readouterr().out


def test_no_journal_is_wrong_usage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["journal", "verify", str(tmp_path)]) == 2
    assert "there is no journal at" in capsys.readouterr().err
