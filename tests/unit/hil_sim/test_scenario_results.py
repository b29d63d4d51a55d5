"""What comes of scenarios: for a person, as JSON, as JUnit, and as exit status."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gateway.main import main
from hil_sim.cli import run as command
from hil_sim.scenario import records, report
from hil_sim.scenario.expectation import ScenarioResult, Verdict
from hil_sim.scenario.records import Ran
from hil_sim.scenario.runner import ScenarioOutcome
from hil_sim.scenario.script import Script

MET = Verdict(True, "a is 1", "a was 1", 1.0)
FAILED = Verdict(False, "b is 2", "b was 3 at 4.20 s", 4.2)
SLOW = Verdict(False, "c is 5", "c was 6", 5.0, "this computer was too slow")
BEGAN_S = 1_795_255_200.0


def ran(*verdicts: Verdict, problem: str = "", name: str = "tests/two.toml", skipped_s: float = 0.0) -> Ran:
    outcome = ScenarioOutcome(verdicts, skipped_s, seconds=3.0, problem=problem)
    return Ran(Path(name), Script(title="Two things"), outcome, BEGAN_S)


def told(one: Ran) -> list[str]:
    return report.text(one.file, one.script, one.outcome).splitlines()


@pytest.mark.parametrize(
    ("verdicts", "result"),
    [
        ((), ScenarioResult.PASSED),
        ((MET,), ScenarioResult.PASSED),
        ((MET, FAILED, SLOW), ScenarioResult.FAILED),
        ((MET, SLOW), ScenarioResult.INCONCLUSIVE),
    ],
)
def test_a_scenario_is_as_good_as_its_worst_expectation(
    verdicts: Sequence[Verdict], result: ScenarioResult
) -> None:
    assert ran(*verdicts).outcome.result is result


def test_one_that_could_not_be_run_is_no_success() -> None:
    assert ran(problem="no gateway").outcome.result is ScenarioResult.NOT_RUN


def test_a_person_reads_the_file_what_was_expected_what_was_seen_and_a_total() -> None:
    assert told(ran(MET, FAILED, SLOW)) == [
        "tests/two.toml: Two things",
        "  ok      a is 1",
        "          a was 1",
        "  FAILED  b is 2",
        "          b was 3 at 4.20 s",
        "  ?       c is 5",
        "          c was 6",
        "          inconclusive: this computer was too slow",
        "of 3 expectations 1 failed, 1 inconclusive",
    ]
    assert told(ran(MET))[-1] == "1 expectation met"
    assert told(ran(problem="x"))[-1] == "not run"
    assert told(ran(MET, skipped_s=0.31))[-1].startswith("This computer was too slow: 0.3 s were left out")
    results = [
        ScenarioResult.PASSED,
        ScenarioResult.FAILED,
        ScenarioResult.PASSED,
        ScenarioResult.INCONCLUSIVE,
        ScenarioResult.PASSED,
    ]
    assert report.total(results) == "5 scenarios: 3 passed, 1 failed, 1 inconclusive\n"
    assert report.total([ScenarioResult.NOT_RUN]) == "1 scenario: 1 not run\n"


def test_a_program_reads_the_same_as_json() -> None:
    one = json.loads(json.dumps(records.as_json(ran(FAILED, SLOW))))
    assert (one["file"], one["title"], one["result"]) == ("tests/two.toml", "Two things", "failed")
    assert one["expectations"][0] == {
        "expected": "b is 2",
        "result": "failed",
        "seen": "b was 3 at 4.20 s",
        "decided_s": 4.2,
        "doubt": None,
    }
    assert one["expectations"][1]["doubt"] == "this computer was too slow"
    total = records.total_as_json([ScenarioResult.PASSED, ScenarioResult.NOT_RUN])
    assert total == {"scenarios": 2, "passed": 1, "failed": 0, "inconclusive": 0, "not_run": 1}


def test_a_ci_system_reads_a_suite_a_file_and_a_case_an_expectation() -> None:
    whole = ElementTree.fromstring(records.junit([ran(MET, FAILED, SLOW), ran(MET, name="/x/three.toml")]))
    assert whole.tag == "testsuites"
    assert {name: whole.attrib[name] for name in ("tests", "failures", "errors", "skipped", "time")} == {
        "tests": "4",
        "failures": "1",
        "errors": "0",
        "skipped": "1",
        "time": "6.000",
    }
    first, second = whole.findall("testsuite")
    assert (first.attrib["name"], first.attrib["timestamp"]) == ("tests/two.toml", "2026-11-21T10:00:00")
    for suite in (first, second):  # as junit-10.xsd of Jenkins has it
        assert {"name", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname"} == set(
            suite.attrib
        )
        cases = suite.findall("testcase")
        assert int(suite.attrib["tests"]) == len(cases) == len(list(suite))
        assert int(suite.attrib["failures"]) == len(suite.findall("testcase/failure"))
        assert int(suite.attrib["skipped"]) == len(suite.findall("testcase/skipped"))
        assert sum(float(case.attrib["time"]) for case in cases) == pytest.approx(3.0, abs=0.01)
    met, failed, slow = first.findall("testcase")
    assert (met.attrib["classname"], met.attrib["name"], list(met)) == ("tests.two", "a is 1", [])
    (failure,) = failed
    assert (failure.tag, failure.attrib["message"]) == ("failure", "b was 3 at 4.20 s")
    (skipped,) = slow
    assert (skipped.tag, skipped.attrib["message"]) == (
        "skipped",
        "this computer was too slow; seen: c was 6",
    )


def test_what_could_not_be_run_is_an_error_in_junit() -> None:
    whole = ElementTree.fromstring(records.junit([ran(problem="the gateway did not start")]))
    assert (whole.attrib["errors"], whole.attrib["tests"]) == ("1", "1")
    error = whole.find("testsuite/testcase/error")
    assert error is not None
    assert error.text == "the gateway did not start"


def test_words_that_xml_cannot_hold_are_replaced() -> None:
    verdict = Verdict(False, "<a> & 'b'", "a was \x00\x1b[1m\ud800 é ☃", 1.0)
    content = records.junit([ran(verdict)])
    case = ElementTree.fromstring(content).find("testsuite/testcase")
    assert case is not None
    assert case.attrib["name"] == "<a> & 'b'"
    assert case[0].attrib["message"] == "a was \ufffd\ufffd[1m\ufffd é ☃"


@pytest.fixture
def outcomes(monkeypatch: pytest.MonkeyPatch) -> list[ScenarioOutcome]:
    """What comes of the scenarios that are run, one after the other."""
    coming: list[ScenarioOutcome] = []
    monkeypatch.setattr(command, "run", lambda *_: coming.pop(0))
    return coming


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [([MET, MET], 0), ([MET, FAILED], 1), ([FAILED, SLOW], 1), ([MET, SLOW], 3)],
)
def test_the_exit_status_says_what_came_of_all(
    verdicts: list[Verdict],
    status: int,
    outcomes: list[ScenarioOutcome],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    files = [tmp_path / f"{number}.toml" for number in range(len(verdicts))]
    for file in files:
        file.write_text("", encoding="utf-8")
    outcomes.extend(ScenarioOutcome((verdict,)) for verdict in verdicts)
    junit = tmp_path / "junit.xml"
    assert main(["sim", "run", "--junit", str(junit), *map(str, files)]) == status
    said = capsys.readouterr().out
    assert re.findall(r"^(\S+\.toml): ", said, re.MULTILINE) == [str(file) for file in files]
    assert said.splitlines()[-1].startswith("2 scenarios: ")
    assert len(ElementTree.fromstring(junit.read_bytes()).findall("testsuite")) == 2


def test_results_that_could_not_be_written_are_told_before_anything_is_run(
    outcomes: list[ScenarioOutcome], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, outcome = tmp_path / "two.toml", ScenarioOutcome((MET,))
    file.write_text("", encoding="utf-8")
    outcomes.append(outcome)
    nowhere = tmp_path / "none" / "junit.xml"
    assert main(["sim", "run", "--junit", str(nowhere), str(file)]) == 1
    said = capsys.readouterr()
    assert f"{nowhere} cannot be written, so nothing was run: No such file or directory" in said.err
    assert (said.out, outcomes) == ("", [outcome])


def test_results_of_before_stay_until_there_are_new_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, junit, new = tmp_path / "two.toml", tmp_path / "junit.xml", tmp_path / "new.xml"
    file.write_text("", encoding="utf-8")
    junit.write_text("of before", encoding="utf-8")

    def killed(*_: object) -> ScenarioOutcome:
        assert junit.read_text(encoding="utf-8") == "of before"
        assert not new.exists()
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "run", killed)
    for one in (junit, new):
        assert main(["sim", "run", "--junit", str(one), str(file)]) == 130


def test_which_one_is_run_is_said_before_it_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "two.toml"
    file.write_text('title = "Two things"\n', encoding="utf-8")
    before: list[str] = []

    def run(*_: object) -> ScenarioOutcome:
        before.append(capsys.readouterr().out)
        return ScenarioOutcome((MET,))

    monkeypatch.setattr(command, "run", run)
    assert main(["sim", "run", str(file)]) == 0
    assert before == [f"{file}: Two things\n"]
    assert "Two things" not in capsys.readouterr().out


def test_one_that_cannot_be_run_does_not_keep_the_others_from_it(
    outcomes: list[ScenarioOutcome], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / f"{number}.toml" for number in range(2)]
    for file in files:
        file.write_text("", encoding="utf-8")
    outcomes.extend([ScenarioOutcome(problem="the gateway did not start"), ScenarioOutcome((MET,))])
    assert main(["sim", "run", "--json", *map(str, files)]) == 1
    said = capsys.readouterr()
    first, second, total = map(json.loads, said.out.splitlines())
    assert (first["result"], first["problem"]) == ("not run", "the gateway did not start")
    assert (second["result"], total["passed"], total["not_run"]) == ("passed", 1, 1)
    assert f"{files[0]}: the gateway did not start" in said.err


def test_results_that_cannot_be_written_any_more_are_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x.toml").write_text("", encoding="utf-8")
    folder = tmp_path / "going"
    folder.mkdir()

    def run(*_: object) -> ScenarioOutcome:
        folder.rmdir()
        return ScenarioOutcome((MET,))

    monkeypatch.setattr(command, "run", run)
    assert main(["sim", "run", "--junit", str(folder / "x.xml"), str(tmp_path / "x.toml")]) == 1
    assert "x.xml cannot be written: No such file" in capsys.readouterr().err
