"""What people write wrong into files is told with table, key, what is allowed and the likely fix."""

import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from gateway.config.checks import complaints
from gateway.config.reading import examine as examine_robot
from gateway.config.usable_parts import remains
from gateway.tables.finding import Finding, Severity
from gateway.tables.finding import mistakes as only_mistakes
from gateway.tables.reading import Unreadable, read
from hil_sim.scenario.script import examined
from server_gui.core.settings.server_file import examine as examine_server

DATA: Final = Path(__file__).parents[2] / "data" / "mistakes"


def examine_scenario(file: Path) -> list[Finding]:
    try:
        found = examined(file, read(file))[1]
    except Unreadable as error:
        return [error.finding]
    return [Finding(one.where, one.key, one.text, Severity(one.severity)) for one in found]


EXAMINE: Final[dict[str, Callable[[Path], list[Finding]]]] = {
    "robot": lambda file: examine_robot(file).findings,
    "server": lambda file: examine_server(file).findings,
    "scenario": examine_scenario,
}


class Mistake(NamedTuple):
    """One of the data's, which says what is changed in which good file."""

    kind: str
    what: dict[str, Any]

    def write(self, folder: Path) -> Path:
        """The good file with this mistake."""
        good, file = good_text(self.kind), folder / f"{self.kind}.toml"
        old = self.what.get("old", "")
        assert not old or good.count(old) == 1, f"{old!r} is not once in the good file"
        text = good.replace(old, self.what.get("new", "")) if old else good
        text += self.what.get("add", "")
        file.write_text(text, encoding=self.what.get("encoding", "utf-8"))
        return file


def good_text(kind: str) -> str:
    return (DATA / f"{kind}.toml").read_text(encoding="utf-8")


def mistakes(kind: str) -> Iterator[tuple[str, Mistake]]:
    data = tomllib.loads((DATA / f"{kind}_mistakes.toml").read_text(encoding="utf-8"))
    for category, entries in data.items():
        for one in entries:
            yield f"{kind}: {category}: {one['mistake']}", Mistake(kind, one)


ALL: Final = [pytest.param(one, id=name) for kind in EXAMINE for name, one in mistakes(kind)]


@pytest.mark.parametrize("mistake", ALL)
def test_a_mistake_is_named(mistake: Mistake, tmp_path: Path) -> None:
    findings = EXAMINE[mistake.kind](mistake.write(tmp_path))
    told = "\n".join(one.words for one in findings)
    assert [words for words in mistake.what["says"] if words not in told] == [], told
    refused = any(one.severity is Severity.MISTAKE for one in findings)
    assert refused != mistake.what.get("warning", False), told
    assert len(findings) <= 3, f"one mistake is told as one, not as\n{told}"


@pytest.mark.parametrize("kind", EXAMINE)
def test_nothing_is_said_of_a_good_file(kind: str) -> None:
    assert EXAMINE[kind](DATA / f"{kind}.toml") == []


def test_there_are_more_than_a_hundred() -> None:
    assert len(ALL) >= 100


@pytest.mark.parametrize("kind", EXAMINE)
def test_all_mistakes_of_a_file_are_told_at_once(kind: str, tmp_path: Path) -> None:
    """Every mistake that does not hide others is made in one file, and each is still told."""
    text, wanted = good_text(kind), []
    for what in [one.what for _name, one in mistakes(kind) if one.what.get("at_once", False)]:
        old = what.get("old", "")
        assert old in text
        text = (text.replace(old, what.get("new", "")) if old else text) + what.get("add", "")
        wanted += what["says"]
    file = tmp_path / f"{kind}.toml"
    file.write_text(text, encoding="utf-8")
    told = "\n".join(finding.words for finding in EXAMINE[kind](file))
    assert len(wanted) >= 10
    assert [words for words in wanted if words not in told] == [], told


KINDS: Final = ("can", "joint", "device", "insole", "imu", "parameter", "channel")


@pytest.mark.parametrize("mistake", [one for one in ALL if "robot: " in str(one.id)])
def test_what_remains_of_a_robot_without_its_mistakes_has_none(mistake: Mistake, tmp_path: Path) -> None:
    found = examine_robot(mistake.write(tmp_path))
    if found.rest is None:
        return  # no robot at all, or no mistake
    rest = remains(found.rest, only_mistakes(found.findings))
    wrong = [one for one in only_mistakes(complaints(rest)) if one.where.lstrip("[").startswith(KINDS)]
    assert wrong == []
    assert all(
        getattr(one, "bus", None) in {None, *rest.can} for one in (*rest.joint.values(), *rest.imu.values())
    )
