"""Requests of a window to one robot; tests bring their own."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from typing import NamedTuple, Protocol

from gateway.wire.control import Lease
from gateway.wire.dictionary import ObjectList, ObjectValues
from gateway.wire.parameter import Confirmed, Reverted, Stored, Written
from gateway.wire.stop import Reset, Stopped


class ReadBack(NamedTuple):
    """A device's present value of a parameter, None if unreadable; and whether it is on trial."""

    value: float | None
    problem: str | None
    on_trial: bool


class Commands(Protocol):
    """Every call returns at once; its future is done in the network's thread, or fails with `ClientError`."""

    def stop(self, reason: str) -> "Future[Stopped]":
        """Quick stop on every drive; needs nothing and waits for nothing."""
        ...

    def take_control(self) -> "Future[Lease]":
        """Become the one writer, or stay it."""
        ...

    def release_control(self) -> "Future[None]":
        """Let others write; what is on trial goes back."""
        ...

    def write(self, changes: Mapping[str, float], trial_s: float | None) -> "Future[Written]":
        """Write in one transaction, read back; take control first."""
        ...

    def confirm(self, write: int) -> "Future[Confirmed]":
        """Keep the values on trial."""
        ...

    def revert(self, write: int) -> "Future[Reverted]":
        """Take back what is on trial."""
        ...

    def read_back(self, name: str) -> "Future[ReadBack]":
        """Read a parameter from its device, and whether a trial of it still stands."""
        ...

    def store(self, component: str) -> "Future[Stored]":
        """Make a device keep its parameters over a reset; takes control first."""
        ...

    def reset(self) -> "Future[Reset]":
        """End a held stop; takes control first. Enables nothing."""
        ...

    def objects(self, component: str, search: str) -> "Future[ObjectList]":
        """Return the objects of the EDS that the search selects."""
        ...

    def read_objects(self, component: str, objects: Sequence[str]) -> "Future[ObjectValues]":
        """Return the device's present values of these objects."""
        ...

    def dial(self) -> None:
        """Connect now where there is no link: the robot has been seen."""
        ...

    def show_processes(self, wanted: bool) -> None:
        """Ask for the process table from now on, or no more."""
        ...
