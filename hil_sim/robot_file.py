"""The robot's file that a gateway needs for the simulated robot, written as an example to learn from."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil_sim import personality, toml_text
from hil_sim.bus.hub import HOST
from hil_sim.drive.drive import JointDrive
from hil_sim.exoskeleton import CONTROLLER, CONTROLLER_EDS, CONTROLLER_NODE, DRIVE_EDS, Exoskeleton
from hil_sim.mounting import Mounting
from hil_sim.sensors.tables import tables

CHANNEL = "sim"

_HEAD = """\
# The simulated exoskeleton, described for its gateway:  gwrms gateway {path}
# For a robot of your own, copy this file and change what is different. Quantities are SI: rad, m, s, N·m.

[robot]
name = "simulated-exo"          # how servers and journals call it

[gateway]
host = "127.0.0.1"              # who may reach the gateway: this machine alone
port = 7420                     # its TCP port
role = "observer"               # another controller leads the bus (here: `gait`); we send nothing unasked
linger_s = 5                    # seconds that a module stays awake after its last client
records = "records"             # folder beside this file: journal, held stop, writes to be taken back

{bus}
# Joints: flexion of hip and knee and dorsiflexion of the ankle count positive.
#   angle = direction · counts / (counts_per_revolution · gear_ratio) · 2π + zero_offset
"""

_HUB = """\
[can.main]                      # one CAN bus; its name is what `bus = …` below refers to
interface = "socketcand"        # python-can's name of the interface; "socketcan" for a real one
channel = "{channel}"                 # the bus at the hub; "can0" or the like for a real one
host = "{host}"              # the simulator's hub: it speaks only to this machine
port = {port}                    # stays the same when the simulator starts again in this folder
bitrate = 1000000               # bit/s: what the load of the bus is told by
tcp_tune = true                 # send each frame at once
"""

_VIRTUAL = """\
[can.main]                      # one CAN bus; its name is what `bus = …` below refers to
interface = "virtual"           # python-can's bus within one process
channel = "{channel}"
"""

_SOCKETCAN = """\
[can.main]                      # one CAN bus; its name is what `bus = …` below refers to
interface = "socketcan"         # Linux's own CAN interfaces
channel = "{channel}"               # as `ip link` calls it
"""

_OUR_NODE = """\
node_id = 100                   # ours, by which the guard's heartbeat is known
"""

_GUARD_NOTE = """
# The guard of the scenario.
"""

_FIRST_JOINT = """
[joint.{name}]
bus = "main"                    # the [can.…] table it is wired to
node_id = {node_id}                     # its CANopen node id (1–127)
eds = {eds:<25} # beside this file, or one that ships with GWRMS
counts_per_revolution = 4096    # of the encoder that 6064h counts, here the motor's
gear_ratio = 100.0              # motor revolutions per revolution of the joint
direction = {direction:<20}# −1 where counts fall when the joint bends
zero_offset = {zero:<18}# rad, the joint's angle where the drive counts 0
"""

_JOINT = """
[joint.{name}]
bus = "main"
node_id = {node_id}
eds = {eds}
counts_per_revolution = 4096
gear_ratio = 100.0
direction = {direction}
zero_offset = {zero}
"""

_RATED = """\
rated_torque = 40.0             # N·m at the joint, where 6076h does not say it
rated_current = 5.0             # A, where 6075h does not
"""

_NOT_SIMULATED = """
# Not simulated, so nobody here knows them: {names}. gwrms docs wire-a-joint tells how to describe them.
"""

_ONE_SIDE = """
# This robot assists the {side} leg alone. The other one walks by itself: nobody knows its joints.
"""

_CONTROLLER_TABLE = """
[device.{controller}]                   # any other CANopen device that has parameters
bus = "main"
node_id = {controller_node}
eds = "{controller_eds}"

[channel."{controller}.phase"]          # an object of a device or joint that is shown, recorded and watched
object = "0x2011:0"             # index and sub-index; read by PDO where one brings it, else by SDO
scale = 0.001                   # value = device's number · scale + offset, in `unit`
poll_hz = 10                    # how often it is asked for where no PDO brings it

[channel."{controller}.controller_state"]
object = "0x2010:0"
words = {{ 0 = "idle", 1 = "starting", 2 = "enabling", 3 = "running", 4 = "held" }}

[stop]                          # what a stop does beside the quick stop of every drive
timeout_s = 2.5                 # within which it is answered, whatever the drives do
fallback = []                   # what follows where a quick stop is not confirmed: "disable_voltage" (the
                                # joint goes limp under its wearer), and last "nmt_stop" (never confirmed)
[[stop.controller]]             # who commands the drives is stopped too: an object, and the value that does
component = "{controller}"
object = "0x2000:0"             # the gait controller's command: 0 stop, 1 start
value = 0
"""

_PARAMETERS_NOTE = """
# Parameters: what may be changed, within which limits. The name before the dot is the component it belongs
# to. The stricter of these limits and those of the EDS counts.
"""

_CONTROLLER_PARAMETERS = """
[parameter."gait.step_length"]  # heel to heel of the other foot: more makes the hips swing further
object = "0x2001:0"             # index and sub-index in the device's dictionary
unit = "m"
scale = 0.001                   # unit per device count: the device counts millimetres
min = 0.20
max = 0.60
max_step = 0.10                 # the most that one write may change it
live = true                     # may be changed while the drives are enabled

[parameter."gait.cycle_time"]   # one stride: two steps
object = "0x2002:0"
unit = "s"
scale = 0.001
min = 1.0
max = 4.0
max_step = 0.5
live = true

[parameter."gait.toe_height"]   # how far the toes clear the ground in swing: bends knee and ankle
object = "0x2003:0"
unit = "m"
scale = 0.001
min = 0.02
max = 0.12
max_step = 0.03
live = true

[parameter."gait.trunk_angle"]  # lean of the trunk, forward positive
object = "0x2004:0"
unit = "rad"
scale = 0.001
min = -0.10
max = 0.30
max_step = 0.10
live = true
"""

_JOINT_PARAMETERS_NOTE = """
# Per joint: the most torque that the drive may use (6072h, per mille of 40 N·m rated at the joint), and the
# speed of its own moves in profile position mode (6081h, counts/s; 2π / 409 600 rad each); and how stiffly
# it holds to its target (2030h:1, as its EDS says): half the gain, twice the tracking error.
"""

# By the object that the drive must have for it; a vendor's in the manufacturer's range is another one.
_JOINT_PARAMETERS = {
    (0x6072, 0): """
[parameter."{name}.max_torque"]
object = "0x6072:0"
unit = "N·m"
scale = 0.04
min = 8.0
max = 80.0
max_step = 40.0
live = true
""",
    (0x6081, 0): """
[parameter."{name}.profile_velocity"]
object = "0x6081:0"
unit = "rad/s"
scale = 1.5339807878856412e-05
min = 0.05
max = 6.0
max_step = 2.0
live = true
""",
    (0x2030, 1): """
[parameter."{name}.position_gain"]
object = "0x2030:1"
unit = "N·m/rad"
scale = 1.0
min = 500.0
max = 6000.0
max_step = 1000.0
live = true
""",
}


def hub_bus(port: int) -> str:
    """Return the bus's table where it is reached through the hub on `port`."""
    return _HUB.format(channel=CHANNEL, host=HOST, port=port)


def virtual_bus(channel: str) -> str:
    """Return the bus's table where it is reached in the same process."""
    return _VIRTUAL.format(channel=channel)


def socketcan_bus(interface: str) -> str:
    """Return the bus's table where it is a Linux CAN interface."""
    return _SOCKETCAN.format(channel=interface)


def text(folder: Path, bus: str, robot: Exoskeleton, guard: Mapping[str, Any] | None = None) -> str:
    """Return the file for the simulator in `folder` (absolute), with the tables of bus, sensors and guard."""
    drives = robot.simulated_drives
    templates = (_FIRST_JOINT, *[_JOINT] * (len(drives) - 1))
    led, others = CONTROLLER not in robot.without, robot.without - robot.absent
    return "".join(
        (
            _HEAD.format(path=folder / "robot.toml", bus=bus + _OUR_NODE * ("heartbeat_ms" in (guard or {}))),
            *(
                _joint(one, drive, robot.mountings[drive.name])
                for one, drive in zip(templates, drives, strict=True)
            ),
            "" if robot.assists is None else _ONE_SIDE.format(side=robot.assists),
            _NOT_SIMULATED.format(names=", ".join(sorted(others))) if others else "",
            _controller_table() if led else "",
            "\n",
            tables(robot.sensors.choice, folder),
            _PARAMETERS_NOTE,
            _CONTROLLER_PARAMETERS if led else "",
            _JOINT_PARAMETERS_NOTE,
            *map(_joint_parameters, drives),
            "" if guard is None else _GUARD_NOTE + toml_text.table("guard", guard),
        )
    )


def _controller_table() -> str:
    return _CONTROLLER_TABLE.format(
        controller=CONTROLLER, controller_node=CONTROLLER_NODE, controller_eds=CONTROLLER_EDS
    )


def _joint(template: str, drive: JointDrive, mounting: Mounting) -> str:
    file = personality.name(drive.description)
    table = template.format(
        name=drive.name,
        node_id=drive.node_id,
        eds=json.dumps(file, ensure_ascii=False),
        direction=mounting.direction,
        zero=round(mounting.angle(0, drive.counts_per_radian), 6) + 0.0,
    )
    return table if file == DRIVE_EDS else table + _RATED


def _joint_parameters(drive: JointDrive) -> str:
    texts = _JOINT_PARAMETERS.items()
    return "".join(text.format(name=drive.name) for key, text in texts if drive.objects.has(key))
