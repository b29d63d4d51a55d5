"""Component-processing over a recording: the same events and measures as live, for a whole session."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.gait_events import GaitEvent, Leg
from server_gui.core.processing.gait_measures import Gait, Stride, summary
from server_gui.core.processing.joint_measures import Error, Floats, tracking_error
from server_gui.core.processing.wiring import POSITION, STATE, Wiring

Ints = npt.NDArray[np.int64]
ROWS = 8192  # at a time


@dataclass(frozen=True, slots=True)
class RecordedGait:
    """Gait in a recording: every event and stride, and the measures over all of them (SI units)."""

    events: list[GaitEvent]
    strides: list[Stride]
    gait: Gait
    errors: Mapping[str, Error | None]  # of joints that tell one; None: never while its drive was enabled


def summarise(
    stamps_ns: Ints,
    columns: Mapping[str, Floats],
    enabled: Mapping[str, Collection[float]] = MappingProxyType({}),
) -> RecordedGait:
    """Summarise rows of one robot, given in the order of time.

    `stamps_ns` are on the robot's monotonic clock; `columns` are as long, by channel, NaN where there is no
    value. `enabled` has of each channel that is a drive's state the numbers that mean *operation enabled*.
    """
    wiring = Wiring.of(list(columns))
    used = {name: columns[name] for name in sorted(wiring.channels)}
    processing = ComponentProcessing()
    events: list[GaitEvent] = []
    strides: list[Stride] = []
    for begin in range(0, len(stamps_ns), ROWS):
        rows = slice(begin, begin + ROWS)
        part = {name: _with_none(column[rows]) for name, column in used.items()}
        found = processing.take(stamps_ns[rows].tolist(), part)
        events += found.events
        strides += found.strides
    by_leg = {leg: [stride for stride in strides if stride.leg is leg] for leg in Leg}
    errors = {
        joint: tracking_error(error, columns.get(state := f"{joint}.{STATE}"), enabled.get(state))
        for joint, error in _errors(wiring, columns)
        if not np.isnan(error).all()
    }
    return RecordedGait(events, strides, summary(by_leg), errors)


def _errors(wiring: Wiring, columns: Mapping[str, Floats]) -> Iterator[tuple[str, Floats]]:
    """Yield each joint's following error (60F4h), or target − position where it tells none."""
    for channel, joint in wiring.errors:
        yield joint, columns[channel]
    for channel, joint in wiring.targets:
        if (position := columns.get(f"{joint}.{POSITION}")) is not None:
            yield joint, columns[channel] - position


def _with_none(column: Floats) -> list[float | None]:
    values: list[float | None] = column.tolist()
    for place in np.flatnonzero(np.isnan(column)):
        values[place] = None
    return values
