"""What an integrator says about the stop: `[stop]` of the robot's file."""

from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta, Struct

from gateway.object_names import ObjectName, address_of

if TYPE_CHECKING:
    from gateway.config import RobotConfig


class Fallback(StrEnum):
    """What follows, in this order, on a drive that has not confirmed its quick stop in time."""

    DISABLE_VOLTAGE = "disable_voltage"
    NMT_STOP = "nmt_stop"

    @property
    def words(self) -> str:
        return _WORDS[self]


_WORDS = {
    Fallback.DISABLE_VOLTAGE: (
        "disable voltage: the motor loses its current, and the joint goes limp under its wearer"
    ),
    Fallback.NMT_STOP: (
        "NMT stop, where 6007h says that the drive acts on it: nothing confirms what it does, and it answers "
        "nothing until a master starts its node again"
    ),
}


class ControllerStop(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[[stop.controller]]`: an object of who commands the drives, and the value that stops it."""

    component: str
    object: ObjectName
    value: int

    @property
    def address(self) -> tuple[int, int]:
        """Index and subindex."""
        return address_of(self.object)


class StopSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[stop]`: a stop is answered within `timeout_s`, whatever drives and controllers do until then."""

    timeout_s: Annotated[float, Meta(gt=0, le=4)] = 2.5
    fallback: tuple[Fallback, ...] = ()
    controller: tuple[ControllerStop, ...] = ()


def complaints(config: "RobotConfig", stop: StopSettings) -> Iterator[str]:
    """Everything that is wrong with the table in this robot's file."""
    if list(stop.fallback) != [one for one in Fallback if one in stop.fallback]:
        order = ", ".join(f'"{one}"' for one in Fallback)
        yield f"[stop] fallback: each once, NMT stop last because it silences the drive: {order}"
    for number, controller in enumerate(stop.controller, 1):
        where = f"[[stop.controller]] number {number}"
        if controller.component not in config.device:
            known = ", ".join(config.device) or "none"
            yield f"{where} component: there is no [device.{controller.component}]; here are {known}"
        if controller.address[1] > 0xFF:
            yield f"{where} object: the subindex goes from 0 to 255"
