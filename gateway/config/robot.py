"""The robot's file as frozen structs, a table each."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from msgspec import Meta, Struct

from drivers.bus.settings import (
    CanSettings,
    ChannelSettings,
    DeviceSettings,
    ObjectName,
    Role,
    address_of,
)
from drivers.component import ComponentKind
from drivers.imu.settings import CanImuSettings, ImuSettings, MountedSettings, NodeImuSettings
from drivers.insole.settings import InsoleSettings
from drivers.joint.settings import JointSettings
from gateway.config.stop import StopSettings
from gateway.records.folder import default_folder

if TYPE_CHECKING:
    from gateway.config.guard import GuardSettings

Node = tuple[str, int]  # a bus by its name, and a node id there
OnPort = InsoleSettings | ImuSettings
OnBus = JointSettings | DeviceSettings | CanImuSettings | NodeImuSettings

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
COMPONENT_TABLES = tuple(ComponentKind)  # each kind by its name


class RobotSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[robot]`."""

    name: Annotated[str, Meta(min_length=1)]  # the robot's name for clients and journals


class GatewaySettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[gateway]`: the gateway's address, its folders, and its limits."""

    host: str = "127.0.0.1"  # address to listen on
    port: Annotated[int, Meta(ge=0, le=65535)] = 7420  # 0 picks a free one
    role: Role = Role.OBSERVER  # on the CAN buses
    linger_s: Annotated[float, Meta(ge=0, le=86_400)] = 5.0  # how long modules run on after the last client
    records: str | None = None  # folder of journal, held stop and pending reverts; relative to this file
    access: str = "."  # folder of keys, clients and roles; relative to this file
    socket: str | None = None  # Unix socket for local users, "": none; None: see gwrms docs pair
    classic_port: Annotated[int, Meta(ge=0, le=65535)] | None = None  # port of the paper's protocol
    max_cpu_percent: Annotated[float, Meta(gt=0)] | None = (
        None  # of a core; beyond it, streams send fewer rows
    )
    buffer_kb: Annotated[int, Meta(ge=64, le=65_536)] = 1024  # stream data kept for a slow client
    stuck_s: Annotated[float, Meta(gt=0, le=3600)] = (
        30.0  # a client that reads nothing for so long is dropped
    )


class ControlLoopSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[control_loop]`: the robot's own control program, on this computer.

    With `bus`, the gateway watches the loop's frame there; a frame that is too late is an overrun.
    """

    processes: Annotated[tuple[str, ...], Meta(min_length=1)]  # names as in `ps`, or programs; globs
    bus: str | None = None  # bus of the loop's periodic frame
    can_id: Annotated[int, Meta(ge=0, le=0x1FFF_FFFF)] = 0x080  # identifier of that frame
    period_ms: Annotated[float, Meta(gt=0, le=10_000)] | None = None  # its period
    late_ms: Annotated[float, Meta(gt=0)] | None = None  # delay of an overrun; None: half a period

    @property
    def tolerance_ms(self) -> float:
        """After a frame's time."""
        return (self.period_ms or 0.0) / 2 if self.late_ms is None else self.late_ms


class JointTable(JointSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[joint.NAME]`: a joint, and the parameters of its EDS."""

    parameters: Literal["eds"] | None = None  # "eds": every writable number of the EDS, for reading
    release: tuple[str, ...] = ()  # names or globs of those that may also be changed


class DeviceTable(DeviceSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[device.NAME]`: another device, and the parameters of its EDS."""

    parameters: Literal["eds"] | None = None  # "eds": every writable number of the EDS, for reading
    release: tuple[str, ...] = ()  # names or globs of those that may also be changed


class ParameterSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[parameter."component.name"]`: an object of a CANopen device, and the limits of changing it.

    value = device's number · scale, in `unit`
    """

    object: ObjectName  # index and sub-index
    unit: str = ""  # SI, or "" for a pure number
    scale: float = 1.0  # unit per count of the device
    min: float | None = None  # in `unit`
    max: float | None = None  # in `unit`
    max_step: Annotated[float, Meta(gt=0)] | None = None  # largest change in one write, in `unit`
    live: bool = False  # allow changes while a drive is enabled
    states: tuple[str, ...] | None = None  # CiA 402 states that allow a change; None: as `live` says

    @property
    def address(self) -> tuple[int, int]:
        """Index and subindex."""
        return address_of(self.object)


class RobotConfig(Struct, frozen=True, kw_only=True):
    """A robot as its file describes it; each dictionary is by the components' names."""

    path: Path
    robot: RobotSettings
    gateway: GatewaySettings = GatewaySettings()
    can: dict[str, CanSettings] = {}
    joint: dict[str, JointTable] = {}
    device: dict[str, DeviceTable] = {}
    insole: dict[str, InsoleSettings] = {}
    imu: dict[str, MountedSettings] = {}
    parameter: dict[str, ParameterSettings] = {}
    channel: dict[str, ChannelSettings] = {}
    stop: StopSettings = StopSettings()
    guard: "GuardSettings | None" = None
    control_loop: ControlLoopSettings | None = None
    # By table, the names of those that could not be read: others may speak of them while the file is checked.
    lost: Mapping[str, frozenset[str]] = {}
    digest: str = ""  # of all that the file says, whatever its comments and order
    outdated: str = ""  # why the file cannot be used now, where this is how it was valid last

    def names(self, *tables: str) -> list[str]:
        """Return the names in tables of these kinds, including unreadable ones."""
        return [name for table in tables for name in (*getattr(self, table), *self.lost.get(table, ()))]

    def node_of(self, component: str) -> Node:
        """Return the bus and node id of a joint or device."""
        table = self.joint[component] if component in self.joint else self.device[component]
        return table.bus, table.node_id

    def sharing(self, component: str) -> tuple[str, ...]:
        """Return the joints and devices on one's node, itself among them: the axes of one drive."""
        node = self.node_of(component)
        return tuple(name for name in (*self.joint, *self.device) if self.node_of(name) == node)

    def drives_of(self, component: str) -> tuple[str, ...]:
        """Return the joints that its parameters may move: those on its node.

        Where it has none, every joint.
        """
        return tuple(name for name in self.sharing(component) if name in self.joint) or tuple(self.joint)

    def channels_of(self, component: str) -> dict[str, ChannelSettings]:
        """Return the tables `[channel."COMPONENT.NAME"]` of a joint or device, by the names after the dot."""
        whole = ((name.partition("."), one) for name, one in self.channel.items())
        return {quantity: one for (owner, _, quantity), one in whole if owner == component}

    def on_buses(self) -> Iterator[tuple[str, OnBus]]:
        """Yield every table of something on a CAN bus, with its header."""
        for table in COMPONENT_TABLES:
            for name, settings in getattr(self, table).items():
                if isinstance(settings, OnBus):
                    yield f"[{table}.{name}]", settings

    def on_ports(self) -> Iterator[tuple[str, OnPort]]:
        """Yield every table of a sensor on a serial port, with its header."""
        for table in (ComponentKind.INSOLE, ComponentKind.IMU):
            for name, settings in getattr(self, table).items():
                if isinstance(settings, OnPort):
                    yield header(table, name), settings

    @property
    def records(self) -> Path:
        """The folder of this robot's records."""
        given = self.gateway.records
        return default_folder(self.robot.name) if given is None else self.path.parent / given

    @property
    def access(self) -> Path:
        """The folder of keys, clients and roles."""
        return self.path.parent / self.gateway.access


def header(table: str, name: str) -> str:
    """Return it as the file writes it."""
    return f'[{table}."{name}"]' if "." in name else f"[{table}.{name}]"
