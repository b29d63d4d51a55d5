"""A robot as the terminal knows it, and what is drawn of it."""

import io

from rich.console import Console

from gateway.client import ConnectionState
from gateway.wire.component import ComponentInfo, Snapshot
from gateway.wire.parameter import ParameterInfo, ParameterValue, ParameterValues
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Described, LinkChanged, Looked
from server_gui.core.follow.news import News
from server_gui.core.follow.robot import Robot
from server_gui.terminal.controls import Controls
from server_gui.terminal.dashboard import draw
from tests.support.desk import FakeCommands


def parameter(
    name: str, low: float | None, high: float | None, largest: float | None = None
) -> ParameterInfo:
    return ParameterInfo(name, "m", low, high, largest, True, None, "gait", "0x2001:0", "rw", False)


def a_station(asked: FakeCommands | None = None) -> Station:
    """With a robot; answers come at once."""
    station = Station("exo-01", "127.0.0.1:7420", asked or FakeCommands(), lambda call: call(), News())
    station.robot = a_robot()
    return station


def a_robot(at_ns: int = 0) -> Robot:
    robot = Robot()
    robot.apply(LinkChanged(ConnectionState.CONNECTED, None, at_ns))
    parts = [("left_knee", "joint"), ("left_insole", "insole"), ("trunk", "imu"), ("gait", "device")]
    parameters = [parameter("gait.step_length", 0.2, 0.6, 0.1), parameter("gait.free", None, None)]
    robot.apply(
        Described(
            Description(
                robot="exo-01",
                boot_id="b",
                role="observer",
                components=[ComponentInfo(name, kind, "ok") for name, kind in parts],
                channels=[],
                parameters=parameters,
                modules={},
                clock=Clock(0, 0, "b"),
                stop=StopInfo(False, None, None, {}, {}),
                guard=GuardInfo(),
            )
        )
    )
    values = {
        "gait.step_length": ParameterValue(0.4, "m", 0.2, 0.6, 0),
        "gait.free": ParameterValue(1.0, "", None, None, 0),
    }
    robot.apply(Looked(Snapshot(0, {}, {}, {}), ParameterValues(values), at_ns))
    return robot


def screen(station: Station, controls: Controls | None = None, size: tuple[int, int] = (118, 27)) -> str:
    controls = controls or Controls(station)
    console = Console(width=size[0], height=size[1], file=io.StringIO(), record=True, force_terminal=True)
    console.print(draw(station, controls, "127.0.0.1:7420", size), height=size[1])
    return console.export_text()
