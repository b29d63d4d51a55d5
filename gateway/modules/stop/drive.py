"""The part of a joint's driver that a stop needs."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, Protocol

from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.reading import DriveReading
from drivers.joint.transitions import Led
from drivers.latest import Latest
from drivers.samples import Channel
from gateway.process.futures import failed


class Drive(Protocol):
    """One axis; see `drivers.joint.power.PowerDrive`."""

    @property
    def name(self) -> str: ...

    @property
    def node(self) -> Any:
        """The node that the axes of one drive share."""

    @property
    def channels(self) -> tuple[Channel, ...]: ...

    @property
    def latest(self) -> Latest: ...

    @property
    def reading(self) -> DriveReading | None: ...

    def quick_stop(self, *, wake: bool = True) -> "Future[StopOutcome]": ...

    def wake(self) -> None: ...

    def disable_voltage(self) -> "Future[StopOutcome]": ...

    def nmt_stop(self) -> None: ...

    def reset(self, wanted: Callable[[], bool]) -> "Future[Led]": ...

    def look(self) -> "Future[Led]": ...

    def step_up(self, origin: DriveState, wanted: Callable[[], bool]) -> "Future[Led]": ...


def quick_stop(drive: Drive, *, wake: bool = True) -> "Future[StopOutcome]":
    """Stop it; never raises: the other drives are to be stopped all the same."""
    try:
        return drive.quick_stop(wake=wake)
    except Exception as error:  # noqa: BLE001 - it becomes the future's
        return failed(error)


def is_enabled(statusword: float) -> bool:
    """Return whether a statusword (6041h) says OPERATION ENABLED."""
    return drive_state(int(statusword)) is DriveState.OPERATION_ENABLED
