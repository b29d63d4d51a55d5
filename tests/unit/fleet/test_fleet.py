"""The fleet: everything of every robot is recorded, and one bad robot disturbs no other."""

import json
import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gateway.client import Robot
from server_gui.core.follow.events import Event, Journalled, Looked, Resources, Telemetry
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S
from tests.unit.fleet.recording import FOLLOWING, Kept, recording
from tests.unit.gateway.harness import Bench, config, serving

Start = Callable[[], FakeRobot]


@pytest.fixture
def start() -> Iterator[Start]:
    """Another robot, at every call."""
    with ExitStack() as robots:
        yield lambda: robots.enter_context(FakeRobot())


@pytest.fixture
def gateway(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """The address of a real gateway over fake components."""
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.module.assemble", bench.assemble)
    with serving(config(tmp_path)) as (host, port):
        yield f"{host}:{port}"


def test_a_gateway_is_recorded_with_rows_parameters_resources_and_units(gateway: str, tmp_path: Path) -> None:
    with recording(tmp_path / "spool", {"exo-test": gateway}, operator="Ada", notes="first try") as fleet:
        fleet.until_more("exo-test")
        fleet.until(lambda: any(isinstance(event, Looked) and event.parameters for _, event in fleet.shown))
        fleet.until(lambda: any(isinstance(event, Resources) for _, event in fleet.shown))
        fleet.until(lambda: fleet.recorder.flush(1))
    kept = Kept.of(tmp_path / "spool")
    assert kept.is_whole("exo-test")
    run = kept.runs[0]
    units = dict(zip(run.layout.channels, run.layout.units, strict=True))
    assert units["left_knee.position"] == "rad"
    assert not any(name.startswith("resource.") for name in units)
    place = run.layout.channels.index("left_knee.position")
    assert set(run.values[place]) == {0.5}
    session = kept.table("sessions", "exo-test")[-1]
    assert (session["operator"], session["notes"]) == ("Ada", "first try")
    assert json.loads(session["parameters"])["gait.step_length"] == 0.4
    assert "Linux" in json.loads(session["versions"])["robot's kernel"]
    assert len(session["configuration_hash"]) == 64
    assert session["ended"] is not None
    assert {found["session"] for found in kept.table("sessions", "exo-test")} == {run.session}
    assert kept.table("resources", "exo-test")[0]["processes"]
    assert kept.events("exo-test") == []


def test_what_a_gateway_has_journalled_is_recorded_once(gateway: str, tmp_path: Path) -> None:
    with recording(tmp_path / "spool", {"exo-test": gateway}) as fleet:
        fleet.until_more("exo-test")
        with Robot(gateway) as robot:
            for length in (0.41, 0.42, 0.43):
                robot.write({"gait.step_length": length})
        fleet.until(lambda: any(_writes(event) >= 3 for _, event in fleet.shown))
    entries = Kept.of(tmp_path / "spool").table("journal", "exo-test")
    assert [entry["n"] for entry in entries] == list(range(1, len(entries) + 1))
    assert sum(entry["what"] == "write" for entry in entries) == 3


def test_a_journal_that_is_longer_than_a_look_is_recorded_from_its_beginning(
    start: Start, tmp_path: Path
) -> None:
    entries = [{"n": n, "hash": f"h{n}", "utc_ns": n, "who": "ada", "what": "write"} for n in range(1, 51)]
    robot = start()
    robot.overrides["journal.tail"] = lambda params: {"entries": entries[-params["n"] :]}
    with recording(tmp_path, {"exo-fake": robot.address}) as fleet:
        fleet.until(lambda: any(_writes(event) == 50 for _, event in fleet.shown))
        entries += [{"n": n, "hash": f"h{n}", "who": "ada", "what": "stop"} for n in range(51, 101)]
        fleet.until(lambda: any(len(_entries(event)) == 100 for _, event in fleet.shown))
    kept = Kept.of(tmp_path)
    assert [entry["n"] for entry in kept.table("journal", "exo-fake")] == list(range(1, 101))
    assert kept.events("exo-fake") == []


def _writes(event: Event) -> int:
    return sum(entry["what"] == "write" for entry in _entries(event))


def _entries(event: Event) -> Sequence[dict[str, Any]]:
    return event.journal.entries if isinstance(event, Journalled) else ()


def test_two_robots_are_recorded_whole_and_nobody_sees_what_is_not(start: Start, tmp_path: Path) -> None:
    left, right = start(), start()
    with recording(tmp_path, {"left": left.address, "right": right.address}) as fleet:
        fleet.until_more("left", "right")
        seen = [(robot, event.batch.seq) for robot, event in fleet.shown if isinstance(event, Telemetry)]
        assert fleet.recorder.flush(WAIT_S)
    kept = Kept.of(tmp_path)
    for robot in ("left", "right"):
        assert kept.is_whole(robot)
        assert {seq for name, seq in seen if name == robot} <= {seq for _, _, seq, _ in kept.rows(robot)}


def test_a_link_that_comes_back_is_a_gap_in_the_same_session(
    start: Start, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "server_gui")
    robot = start()
    with recording(tmp_path, {"exo-fake": robot.address}) as fleet:
        fleet.until_more("exo-fake")
        robot.refuse()
        fleet.until(lambda: fleet.fleet.report()["exo-fake"].state != "connected")
        robot.listen()
        fleet.until_more("exo-fake")
        assert fleet.fleet.report()["exo-fake"].links == 2
        assert fleet.fleet.report()["exo-fake"].problem is None
    kept = Kept.of(tmp_path)
    assert [kind for kind, _ in kept.events("exo-fake")] == ["link", "gap"]
    assert len({run.connection for run in kept.runs}) == 2
    assert len({found["session"] for found in kept.table("sessions", "exo-fake")}) == 1
    assert kept.is_whole("exo-fake")
    said = [record.getMessage() for record in caplog.records]
    assert sum("exo-fake: linked to" in line for line in said) == 2
    assert sum("exo-fake: link dropped" in line for line in said) == 1


@pytest.mark.parametrize("what", ["boot_id", "version"])
def test_another_boot_or_software_of_the_robot_is_another_session(
    start: Start, tmp_path: Path, what: str
) -> None:
    robot = start()
    with recording(tmp_path, {"exo-fake": robot.address}) as fleet:
        fleet.until_more("exo-fake")
        setattr(robot, what, "another")
        robot.cut()
        fleet.until(lambda: fleet.fleet.report()["exo-fake"].links == 2)
        fleet.until_more("exo-fake")
    kept = Kept.of(tmp_path)
    names = list(dict.fromkeys(found["session"] for found in kept.table("sessions", "exo-fake")))
    assert len(names) == 2
    assert {run.session for run in kept.runs} == set(names)


def test_robots_that_share_a_name_are_warned_about_and_both_recorded(
    start: Start, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with recording(tmp_path, {"exo-fake": start().address, "right": start().address}) as fleet:
        fleet.until_more("exo-fake", "right")
    kept = Kept.of(tmp_path)
    told = [found["text"] for name in ("exo-fake", "right") for found in kept.table("events", name)]
    assert any(
        one.startswith("right calls itself exo-fake in its own file: give it one name") for one in told
    )
    assert any("both call themselves exo-fake" in text for text in told)
    assert all(any(text in record.getMessage() for record in caplog.records) for text in told)
    assert kept.is_whole("exo-fake")
    assert kept.is_whole("right")


def old(robot: FakeRobot) -> None:
    robot.protocol = 0


def mute(robot: FakeRobot) -> None:
    robot.mute = True


def nonsense(robot: FakeRobot) -> None:
    robot.overrides["robot.describe"] = lambda params: {"robot": 5}


def without_numbers(robot: FakeRobot) -> None:
    robot.overrides["journal.tail"] = lambda params: {"entries": [{"who": "nobody"}]}


def same_numbers(robot: FakeRobot) -> None:
    robot.seq_step = 0


def ragged(robot: FakeRobot) -> None:
    data = {"stream": 1, "seq": 0, "dropped": 0, "stamp_ns": [1, 2], "columns": {"trunk.tilt_side": [0.5]}}
    line = json.dumps({"jsonrpc": "2.0", "method": "stream.data", "params": data}).encode() + b"\n"

    def push(params: dict[str, object]) -> dict[str, object]:
        robot.push(line)
        return {"monotonic_ns": 1, "utc_ns": 2, "boot_id": "boot-1"}

    robot.overrides["clock.read"] = push


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (old, "speaks protocol 0, this program speaks 1; update the older of the two"),
        (mute, None),
        (nonsense, "answered robot.describe with something else"),
        (without_numbers, "entries without a number or a hash"),
        (same_numbers, None),
        (ragged, "2 stamps, but 1 values of a channel"),
    ],
)
def test_a_bad_robot_is_told_and_disturbs_no_other(
    start: Start,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    spoil: Callable[[FakeRobot], None],
    words: str | None,
) -> None:
    bad, good = start(), start()
    spoil(bad)
    with recording(tmp_path, {"bad": bad.address, "good": good.address}) as fleet:
        fleet.until_more("good")
        if words is not None:
            fleet.until(lambda: any(words in record.getMessage() for record in caplog.records))
        fleet.until_more("good")
        assert fleet.recorder.flush(WAIT_S)
    kept = Kept.of(tmp_path)
    assert kept.is_whole("good")
    assert {kind for kind, _ in kept.events("good")} <= {"name"}


def test_channels_that_the_robot_does_not_have_are_told(
    start: Start, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with recording(
        tmp_path, {"exo-fake": start().address}, replace(FOLLOWING, channels=("left_tail.*",))
    ) as fleet:
        fleet.until(
            lambda: any("has no channel left_tail" in record.getMessage() for record in caplog.records)
        )
        assert fleet.rows("exo-fake") == 0
