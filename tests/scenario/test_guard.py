"""The guard before a whole simulated robot: what it stops, what it tells, and what its death leads to."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import can
import pytest

from drivers.joint.cia402 import DriveState
from gateway.config import load
from gateway.guard.inputs import AGAIN_NS
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from hil_sim.control_socket import ask
from hil_sim.drive.power_state import PowerState
from hil_sim.exoskeleton import JOINTS
from hil_sim.robot import SimulatedRobot
from server_gui.processes.children import Child, ChildFailed
from tests.scenario.processes import nothing
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import Client, serving

ENABLED = PowerState.OPERATION_ENABLED
DOWNLOAD, UPLOAD = 1, 2  # client command specifiers (CiA 301 §7.2.4.3)
OUR_NODE, PERIOD_MS = 100, 1000  # slow, so that no busy computer makes the drives stop by itself
PATIENT_MS = 4 * PERIOD_MS  # … nor one that is starved, where it is not asked when they do
CONSUMER_S = 2.5 * PERIOD_MS / 1000
ENTRY = OUR_NODE << 16 | round(CONSUMER_S * 1000)

HEARTBEAT = f"[guard]\nheartbeat_ms = {PERIOD_MS}\n"
PATIENT = f"[guard]\nheartbeat_ms = {PATIENT_MS}\n"
# A test has the rules that it is about: on a busy computer others would trip, rightly, before it begins.
LOST = """
[guard.rule.lost]
watch = "node_lost"
on = ["*_hip", "*_knee", "*_ankle"]
silent_s = 5.0
actions = ["quick_stop", "alarm"]
"""
OVERCURRENT = """
[guard.rule.overcurrent]
watch = "emcy"
codes = ["0x23"]
actions = ["quick_stop", "alarm"]
"""
RULES = f"""
{LOST}
{OVERCURRENT}
[guard.rule.foot]
watch = "insole_stale"
silent_s = 1.0

[guard.rule.hot]
watch = "temperature"
above = 90.0
actions = ["quick_stop", "alarm"]

[guard.rule.upright]
watch = "tilt"
above = 1.2
"""

CONTROLLER = """
[guard.rule.controller]
watch = "node_lost"
on = ["gait"]
silent_s = 2.0
actions = ["quick_stop"]
"""
SLOW = """
[guard.rule.slow]
watch = "sdo_latency"
above = 1.5
"""
EMERGENCY_STOP = """
[guard.rule.hardware]
watch = "digital_input"
name = "emergency stop"
must_be_clear = [16]
actions = ["quick_stop", "alarm"]
"""
BUS = """
[guard.rule.bus]
watch = "bus"
silent_s = 2.0
"""


def configure(robot: SimulatedRobot, text: str) -> Path:
    """The robot's file with a guard, and a node id of ours on its bus."""
    file = robot.config.read_text(encoding="utf-8")
    file = re.sub(r"^(\[can\.main\].*)$", rf"\1\nnode_id = {OUR_NODE}", file, flags=re.MULTILINE)
    robot.config.write_text(f"{file}\n{text}", encoding="utf-8")
    return robot.config


def journal(config: Path, what: str) -> list[dict[str, Any]]:
    file = RecordsFolder(load(config).records).journal
    entries = read_verified(file) if file.exists() else []  # there is none before the first entry
    return [one for one in entries if one["what"] == what]


def alarms(robot: SimulatedRobot) -> list[str]:
    """The rules that there were alarms about."""
    return [one["about"] for one in journal(robot.config, "alarm")]


def power_states(robot: SimulatedRobot) -> set[PowerState]:
    return {drive.power_state for drive in robot.exoskeleton.drives.values()}


def entries(robot: SimulatedRobot) -> set[int]:
    """What 1016h of the drives holds."""
    drives = robot.exoskeleton.drives.values()
    return {drive.dictionary[0x1016, at].number() for drive in drives for at in range(1, 5)}


def stand_still(robot: SimulatedRobot, client: Client) -> None:
    """The gait controller switches its drives off by itself, as a caregiver does at the end of the day.

    The gateway has heard of it: before that it does not end, as it should not.
    """
    ask(robot.folder.path, {"controller": "stop"})
    until(lambda: ENABLED not in power_states(robot), "no drive is enabled")
    until(lambda: knows_that_none_is_enabled(client), "the gateway knows")


def knows_that_none_is_enabled(client: Client) -> bool:
    states = client.call("component.snapshot", channels=[f"{joint}.state" for joint in JOINTS])["values"]
    return len(states) == len(JOINTS) and not {None, DriveState.OPERATION_ENABLED.value} & set(
        states.values()
    )


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    with SimulatedRobot(tmp_path, virtual_channel=f"guard {tmp_path.name}") as robot:
        until(lambda: power_states(robot) == {ENABLED}, "it walks")
        yield robot


@pytest.fixture
def guarded(robot: SimulatedRobot) -> Iterator[Callable[[str], Client]]:
    """A gateway with these tables; everything of its guard sees what it watches."""
    with ExitStack() as stack:

        def start(text: str) -> Client:
            address = stack.enter_context(serving(load(configure(robot, text))))
            client = stack.enter_context(Client(address))
            until_it_watches(client)
            return client

        yield start


def until_it_watches(client: Client) -> None:
    """Every rule, and over something that it has heard: what was never heard cannot be lost."""
    until(lambda: qualities(client) == {"ok"}, "everything is heard")
    looked = time.monotonic() + 3 * AGAIN_NS / 1e9
    until(lambda: time.monotonic() > looked, "the guard has heard it too")
    until(lambda: states(client) and set(states(client).values()) == {"watching"}, "it watches")


def qualities(client: Client) -> set[str]:
    return {one["state"] for one in client.call("component.snapshot")["quality"].values()}


def states(client: Client) -> dict[str, str]:
    return {one["name"]: one["state"] for one in client.call("robot.describe")["guard"]["rules"]}


class TestRules:
    def test_a_node_that_is_lost_stops_the_others(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(LOST)
        ask(robot.folder.path, {"fault": "heartbeat_missing", "on": "left_knee"})
        until(lambda: states(client)["lost"] == "tripped", "lost")
        until(lambda: ENABLED not in power_states(robot), "stopped")
        stop = client.call("robot.describe")["stop"]
        assert stop["held"] is True
        assert "guard rule lost: left_knee: silent for" in stop["reason"]
        ask(robot.folder.path, {"clear": "all"})
        until(lambda: states(client)["lost"] == "cleared", "it is back")

    def test_an_emergency_of_one_drive_stops_all_in_a_storm_of_others(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client], tmp_path: Path
    ) -> None:
        client = guarded(OVERCURRENT)
        with can.Bus(interface="virtual", channel=f"guard {tmp_path.name}") as third:
            storm = can.Message(
                arbitration_id=0x082, data=bytes.fromhex("3081110000000000"), is_extended_id=False
            )
            for _ in range(5000):
                third.send(storm)
            assert states(client)["overcurrent"] == "watching"
            ask(robot.folder.path, {"fault": "overcurrent", "on": "right_hip"})
            until(lambda: states(client)["overcurrent"] == "tripped", "tripped")
            until(lambda: ENABLED not in power_states(robot), "stopped")
        assert "right_hip: 0x2310" in client.call("robot.describe")["stop"]["reason"]
        until(lambda: "overcurrent" in alarms(robot), "told")
        assert alarms(robot).count("overcurrent") == 1

    def test_a_motor_that_gets_too_hot_stops_the_robot_before_its_drive_does(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(RULES)
        hot = {"to_c": 98.0, "rate_c_per_s": 1000.0}  # the drive's own limit is 100
        ask(robot.folder.path, {"fault": "overtemperature", "on": "left_hip", "params": hot})
        until(lambda: states(client)["hot"] == "tripped", "tripped")
        until(lambda: ENABLED not in power_states(robot), "stopped")
        assert "left_hip.temperature: " in client.call("robot.describe")["stop"]["reason"]

    def test_an_insole_that_is_unplugged_is_an_alarm_and_no_stop(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(RULES)
        ask(robot.folder.path, {"fault": "sensor_unplugged", "on": "left_insole"})
        until(lambda: states(client)["foot"] == "tripped", "silent")
        until(lambda: journal(robot.config, "alarm"), "told")
        assert "left_insole: silent" in journal(robot.config, "alarm")[0]["reason"]
        assert power_states(robot) == {ENABLED}

    def test_a_controller_that_is_lost_stops_the_drives_that_it_commanded(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(CONTROLLER)
        ask(robot.folder.path, {"fault": "node_lost", "on": "gait"})
        until(lambda: states(client)["controller"] == "tripped", "lost")
        until(lambda: ENABLED not in power_states(robot), "stopped")
        assert "guard rule controller: gait: silent for" in client.call("robot.describe")["stop"]["reason"]

    def test_a_node_that_answers_no_sdo_in_time_is_told(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(SLOW)
        ask(robot.folder.path, {"fault": "sdo_late", "on": "gait", "params": {"delay_ms": 2000}})
        until(lambda: journal(robot.config, "alarm"), "told")
        assert journal(robot.config, "alarm")[0]["reason"] == "gait: no answer"
        ask(robot.folder.path, {"clear": "all"})
        until(lambda: states(client)["slow"] == "cleared", "it answers again")


class TestEmergencyStop:
    """What hardware has taken is seen, named, and not fought."""

    def test_it_is_called_by_its_name_and_holds_the_robot_until_it_is_over(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client], tmp_path: Path
    ) -> None:
        client = guarded(EMERGENCY_STOP)
        ask(robot.folder.path, {"fault": "sto", "on": "left_knee"})
        until(lambda: client.call("robot.describe")["stop"]["held"], "held")
        until(lambda: ENABLED not in power_states(robot), "stopped")
        reason = "left_knee.digital_inputs: emergency stop, bit 16 set"
        assert client.call("robot.describe")["stop"]["reason"] == f"guard rule hardware: {reason}"
        client.call("control.acquire", ttl_s=60)
        refused = client.refused("robot.reset")
        assert refused.kind == "stopped"
        assert f"hardware ({reason})" in str(refused)
        until(lambda: journal(robot.config, "stop answered"), "answered")
        with can.Bus(interface="virtual", channel=f"guard {tmp_path.name}") as third:
            requests = requests_to(third, JOINTS["left_knee"], seconds=2.0)
        assert (UPLOAD, 0x60FD) in requests, "it is looked at"
        assert not [index for what, index in requests if what == DOWNLOAD], "and not commanded"
        ask(robot.folder.path, {"clear": "all"})
        until(lambda: states(client)["hardware"] == "cleared", "it is over")
        assert client.call("robot.describe")["stop"]["held"] is True
        assert client.call("robot.reset")["held"] is False
        assert power_states(robot) == {PowerState.SWITCH_ON_DISABLED}, "nothing enables anything"


def requests_to(bus: can.BusABC, node: int, seconds: float) -> list[tuple[int, int]]:
    """What SDO requests to a node are about in this time: what they ask for (CiA 301), and the index."""
    end, found = time.monotonic() + seconds, []
    while (left_s := end - time.monotonic()) > 0:
        message = bus.recv(left_s)
        if message is not None and message.arbitration_id == 0x600 + node:
            found.append((message.data[0] >> 5, int.from_bytes(message.data[1:3], "little")))
    return found


class TestBus:
    def test_our_own_controller_that_is_bus_off_is_told(
        self, robot: SimulatedRobot, guarded: Callable[[str], Client]
    ) -> None:
        client = guarded(BUS)
        ask(robot.folder.path, {"fault": "gateway_bus_off"})
        until(lambda: states(client)["bus"] == "tripped", "seen")
        until(lambda: journal(robot.config, "alarm"), "told")
        assert journal(robot.config, "alarm")[0]["reason"] == "main: our CAN controller is bus off"
        ask(robot.folder.path, {"clear": "all"})
        until(lambda: states(client)["bus"] == "cleared", "it is back")

    def test_a_guard_that_begins_before_its_bus_tells_it_and_sees_when_it_comes(self, tmp_path: Path) -> None:
        with ExitStack() as stack:
            power = stack.enter_context(ExitStack())
            robot = power.enter_context(SimulatedRobot(tmp_path))
            config = load(configure(robot, RULES))
            power.close()
            client = stack.enter_context(Client(stack.enter_context(serving(config))))
            until(lambda: states(client).get("lost") == "blind", "it cannot see")
            until(lambda: journal(robot.config, "alarm"), "told")
            stack.enter_context(SimulatedRobot(tmp_path))
            until(lambda: set(states(client).values()) == {"watching"}, "it sees")
            assert client.call("robot.describe")["stop"]["held"] is False

    def test_a_bus_that_goes_makes_every_node_lost_and_the_stop_is_held_when_it_is_back(
        self, tmp_path: Path
    ) -> None:
        with ExitStack() as stack:
            power = stack.enter_context(ExitStack())
            robot = power.enter_context(SimulatedRobot(tmp_path))
            config = load(configure(robot, RULES))
            client = stack.enter_context(Client(stack.enter_context(serving(config))))
            until_it_watches(client)
            power.close()
            until(lambda: states(client)["lost"] == "tripped", "lost")
            until(lambda: states(client)["hot"] == "blind", "nobody knows")
            back = stack.enter_context(SimulatedRobot(tmp_path))
            until(lambda: set(states(client).values()) <= {"watching", "cleared"}, "it sees")
            assert client.call("robot.describe")["stop"]["held"] is True
            clock = back.exoskeleton.clock
            enabled: list[float] = []
            back.exoskeleton.measured.append(
                lambda: enabled.append(clock.now_s) if power_states(back) == {ENABLED} else None
            )
            until(lambda: clock.now_s > 3.5, "the gait controller had its chance")
            assert not enabled, "not one cycle with every drive enabled"


class TestArming:
    def test_every_drive_is_armed_told_and_freed_at_the_end(self, robot: SimulatedRobot) -> None:
        with serving(load(configure(robot, HEARTBEAT))) as address, Client(address) as client:
            until(lambda: armed(client) == set(JOINTS), "armed")
            assert entries(robot) == {ENTRY, 0}
            arming = client.call("robot.describe")["guard"]["arming"]
            assert set(arming.values()) == {f"armed by 1016h:1, {round(CONSUMER_S * 1000)} ms"}
            stand_still(robot, client)
        assert entries(robot) == {0}

    def test_a_drive_that_keeps_moving_without_us_is_told_and_not_armed(self, robot: SimulatedRobot) -> None:
        robot.exoskeleton.drives["left_knee"].dictionary[0x6007, 0].value = 0
        with serving(load(configure(robot, HEARTBEAT))) as address, Client(address) as client:
            until(lambda: armed(client) == set(JOINTS) - {"left_knee"}, "the others are armed")
            until(lambda: journal(robot.config, "alarm"), "told")
            assert "6007h is 0" in client.call("robot.describe")["guard"]["arming"]["left_knee"]
            assert robot.exoskeleton.drives["left_knee"].dictionary[0x1016, 1].number() == 0
            stand_still(robot, client)

    def test_a_rebooted_drive_is_armed_again(self, robot: SimulatedRobot) -> None:
        with serving(load(configure(robot, HEARTBEAT))) as address, Client(address) as client:
            until(lambda: armed(client) == set(JOINTS), "armed")
            knee = robot.exoskeleton.drives["left_knee"].dictionary[0x1016, 1]
            ask(robot.folder.path, {"fault": "reboot", "on": "left_knee"})
            assert knee.number() == 0, "it has lost it"
            until(lambda: knee.number() == ENTRY and armed(client) == set(JOINTS), "armed again")
            stand_still(robot, client)

    def test_drives_that_cannot_be_reached_at_the_end_are_said_to_be_left_armed(
        self, robot: SimulatedRobot
    ) -> None:
        with serving(load(configure(robot, HEARTBEAT))) as address, Client(address) as client:
            until(lambda: armed(client) == set(JOINTS), "armed")
            stand_still(robot, client)
            ask(robot.folder.path, {"fault": "bus_cut"})
            until(lambda: lost(client) >= set(JOINTS), "nothing is heard any more")
        assert len(journal(robot.config, "not disarmed")) == len(JOINTS)


def lost(client: Client) -> set[str]:
    quality = client.call("component.snapshot")["quality"]
    return {name for name, one in quality.items() if one["state"] == "lost"}


def armed(client: Client) -> set[str]:
    drives = client.call("robot.describe")["stop"]["drives"]
    return {name for name, one in drives.items() if one["armed"]}


class Killed:
    """A robot in this process, and its gateway in one of its own."""

    def __init__(self, folder: Path, stack: ExitStack, guard: str = HEARTBEAT) -> None:
        self.robot = stack.enter_context(SimulatedRobot(folder))
        self.config = configure(self.robot, guard)
        self.gateway = stack.enter_context(Child("gateway", ["gateway", str(self.config), "--port", "0"]))
        found = self.gateway.wait_ready(_listening, WAIT_S, nothing)
        self.client = stack.enter_context(Client((found[1], int(found[2]))))
        self.stopped_s: float | None = None
        self.robot.exoskeleton.measured.append(self._look)
        until(lambda: armed(self.client) == set(JOINTS), "armed")
        until(lambda: power_states(self.robot) == {ENABLED}, "it walks")
        self.stopped_s = None

    def _look(self) -> None:
        if self.stopped_s is None and ENABLED not in power_states(self.robot):
            self.stopped_s = self.robot.exoskeleton.clock.now_s

    def signal(self, number: int) -> None:
        os.kill(self.gateway.pid, number)

    def is_over(self) -> bool:
        try:
            self.gateway.check()
        except ChildFailed:
            return True
        return False


def _listening(line: str) -> re.Match[str] | None:
    return re.fullmatch(r"listening on (\S+):(\d+)", line)


@pytest.fixture
def killed(tmp_path: Path) -> Iterator[Killed]:
    with ExitStack() as stack:
        yield Killed(tmp_path, stack)


@pytest.fixture
def patient(tmp_path: Path) -> Iterator[Killed]:
    with ExitStack() as stack:
        yield Killed(tmp_path, stack, PATIENT)


class TestDeath:
    def test_a_killed_gateway_makes_every_drive_stop_by_itself_in_time(self, killed: Killed) -> None:
        killed.signal(signal.SIGKILL)
        until(killed.is_over, "dead")
        died_s = killed.robot.exoskeleton.clock.now_s
        assert killed.stopped_s is None, "they walk on as the gait controller says"
        until(lambda: killed.stopped_s is not None, "every drive has stopped")
        assert killed.stopped_s is not None
        assert killed.stopped_s - died_s < CONSUMER_S + 0.5
        until(
            lambda: all(abs(d.joint.velocity) < 0.05 for d in killed.robot.exoskeleton.drives.values()),
            "at rest",
        )

    def test_a_gateway_that_hangs_makes_every_drive_stop_by_itself(self, killed: Killed) -> None:
        killed.signal(signal.SIGSTOP)
        until(lambda: killed.stopped_s is not None, "every drive has stopped")
        killed.signal(signal.SIGKILL)

    def test_it_does_not_end_while_a_drive_is_enabled_and_ends_after_a_stop(self, patient: Killed) -> None:
        for attempt in (1, 2):
            patient.signal(signal.SIGTERM)
            until(lambda: len(journal(patient.config, "end refused")) == attempt or patient.is_over())  # noqa: B023
            assert not patient.is_over(), patient.gateway.last_words()
        reason = journal(patient.config, "end refused")[0]["reason"]
        assert "left_hip is enabled" in reason
        assert "gwrms stop" in reason
        assert power_states(patient.robot) == {ENABLED}
        patient.client.call("robot.stop", reason="end of the day")
        until(lambda: ENABLED not in power_states(patient.robot), "stopped")
        patient.signal(signal.SIGTERM)
        until(patient.is_over, "ended")
        assert entries(patient.robot) == {0}
        assert "the gateway does not end: left_hip is enabled" in patient.gateway.last_words()
