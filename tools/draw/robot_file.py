"""docs/reference/robot-toml.md: every table of the robot's file, from the structs that read it."""

import dataclasses
from collections.abc import Collection, Iterator, Mapping
from typing import Final

from msgspec import Struct

from drivers.bus.settings import CanSettings, ChannelSettings
from drivers.imu import can, canopen
from drivers.imu import formats as imu_formats
from drivers.imu.canopen.cia410 import InclinometerSettings
from drivers.imu.settings import CanImuSettings, ImuSettings
from drivers.insole import formats as insole_formats
from drivers.insole.settings import InsoleSettings
from gateway.config.guard import GuardSettings
from gateway.config.guard_rules import GuardRule
from gateway.config.robot import (
    ControlLoopSettings,
    DeviceTable,
    GatewaySettings,
    JointTable,
    ParameterSettings,
    RobotSettings,
)
from gateway.config.stop import ControllerStop, StopSettings
from tools.draw.structs import Key, docstring, table, written

PAGE: Final = "robot-toml.md"
_HEAD: Final = """# robot.toml

This file describes a robot to its gateway: `gwrms gateway robot.toml`. Only `[robot]` is required.
Keys in bold are required in their table; an unknown key is refused, with the likely one
([check files](../how-to/check-files.md), also while you type). Values are in SI
units; paths are relative to this file. To find the right
values: [wire a joint](../how-to/wire-a-joint.md), [wire a sensor](../how-to/wire-a-sensor.md), [a
first real robot](../how-to/first-robot.md)."""
_TABLES: Final[tuple[tuple[str, type[Struct], tuple[str, ...]], ...]] = (
    ("`[robot]`", RobotSettings, ()),
    ("`[gateway]`", GatewaySettings, ()),
    ("`[can.NAME]`", CanSettings, ("more",)),
    ("`[joint.NAME]`", JointTable, ()),
    ("`[device.NAME]`", DeviceTable, ()),
    ("`[insole.NAME]`", InsoleSettings, ()),
    ("`[imu.NAME]` on a serial port", ImuSettings, ()),
    ("`[imu.NAME]` on a CAN bus", CanImuSettings, ()),
    ("`[imu.NAME]`, an inclinometer", InclinometerSettings, ()),
    ('`[parameter."COMPONENT.NAME"]`', ParameterSettings, ()),
    ('`[channel."COMPONENT.NAME"]`', ChannelSettings, ()),
    ("`[stop]`", StopSettings, ("controller",)),
    ("`[[stop.controller]]`", ControllerStop, ()),
    ("`[control_loop]`", ControlLoopSettings, ()),
    ("`[guard]`", GuardSettings, ("rule",)),
    ("`[guard.rule.NAME]`", GuardRule, ()),
)
_NODE: Final = "Shipped EDS files: [sources](../../eds/files/SOURCES.md)."
_GATEWAY: Final = """With the role `observer`, another controller owns the buses: the gateway sends only
requested SDOs, a stop, and the guard's heartbeat. As `master`, on a bench, it also starts
nodes, and sends SYNC and a heartbeat if configured for the bus.
Before you change `host`, read [security](../../SECURITY.md).
`linger_s` and `max_cpu_percent` are explained in [measure the cost](../how-to/measure-the-cost.md).
`classic_port` is for comparison with [the paper](../explanation/paper.md)."""
_PARAMETER: Final = (
    "The stricter of these limits and those of the device's EDS apply: [parameters](parameters.md)."
)
_MAKER: Final = "[vendor-specific objects](../how-to/wire-a-joint.md#vendor-specific-objects)"
_CHANNEL: Final = f"""The channel is named `COMPONENT.NAME`, of a joint or a device, and has the type of its
object in the EDS. It is read from a TPDO of the node if one brings it, else by SDO at
`poll_hz`. This is how a device gets channels, and a joint {_MAKER}."""
_RULE: Final = "Every rule has these keys, and those of its kind: [the table of rules](guard.md#rules)."
_MORE: Final[Mapping[str, str]] = {
    "`[gateway]`": _GATEWAY,
    "`[can.NAME]`": "All further keys are python-can's own, and are passed to the interface.",
    "`[joint.NAME]`": _NODE,
    "`[device.NAME]`": _NODE,
    '`[parameter."COMPONENT.NAME"]`': _PARAMETER,
    '`[channel."COMPONENT.NAME"]`': _CHANNEL,
    "`[stop]`": "Effects and dangers of a fallback: [stop](../explanation/stop.md#the-robots-file).",
    "`[guard.rule.NAME]`": _RULE,
}


_FORMATS: Final[Mapping[str, Collection[str]]] = {  # found by their folders
    "`[insole.NAME]`": insole_formats.FORMATS,
    "`[imu.NAME]` on a serial port": imu_formats.FORMATS,
    "`[imu.NAME]` on a CAN bus": can.FORMATS,
    "`[imu.NAME]`, an inclinometer": canopen.FORMATS,
}


def draw() -> str:
    """Return the page."""
    return "\n\n".join([_HEAD, *_sections()]) + "\n"


def _sections() -> Iterator[str]:
    for title, struct, left_out in _TABLES:
        yield f"## {title}"
        if said := docstring(struct):
            yield said
        yield table(_told(title, key) for key in written(struct) if key.name not in left_out)
        if title in _MORE:
            yield _MORE[title]


def _told(title: str, key: Key) -> Key:
    if key.name != "format":
        return key
    return dataclasses.replace(key, kind=", ".join(f'`"{name}"`' for name in _FORMATS[title]))
