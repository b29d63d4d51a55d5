"""What an integrator says about an insole: the table `[insole.NAME]` of the robot's file."""

from typing import Annotated, Literal

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0)]


class InsoleSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One foot. Two feet on one device: give both tables the same `port`."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 230400
    format: Literal["insole-cobs", "insole-csv", "insole-frame"] = "insole-cobs"
    layout: str = "insole-16"  # a shipped layout, or a .toml file beside the robot's file
    calibration: str | None = None  # a file of `gwrms calibrate insole`, beside the robot's file
    foot: Literal["left", "right"] | None = None  # None: by the component's name, left_… or right_…
    force_threshold: Positive = 20.0  # N; below it the foot is in the air and has no centre of pressure
    stale_after_s: Positive = 0.5
    lost_after_s: Positive = 2.0
