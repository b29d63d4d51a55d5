"""Settings of a joint: the table `[joint.NAME]` of the robot's file."""

import math
from typing import Annotated, Literal

import msgspec

from drivers.bus.settings import Angle, LongSeconds, NodeId, NodeTimes, Positive, Seconds

VelocityUnit = Literal["counts/s", "rpm", "0.1rpm", "0.01rpm", "0.001rpm"]


class JointSettings(NodeTimes, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One axis of a CiA 402 drive, and how its counts become the joint's angle.

    angle = direction · counts / (counts_per_revolution · gear_ratio) · 2π + zero_offset
    """

    bus: str  # NAME of its `[can.NAME]` table
    node_id: NodeId  # its CANopen node id
    eds: str  # its EDS or DCF file, beside this one or shipped
    axis: Annotated[int, msgspec.Meta(ge=0, le=7)] = (
        0  # number of the axis in a multi-axis drive (objects 800h apart)
    )
    counts_per_revolution: Positive  # of the encoder behind 6064h
    gear_ratio: Positive  # revolutions of the encoder per revolution of the joint
    direction: Literal[1, -1] = 1  # -1: its counts fall while the joint flexes
    zero_offset: Angle = 0.0  # rad: the joint's angle at the drive's count 0
    velocity_unit: VelocityUnit = "counts/s"  # unit of 606Ch, at the encoder
    rated_torque: Positive | None = None  # N·m at the joint; None: 6076h times gear_ratio
    rated_current: Positive | None = None  # A; None: 6075h
    poll_hz: Annotated[float, msgspec.Meta(ge=0, le=200)] = (
        20.0  # rate of reading position and state by SDO, if no TPDO brings them; 0: never
    )
    slow_poll_hz: Annotated[float, msgspec.Meta(ge=0, le=50)] = 4.0  # the same for other quantities; 0: never
    configure_pdos: bool = False  # let the gateway map its quantities into unused TPDOs
    stop_timeout_s: Seconds = 1.0  # time-out of a quick stop's confirmation
    stale_after_s: LongSeconds = 0.5  # silence after which its values are `null`
    lost_after_s: LongSeconds = 2.0  # silence after which it is lost

    @property
    def rad_per_count(self) -> float:
        """Angle of the joint per count; negative if counts fall when it flexes."""
        return self.direction * math.tau / (self.counts_per_revolution * self.gear_ratio)
