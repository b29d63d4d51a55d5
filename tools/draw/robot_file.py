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

The file that describes a robot to its gateway: `gwrms gateway robot.toml`. `[robot]` is needed,
everything else is not. Keys in bold are needed in their table; an unknown key is refused, and the key is
named that was meant ([check files](../how-to/check-files.md), also while you type). Values are in SI
units; files that are named lie beside this one. How to find out
what to write: [wire a joint](../how-to/wire-a-joint.md), [wire a sensor](../how-to/wire-a-sensor.md), [a
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
_TIMES: Final = """`stale_after_s` and `lost_after_s` are the silence after which its values are `null`, and
after which it is lost."""
_NODE: Final = f"""`bus` is the NAME of a `[can.NAME]` table, `node_id` the CANopen node id there, and `eds`
the vendor's file, beside this one or [shipped](../../eds/files/SOURCES.md). {_TIMES}"""
_GATEWAY: Final = """With the role `observer` another controller owns the buses: the gateway sends only SDO
requests that were asked for, a stop, and the guard's heartbeat. As `master`, on a bench, it also starts
nodes, and sends SYNC and a heartbeat where its buses say so. Before you change `host`, read
[who may connect](../../SECURITY.md). `linger_s` and the budget are explained in
[measure the cost](../how-to/measure-the-cost.md)."""
_PARAMETER: Final = "The stricter of this and the device's EDS counts: [parameters](parameters.md)."
_MAKER: Final = "[vendor-specific objects](../how-to/wire-a-joint.md#vendor-specific-objects)"
_CHANNEL: Final = f"""The channel is there as `COMPONENT.NAME`, of a joint or a device, with the type that the
EDS gives its object. Where a TPDO of the node brings it, it is read there; else it is asked for by SDO
`poll_hz` times a second. So a device gets channels, and a joint {_MAKER}."""
_RULE: Final = (
    "Every rule has these keys, and those of what it watches: [the table of rules](guard.md#rules)."
)
_MORE: Final[Mapping[str, str]] = {
    "`[robot]`": "`name` is how clients and journals call it.",
    "`[gateway]`": _GATEWAY,
    "`[can.NAME]`": "Every further key is python-can's own, and goes to the interface as it stands.",
    "`[joint.NAME]`": _NODE,
    "`[device.NAME]`": _NODE,
    "`[insole.NAME]`": _TIMES,
    "`[imu.NAME]` on a serial port": _TIMES,
    '`[parameter."COMPONENT.NAME"]`': _PARAMETER,
    '`[channel."COMPONENT.NAME"]`': _CHANNEL,
    "`[stop]`": "What a fallback does, and its dangers: [stop](../explanation/stop.md#the-robots-file).",
    "`[guard.rule.NAME]`": _RULE,
}


_FORMATS: Final[Mapping[str, Collection[str]]] = {  # found by their folders
    "`[insole.NAME]`": insole_formats.FORMATS,
    "`[imu.NAME]` on a serial port": imu_formats.FORMATS,
    "`[imu.NAME]` on a CAN bus": can.FORMATS,
    "`[imu.NAME]`, an inclinometer": canopen.FORMATS,
}


def draw() -> str:
    """The page."""
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
