"""Settings of an insole: the table `[insole.NAME]` of the robot's file."""

from typing import Annotated

import msgspec

from drivers.bus.settings import LongSeconds, Positive
from drivers.folder import not_a_format
from drivers.insole.foot import Foot, foot_in
from drivers.insole.formats import FORMATS


class InsoleSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One foot. Two feet on one device: give both tables the same `port`."""

    port: str  # a stable path: /dev/serial/by-id/…
    baudrate: Annotated[int, msgspec.Meta(gt=0)] = 230400  # of the serial line
    format: str = "insole-cobs"  # of its stream; `gwrms sensor PORT` finds it
    layout: str | None = None  # a shipped one, or a .toml file beside this one; None: the format's default
    calibration: str | None = None  # file of `gwrms calibrate insole`, beside this one
    foot: Foot | None = None  # None: from the component's name, left_… or right_…
    force_threshold: Positive = 20.0  # N; below it the foot is in the air, without centre of pressure
    stale_after_s: LongSeconds = 0.5  # silence after which its values are `null`
    lost_after_s: LongSeconds = 2.0  # silence after which it is lost

    def __post_init__(self) -> None:
        if self.format not in FORMATS:
            raise ValueError(not_a_format(self.format, FORMATS))

    def side(self, name: str) -> Foot | None:
        """Return the foot of a component with that name; `None` if it is unknown."""
        return self.foot or foot_in(name)
