"""Faults of a sensor and its line: plain switches, all off, to be set while the robot runs."""

import math
from dataclasses import dataclass, field


@dataclass(slots=True)
class LineFaults:
    """One sensor, its cable and its settings. On a CAN bus only `unplugged` and `frozen` mean anything."""

    unplugged: bool = False  # nothing arrives and the port is gone; plugged in again, the sensor starts anew
    frozen: bool = (
        False  # it measures no more: the same values again and again, in frames that go on counting
    )
    wrong_baud: int | None = None  # the rate at which it sends instead of its own
    garbage_share: float = 0.0  # of its bytes: replaced by noise on the way
    dropout_share: float = 0.0  # of its frames: never sent, but counted
    wraps_soon: bool = False  # when it starts next, its counters stand seconds before they wrap


@dataclass(slots=True)
class InsoleFaults(LineFaults):
    """Further faults of an insole."""

    stuck_cell: int | None = None  # the number of a cell that always says the same
    saturated: bool = False  # its amplifier ends far too low, and it says so where its format can
    drift: float = 0.0  # Pa/s by which every cell reads more and more; 0 again takes all of it away
    swapped: bool = False  # it lies in the other shoe
    dead_cells: set[int] = field(default_factory=set)  # numbers of cells that say nothing
    scale: float = 1.0  # by which each cell is told wrong


@dataclass(slots=True)
class ImuFaults(LineFaults):
    """Further faults of an IMU."""

    drift: float = 0.0  # rad/s that its gyro about y reads too much, and its pitch with it; 0 takes it away
    slipped: float = 0.0  # rad about y by which it sits on the trunk otherwise than it was built in
    clipped_at: float = math.inf  # m/s² at which each axis of its accelerometer ends
