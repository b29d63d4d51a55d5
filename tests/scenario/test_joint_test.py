"""A joint is tested by `gwrms joint-test`; whatever ends that leaves it at rest, without power, as it was."""

import json
import math
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest

from drivers.bus.bus import CanBus
from drivers.bus.settings import Role
from drivers.errors import DeviceTimeout
from gateway.commission.bench import CanBench
from gateway.config.reading import load
from hil_sim.control_socket import ask
from hil_sim.drive.power_state import ENERGISED
from hil_sim.exoskeleton import Scenario
from hil_sim.robot import SimulatedRobot
from server_gui.core.joint_tests.comparing import analysed
from server_gui.core.joint_tests.file import read
from tests.support.waiting import WAIT_S, until

KNEE = "left_knee"
Process = subprocess.Popen[str]
ROOM = ("--max-torque", "80", "--late", "200")  # for a busy machine
LONG = ("friction", "--amplitude", "10", *ROOM)
TRIES = 12  # a machine that is too busy ends a test, as it should
UNUSUAL = 0x1C5  # an identifier for process data
BUSY = (
    "busy",
    "stay away",
    "beyond the limit",
    "behind its target",
    "is missing",
    "stood still",
    "did not come up",
    "in time",
)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    with SimulatedRobot(tmp_path / "sim", Scenario.STAND, without=["gait"]) as robot:
        text = robot.config.read_text(encoding="utf-8").replace('role = "observer"', 'role = "master"')
        robot.config.write_text(text, encoding="utf-8")
        yield robot


@contextmanager
def begun(robot: SimulatedRobot, *words: str, config: Path | None = None) -> Iterator[Process]:
    where = f"{config or robot.config}:{KNEE}"
    command = [
        sys.executable,
        "-P",
        "-m",
        "gateway.main",
        "joint-test",
        words[0],
        where,
        *words[1:],
        "--json",
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def typed(process: Process, text: str) -> None:
    assert process.stdin is not None
    process.stdin.write(text + "\n")
    process.stdin.flush()


def heard(process: Process, phrase: str | None = None) -> Iterator[dict[str, Any]]:
    """What it says; its questions are answered, the last one by its phrase, or by `phrase`."""
    assert process.stdout is not None
    for one in map(json.loads, process.stdout):
        yield one
        if "ask" in one:
            found = re.search(r"Type  (.*)  to put", one["ask"])
            typed(process, "" if found is None else found[1] if phrase is None else phrase)


def moves(process: Process) -> bool:
    """Whether the joint has come on its way; a computer that is too busy for that ends it."""
    for one in heard(process):
        degrees = re.search(r"\(([+-][\d.]+)°\)", one.get("moving") or "")
        if degrees is not None and abs(float(degrees[1])) > 0.3:
            return True
        if "tested" in one:
            assert any(word in one["tested"]["problem"] for word in BUSY), one
    return False


@contextmanager
def under_way(robot: SimulatedRobot, *words: str) -> Iterator[Process]:
    """A test that moves the joint."""
    for _ in range(TRIES):
        with begun(robot, *words) as process:
            if moves(process):
                yield process
                return
    raise AssertionError("this computer is too busy for any test")


def recorded(robot: SimulatedRobot, *words: str) -> list[dict[str, Any]]:
    """What a test has said that was recorded to its end."""
    for _ in range(TRIES):
        with begun(robot, *words) as process:
            said = list(heard(process))
            if process.wait() == 0:
                return said
            problem = said[-1].get("tested", {}).get("problem") or str(said[-3:])
            assert any(word in problem for word in BUSY), said[-3:]
    raise AssertionError("this computer is too busy for any test")


def at_rest(robot: SimulatedRobot) -> bool:
    drive = robot.exoskeleton.drives[KNEE]
    return drive.power_state not in ENERGISED and abs(drive.joint.velocity) < 1e-3


def recordings(robot: SimulatedRobot) -> list[Path]:
    return sorted((robot.config.parent / "joint-tests").glob("*.jsonl"), key=lambda one: one.stat().st_mtime)


def parameters(robot: SimulatedRobot) -> dict[tuple[int, int], object]:
    drive = robot.exoskeleton.drives[KNEE]
    return {
        one.key: one.value for one in drive.dictionary if one.writable and one.key[0] in range(0x6060, 0x6070)
    }


def test_a_step_is_recorded_shown_and_everything_is_as_before(robot: SimulatedRobot) -> None:
    before = parameters(robot)
    said = recorded(robot, "step", "--repeat", "1", *ROOM)
    assert {"moving": None} in said
    assert at_rest(robot)
    assert parameters(robot) == before
    shown = analysed(recordings(robot)[-1])
    assert shown.test.problem is None
    assert shown.test["torque"].size > 200
    rise = shown.result.value("rise_time")
    assert rise is not None
    assert 0.02 < rise < 0.3
    assert shown.test.head.parameters["0x2030:1"] == 3000


@contextmanager
def another_master(robot: SimulatedRobot) -> Iterator[CanBus]:
    config = load(robot.config)
    name = config.joint[KNEE].bus
    bus = CanBus(name, msgspec.structs.replace(config.can[name], sync_period_s=None), Role.MASTER)
    bus.start()
    try:
        until(lambda: bus.is_open)
        yield bus
    finally:
        bus.stop()


def has_come_up(bench: CanBench, node: int) -> bool:
    with suppress(DeviceTimeout):
        return bench.read(node, 0x1400, 1) is not None
    return False


def test_process_data_to_another_drive_end_it_wherever_it_takes_them(robot: SimulatedRobot) -> None:
    config = load(robot.config)
    beside = config.joint["right_knee"]
    with closing(CanBench(beside.bus, config.can[beside.bus])) as bench:
        until(lambda: has_come_up(bench, beside.node_id))
        bench.write(beside.node_id, 0x1400, 1, (0x8000_0000 | 0x200 + beside.node_id).to_bytes(4, "little"))
        bench.write(beside.node_id, 0x1400, 1, UNUSUAL.to_bytes(4, "little"))
    with another_master(robot) as bus, begun(robot, *LONG) as process:
        for one in heard(process):
            if "are read" in (one.get("moving") or ""):
                bus.send(UNUSUAL, bytes(2))
        assert process.wait() == 1
    assert f"process data to node {beside.node_id}" in str(read(recordings(robot)[-1]).problem)
    assert at_rest(robot)


def ends(number: signal.Signals) -> Callable[[SimulatedRobot, Process], None]:
    return lambda _robot, process: process.send_signal(number)


def stop_from_elsewhere(robot: SimulatedRobot, _process: Process) -> None:
    with begun(robot, "stop") as other:
        said = list(heard(other))
    assert any("stopped" in one for one in said)


def faults(name: str) -> Callable[[SimulatedRobot, Process], None]:
    def make(robot: SimulatedRobot, _process: Process) -> None:
        ask(robot.config.parent, {"fault": name, "on": KNEE})

    return make


EVENTS: dict[str, Callable[[SimulatedRobot, Process], None]] = {
    "killed": ends(signal.SIGKILL),
    "fault": faults("overcurrent"),
    "ctrl_c": ends(signal.SIGINT),
    "terminated": ends(signal.SIGTERM),
    "hung_up": ends(signal.SIGHUP),
    "suspended": ends(signal.SIGSTOP),
    "enter": lambda _robot, process: typed(process, ""),
    "stop_from_elsewhere": stop_from_elsewhere,
    "silent": faults("node_lost"),
    "sto": faults("sto"),
}


def ended_by(robot: SimulatedRobot, event: Callable[[SimulatedRobot, Process], None]) -> None:
    """A test that moves the joint is ended by that, and the joint comes to rest without power."""
    with under_way(robot, *LONG) as process:
        event(robot, process)
        until(lambda: at_rest(robot))
    ask(robot.config.parent, {"clear": "all"})
    assert read(recordings(robot)[-1]).problem is not None, "that it was cut off is known"


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS.keys())
def test_whatever_ends_it_leaves_the_joint_at_rest_and_without_power(
    robot: SimulatedRobot, event: Callable[[SimulatedRobot, Process], None]
) -> None:
    ended_by(robot, event)


def test_one_that_is_killed_leaves_the_joint_without_power_and_the_next_puts_back_what_it_had(
    robot: SimulatedRobot,
) -> None:
    """The next gives no power to a joint that was moved since its motion was told."""
    offset = robot.exoskeleton.drives[KNEE].dictionary[0x60B2, 0]
    offset.value = 5
    before = parameters(robot)
    killed_under_power(robot)
    until(lambda: at_rest(robot))
    assert offset.value == 0
    assert "0x60B2:0 0 instead of 5" in stop_says(robot)
    problem, said = moved_by_hand(robot)
    assert "0x60B2:0: put back" in said
    assert (offset.value, parameters(robot)) == (5, before)
    assert stop_says(robot) == ""
    for _ in range(TRIES):
        if "the joint was moved" in problem:
            return
        assert any(word in problem for word in BUSY), problem
        problem, _ = moved_by_hand(robot)
    raise AssertionError("this computer is too busy for any test")


def moved_by_hand(robot: SimulatedRobot) -> tuple[str, str]:
    """Why a test ended whose joint was moved before the phrase was typed, and what it said."""
    angle = robot.exoskeleton.drives[KNEE].joint.position * robot.exoskeleton.mountings[KNEE].direction
    earlier, said = recordings(robot), []
    with begun(robot, "step", *ROOM) as process:
        for one in heard(process):
            said.append(one.get("say", ""))
            if "Type  " in one.get("ask", ""):
                ask(robot.config.parent, {"hand": KNEE, "degrees": math.degrees(angle) + 3.0})
            assert "step test" not in (one.get("moving") or "")
        assert process.wait() == 1
    found = recordings(robot)
    return str(read(found[-1]).problem) if len(found) > len(earlier) else "busy", str(said)


def killed_under_power(robot: SimulatedRobot) -> None:
    for _ in range(TRIES):
        with begun(robot, *LONG) as process:
            for _said in heard(process):
                if robot.exoskeleton.drives[KNEE].power_state in ENERGISED:
                    return  # which kills it
    raise AssertionError("this computer is too busy for any test")


def stop_says(robot: SimulatedRobot) -> str:
    """What `stop` warns of."""
    with begun(robot, "stop") as process:
        return process.communicate(timeout=WAIT_S)[1]


def test_two_at_once_are_one_and_without_its_phrase_nothing_gets_power(robot: SimulatedRobot) -> None:
    with begun(robot, "step") as process:
        next(one for one in heard(process) if "ask" in one)
        with begun(robot, "step") as other:
            _, errors = other.communicate(timeout=WAIT_S)
        assert (other.returncode, "is at it" in errors) == (1, True)
        typed(process, "")
        said = list(heard(process, phrase="yes"))
        assert process.wait() == 1
    assert any("ask" in one for one in said), "the first one goes on"
    assert {"say": "Nothing gets power."} in said
    assert not any("moving" in one for one in said)


def test_a_rule_of_the_guard_ends_it(robot: SimulatedRobot) -> None:
    angle = robot.exoskeleton.drives[KNEE].joint.position
    rule = f'\n[guard.rule.end]\nwatch = "stopping_distance"\non = ["{KNEE}"]\nmin = -2.0\n'
    rule += f"max = {angle + 0.02}\n"
    config = robot.config.with_name("guarded.toml")
    config.write_text(
        robot.config.read_text(encoding="utf-8") + rule + "deceleration = 5.0\n", encoding="utf-8"
    )
    for _ in range(TRIES):
        with begun(robot, *LONG, config=config) as process:
            said = list(heard(process))
            assert process.wait() == 1
        assert at_rest(robot)
        if any("guard rule end" in one.get("say", "") for one in said):
            return
        assert any(word in str(said[-3:]) for word in BUSY), said[-3:]
    raise AssertionError("this computer is too busy for any test")
