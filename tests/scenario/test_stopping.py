"""The stop on a whole simulated robot: against its controller, over crashes and restarts, and up again."""

import os
import signal
import struct
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import can
import pytest
from msgspec.structs import replace

from drivers.joint import power
from gateway.config import RobotConfig, load
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from hil_sim.controller import ControllerState
from hil_sim.drive import objects as od
from hil_sim.drive.power_state import PowerState
from hil_sim.exoskeleton import JOINTS
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.robot import SimulatedRobot
from server_gui.processes.children import ChildFailed
from tests.scenario.patience import patient
from tests.scenario.processes import Bench, gwrms
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import Client, serving

ENABLED = PowerState.OPERATION_ENABLED
MASTER = (
    ('role = "observer"', 'role = "master"'),
    ('interface = "virtual"', 'interface = "virtual"\nsync_period_s = 0.01'),
)


def edit(file: Path, *changes: tuple[str, str]) -> Path:
    """Change a robot's file; every change must apply."""
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    file.write_text(text, encoding="utf-8")
    return file


def waits(file: Path, hasty: Collection[str] = ()) -> RobotConfig:
    """What the file says, but that a stop is answered only when every drive has said what became of it."""
    config = load(patient(file, hasty))
    return replace(config, stop=replace(config.stop, timeout_s=WAIT_S))


@pytest.fixture(autouse=True)
def power_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """However busy the computer is, nothing else ends the way up or down."""
    monkeypatch.setattr(power, "TRANSITION_S", WAIT_S)
    monkeypatch.setattr(power, "RESET_S", WAIT_S)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[SimulatedRobot]:
    with SimulatedRobot(tmp_path, virtual_channel=f"stopping {tmp_path.name}") as robot:
        yield robot


@pytest.fixture
def serve(robot: SimulatedRobot) -> Iterator[Callable[..., Client]]:
    """A gateway for the walking robot, its file changed so; those of `hasty` are not waited for as long."""
    with ExitStack() as stack:

        def start(*changes: tuple[str, str], hasty: Collection[str] = ()) -> Client:
            address = stack.enter_context(serving(waits(edit(robot.config, *changes), hasty)))
            client = stack.enter_context(Client(address))
            until(lambda: states(client) == {"ok"}, "every component is there")
            until(lambda: enabled(robot) == len(JOINTS), "the robot walks")
            return client

        yield start


def states(client: Client) -> set[str]:
    return {one["state"] for one in client.call("component.snapshot")["quality"].values()}


def enabled(robot: SimulatedRobot) -> int:
    """How many drives really are."""
    return sum(drive.power_state is ENABLED for drive in robot.exoskeleton.drives.values())


def entries(robot: SimulatedRobot) -> list[dict[str, Any]]:
    """The journal as it is on the disk, where an entry comes after the answer."""
    return read_verified(RecordsFolder(load(robot.config).records).journal)


def fallbacks(robot: SimulatedRobot) -> list[str]:
    return [one["drive"] for one in entries(robot) if one["what"] == "stop fallback"]


def start_controller(robot: SimulatedRobot, tmp_path: Path) -> None:
    """Somebody writes 1 to the controller's start object, as a technician's tool would."""
    with can.Bus(interface="virtual", channel=f"stopping {tmp_path.name}") as third:
        third.send(
            can.Message(arbitration_id=0x610, data=bytes.fromhex("2f00200001000000"), is_extended_id=False)
        )


def set_option(robot: SimulatedRobot, key: tuple[int, int], value: int) -> None:
    for drive in robot.exoskeleton.drives.values():
        drive.dictionary[key].value = value


def test_a_stop_goes_to_the_controller_too_and_it_confirms(
    robot: SimulatedRobot, serve: Callable[..., Client]
) -> None:
    client = serve()
    answer = client.call("robot.stop", reason="scenario")
    assert answer["drives"] == dict.fromkeys(JOINTS, "confirmed")
    assert answer["controllers"] == {"gait": "confirmed"}
    assert (answer["held"], answer["fallbacks"], answer["problem"]) == (True, {}, None)
    assert enabled(robot) == 0
    assert robot.exoskeleton.controller.controller_state is ControllerState.HELD
    told = ["stop", "stop answered"]
    until(
        lambda: [one["what"] for one in entries(robot) if one["what"] in told] == told, lambda: entries(robot)
    )


@pytest.mark.parametrize("option", [5, 6])
def test_a_drive_that_the_controller_enables_again_is_stopped_again_and_it_is_said(
    robot: SimulatedRobot, serve: Callable[..., Client], tmp_path: Path, option: int
) -> None:
    """Also where 605Ah lets a drive stay in quick stop active, from where "enable operation" is one step."""
    client = serve()
    set_option(robot, od.QUICK_STOP_OPTION, option)
    client.call("robot.stop", reason="scenario")

    def again() -> bool:
        start_controller(robot, tmp_path)
        return any(client.call("robot.describe")["stop"]["stopped_again"].values())

    until(again, "a drive was enabled and stopped again")
    until(lambda: enabled(robot) == 0, "no drive is left enabled")
    until(lambda: robot.exoskeleton.controller.controller_state is ControllerState.HELD, "nor its controller")
    until(lambda: "stopped again" in [one["what"] for one in entries(robot)], "the journal says so")


def test_a_held_stop_outlives_its_client_and_ends_with_a_reset(
    robot: SimulatedRobot, serve: Callable[..., Client], tmp_path: Path
) -> None:
    client = serve(("linger_s = 5", "linger_s = 0.1"))
    client.call("robot.stop", reason="scenario")
    assert client.refused("robot.reset").kind == "no_lease"
    client.call("control.acquire", ttl_s=60)
    assert client.refused("robot.enable").kind == "not_allowed"
    answer = client.call("robot.reset")
    assert answer == {"drives": dict.fromkeys(JOINTS, "switch on disabled"), "problems": {}, "held": False}
    assert not RecordsFolder(load(robot.config).records).hold.exists()
    start_controller(robot, tmp_path)
    until(lambda: enabled(robot) == len(JOINTS), "its controller may enable them again, and nobody stops it")
    assert client.call("robot.describe")["stop"]["held"] is False


def test_a_reset_of_a_walking_robot_brings_it_to_rest_before_the_current_goes(
    robot: SimulatedRobot, serve: Callable[..., Client]
) -> None:
    client = serve()
    set_option(robot, od.QUICK_STOP_OPTION, 6)
    knee = robot.exoskeleton.drives["left_knee"]
    gone_at: list[float] = []
    changed = knee.power._changed

    def watch(before: PowerState) -> None:
        if knee.power_state is PowerState.SWITCH_ON_DISABLED:
            gone_at.append(abs(knee.joint.velocity))
        changed(before)

    knee.power._changed = watch
    client.call("control.acquire", ttl_s=60)
    assert client.call("robot.reset")["problems"] == {}
    assert enabled(robot) == 0
    assert gone_at
    assert max(gone_at) < 0.1


def test_a_fault_is_reset_and_one_that_stays_is_told_and_known_not_to_move(
    robot: SimulatedRobot, serve: Callable[..., Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(power, "RESET_S", 3.0)
    client = serve()
    left, right = robot.exoskeleton.drives["left_knee"], robot.exoskeleton.drives["right_knee"]
    left.fault(0x7300)
    right.supply_v = 10.0  # undervoltage: it stays
    until(lambda: {left.power_state, right.power_state} == {PowerState.FAULT}, "both are in fault")
    client.call("robot.stop", reason="scenario")
    client.call("control.acquire", ttl_s=60)
    answer = client.call("robot.reset")
    assert answer["drives"]["left_knee"] == "switch on disabled"
    assert answer["drives"]["right_knee"] == "fault"
    assert list(answer["problems"]) == ["right_knee"]
    assert answer["held"] is False


def test_a_drive_out_of_reach_keeps_the_stop_held(
    robot: SimulatedRobot, serve: Callable[..., Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(power, "RESET_S", 3.0)
    client = serve(hasty=["left_knee"])
    robot.exoskeleton.drives["left_knee"].power_off()
    answer = client.call("robot.stop", reason="scenario")
    assert answer["drives"]["left_knee"] == "unreachable"
    client.call("control.acquire", ttl_s=60)
    answer = client.call("robot.reset")
    assert answer["drives"]["left_knee"] == "unknown"
    assert list(answer["problems"]) == ["left_knee"]
    assert answer["held"] is True
    assert client.call("robot.describe")["stop"]["held"] is True
    robot.exoskeleton.drives["left_knee"].power_on()
    until(lambda: client.call("robot.reset")["held"] is False, "it is back, and at rest")


def test_a_fallback_follows_only_where_the_quick_stop_is_not_confirmed(
    robot: SimulatedRobot, serve: Callable[..., Client]
) -> None:
    client = serve(("fallback = []", 'fallback = ["disable_voltage", "nmt_stop"]'), hasty=["left_knee"])
    knee = robot.exoskeleton.drives["left_knee"]
    take = knee.dictionary[od.CONTROLWORD].on_write
    assert take is not None

    def deaf_to_quick_stop(value: Any) -> None:
        if value == 0x0002:
            raise SdoAbort(AbortCode.WRONG_STATE)
        take(value)

    knee.dictionary[od.CONTROLWORD].on_write = deaf_to_quick_stop
    answer = client.call("robot.stop", reason="scenario")
    assert answer["drives"] == dict.fromkeys(JOINTS, "confirmed")
    assert list(answer["fallbacks"]) == ["left_knee"]
    assert "the joint is limp" in answer["fallbacks"]["left_knee"]
    assert knee.power_state is PowerState.SWITCH_ON_DISABLED
    until(lambda: fallbacks(robot) == ["left_knee"], "the journal says so")


def test_an_nmt_stop_that_the_drive_acts_on_never_counts_as_confirmed(
    robot: SimulatedRobot, serve: Callable[..., Client]
) -> None:
    client = serve(("fallback = []", 'fallback = ["nmt_stop"]'), hasty=["left_knee"])
    knee = robot.exoskeleton.drives["left_knee"]

    def deaf(_value: Any) -> None:
        raise SdoAbort(AbortCode.WRONG_STATE)

    knee.dictionary[od.CONTROLWORD].on_write = deaf
    answer = client.call("robot.stop", reason="scenario")
    assert answer["drives"]["left_knee"] == "unconfirmed"
    assert list(answer["fallbacks"]) == ["left_knee"]
    assert "NMT stop was sent" in answer["fallbacks"]["left_knee"]
    until(lambda: knee.power_state is not ENABLED, "as its 6007h (3, quick stop) says")


class TestMaster:
    """As the master of a bench, whose gait controller is silent."""

    @pytest.fixture
    def client(self, robot: SimulatedRobot, tmp_path: Path) -> Iterator[Client]:
        until(lambda: enabled(robot) == len(JOINTS), "the robot walks")
        with can.Bus(interface="virtual", channel=f"stopping {tmp_path.name}") as third:
            nmt_stop = can.Message(arbitration_id=0, data=bytes([2, 16]), is_extended_id=False)
            third.send(nmt_stop)
        with serving(waits(edit(robot.config, *MASTER), ["gait"])) as address, Client(address) as client:
            until(lambda: all_seen(client), "every drive is there")
            client.call("control.acquire", ttl_s=60)
            yield client

    def test_a_robot_is_reset_and_enabled_one_transition_at_a_time_and_a_stop_overtakes_the_next_way_up(
        self, robot: SimulatedRobot, client: Client
    ) -> None:
        assert client.call("robot.reset")["drives"] == dict.fromkeys(JOINTS, "switch on disabled")
        seen: dict[str, list[PowerState]] = {name: [] for name in JOINTS}
        for name, drive in robot.exoskeleton.drives.items():
            watch_states(drive, seen[name])
        before = {name: drive.joint.position for name, drive in robot.exoskeleton.drives.items()}
        answer = client.call("robot.enable")
        assert answer == {
            "drives": dict.fromkeys(JOINTS, "operation enabled"),
            "problems": {},
            "modes": dict.fromkeys(JOINTS, "cyclic synchronous position"),
        }
        way = [PowerState.READY_TO_SWITCH_ON, PowerState.SWITCHED_ON, ENABLED]
        assert all(states == way for states in seen.values())
        since = robot.exoskeleton.clock.now_s
        until(lambda: robot.exoskeleton.clock.now_s > since + 0.5, "it stands a while")
        after = {name: drive.joint.position for name, drive in robot.exoskeleton.drives.items()}
        assert all(abs(after[name] - before[name]) < 0.02 for name in JOINTS)
        self.stop_overtakes_the_way_up(robot, client)
        assert client.refused("robot.enable").kind == "stopped"

    def stop_overtakes_the_way_up(self, robot: SimulatedRobot, client: Client) -> None:
        client.call("robot.reset")
        knee = robot.exoskeleton.drives["left_knee"]
        take = knee.dictionary[od.CONTROLWORD].on_write
        assert take is not None
        knee.dictionary[od.CONTROLWORD].on_write = lambda value: None if value == 0x0007 else take(value)
        enabling = client.request("robot.enable")
        until(
            lambda: (
                {drive.power_state for drive in robot.exoskeleton.drives.values()}
                == {PowerState.READY_TO_SWITCH_ON, PowerState.SWITCHED_ON}
            ),
            "under way",
        )
        assert client.call("robot.stop", reason="scenario")["held"] is True
        answer = client.answer(enabling)
        assert set(answer["problems"]) == set(JOINTS)
        assert enabled(robot) == 0
        # Where their confirmed quick stop has led them.
        assert set(answer["drives"].values()) == {"switch on disabled"}

    def test_a_stop_goes_by_an_rpdo_that_our_sync_lets_take_effect(
        self, robot: SimulatedRobot, client: Client, tmp_path: Path
    ) -> None:
        client.call("robot.reset")
        client.call("robot.enable", joints=["left_knee"])
        knee = robot.exoskeleton.drives["left_knee"]
        target = knee.dictionary[od.TARGET_POSITION].number()
        with can.Bus(interface="virtual", channel=f"stopping {tmp_path.name}") as third:
            client.call("robot.stop", reason="scenario")
            rpdos = frames(third, 0x200 + JOINTS["left_knee"])
        # Controlword 0002h; mode and target position as the drive has had them.
        assert rpdos[0] == struct.pack("<Hbi", 0x0002, 8, target)

    def test_one_drive_that_does_not_follow_stops_what_was_begun(
        self, robot: SimulatedRobot, client: Client, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        client.call("robot.reset")
        monkeypatch.setattr(power, "TRANSITION_S", 3.0)
        knee = robot.exoskeleton.drives["left_knee"]
        take = knee.dictionary[od.CONTROLWORD].on_write
        assert take is not None
        knee.dictionary[od.CONTROLWORD].on_write = lambda value: None if value == 0x000F else take(value)
        answer = client.call("robot.enable")
        assert "did not go from switched on to operation enabled" in answer["problems"]["left_knee"]
        assert "another drive was not led there" in answer["problems"]["right_hip"]
        assert set(answer["problems"]) == set(JOINTS)
        assert enabled(robot) == 0


def all_seen(client: Client) -> bool:
    quality = client.call("component.snapshot")["quality"]
    return all(quality[name]["state"] == "ok" for name in JOINTS)


def watch_states(drive: Any, seen: list[PowerState]) -> None:
    changed = drive.power._changed

    def watch(before: PowerState) -> None:
        seen.append(drive.power_state)
        changed(before)

    drive.power._changed = watch


def frames(bus: can.BusABC, can_id: int) -> list[bytes]:
    found = []
    while (message := bus.recv(timeout=0)) is not None:
        if message.arbitration_id == can_id:
            found.append(bytes(message.data))
    return found


class TestProcesses:
    """Over the ends of gateways, each a process of its own."""

    def journal(self, bench: Bench) -> list[dict[str, Any]]:
        return read_verified(RecordsFolder(load(bench.config).records).journal)

    def test_a_held_stop_goes_on_with_the_next_gateway_without_any_client(self, bench: Bench) -> None:
        assert gwrms("stop", "--robot", bench.address).returncode == 0
        os.kill(bench.gateway.pid, signal.SIGTERM)
        until(lambda: is_dead(bench))
        bench.start_gateway()
        until(lambda: self.said(bench, "stop still held"))
        config = load(bench.config)
        more = config.can["main"].more
        with can.Bus(interface="socketcand", channel="sim", host=more["host"], port=more["port"]) as third:
            start = can.Message(
                arbitration_id=0x610, data=bytes.fromhex("2f00200001000000"), is_extended_id=False
            )

            def again() -> bool:
                third.send(start)
                return self.said(bench, "stopped again")

            until(again)
        held = bench.ask("robot.describe")["stop"]
        assert held["held"] is True
        reset = gwrms("reset", "--robot", bench.address)
        assert "No stop is held." in reset.stdout, reset.stdout + reset.stderr
        assert reset.returncode == 0
        assert bench.ask("robot.describe")["stop"]["held"] is False

    def test_a_gateway_killed_in_the_middle_of_a_stop_has_stopped_and_the_next_one_holds(
        self, bench: Bench
    ) -> None:
        """It takes back a trial, too, though nobody asks it for anything."""
        folder = RecordsFolder(load(bench.config).records)
        before = cycle_time(bench)
        with Client(("127.0.0.1", bench.port)) as client:
            client.call("control.acquire", ttl_s=300)
            client.call("parameter.write", changes={"gait.cycle_time": 1.25}, trial_s=250)
            client.request("robot.stop", reason="and killed")
            until(folder.hold.exists)
            bench.kill(bench.gateway)
        assert folder.undo.exists()
        bench.start_gateway()
        until(lambda: not folder.undo.exists())
        assert cycle_time(bench) == before
        until(lambda: self.said(bench, "taken back"))
        until(lambda: self.said(bench, "stop still held"))
        until(lambda: not any(state == 4 for state in drive_states(bench)))
        assert bench.ask("robot.describe")["stop"]["reason"] == "and killed"

    def said(self, bench: Bench, what: str) -> bool:
        with suppress(FileNotFoundError):  # the one before was killed before it had written any
            return what in [one["what"] for one in self.journal(bench)]
        return False


def is_dead(bench: Bench) -> bool:
    try:
        bench.gateway.check()
    except ChildFailed:
        return True
    return False


def cycle_time(bench: Bench) -> float | None:
    read = bench.ask("parameter.read", names=["gait.cycle_time"])
    found: float | None = read["values"]["gait.cycle_time"]["value"]
    return found


def drive_states(bench: Bench) -> list[float | None]:
    return list(bench.ask("component.snapshot", channels=["*.state"])["values"].values())
