"""The robot's file of the attacked robot: eight armed drives, two insoles, an IMU and a few rules."""

from pathlib import Path

from hil_sim.sensors.suite import SensorChoice
from hil_sim.sensors.tables import companions, tables
from tests.bench._drives import DRIVES
from tests.unit.joint.conftest import drive_eds

OUR_NODE = 100
HEARTBEAT_MS = 100
ARMED_MS = 2.5 * HEARTBEAT_MS  # without a heartbeat for so long, the drives stop by themselves
FIRST_PARAMETER = 0x3000
PARAMETERS = 113  # of each drive
PARAMETER = "joint_1.gain"  # one that may be changed while the drive is enabled

SERVED = {
    (0x1016, 0): bytes([4]),
    **{(0x1016, at): bytes(4) for at in range(1, 5)},
    **{(FIRST_PARAMETER + at, 1): bytes(4) for at in range(PARAMETERS)},
}

HEAD = f"""
[robot]
name = "attacked"
[gateway]
port = 0
records = "records"
[can.main]
interface = "socketcand"
channel = "main"
host = "127.0.0.1"
port = {{port}}
node_id = {OUR_NODE}
[parameter."{PARAMETER}"]
object = "0x{FIRST_PARAMETER:04X}:1"
live = true
[guard]
heartbeat_ms = {HEARTBEAT_MS}
[guard.rule.limit]
watch = "joint_limit"
max = 10.0
clear_s = 0.001
actions = ["quick_stop"]
[guard.rule.emergency]
watch = "emcy"
[guard.rule.lost]
watch = "node_lost"
silent_s = 1.0
[guard.rule.foot]
watch = "insole_stale"
silent_s = 1.0
[guard.rule.upright]
watch = "tilt"
above = 1.2
[guard.rule.silence]
watch = "bus"
"""
JOINT = """
[joint.joint_{node_id}]
bus = "main"
node_id = {node_id}
eds = "drive.eds"
parameters = "eds"
counts_per_revolution = 4096
gear_ratio = 100
"""


def write(folder: Path, port: int, sensors: SensorChoice, objects: dict[tuple[int, int], bytes]) -> Path:
    """The file and all that it names; `port` is the bus's."""
    (folder / "drive.eds").write_text(drive_eds(objects), encoding="utf-8")
    for name, text in companions(sensors).items():
        (folder / name).write_text(text, encoding="utf-8")
    joints = "".join(JOINT.format(node_id=node_id) for node_id in range(1, DRIVES + 1))
    file = folder / "robot.toml"
    file.write_text(HEAD.format(port=port) + joints + tables(sensors, folder), encoding="utf-8")
    return file
