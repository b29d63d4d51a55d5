"""Several joints at once: one change, staged whole or not at all, with what each holds now."""

import pytest
from msgspec.structs import replace

from gateway.client import RemoteError
from gateway.units import Units
from gateway.wire.parameter import Written
from server_gui.core.follow.events import Described
from server_gui.core.tuning.several_joints import Offer, offers
from server_gui.core.tuning.writing import WriteState
from tests.support.desk import JOINTS, Bench, described, info, looked

TORQUES = {f"{joint}.max_torque": 80.0 for joint in JOINTS}


def offered(station_values: dict[str, float], name: str = "left_knee.max_torque") -> list[Offer]:
    description = described(parameters=station_values).description
    held = looked(station_values).parameters
    assert held is not None
    return offers(name, 60.0, description, held.values, Units())


def test_the_other_side_and_all_joints_are_offered_with_what_they_hold() -> None:
    other, every = offered({**TORQUES, "right_knee.max_torque": 70.0})
    assert other.title == "60 N·m for right knee, too"
    assert other.changes == {"left_knee.max_torque": 60.0, "right_knee.max_torque": 60.0}
    assert other.held == "left_knee.max_torque: 80 N·m\nright_knee.max_torque: 70 N·m"
    assert every.changes == dict.fromkeys(TORQUES, 60.0)


def test_where_one_joint_cannot_nothing_is_offered_but_by_word() -> None:
    known = {name: value for name, value in TORQUES.items() if name != "right_ankle.max_torque"}
    every, without = offered(known)[1:]
    assert every.changes == {}
    assert "right_ankle: it has no max_torque" in every.problem
    assert without.title.endswith("without right_ankle")
    assert without.changes == dict.fromkeys(known, 60.0)


def test_a_parameter_of_no_joint_has_nothing_to_offer() -> None:
    assert offered(TORQUES | {"gait.step_length": 0.4}, "gait.step_length") == []


@pytest.fixture
def knees(bench: Bench) -> Bench:
    """Both knees' torques are staged."""
    described_ = described(parameters=TORQUES)
    bench.station.take([described_, looked(TORQUES)])
    for name in ("left_knee.max_torque", "right_knee.max_torque"):
        bench.station.edits.stage(name, 60.0, bench.station.robot.parameters.get(name))
    return bench


def test_it_is_one_write_on_trial_that_goes_back_whole(knees: Bench) -> None:
    station = knees.station
    station.write(station.difference(Units()), 20.0)
    asked = {"left_knee.max_torque": 60.0, "right_knee.max_torque": 60.0}
    assert knees.first.named("write") == [(asked, 20.0)]
    before = dict.fromkeys(asked, 80.0)
    knees.first.answer(Written(7, before, asked, trial_s=20.0))
    assert station.writing.trial is not None
    assert station.writing.trial.before == before
    station.end_trial()
    assert knees.first.named("revert") == [(7,)]


def test_a_joint_that_is_lost_before_the_write_takes_all_of_it_back(knees: Bench) -> None:
    station = knees.station
    station.write(station.difference(Units()))
    outcome = {"left_knee.max_torque": "taken back", "right_knee.max_torque": "it does not answer"}
    knees.first.fail(RemoteError(-32012, "rolled back", {"kind": "rolled_back", "outcome": outcome}))
    assert station.writing.state is WriteState.FAILED
    assert station.writing.rows == outcome
    assert set(station.edits.staged) == set(outcome), "the edits stay, to be tried again"


def test_a_joint_whose_limits_have_become_narrower_is_refused_in_the_review(knees: Bench) -> None:
    narrow = [
        replace(info(name), max=50.0) if name.startswith("right_knee") else info(name) for name in TORQUES
    ]
    description = replace(described(parameters=TORQUES).description, parameters=narrow)
    knees.station.take([Described(description)])
    problems = {change.name: change.problem for change in knees.station.difference(Units())}
    assert problems["left_knee.max_torque"] is None
    assert "above the largest allowed, 50" in (problems["right_knee.max_torque"] or "")
