"""What is drawn around a fault: the alarm's own signal first, and what explains it, of what the robot has."""

import pytest
from msgspec.structs import replace

from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Description
from server_gui.core.alarms.explaining_signals import explaining_signals
from tests.support.desk import UNITS, described

KNEE = "left_knee"


def having(**units: str) -> Description:
    """The robot, whose left knee has these quantities more."""
    known = described().description
    more = [ChannelInfo(f"{KNEE}.{name}", unit, KNEE, name) for name, unit in units.items()]
    return replace(known, channels=[*known.channels, *more])


@pytest.mark.parametrize(
    ("own", "others"),
    [
        ("current", ["torque", "position", "velocity"]),
        ("temperature", ["current", "torque", "position"]),
        ("position", ["current", "torque", "velocity"]),
    ],
)
def test_a_drive_is_explained_by_four_of_its_plots_the_alarms_own_first(own: str, others: list[str]) -> None:
    assert explaining_signals(having(), f"{KNEE}.{own}") == [f"{KNEE}.{name}" for name in (own, *others)]


def test_a_position_has_its_target_beside_it_as_a_channel_or_computed() -> None:
    told = explaining_signals(having(target_position="rad", following_error="rad"), f"{KNEE}.current")
    assert f"{KNEE}.target_position" in told
    assert not [text for text in told if "=" in text]
    computed = explaining_signals(having(following_error="rad"), f"{KNEE}.current")
    assert computed[-1] == f"target = {KNEE}.position + {KNEE}.following_error"


def test_only_what_the_robot_has_is_drawn() -> None:
    known = described().description
    few = [one for one in known.channels if one.name in (f"{KNEE}.position", f"{KNEE}.state")]
    assert explaining_signals(replace(known, channels=few), f"{KNEE}.position") == [f"{KNEE}.position"]
    assert explaining_signals(None, f"{KNEE}.position") == [f"{KNEE}.position"]


def test_a_sensor_is_explained_by_its_own_channels_and_by_no_states() -> None:
    told = explaining_signals(described(cells=2).description, "left_insole.cell_1")
    assert told == ["left_insole.cell_1", "left_insole.force", "left_insole.cell_0"]


def test_a_sensor_of_many_units_has_no_more_plots_than_a_drive() -> None:
    known = described().description
    units = [*UNITS.values(), "m"]
    many = [ChannelInfo(f"trunk.{place}", unit, "trunk", str(place)) for place, unit in enumerate(units)]
    assert len(explaining_signals(replace(known, channels=many), "trunk.5")) == 4
