"""The shape every driver has towards the gateway."""

from enum import StrEnum
from typing import Protocol

from drivers.latest import Latest
from drivers.samples import Channel, Quality


class ComponentKind(StrEnum):
    """Kind of a component."""

    JOINT = "joint"
    DEVICE = "device"  # any other CANopen device that has parameters
    INSOLE = "insole"
    IMU = "imu"


class Component(Protocol):
    """A source of samples that is started when somebody asks and stopped when nobody does.

    `start` returns at once and never raises for hardware that is not there: the driver says so in its
    quality and keeps trying until `stop`. Both are idempotent; `stop` joins every thread the driver began.
    """

    @property
    def name(self) -> str: ...

    @property
    def kind(self) -> ComponentKind: ...

    @property
    def channels(self) -> tuple[Channel, ...]: ...

    @property
    def latest(self) -> Latest: ...

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def quality(self, now_ns: int) -> Quality: ...
