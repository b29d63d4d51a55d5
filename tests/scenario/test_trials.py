"""Changes of parameters on a whole robot whose devices, clients and gateways fail in the middle of them."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from gateway.config import load
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from hil_sim.control_socket import ask
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Value
from hil_sim.robot import SimulatedRobot
from server_gui.processes.children import Child
from tests.scenario.processes import Bench, is_dead, listening, nothing
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import Answered, Client

KNEE_TORQUE = (0x6072, 0)
SIX = {f"{joint}.max_torque": 60.0 for joint in ("left_hip", "left_knee", "left_ankle")} | {
    f"{joint}.max_torque": 60.0 for joint in ("right_hip", "right_knee", "right_ankle")
}


@pytest.fixture
def robot(one_robot: SimulatedRobot) -> Iterator[SimulatedRobot]:
    """One for all tests of this file: whatever one has done to it is taken back."""
    torques = [drive.dictionary[KNEE_TORQUE] for drive in one_robot.exoskeleton.drives.values()]
    before = [(one, one.value, one.on_write) for one in torques]
    yield one_robot
    ask(one_robot.folder.path, {"clear": "all"})
    for drive in one_robot.exoskeleton.drives.values():
        if not drive.powered:
            drive.power_on()
    for one, value, check in before:
        one.value, one.on_write = value, check


@pytest.fixture
def writer(robot: SimulatedRobot, one_gateway: tuple[str, int]) -> Iterator[Client]:
    with Client(one_gateway) as client:
        until(lambda: client.call("robot.describe")["trials"] == [], "nothing is left of the test before")
        until(lambda: None not in read(client).values(), "every parameter can be read")
        client.call("control.acquire", ttl_s=300)
        yield client


def read(client: Client) -> dict[str, float | None]:
    values = client.call("parameter.read")["values"]
    return {name: one["value"] for name, one in values.items()}


def journal(robot: SimulatedRobot) -> list[dict[str, Any]]:
    return read_verified(RecordsFolder(load(robot.config).records).journal)


def refuse_torque(robot: SimulatedRobot, joint: str) -> None:
    """The drive refuses every new torque limit, but for the one it has."""
    dictionary = robot.exoskeleton.drives[joint].dictionary
    now = dictionary[KNEE_TORQUE].number()

    def check(value: Value) -> None:
        if value != now:
            raise SdoAbort(AbortCode.INVALID_VALUE)

    dictionary[KNEE_TORQUE].on_write = check


class Terminal:
    """`gwrms set --trial` in a process of its own, with a person who has not decided yet."""

    def __init__(self, bench: Bench, *changes: str) -> None:
        command = [sys.executable, "-P", "-m", "gateway.main", "set", "--trial", "250", *changes]
        self.process = subprocess.Popen(
            [*command, "--robot", bench.address],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        while "on trial for 250 s" not in (line := self.process.stdout.readline()):
            assert line, "it ended"

    def kill(self) -> None:
        """As when its terminal is closed, or worse."""
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.communicate()


def value(bench: Bench, name: str) -> float | None:
    found: float | None = bench.ask("parameter.read", names=[name])["values"][name]["value"]
    return found


def test_a_trial_reverts_when_its_terminal_is_killed(bench: Bench) -> None:
    before = value(bench, "gait.cycle_time")
    terminal = Terminal(bench, "gait.cycle_time=1.25")
    try:
        assert value(bench, "gait.cycle_time") == 1.25
    finally:
        terminal.kill()
    until(lambda: value(bench, "gait.cycle_time") == before)
    until(lambda: bench.ask("robot.describe")["trials"] == [])
    last = bench.ask("journal.tail", n=1)["entries"][0]
    assert (last["what"], last["reason"]) == ("taken back", "lease lost with the connection")


def test_a_gateway_killed_during_a_store_leaves_a_record_of_it_and_a_robot_that_answers(
    tmp_path: Path,
) -> None:
    with SimulatedRobot(tmp_path) as robot, ExitStack() as processes:
        config, folder = str(robot.config), RecordsFolder(load(robot.config).records)
        gateway = processes.enter_context(Child("gateway", ["gateway", config, "--port", "0"]))
        port = gateway.wait_ready(listening, WAIT_S, nothing)[1]
        client = processes.enter_context(Client(("127.0.0.1", port)))
        until(lambda: None not in read(client).values(), "every parameter can be read")
        client.call("robot.stop", reason="to store")
        client.call("control.acquire", ttl_s=300)
        until(lambda: not client.call("robot.reset")["held"], "every drive is at rest")
        command = robot.exoskeleton.drives["left_knee"].dictionary[0x1010, 1]
        check = command.on_write

        def kill(value: Value) -> None:
            os.kill(gateway.pid, signal.SIGKILL)
            if check is not None:
                check(value)

        command.on_write = kill
        client.request("parameter.store", component="left_knee")
        until(lambda: is_dead(gateway))
        last = read_verified(folder.journal)[-1]
        assert (last["what"], last["component"]) == ("store", "left_knee")  # begun, and no end of it
        command.on_write = check
        again = processes.enter_context(Child("gateway again", ["gateway", config, "--port", "0"]))
        port = again.wait_ready(listening, WAIT_S, nothing)[1]
        second = processes.enter_context(Client(("127.0.0.1", port)))
        second.call("control.acquire", ttl_s=300)
        until(lambda: None not in read(second).values(), "every parameter can be read")
        assert second.call("parameter.store", component="left_knee")["component"] == "left_knee"
        assert len(read_verified(folder.journal)) > last["n"]


# Last: their robot walks as long as a test of this file is to come.


@pytest.mark.parametrize("number", range(6))
def test_an_abort_of_the_nth_of_six_writes_leaves_all_as_they_were(
    robot: SimulatedRobot, writer: Client, number: int
) -> None:
    before = read(writer)
    joint = list(SIX)[number].partition(".")[0]
    refuse_torque(robot, joint)
    error = writer.refused("parameter.write", changes=SIX)
    assert error.kind == ("rolled_back" if number else "device_abort")
    assert error.data["component"] == joint
    expected = ["taken back"] * number + ["unchanged"] + ["not written"] * (5 - number)
    assert list(error.data["outcome"].values()) == expected
    assert read(writer) == before
    assert writer.call("robot.describe")["trials"] == []


def test_three_nodes_whose_second_refuses_stay_as_they_were_and_the_journal_says_so(
    robot: SimulatedRobot, writer: Client
) -> None:
    before = read(writer)
    refuse_torque(robot, "left_knee")
    changes = {f"{joint}.max_torque": 60.0 for joint in ("left_hip", "left_knee", "left_ankle")}
    assert writer.refused("parameter.write", changes=changes).kind == "rolled_back"
    assert read(writer) == before
    begun, taken_back = journal(robot)[-2:]
    assert (begun["what"], begun["after"]) == ("write", changes)
    assert begun["before"] == {name: before[name] for name in changes}
    assert taken_back["what"] == "write taken back"
    assert taken_back["outcome"] == {
        "left_hip.max_torque": "taken back",
        "left_knee.max_torque": "unchanged",
        "left_ankle.max_torque": "not written",
    }


def test_a_node_lost_in_mid_transaction_is_rolled_back_on_the_others(
    robot: SimulatedRobot, writer: Client
) -> None:
    before = read(writer)
    begun = len(journal(robot))
    ankle = robot.exoskeleton.drives["left_ankle"]
    ankle.dictionary[KNEE_TORQUE].on_write = lambda _value: ankle.power_off()
    changes = {f"{joint}.max_torque": 60.0 for joint in ("left_hip", "left_knee", "left_ankle")}
    error = writer.refused("parameter.write", changes=changes)
    assert error.kind == "rollback_failed"
    outcome = error.data["outcome"]
    assert (outcome["left_hip.max_torque"], outcome["left_knee.max_torque"]) == ("taken back", "taken back")
    assert outcome["left_ankle.max_torque"].startswith("unknown")
    (pending,) = writer.call("robot.describe")["trials"]
    assert "left_ankle.max_torque" in pending["problem"]
    ankle.dictionary[KNEE_TORQUE].on_write = None
    ankle.power_on()  # with its stored value: what was written is gone
    until(lambda: writer.call("robot.describe")["trials"] == [], "taken back as soon as it is there")
    until(lambda: read(writer) == before, "as it was")
    assert [one["what"] for one in journal(robot)[begun:]].count("ROLL-BACK FAILED") == 1


def test_a_node_lost_in_mid_roll_back_is_taken_back_when_it_returns(
    robot: SimulatedRobot, writer: Client
) -> None:
    """The hip is written, the ankle refuses, and the hip is gone when it is to be taken back."""
    before = read(writer)
    hip, ankle = robot.exoskeleton.drives["left_hip"], robot.exoskeleton.drives["left_ankle"]

    def go(_value: Value) -> None:
        hip.power_off()
        raise SdoAbort(AbortCode.INVALID_VALUE)

    ankle.dictionary[KNEE_TORQUE].on_write = go
    error = writer.refused(
        "parameter.write", changes={"left_hip.max_torque": 60.0, "left_ankle.max_torque": 60.0}
    )
    assert error.kind == "rollback_failed"
    assert "left_hip.max_torque" in str(error)
    hip.power_on()
    until(lambda: writer.call("robot.describe")["trials"] == [], "taken back")
    until(lambda: read(writer) == before, "as it was")


THREE = {f"{joint}.max_torque": 60.0 for joint in ("left_hip", "left_knee", "left_ankle")}


def test_a_joint_whose_sdo_answers_are_doubled_is_not_written_to(
    robot: SimulatedRobot, writer: Client
) -> None:
    """Two devices may answer, and both would take it. The others can be written."""
    before = read(writer)
    ask(robot.folder.path, {"fault": "sdo_duplicate", "on": "left_knee"})
    until(lambda: "two devices" in _findings(writer, "left_knee"), "it is seen")
    error = writer.refused("parameter.write", changes=THREE)
    assert (error.kind, error.data["component"]) == ("not_allowed", "left_knee")
    assert read(writer) == before
    others = {name: value for name, value in THREE.items() if "knee" not in name}
    assert writer.call("parameter.write", changes=others)["after"] == others
    ask(robot.folder.path, {"clear": "all"})
    until(lambda: "two devices" not in _findings(writer, "left_knee"), "it is well again")
    assert writer.call("parameter.write", changes=THREE)["after"] == THREE


def _findings(client: Client, component: str) -> str:
    """What is said of it, after it was read once more."""
    read(client)
    return str(client.call("component.snapshot")["quality"][component]["problem"])


@pytest.mark.parametrize(
    "fault",
    [{"fault": "sdo_late", "params": {"delay_ms": 800}}, {"fault": "sdo_silent"}, {"fault": "bus_cut"}],
)
def test_answers_that_fail_in_mid_transaction_leave_all_as_they_were_in_the_end(
    robot: SimulatedRobot, writer: Client, fault: dict[str, Any]
) -> None:
    """The knee's write is carried out, but nobody is told, or too late."""
    before = read(writer)
    dictionary = robot.exoskeleton.drives["left_knee"].dictionary
    on = {} if fault["fault"] == "bus_cut" else {"on": "left_knee"}

    def begin(_value: Value) -> None:
        dictionary[KNEE_TORQUE].on_write = None
        robot.operator.obey({**fault, **on})

    dictionary[KNEE_TORQUE].on_write = begin
    error = writer.refused("parameter.write", changes=THREE)
    assert error.kind in ("rolled_back", "rollback_failed")
    ask(robot.folder.path, {"clear": "all"})
    until(lambda: writer.call("robot.describe")["trials"] == [], "all is taken back")
    until(lambda: read(writer) == before, "as it was")


def test_a_trial_ends_in_time_also_where_no_sample_comes(robot: SimulatedRobot, writer: Client) -> None:
    """The drive answers SDO; that its position is missing is another matter."""
    torque = robot.exoskeleton.drives["left_knee"].dictionary[KNEE_TORQUE]
    before = torque.number()
    ask(robot.folder.path, {"fault": "tpdo_silent", "on": "left_knee"})
    quality = "component.snapshot"
    until(lambda: writer.call(quality)["quality"]["left_knee"]["state"] == "lost", "it is not seen")
    writer.call("parameter.write", changes={"left_knee.max_torque": 60.0}, trial_s=0.2)
    assert torque.number() != before
    until(lambda: writer.call("robot.describe")["trials"] == [], "its time was over")
    assert torque.number() == before
    assert writer.call(quality)["quality"]["left_knee"]["state"] == "lost"


def test_a_write_goes_through_a_storm_of_emergencies(robot: SimulatedRobot, writer: Client) -> None:
    """8000h is the vendor's to define: the drive goes on."""
    ask(robot.folder.path, {"fault": "bus_load", "params": {"percent": 90, "cob_id": 0x081}})
    assert writer.call("parameter.write", changes=THREE)["after"] == THREE
    values = writer.call("parameter.read", names=list(THREE))["values"]
    assert {name: one["value"] for name, one in values.items()} == THREE


def test_two_clients_racing_for_the_lease_never_both_have_it(one_gateway: tuple[str, int]) -> None:
    with ExitStack() as clients:
        racers = [clients.enter_context(Client(one_gateway)) for _ in range(8)]
        for _ in range(10):
            asked = [(racer, racer.request("control.acquire", ttl_s=5)) for racer in racers]
            answers = {racer: _answer(racer, id_) for racer, id_ in asked}
            assert sorted(answers.values()) == ["lease"] + ["lease_held"] * 7
            next(racer for racer, answer in answers.items() if answer == "lease").call("control.release")


def _answer(client: Client, id_: int) -> str:
    try:
        client.answer(id_)
    except Answered as refused:
        return str(refused.kind)
    return "lease"
