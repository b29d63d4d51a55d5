"""`gwrms describe` says of a controller that is held that somebody must start it."""

import msgspec
import pytest

from gateway.cli.describe import held, holding_channels
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
