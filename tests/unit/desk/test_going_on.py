"""How to go on after a stop, as the robot's gateway may: an observer enables nothing."""

import pytest

from gateway.wire.stop import Reset
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.desk.resetting import after_reset


@pytest.mark.parametrize("kind", [Kind.RESET, Kind.STOPPED])
def test_an_observer_s_user_is_told_to_start_the_controller(kind: Kind) -> None:
    said = check_of(kind, role="observer")
    assert "start the robot's controller again" in said
    assert "Start walking" in said
    assert "gwrms sim-fault --dir DIR --controller start" in said
    assert "gwrms enable" not in said
    assert "gwrms enable" in check_of(kind, role="master")


def test_the_answer_to_a_reset_says_so_too() -> None:
    reset = Reset({"left_knee": "switch on disabled"}, {}, held=False)
    assert "controller again" in after_reset(reset, "observer")[0]
    assert "gwrms enable" in after_reset(reset, "master")[0]
