"""Component-processing over a recording: the same events and measures as live, for a whole session."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.gait_events import GaitEvent, Leg
from server_gui.core.processing.gait_measures import Gait, Stride, summary
from server_gui.core.processing.joint_measures import Error
from server_gui.core.processing.wiring import Wiring

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
ROWS = 8192  # at a time


@dataclass(frozen=True, slots=True)
class RecordedGait:
    """Gait in a recording: every event and stride, and the measures over all of them (SI units)."""

    events: list[GaitEvent]
    strides: list[Stride]
    gait: Gait
    errors: Mapping[str, Error]  # of joints that tell a following error, over all rows


def summarise(stamps_ns: Ints, columns: Mapping[str, Floats]) -> RecordedGait:
    """Summarise rows of one robot, given in the order of time.

    `stamps_ns` are on the robot's monotonic clock; `columns` are as long, by channel, NaN where there is no
    value.
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
    errors = {name.component: _error(columns[name.channel]) for name in wiring.errors}
    known = {name: error for name, error in errors.items() if error is not None}
    return RecordedGait(events, strides, summary(by_leg), known)


def _with_none(column: Floats) -> list[float | None]:
    values: list[float | None] = column.tolist()
    for place in np.flatnonzero(np.isnan(column)):
        values[place] = None
    return values


def _error(column: Floats) -> Error | None:
    known = column[~np.isnan(column)]
    if not len(known):
        return None
    return Error(float(np.sqrt(np.mean(known**2))), float(np.max(np.abs(known))))
