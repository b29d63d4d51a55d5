"""The doctor's page has every finding and every mistake, in the code's own words."""

import re
from pathlib import Path

import pytest

from gateway import main as gwrms
from gateway.cli import doctor
from gateway.cli.doctor import main
from gateway.doctor.table import RULES
from hil_sim.mistakes.registry import MISTAKES

PAGE = (Path(__file__).parents[3] / "docs" / "how-to" / "doctor.md").read_text(encoding="utf-8")


def rows(title: str) -> list[list[str]]:
    chapter = PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]
    lines = re.findall(r"^\| (`\w+` .*) \|$", chapter, re.MULTILINE)
    return [line.split(" | ") for line in lines]


def test_every_finding_is_on_the_page_as_the_table_has_it() -> None:
    assert rows("What it finds") == [[f"`{rule.name}`", rule.meaning, rule.looks] for rule in RULES]


def test_every_mistake_is_on_the_page_as_the_simulator_has_it() -> None:
    assert rows("Mistakes to try") == [[f"`{name}`", one.what] for name, one in MISTAKES.items()]


def test_the_command_tells_its_findings(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--rules"]) == 0
    out = capsys.readouterr().out
    assert [line.split()[0] for line in out.splitlines()] == [rule.name for rule in RULES]


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["robot.toml", "--seconds", "0"],
        ["robot.toml", "--fix", "--json"],
        ["robot.toml", "--fix"],  # without a terminal
        ["robot.toml", "--yes"],
        ["robot.toml", "--robot", "a b"],
    ],
)
def test_what_is_typed_wrong_is_usage(words: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2


def test_a_failure_of_the_doctor_is_no_finding(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def fail(_file: Path) -> None:
        raise RuntimeError("a mistake of ours")

    monkeypatch.setattr(doctor, "examine", fail)
    assert gwrms.main(["doctor", str(tmp_path / "robot.toml")]) == 2
