"""The doctor at a whole robot with mistakes, through its gateway; both in this process."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from gateway.config import load
from gateway.main import main
from hil_sim.robot import SimulatedRobot
from tests.support.waiting import until
from tests.unit.gateway.harness import Client, serving

MISTAKES = ("gear", "heartbeat", "following_window", "second_sdo_client", "governor")
LATE = ("late", "missing", "silent", "no frame")
RULES = {"gear", "heartbeat", "following_window", "second_sdo_client", "governor"}


def test_a_file_that_cannot_be_read_is_trouble_and_no_finding(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_text("[robot]\n")
    assert main(["doctor", str(tmp_path / "robot.toml")]) == 2
    assert "[robot] name" in capsys.readouterr().err


@dataclass
class Ill:
    """A robot with mistakes, and where its gateway is."""

    folder: Path
    config: Path
    address: str


@pytest.fixture
def ill(tmp_path: Path) -> Iterator[Ill]:
    with (
        SimulatedRobot(tmp_path, mistakes=MISTAKES) as robot,
        serving(load(robot.config)) as (host, port),
        Client((host, port)) as client,
    ):
        until(lambda: is_whole(client), "every component is there")
        yield Ill(robot.folder.path, robot.config, f"{host}:{port}")


def is_whole(client: Client) -> bool:
    snapshot = client.call("component.snapshot")
    states = {one["state"] for one in snapshot["quality"].values()}
    return states == {"ok"} and snapshot["values"]["left_hip.position"] is not None


def doctor(ill: Ill, *more: str) -> int:
    computer = str(ill.folder / "computer")
    asked = ["doctor", str(ill.config), "--robot", ill.address, "--computer", computer]
    return main([*asked, "--seconds", "2", *more])


def comes_late(finding: dict[str, Any]) -> bool:
    """What the simulator sends late or not at all, because this computer is busy, is rightly found."""
    said = json.dumps(finding)
    return finding["rule"] in ("sync", "component") and any(word in said for word in LATE)


def test_a_running_robots_mistakes_are_found_through_its_gateway(
    ill: Ill, capsys: pytest.CaptureFixture[str]
) -> None:
    assert doctor(ill, "--json") == 1
    bill = json.loads(capsys.readouterr().out)
    assert {one["rule"] for one in bill["findings"] if not comes_late(one)} == RULES
    assert "bus_load" in bill["well"]
    assert {one["rule"] for one in bill["not_judged"]} >= {"sign", "sides"}
    fixes = {one["rule"]: one["fixes"][0]["words"] for one in bill["findings"]}
    assert "gear_ratio = 100.0" in fixes["gear"]
    assert "left_knee" in next(one["about"] for one in bill["findings"] if one["rule"] == "second_sdo_client")


def test_what_is_safe_is_mended_and_what_the_file_does_not_allow_is_refused_in_words(
    ill: Ill, capsys: pytest.CaptureFixture[str]
) -> None:
    assert doctor(ill, "--fix", "--yes") == 1
    done = capsys.readouterr()
    assert "changed: a gateway takes it at its next start" in done.out
    file = tomllib.loads(ill.config.read_text(encoding="utf-8"))
    assert file["joint"]["left_knee"]["gear_ratio"] == 100.0
    assert '[parameter."right_knee.object_6065"] object = "0x6065:0"' in done.err
    records = Path(ill.folder, "records", "doctor.jsonl").read_text(encoding="utf-8")
    rows = [json.loads(line) for line in records.splitlines()]
    assert [row["rule"] for row in rows if "done" in row] == ["gear"]
    assert any("right_knee.object_6065" in row.get("refused", "") for row in rows)
