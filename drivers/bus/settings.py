"""Settings of a CAN bus and its devices: `[can.…]`, `[device.…]` and `[channel.…]`."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any

import msgspec

from drivers.bus.frames import wire_id

SDO_REQUEST, SDO_RESPONSE = 0x600, 0x580  # of the predefined connection set (CiA 301 §7.3.3)

Positive = Annotated[float, msgspec.Meta(gt=0)]
Seconds = Annotated[float, msgspec.Meta(gt=0, le=60)]
LongSeconds = Annotated[float, msgspec.Meta(gt=0, le=600)]
Angle = Annotated[float, msgspec.Meta(ge=-6.2832, le=6.2832, extra={"unit": "rad"})]  # a turn
NodeId = Annotated[int, msgspec.Meta(ge=1, le=127)]
ObjectName = Annotated[  # as "0x6072:0"
    str,
    msgspec.Meta(
        pattern=r"^0x[0-9A-Fa-f]{4}:(0x[0-9A-Fa-f]{1,2}|[0-9]{1,3})$",
        title="index and sub-index",
        examples=["0x6072:0"],
    ),
]
CobId = Annotated[int, msgspec.Meta(ge=1, le=0x1FFF_FFFF)]


def address_of(name: str) -> tuple[int, int]:
    """Return index and subindex of an object's name; the subindex may be more than one can be."""
    index, _, subindex = name.partition(":")
    return int(index, 16), int(subindex, 16 if subindex.startswith("0x") else 10)


class Role(StrEnum):
    """The gateway's role on its buses."""

    OBSERVER = "observer"  # another controller owns the bus; the gateway only sends requested SDOs
    MASTER = "master"  # on a bench: NMT start, SYNC and a heartbeat come from the gateway


class CanSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One bus."""

    interface: str  # python-can's name: "socketcan", "socketcand", "virtual", "slcan", …
    channel: str | int  # such as "can0"; its form depends on the interface
    bitrate: Annotated[int, msgspec.Meta(ge=1_000, le=1_000_000, extra={"unit": "bit/s"})] | None = (
        None  # the gateway checks it
    )
    sync_period_s: Seconds | None = None  # period of the SYNC that the gateway sends; master only
    node_id: NodeId | None = None  # the gateway's own, for its heartbeat
    heartbeat_s: Seconds | None = None  # period of the gateway's heartbeat; master only
    trusted_network: bool = False  # allow CAN over a network, on which anybody can command the drives
    more: dict[str, Any] = {}  # python-can's further keys

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "CanSettings":
        """Return the settings in a TOML table whose further keys are python-can's.

        Raises `msgspec.ValidationError`, which names the key and what is allowed.
        """
        return msgspec.convert(cls.parted(table), cls)

    @property
    def network(self) -> str | None:
        """Beyond this computer, in words: whoever is on it could send frames; None: there is none.

        A multicast that goes no further than this computer (`hop_limit = 0`) has none.
        """
        if self.interface == "socketcand":
            host = str(self.more.get("host", ""))
            return None if host in ("", "localhost", "::1") or host.startswith("127.") else host
        if self.interface == "udp_multicast" and self.more.get("hop_limit") != 0:
            return f"the multicast group {self.channel}"
        return None

    @property
    def is_program(self) -> bool:
        """Whether a program of this computer carries the frames: a simulator, or an adapter's daemon."""
        return self.interface == "socketcand" and self.network is None

    @classmethod
    def parted(cls, table: Mapping[str, Any]) -> dict[str, Any]:
        """Return the table with python-can's keys in `more`."""
        ours = {key: value for key, value in table.items() if key in cls.__struct_fields__ and key != "more"}
        return {**ours, "more": {key: value for key, value in table.items() if key not in ours}}


class NodeTimes(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Time-outs of one node, and its SDO channel."""

    sdo_timeout_s: Seconds = 0.5  # time-out of an SDO answer
    store_timeout_s: LongSeconds = 10.0  # time-out of 1010h and 1011h, which write flash
    sdo_cob_ids: tuple[CobId, CobId] | None = None  # request, response; None: 600h and 580h + node id
    heartbeat_timeout_s: Seconds | None = None  # None: 2.5 times the device's 1017h
    guard_time_s: Seconds | None = (
        None  # period of node guarding, for a device without heartbeat; master only
    )

    def sdo_ids(self, node_id: int) -> tuple[int, int]:
        """Return the identifiers of its SDO channel, of requests and of responses, with their flags."""
        request, response = self.sdo_cob_ids or (SDO_REQUEST + node_id, SDO_RESPONSE + node_id)
        return wire_id(request), wire_id(response)


class DeviceSettings(NodeTimes, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A CANopen device other than a joint, such as a gait controller."""

    bus: str  # NAME of its `[can.NAME]` table
    node_id: NodeId  # its CANopen node id
    eds: str  # its EDS or DCF file, beside this one or shipped
    stale_after_s: LongSeconds = 0.5  # silence after which its values are `null`
    lost_after_s: LongSeconds = 2.0  # silence after which it is lost


class ChannelSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An object of a joint's or device's node that becomes a channel.

    value = device's number · scale + offset, in `unit`
    """

    object: ObjectName  # index and sub-index
    unit: str = ""  # SI, or "" for a pure number
    scale: float = 1.0  # unit per count of the device
    offset: float = 0.0  # in `unit`
    poll_hz: Annotated[float, msgspec.Meta(ge=0, le=200)] = (
        4.0  # rate of reading by SDO, if no TPDO brings it; 0: never
    )
    words: dict[str, str] = {}  # names of a state's numbers, such as { 0 = "stance", 1 = "swing" }

    @property
    def address(self) -> tuple[int, int]:
        """Index and subindex."""
        return address_of(self.object)

    @property
    def states(self) -> dict[int, str] | None:
        """The words by their numbers; `None` where it is no state."""
        return {int(number): word for number, word in self.words.items()} or None
