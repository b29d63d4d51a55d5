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

    bus: str
    node_id: NodeId
    eds: str
    axis: Annotated[int, msgspec.Meta(ge=0, le=7)] = 0  # of a multi-axis drive: its objects lie 800h apart
    counts_per_revolution: Positive  # of the encoder that 6064h counts
    gear_ratio: Positive  # its revolutions per revolution of the joint
    direction: Literal[1, -1] = 1
    zero_offset: Angle = 0.0  # rad: the joint's angle where the drive counts 0
    velocity_unit: VelocityUnit = "counts/s"  # of 606Ch, at the encoder
    rated_torque: Positive | None = None  # N·m at the joint; None: 6076h times gear_ratio
    rated_current: Positive | None = None  # A; None: 6075h
    poll_hz: Annotated[float, msgspec.Meta(ge=0, le=200)] = (
        20.0  # position and state no TPDO brings; 0: never
    )
    slow_poll_hz: Annotated[float, msgspec.Meta(ge=0, le=50)] = 4.0  # all else no TPDO brings; 0: never
    configure_pdos: bool = False  # may the gateway map what it reads into TPDOs that bring nothing?
    stop_timeout_s: Seconds = 1.0  # how long a quick stop may take to be confirmed
    stale_after_s: LongSeconds = 0.5
    lost_after_s: LongSeconds = 2.0

    @property
    def rad_per_count(self) -> float:
        """Of the joint; negative where counts fall when it bends."""
        return self.direction * math.tau / (self.counts_per_revolution * self.gear_ratio)
