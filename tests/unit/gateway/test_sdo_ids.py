"""An SDO channel that could be taken for something else on its bus is refused, with table, key and remedy."""

from pathlib import Path

import pytest

from gateway.config import ConfigError
from tests.unit.gateway.harness import HEAD, config

JOINT = """
[joint.{name}]
bus = "{bus}"
node_id = {node_id}
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
axis = {axis}
"""
OTHER_BUS = '[can.other]\ninterface = "virtual"\nchannel = "other"\n'


def joint(name: str, node_id: int, ids: str | None = None, *, bus: str = "main", axis: int = 0) -> str:
    table = JOINT.format(name=name, node_id=node_id, bus=bus, axis=axis)
    return table if ids is None else f"{table}sdo_cob_ids = {ids}\n"


@pytest.mark.parametrize(
    "ids",
    [
        "[0x680, 0x6DF]",
        "[0x605, 0x585]",  # its own default channel
        "[0x605, 0x681]",
        "[0x600, 0x580]",  # of node 0, which is nobody
        "[0x186, 0x486]",  # PDOs of a node that is not there
        "[0x10000605, 0x10000585]",  # extended ones
        "[0x800, 0x1FFFFFFF]",
    ],
)
def test_identifiers_that_nobody_uses_are_a_channel(tmp_path: Path, ids: str) -> None:
    robot = config(tmp_path, HEAD + joint("knee", 5, ids) + joint("hip", 2))
    assert robot.joint["knee"].sdo_cob_ids is not None


@pytest.mark.parametrize(
    ("ids", "says"),
    [
        ("[0x680, 0x680]", "request and response are both 0x680"),
        ("[0x602, 0x585]", "the request 0x602 is the default SDO request of node 2"),
        ("[0x605, 0x582]", "the response 0x582 is the default SDO response of node 2"),
        ("[0x641, 0x5C1]", "the request 0x641 is the default SDO request of node 65"),
        ("[0x585, 0x605]", "the request 0x585 is the default SDO response of node 5"),
        ("[0x605, 0x605]", "request and response are both 0x605"),
        ("[0x001, 0x585]", "the request 0x1 is reserved by CiA 301"),
        ("[0x07F, 0x585]", "the request 0x7F is reserved by CiA 301"),
        ("[0x080, 0x585]", "the request 0x80 is SYNC's"),
        ("[0x605, 0x081]", "the response 0x81 is one of emergency messages (EMCY)"),
        ("[0x605, 0x0FF]", "the response 0xFF is one of emergency messages (EMCY)"),
        ("[0x605, 0x100]", "the response 0x100 is TIME's"),
        ("[0x101, 0x585]", "the request 0x101 is reserved by CiA 301"),
        ("[0x180, 0x585]", "the request 0x180 is reserved by CiA 301"),
        ("[0x605, 0x182]", "the response 0x182 is TPDO1 of [joint.hip]"),
        ("[0x202, 0x585]", "the request 0x202 is RPDO1 of [joint.hip]"),
        ("[0x605, 0x485]", "the response 0x485 is TPDO4 of [joint.knee]"),
        ("[0x605, 0x502]", "the response 0x502 is RPDO4 of [joint.hip]"),
        ("[0x605, 0x5FF]", "the response 0x5FF is the default SDO response of node 127"),
        ("[0x67F, 0x585]", "the request 0x67F is the default SDO request of node 127"),
        ("[0x6E0, 0x585]", "the request 0x6E0 is reserved by CiA 301"),
        ("[0x6FF, 0x585]", "the request 0x6FF is reserved by CiA 301"),
        ("[0x605, 0x702]", "the response 0x702 is the heartbeat of node 2"),
        ("[0x605, 0x77F]", "the response 0x77F is the heartbeat of node 127"),
        ("[0x605, 0x780]", "the response 0x780 is reserved by CiA 301"),
        ("[0x605, 0x7FF]", "the response 0x7FF is reserved by CiA 301"),
        ("[0, 0x585]", "must be a whole number, at least 1"),
        ("[0x605, 0x20000000]", "must be a whole number, at most 536870911"),
    ],
)
def test_what_has_a_meaning_already_is_refused(tmp_path: Path, ids: str, says: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config(tmp_path, HEAD + joint("hip", 2) + joint("knee", 5, ids))
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: [joint.knee] sdo_cob_ids")
    assert says in str(caught.value)
    assert "such as one from 0x680 to 0x6DF" in str(caught.value) or "must be" in says


@pytest.mark.parametrize(
    ("ids", "says"),
    [
        ("[0x680, 0x6A0]", "the request 0x680 is used by [joint.hip]"),
        ("[0x6A0, 0x681]", "the response 0x681 is used by [joint.hip]"),
        ("[0x681, 0x6A0]", "the request 0x681 is used by [joint.hip]"),  # the other's response
        ("[0x6A0, 0x6C0]", "the response 0x6C0 is used by [imu.trunk]"),
        ("[0x6A0, 0x6C1]", "the response 0x6C1 is used by [control_loop]"),
    ],
)
def test_what_somebody_else_uses_is_refused(tmp_path: Path, ids: str, says: str) -> None:
    others = joint("hip", 2, "[0x680, 0x681]") + '[imu.trunk]\nbus = "main"\ncan_id = 0x6C0\n'
    others += '[control_loop]\nprocesses = ["loop"]\nbus = "main"\nperiod_ms = 10\ncan_id = 0x6C1\n'
    with pytest.raises(ConfigError) as caught:
        config(tmp_path, HEAD + others + joint("knee", 5, ids))
    assert f"[joint.knee] sdo_cob_ids: {says}" in str(caught.value)
    config(tmp_path, HEAD + OTHER_BUS + others + joint("knee", 5, ids, bus="other"))


def test_an_extended_identifier_that_somebody_else_uses_is_refused(tmp_path: Path) -> None:
    gait = '[device.gait]\nbus = "main"\nnode_id = 16\neds = "gait_controller.eds"\n'
    gait += "sdo_cob_ids = [0x12345, 0x12346]\n"
    with pytest.raises(ConfigError, match=r"\[device.gait\] .* 0x12345 is used by \[joint.knee\]"):
        config(tmp_path, HEAD + joint("knee", 5, "[0x12345, 0x680]") + gait)


def test_the_axes_of_one_node_say_the_same_channel(tmp_path: Path) -> None:
    ids = "[0x680, 0x681]"
    config(tmp_path, HEAD + joint("knee", 5, ids) + joint("hip", 5, ids, axis=1))
    for one, other in ((ids, None), (None, ids), (ids, "[0x682, 0x683]")):
        with pytest.raises(ConfigError, match=r"\[joint.hip\] sdo_cob_ids: .* say what \[joint.knee\] says"):
            config(tmp_path, HEAD + joint("knee", 5, one) + joint("hip", 5, other, axis=1))
