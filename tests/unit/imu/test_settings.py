"""`[imu.NAME]` in the robot's file: by what it says, an IMU on a port, on a bus, or a node of it."""

from pathlib import Path

import pytest

from drivers.imu.can_device import CanImu
from drivers.imu.device import Imu
from drivers.imu.inclinometer import Inclinometer
from gateway import config as configs
from gateway.modules.component.assembly import assemble

BUS = '[robot]\nname = "x"\n[can.main]\ninterface = "virtual"\nchannel = "imu settings"\n[imu.trunk]\n'
JOINT = """
[joint.left_knee]
bus = "main"
node_id = 20
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
"""


def load(folder: Path, text: str) -> configs.RobotConfig:
    path = folder / "robot.toml"
    path.write_text(BUS + text)
    return configs.load(path)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('port = "/dev/ttyUSB0"', Imu),
        ('port = "/dev/ttyUSB0"\nformat = "xsens"', Imu),
        ('bus = "main"\nformat = "witmotion-can"\ncan_id = 0x50', CanImu),
        ('bus = "main"\ncan_id = 0x50\naxes = ["y", "-x", "z"]', CanImu),
        ('bus = "main"\nformat = "cia410"\nnode_id = 20', Inclinometer),
        ('bus = "main"\nnode_id = 20\ndirections = [1, -1]', Inclinometer),
    ],
)
def test_each_table_builds_its_component(
    tmp_path: Path, text: str, kind: type[Imu | CanImu | Inclinometer]
) -> None:
    robot = assemble(load(tmp_path, text))
    assert robot.absent == {}
    assert type(robot.components["trunk"]) is kind
    assert [channel.name for channel in robot.components["trunk"].channels][:2] == [
        "trunk.tilt_forward",
        "trunk.tilt_side",
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('bus = "main"\nformat = "cia410"', "[imu.trunk] lacks the key 'node_id'"),
        ('bus = "main"\nformat = "witmotion-can"', "[imu.trunk] lacks the key 'can_id'"),
        ('format = "witmotion"', "[imu.trunk] lacks the key 'port'"),
        ('format = []\nport = "x"', "[imu.trunk] format must"),
        ('bus = "mian"\nnode_id = 20', "[imu.trunk] bus: there is no bus 'mian'"),
        ('bus = "mian"\ncan_id = 80', "[imu.trunk] bus: there is no bus 'mian'"),
        ('bus = "main"\nnode_id = 20\nport = "x"', "unknown key 'port'"),
        (
            'bus = "main"\nnode_id = 20' + JOINT,
            "[imu.trunk] node_id: 20 on bus 'main' belongs to [joint.left_",
        ),
        ('bus = "main"\nnode_id = 20\ndirections = [1, 2]', "[imu.trunk] directions[1] 2"),
    ],
)
def test_a_table_that_cannot_work_is_named(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(configs.ConfigError) as refused:
        load(tmp_path, text)
    assert says in str(refused.value)
