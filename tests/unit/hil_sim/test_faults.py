"""Faults as such: every one has a test, requests are checked in words, time and people end them."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from gateway.main import COMMANDS
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.faults.fault import FaultRefused, FaultTarget
from hil_sim.faults.injector import Faults
from hil_sim.faults.registry import FAULTS
from hil_sim.scenario.script import load

HOW_TO = Path(__file__).parents[3] / "docs" / "how-to"
SCENARIOS = (HOW_TO / "scenarios.md").read_text(encoding="utf-8")
BENCH = (HOW_TO / "bench.md").read_text(encoding="utf-8")
TESTED = {
    name
    for file in Path(__file__).parent.glob("test_fault_*.py")
    for name in re.findall(r"^def test_(\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
}


@pytest.fixture(scope="module")
def robot() -> Exoskeleton:
    robot = Exoskeleton(Scenario.STAND)
    robot.power_on()
    return robot


@pytest.fixture
def faults(robot: Exoskeleton, tmp_path: Path) -> Iterator[Faults]:
    faults = Faults(robot, tmp_path)
    pass_time(robot, 0.2)
    yield faults
    faults.clear()


def pass_time(robot: Exoskeleton, seconds: float) -> None:
    robot.clock.run_until(robot.clock.now_ns + round(seconds * 1e9))


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_has_a_test_of_its_own_and_says_how_it_looks(name: str) -> None:
    assert any(tested.startswith(f"{name}_") for tested in TESTED)
    assert re.fullmatch(r"[A-Z0-9].{20,}\.", FAULTS[name].looks)


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_stands_in_the_bench_chapter_as_it_looks(name: str) -> None:
    assert f"\n| `{name}` | {FAULTS[name].looks} |\n" in BENCH


def test_the_bench_chapter_names_no_fault_and_no_command_that_is_none() -> None:
    rows = re.findall(r"^\| `(\w+)` \| [A-Z0-9]", BENCH, re.MULTILINE)
    assert rows
    assert set(rows) == set(FAULTS)
    commands = set(re.findall(r"gwrms ([a-z-]+)", BENCH))
    assert {"sim", "sim-fault", "gateway"} <= commands <= set(COMMANDS)


def test_the_scenarios_of_their_page_can_be_read(tmp_path: Path) -> None:
    found = re.findall(r"```toml title=\"(\w+\.toml)\"\n(.*?)```", SCENARIOS, re.DOTALL)
    assert found
    for name, text in found:
        (tmp_path / name).write_text(text, encoding="utf-8")
        script = load(tmp_path / name)
        assert f"\n{name}: {script.title}\n  ok      {script.expectations[0].words}\n" in SCENARIOS


def test_there_are_at_least_thirty() -> None:
    assert len(FAULTS) >= 30


@pytest.mark.parametrize("name", [name for name, fault in FAULTS.items() if fault.on is not FaultTarget.HOST])
def test_every_fault_begins_and_ends_on_each_of_its_devices(name: str, faults: Faults) -> None:
    for device in FAULTS[name].on.value:
        begun = faults.begin(name, device)
        assert (begun.name, begun.on) == (name, device)
        assert (begun in faults.active) is not FAULTS[name].momentary
        faults.clear()
        assert faults.active == []


def test_a_fault_ends_when_its_time_is_over(robot: Exoskeleton, faults: Faults) -> None:
    begun = faults.begin("heartbeat_missing", "left_knee", for_s=0.25)
    assert begun.until_s == begun.since_s + 0.25
    pass_time(robot, 0.24)
    assert faults.active == [begun]
    pass_time(robot, 0.02)
    assert faults.active == []
    assert robot.bus.disturbances == []


def test_a_fault_that_was_cleared_early_does_not_end_twice(robot: Exoskeleton, faults: Faults) -> None:
    faults.begin("node_lost", "left_knee", for_s=0.2)
    assert [one.name for one in faults.clear("node_lost")] == ["node_lost"]
    begun = faults.begin("node_lost", "left_knee")
    pass_time(robot, 0.5)
    assert faults.active == [begun]


def test_clear_ends_what_is_named_and_where_it_is_named(faults: Faults) -> None:
    for name, on in (("node_lost", "left_knee"), ("node_lost", "left_hip"), ("bus_load", None)):
        faults.begin(name, on)
    assert [one.on for one in faults.clear("node_lost", "left_hip")] == ["left_hip"]
    assert [one.name for one in faults.clear("bus_load")] == ["bus_load"]
    assert [one.on for one in faults.clear()] == ["left_knee"]


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (("nod_lost",), "there is no fault 'nod_lost': did you mean 'node_lost'?"),
        (("node_lost",), "node_lost needs to be told where: on is one of left_hip, .*gait"),
        (("node_lost", "trunk"), "node_lost cannot be on 'trunk': on is one of"),
        (("overcurrent", "gait"), "overcurrent cannot be on 'gait'"),
        (("node_lost", "gait", 0), "for_s = 0 is no time"),
        (("node_lost", "gait", float("nan")), "for_s = nan is no time"),
        (("node_lost", "gait", "5"), "for_s = '5' is no time"),
        (("reboot", "gait", 5), "reboot is over as soon as it has begun; leave for_s out"),
        (("node_lost", "gait", 1, {"x": 1}), "node_lost has no parameter 'x': it has none"),
        (("bus_load", None, 1, {"x": 1}), "bus_load has no parameter 'x': it has percent, cob_id"),
        (
            ("bus_load", None, 1, {"percnt": 1}),
            "no parameter 'percnt': did you mean 'percent'\\? it has percent",
        ),
        (("node_lost", "left_nee"), "cannot be on 'left_nee': did you mean 'left_knee'\\? on is one of"),
        (("bus_load", None, 1, {"percent": 101}), "percent = 101 .*give a number from 1 % to 100 %"),
        (("bus_load", None, 1, {"percent": "much"}), "percent = 'much' is not possible"),
        (("bus_load", None, 1, {"percent": True}), "percent = True is not possible"),
        (("bus_load", None, 1, {"percent": float("inf")}), "percent = inf is not possible"),
        (("bus_load", None, 1, {"cob_id": 1.5}), "whole number from 0x1 to 0x7FF"),
        (("sdo_abort", "gait", 1, {"nth": 2.5}), "nth = 2.5 .*give a whole number from 1 to 10000"),
    ],
)
def test_what_cannot_be_is_refused_in_words(request_: tuple[object, ...], words: str, faults: Faults) -> None:
    with pytest.raises(FaultRefused, match=words):
        faults.begin(*request_)  # type: ignore[arg-type]
    assert faults.active == []


def test_the_same_fault_twice_on_a_device_is_refused(faults: Faults) -> None:
    faults.begin("node_lost", "gait")
    with pytest.raises(FaultRefused, match="node_lost is already on gait; clear it first"):
        faults.begin("node_lost", "gait")


def test_numbers_may_be_written_as_people_type_them(faults: Faults) -> None:
    begun = faults.begin("bus_load", params={"percent": "12.5", "cob_id": "0x7F0"})
    assert begun.values == {"percent": 12.5, "cob_id": 0x7F0}


def test_faults_of_one_node_end_in_any_order(robot: Exoskeleton, faults: Faults) -> None:
    for name in ("sdo_late", "tpdo_silent", "heartbeat_missing", "encoder_stuck"):
        faults.begin(name, "left_knee")
    faults.begin("frame_loss")
    for name in ("heartbeat_missing", "frame_loss", "sdo_late", "encoder_stuck", "tpdo_silent"):
        faults.clear(name)
    assert robot.bus.disturbances == []
    assert not robot.drives["left_knee"].encoder.stuck
