"""One value for several joints: signs, angles, other drives and narrower limits."""

import math

import pytest
from msgspec.structs import replace

from gateway.several_joints import Spread, all_joints, mirrored, other_side, spread, storing
from gateway.wire.component import AngleInfo, ComponentInfo
from gateway.wire.parameter import ParameterInfo, ParameterValue
from gateway.wire.robot import Description
from tests.support.desk import described

PER_COUNT = math.tau / (4096 * 100.0)


def parameter(name: str, address: str, **fields: object) -> ParameterInfo:
    base = ParameterInfo(
        name, "", None, None, None, True, None, name.partition(".")[0], address, "rw", True, type="INTEGER32"
    )
    return replace(base, **fields)


def robot(*parameters: ParameterInfo, right: AngleInfo | None = None) -> Description:
    """Two knees: the right one's counts fall when it bends."""
    right = right or AngleInfo(-PER_COUNT, 0.02)
    device: dict[str, str | int] = {"eds_digest": "5e"}
    components = [
        ComponentInfo("left_knee", "joint", "ok", device=device, angle=AngleInfo(PER_COUNT, -0.01)),
        ComponentInfo("right_knee", "joint", "ok", device=device, angle=right),
        ComponentInfo("trunk", "imu", "ok"),
    ]
    return replace(described().description, components=components, parameters=list(parameters))


def held(**values: float) -> dict[str, ParameterValue]:
    return {
        name.replace("__", "."): ParameterValue(value, "", None, None, 0) for name, value in values.items()
    }


def over(name: str, value: float, description: Description, **known: float) -> Spread:
    return spread(name, value, mirrored(name.partition(".")[0], description), description, held(**known))


def pair(address: str, **fields: object) -> tuple[ParameterInfo, ParameterInfo]:
    return parameter("left_knee.it", address, **fields), parameter("right_knee.it", address, **fields)


def test_sides_and_joints() -> None:
    assert other_side("left_knee") == "right_knee"
    assert other_side("right_hip") == "left_hip"
    assert (other_side("trunk"), other_side("left")) == (None, None)
    assert mirrored("left_knee", robot()) == ["left_knee", "right_knee"]
    assert mirrored("trunk", robot()) == ["trunk"]
    assert all_joints(robot()) == ["left_knee", "right_knee"]


@pytest.mark.parametrize("fields", [{"type": "UNSIGNED16"}, {"min": 8.0, "unit": "N·m", "scale": 0.04}])
def test_what_has_no_sign_is_copied_whichever_way_the_counts_run(fields: dict[str, object]) -> None:
    found = over("left_knee.it", 40, robot(*pair("0x6072:0", **fields)))
    assert (found.changes, found.problem) == ({"left_knee.it": 40, "right_knee.it": 40}, "")


def test_what_can_be_negative_is_copied_only_where_the_counts_run_alike() -> None:
    found = over("left_knee.it", -3, robot(*pair("0x2040:0")))
    assert found.changes == {"left_knee.it": -3}
    assert "nothing says whether its sign turns" in found.refused["right_knee"]
    alike = robot(*pair("0x2040:0"), right=AngleInfo(PER_COUNT, 0.0))
    assert over("left_knee.it", -3, alike).changes == {"left_knee.it": -3, "right_knee.it": -3}


def test_a_scale_that_turns_the_sign_back_makes_it_the_joints_own() -> None:
    left, right = pair("0x2040:0", unit="N·m", scale=0.1)
    description = robot(left, replace(right, scale=-0.1))
    assert over("left_knee.it", -3.0, description).changes["right_knee.it"] == -3.0


def test_a_limit_of_position_is_the_same_angle_of_the_other_joint() -> None:
    """By hand: 100000 counts at the left are 1.534 − 0.01 rad; at the right −PER_COUNT · counts + 0.02."""
    names = [
        parameter(f"{side}_knee.{end}", f"0x607D:{sub}")
        for side in ("left", "right")
        for end, sub in (("min_position", 1), ("max_position", 2))
    ]
    found = over("left_knee.max_position", 100_000, robot(*names))
    assert found.changes.keys() == {"left_knee.max_position", "right_knee.min_position"}
    counts = found.changes["right_knee.min_position"]
    assert -PER_COUNT * counts + 0.02 == pytest.approx(PER_COUNT * 100_000 - 0.01, abs=PER_COUNT)
    assert isinstance(counts, int)
    assert counts < 0


def test_a_limit_of_position_of_a_joint_whose_counts_nobody_explains_is_refused() -> None:
    description = robot(*pair("0x607D:1"))
    parts = [replace(one, angle=AngleInfo(0.0, 0.0)) for one in description.components]
    found = over("left_knee.it", 5, replace(description, components=parts))
    assert "which way" in found.refused["right_knee"]


def test_limits_of_torque_change_places_where_counts_run_the_other_way() -> None:
    names = [
        parameter(f"{side}_knee.{end}", address, type="UNSIGNED16")
        for side in ("left", "right")
        for end, address in (("positive", "0x60E0:0"), ("negative", "0x60E1:0"))
    ]
    assert over("left_knee.positive", 700, robot(*names)).changes == {
        "left_knee.positive": 700,
        "right_knee.negative": 700,
    }


def test_axes_of_one_drive_have_their_objects_800h_apart() -> None:
    left, right = pair("0x6072:0", type="UNSIGNED16")
    found = over(
        "left_knee.it", 7, robot(left, replace(right, name="right_knee.torque_2", object="0x6872:0"))
    )
    assert found.changes == {"left_knee.it": 7, "right_knee.torque_2": 7}


def test_a_home_offset_is_nobody_elses() -> None:
    assert "belongs to" in over("left_knee.it", 5, robot(*pair("0x607C:0"))).refused["right_knee"]


@pytest.mark.parametrize("address", ["0x607E:0", "0x687E:0", "0x6098:0", "0x6091:1"])
def test_what_makes_a_joints_counts_what_they_are_is_nobody_elses(address: str) -> None:
    """None of it is negative, and yet copied to the other side it would turn that joint round."""
    found = over("left_knee.it", 1, robot(*pair(address, type="UNSIGNED8", min=0)))
    assert list(found.changes) == ["left_knee.it"]
    assert "that drive" in found.refused["right_knee"]


@pytest.mark.parametrize(
    ("right", "why"),
    [
        (AngleInfo(-2 * PER_COUNT, 0.0), "a count is another angle there"),
        (AngleInfo(0.0, 0.0), "does not tell how much a count is"),
    ],
)
def test_counts_are_copied_only_where_they_are_as_much(right: AngleInfo, why: str) -> None:
    names = pair("0x6081:0", type="UNSIGNED32")
    assert over("left_knee.it", 9000, robot(*names)).changes["right_knee.it"] == 9000
    assert why in over("left_knee.it", 9000, robot(*names, right=right)).refused["right_knee"]
    told = pair("0x6081:0", type="UNSIGNED32", unit="rad/s")
    assert not over("left_knee.it", 2, robot(*told, right=right)).problem


@pytest.mark.parametrize(
    ("device", "is_copied"),
    [
        ({"eds_digest": "ab", "vendor": "A", "product": "X1"}, True),
        ({"eds_digest": "5e"}, True),
        ({"eds_digest": "ab", "vendor": "A", "product": "X2"}, False),
        ({"eds_digest": "ab", "vendor": "", "product": ""}, False),
        ({}, False),
    ],
)
def test_a_makers_own_object_is_copied_only_between_devices_of_one_kind(
    device: dict[str, str | int], *, is_copied: bool
) -> None:
    """2040h of one maker is a gain, and of the other what it likes."""
    description = robot(*pair("0x2040:0", type="UNSIGNED16"))
    known: dict[str, str | int] = {"eds_digest": "5e", "vendor": "A", "product": "X1"}
    left, right, trunk = description.components
    parts = [replace(left, device=known), replace(right, device=device), trunk]
    found = over("left_knee.it", 7, replace(description, components=parts))
    assert ("right_knee.it" in found.changes) is is_copied
    assert ("own object" in found.problem) is not is_copied


def test_another_drive_without_the_object_is_named_until_it_is_left_out() -> None:
    description = robot(parameter("left_knee.it", "0x6072:0", type="UNSIGNED16"))
    found = over("left_knee.it", 7, description)
    assert found.problem == "right_knee: it has no it (object 0x6072:0)"
    assert found.without(["right_knee"]) == Spread({"left_knee.it": 7}, {})


@pytest.mark.parametrize(
    ("there", "why"),
    [
        ({"max": 30.0}, "above the largest allowed there, 30"),
        ({"max_step": 5.0}, "take two steps"),
        ({"problem": "its drive is lost"}, "its drive is lost"),
        ({"read_only": "not released"}, "cannot be changed: not released"),
        ({"unit": "A"}, "is in A"),
        ({"object": "0x3001:0", "unit": ""}, "another object there"),
    ],
)
def test_a_joint_that_cannot_take_it_is_named_with_the_reason(there: dict[str, object], why: str) -> None:
    left, right = pair("0x6072:0", type="UNSIGNED16", unit="" if "object" in there else "N·m")
    found = over("left_knee.it", 40, robot(left, replace(right, **there)), right_knee__it=20.0)
    assert why in found.refused["right_knee"]
    assert list(found.changes) == ["left_knee.it"]


def test_a_robot_that_tells_nothing_of_it_is_not_written_to() -> None:
    assert "no parameter left_knee.gone" in over("left_knee.gone", 1, robot()).problem


def test_axes_of_one_device_are_stored_together_and_once() -> None:
    left, right = pair("0x6072:0")
    description = robot(left, right)
    place: dict[str, str | int] = {"bus": "main", "node_id": 5}
    parts = [replace(one, device=place) for one in description.components[:2]]
    assert list(storing(replace(description, components=parts))) == [("left_knee", "right_knee")]
    assert list(storing(description)) == [("left_knee",), ("right_knee",)]
