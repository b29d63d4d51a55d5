"""The doctor at a whole robot of processes with mistakes: through its gateway, and from the bus alone."""

import json
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.scenario.processes import Bench, gwrms

MISTAKES = ("gear", "heartbeat", "following_window", "second_sdo_client", "governor")
LATE = ("late", "missing", "silent", "no frame")
RULES = {"gear", "heartbeat", "following_window", "second_sdo_client", "governor"}


class Ill(Bench):
    """A robot with mistakes."""

    simulator_options = tuple(word for name in MISTAKES for word in ("--mistake", name))


def test_a_file_that_cannot_be_read_is_trouble_and_no_finding(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("[robot]\n")
    done = gwrms("doctor", str(tmp_path / "robot.toml"))
    assert done.returncode == 2
    assert "[robot] name" in done.stderr


@pytest.fixture(scope="module")
def ill(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ill]:
    folder = tmp_path_factory.mktemp("ill")
    with ExitStack() as processes:
        patch = processes.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        bench = Ill(folder, processes)
        bench.until_whole()
        yield bench


def doctor(bench: Bench, *more: str) -> tuple[str, ...]:
    computer = str(Path(bench.folder, "computer"))
    return (
        "doctor",
        str(bench.config),
        "--robot",
        bench.address,
        "--computer",
        computer,
        "--seconds",
        "2",
        *more,
    )


def comes_late(finding: dict[str, Any]) -> bool:
    """What the simulator sends late or not at all, because this computer is busy, is rightly found."""
    said = json.dumps(finding)
    return finding["rule"] in ("sync", "component") and any(word in said for word in LATE)


def test_a_running_robots_mistakes_are_found_through_its_gateway(ill: Ill) -> None:
    done = gwrms(*doctor(ill, "--json"))
    assert done.returncode == 1, done.stderr
    bill = json.loads(done.stdout)
    assert {one["rule"] for one in bill["findings"] if not comes_late(one)} == RULES
    assert "bus_load" in bill["well"]
    assert {one["rule"] for one in bill["not_judged"]} >= {"sign", "sides"}
    fixes = {one["rule"]: one["fixes"][0]["words"] for one in bill["findings"]}
    assert "gear_ratio = 100.0" in fixes["gear"]
    assert "left_knee" in next(one["about"] for one in bill["findings"] if one["rule"] == "second_sdo_client")


def test_what_is_safe_is_mended_and_what_the_file_does_not_allow_is_refused_in_words(ill: Ill) -> None:
    done = gwrms(*doctor(ill, "--fix", "--yes"))
    assert done.returncode == 1, done.stderr
    assert "changed: takes effect when the gateway restarts or wakes from rest" in done.stdout
    file = tomllib.loads(ill.config.read_text(encoding="utf-8"))
    assert file["joint"]["left_knee"]["gear_ratio"] == 100.0
    assert '[parameter."right_knee.object_6065"] and below it object = "0x6065:0"' in done.stderr
    records = Path(ill.folder, "records", "doctor.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in records.splitlines()]
    assert [row["rule"] for row in rows if "done" in row] == ["gear"]
    assert any("right_knee.object_6065" in row.get("refused", "") for row in rows)
