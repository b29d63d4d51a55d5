"""How to go on after a stop, as the robot's gateway may: an observer enables nothing."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from gateway.wire.stop import Reset
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.overload import ALSO, THEIRS, load_first
from server_gui.core.alarms.simulated import FAULTS, NO_WIRES, advised, without_wires
from server_gui.core.alarms.stop_alarms import go_on
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.resetting import after_reset
from server_gui.core.follow.events import Described
from server_gui.core.follow.robot import Robot
from server_gui.processes.sim_control import start_command
from tests.support.desk import Bench, described

BUS = "check termination, wiring and bitrate"


@pytest.mark.parametrize("kind", [Kind.RESET, Kind.STOPPED])
def test_an_observer_s_user_is_told_to_start_the_controller(kind: Kind) -> None:
    said = check_of(kind, role="observer")
    assert "start the robot's controller again" in said
    assert "gwrms enable" not in said
    assert "gwrms enable" in check_of(kind, role="master")


@pytest.mark.parametrize("kind", [Kind.RESET, Kind.STOPPED])
def test_what_starts_a_simulator_is_said_only_where_it_is_known_and_then_with_its_folder(kind: Kind) -> None:
    """It named a button that only the demo has, and a folder DIR."""
    station = Bench(Desk()).add("exo-01")
    known = described().description
    parts = [replace(one, device={"node_id": 2, "vendor": "GWRMS"}) for one in known.components]
    station.take([Described(replace(known, components=parts, role="observer"))])
    for absent in ("sim-fault", "Start walking", "DIR"):
        assert absent not in go_on(kind, station.robot)
    station.robot.start_by = f"Start walking, or {start_command(Path('/tmp/my demo'))}"
    said = "(Start walking, or gwrms sim-fault --dir '/tmp/my demo' --controller start)"
    assert said in go_on(kind, station.robot)


def test_a_simulated_bus_blames_no_wiring_and_a_real_one_does() -> None:
    alarm = Alarm(Kind.BUS, "bus.main", "many errors", check=BUS)
    for vendor, check in (("maxon motor ag", alarm.check), ("GWRMS", NO_WIRES)):
        robot, known = Robot(), described().description
        parts = [replace(one, device={"vendor": vendor}) for one in known.components]
        robot.apply(Described(replace(known, components=parts)))
        (one,) = without_wires([alarm], robot)
        assert one.check == check


@pytest.mark.parametrize("kind", [Kind.PART_STALE, Kind.LOST])
def test_no_simulated_part_has_a_cable_and_of_one_alone_a_load_is_looked_at_last(kind: Kind) -> None:
    robot, known = Robot(), described().description
    parts = [replace(one, device={"vendor": "GWRMS"}) for one in known.components]
    alarm = Alarm(kind, "left_knee", "no heartbeat", check="check the node's power and cable")
    (one,) = without_wires([alarm], robot)
    assert one.check == alarm.check, "nobody knows that it is simulated"
    robot.apply(Described(replace(known, components=parts)))
    (one,) = without_wires([alarm], robot)
    assert one.check == NO_WIRES
    (alone,) = load_first([one], (THEIRS,), 10)
    assert alone.check == f"{FAULTS}{ALSO}{THEIRS.replace(' first', '')}"
    assert next(load_first([one], (THEIRS,), 2)).check == f"{THEIRS}; then {FAULTS}", "half of all"
    gone = Alarm(kind, "left_knee", "/dev/pts/3 does not exist", check="plug the device in")
    assert next(without_wires([gone], robot)).check == gone.check


def test_an_overloaded_computer_is_named_once() -> None:
    alarm = Alarm(
        Kind.BUS, "bus.main", "20 % of its PDOs are missing; the robot's computer is overloaded", check=BUS
    )
    assert [one.check for one in load_first([alarm], (THEIRS,), 10)] == [BUS]


def test_of_a_simulated_robot_only_the_wiring_is_left_out_of_what_to_check() -> None:
    said = f"see that the gateway runs; {BUS}; see the manual"
    assert advised(said, simulated=False) == said
    assert advised(said, simulated=True) == f"see that the gateway runs; {NO_WIRES}; see the manual"


def test_of_a_bus_an_overloaded_computer_is_checked_before_the_wiring() -> None:
    alarm = Alarm(Kind.BUS, "bus.main", "many errors", check=BUS)
    (one,) = load_first([alarm], (THEIRS,), 10)
    assert one.check == f"{THEIRS}; then {alarm.check}"


def test_the_answer_to_a_reset_says_so_too() -> None:
    reset = Reset({"left_knee": "switch on disabled"}, {}, held=False)
    said, stays = after_reset(reset, check_of(Kind.RESET, role="observer"))
    assert "controller again" in said
    assert not stays
