"""The drives that a bus has, axis by axis: read while they stand without power, moved by hand."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

from drivers.bus.values import unsigned
from drivers.errors import DriverError
from drivers.joint.cia402 import ENERGISED, DriveState, drive_state
from drivers.joint.quantities import AXIS_OFFSET
from drivers.scan.identification import NodeAnswers
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Talk, press

T = TypeVar("T")

STATUSWORD, POSITION = 0x6041, 0x6064
HALF = 1 << 31  # of what 6064h can count: beyond it goes on at the other end


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of one node."""

    node: int
    number: int = 0

    def __str__(self) -> str:
        return f"node {self.node}" + (f", axis {self.number}" if self.number else "")

    def index(self, index: int) -> int:
        """Return the index, on this axis, of the first axis's object at `index` (CiA 402-2 §5)."""
        return index + self.number * AXIS_OFFSET


def axes_of(told: Mapping[int, NodeAnswers]) -> tuple[Axis, ...]:
    """Return every axis of every node that says that it is a drive."""
    return tuple(Axis(node, axis.number) for node, one in sorted(told.items()) for axis in one.axes)


def state(bench: Bench, axis: Axis) -> DriveState | None:
    """Return the axis's state; `None` if unknown. Raises `DriverError`."""
    data = bench.read(axis.node, axis.index(STATUSWORD))
    return None if data is None else drive_state(unsigned(data))


def powered(bench: Bench, axes: Sequence[Axis]) -> tuple[Axis, ...]:
    """Return those that might move by themselves, or whose state is not known. Raises `DriverError`."""
    return tuple(axis for axis in axes if (found := state(bench, axis)) is None or found in ENERGISED)


def counts(bench: Bench, axis: Axis) -> int | None:
    """Return the encoder's count; `None` if the axis has no position. Raises `DriverError`."""
    data = bench.read(axis.node, axis.index(POSITION))
    return None if data is None else int.from_bytes(data[:4], "little", signed=True)


def nearest(counts: int, to: int) -> int:
    """Return the `counts` of a 32-bit counter, unwrapped to the value nearest to `to`."""
    return to + (counts - to + HALF) % (2 * HALF) - HALF


def number(bench: Bench, axis: Axis, index: int, subindex: int = 0) -> int | None:
    """Return an unsigned object of the axis; `None` where it has none. Raises `DriverError`."""
    data = bench.read(axis.node, axis.index(index), subindex)
    return None if data is None else unsigned(data)


def answered(read: Callable[[], T]) -> Talk[T]:
    """Return the value of `read`; if a drive does not answer, wait for the user, and ask again."""
    while True:
        try:
            return read()
        except DriverError as error:
            yield from press(f"{error}. See that every drive answers.")
