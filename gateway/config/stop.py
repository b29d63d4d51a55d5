"""Settings of the stop: `[stop]` of the robot's file."""

from enum import StrEnum
from typing import Annotated

from msgspec import Meta, Struct

from drivers.bus.settings import ObjectName, address_of


class Fallback(StrEnum):
    """Measures, in this order, for a drive that has not confirmed its quick stop in time."""

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
    """`[[stop.controller]]`: an object of the controller that commands the drives, and its stopping value."""

    component: str  # NAME of its `[device.NAME]` table
    object: ObjectName  # index and sub-index
    value: int  # the value that stops it

    @property
    def address(self) -> tuple[int, int]:
        """Index and subindex."""
        return address_of(self.object)


class StopSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[stop]`: the time-out of a stop's answer, and further measures."""

    timeout_s: Annotated[float, Meta(gt=0, le=4)] = 2.5  # time of the answer, whatever is confirmed by then
    fallback: tuple[Fallback, ...] = ()  # measures for a drive without confirmation, in this order
    controller: tuple[ControllerStop, ...] = ()
