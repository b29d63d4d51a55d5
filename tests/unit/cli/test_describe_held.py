"""`gwrms describe` says of a controller that is held that somebody must start it."""

from types import SimpleNamespace
from typing import cast

import msgspec
import pytest

from gateway.cli.describe import held
from gateway.client import Robot
from gateway.client.held_controllers import holding_channels
from gateway.config.robot import RobotConfig
from gateway.doctor.gathering import with_gateway
from gateway.doctor.observations import Computer, Observations, Samples
from gateway.doctor.rules.components import component
from gateway.doctor.verdicts import Finding
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Description
from gateway.wire.stop import StopInfo
from tests.support.terminal_robot import a_robot

STATE = ChannelInfo("gait.controller_state", "", "gait", "controller_state", {"3": "running", "4": "held"})


def robot(controller: str) -> Description:
    description = a_robot().description
    assert description is not None
    stop = StopInfo(False, None, None, {}, {}, controllers={controller: None})
    return msgspec.structs.replace(description, channels=[STATE], stop=stop)


@pytest.mark.parametrize(("value", "is_said"), [(4.0, True), (3.0, False), (None, False)])
def test_a_controller_that_is_held_is_told_with_what_starts_it(value: float | None, is_said: bool) -> None:
    """A joint was lost for five seconds, and the walk stood still for good: nothing said so."""
    said = "".join(held(robot("gait"), {STATE.name: value}))
    assert ("gait.controller_state is held" in said and "started again" in said) is is_said


def test_a_device_that_commands_no_drive_is_not_asked() -> None:
    assert holding_channels(robot("other")) == []


@pytest.mark.parametrize(("value", "reason"), [(4.0, "F12"), (4.0, None), (3.0, None)])
def test_the_doctor_finds_it_too_and_says_which_stop_holds_it(value: float, reason: str | None) -> None:
    described = robot("gait")
    stop = msgspec.structs.replace(described.stop, held=reason is not None, reason=reason)
    described = msgspec.structs.replace(described, stop=stop)
    asked = SimpleNamespace(
        describe=lambda: described,
        components=lambda *names: SimpleNamespace(values=dict.fromkeys(names, value)),
    )
    controllers, why = with_gateway.held(cast("Robot", asked))
    nothing = cast("RobotConfig", SimpleNamespace(can={}, joint={}, device={}, insole={}, imu={}))
    seen = Observations(nothing, {}, {}, {}, Samples(), Computer(), held=controllers, stop_held=why)
    found = [one for one in component(seen) if isinstance(one, Finding)]
    assert [one.about for one in found] == (["gait"] if value == 4.0 else [])
    for one in found:
        assert one.evidence[0] == "gait.controller_state = held"
        assert one.evidence[1:] == (("a stop is held: F12",) if reason else ())
        assert ("gwrms reset" in one.fixes[0].words) is (reason is not None)
