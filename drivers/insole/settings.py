"""What an integrator says about an insole: the table `[insole.NAME]` of the robot's file."""

from typing import Annotated, Literal

import msgspec

from drivers.insole.formats import FORMATS

Positive = Annotated[float, msgspec.Meta(gt=0)]


class InsoleSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One foot. Two feet on one device: give both tables the same `port`."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 230400
    format: str = "insole-cobs"
    layout: str | None = None  # a shipped one, or a .toml file beside the robot's file; None: the usual one
    calibration: str | None = None  # a file of `gwrms calibrate insole`, beside the robot's file
    foot: Literal["left", "right"] | None = None  # None: by the component's name, left_… or right_…
    force_threshold: Positive = 20.0  # N; below it the foot is in the air and has no centre of pressure
    stale_after_s: Positive = 0.5
    lost_after_s: Positive = 2.0

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise ValueError(f"format {self.format!r} is not known; here are {', '.join(FORMATS)}")
