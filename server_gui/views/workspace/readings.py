"""What the cursors read of the curves that are drawn."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gateway.units import Unit
from server_gui.core.desk.measuring import Measured, measure, row_at
from server_gui.core.workspace.scene import Scene
from server_gui.views.workspace.measuring import Row, apart
from server_gui.views.workspace.unit_plot import UnitPlot

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Readings:
    """Both cursors, at a sample where there is one (s until the newest row), and what each curve is there."""

    a_s: float
    b_s: float
    rows: Sequence[Row]


def readings(
    scene: Scene,
    plots: Iterable[UnitPlot],
    at_s: Sequence[float],
    window: tuple[float, float],
    seconds: float,
) -> Readings:
    """Return what every curve is at the cursors, and over the window in sight; None where it has no row."""
    times, (left, right) = seconds_ago(scene, seconds), window
    a, b = (row_at(times, cursor) for cursor in at_s)
    first, last = np.searchsorted(times, left), np.searchsorted(times, right, "right")

    def measured(values: Floats) -> Measured:
        return measure(values, a, b, int(first), int(last))

    stamps = scene.times(seconds)
    rows = [
        row
        for plot in plots
        for text in plot.drawn
        for row in _rows(scene, plot.unit, text, stamps, measured)
    ]
    a_s, b_s = (s if at is None else float(times[at]) for s, at in zip(at_s, (a, b), strict=True))
    return Readings(a_s, b_s, rows)


def _rows(
    scene: Scene, unit: Unit, text: str, times: Floats, measured: Callable[[Floats], Measured]
) -> Iterator[Row]:
    """Yield what a curve is; with another beside, that too, and how they differ: at cursors, as shown."""
    name, values = scene.meaning(text).name, scene.values(text, len(times))
    here = measured(values)
    if scene.names is None:
        yield name, unit, here
        return
    theirs = scene.values_beside(text, times)
    beside, between = measured(theirs), measured(theirs - values)
    between = replace(between, a=apart(unit, here.a, beside.a), b=apart(unit, here.b, beside.b))
    for said, found in zip((*scene.names, "difference"), (here, beside, between), strict=True):
        yield f"{name}, {said}", unit, found


def seconds_ago(scene: Scene, seconds: float) -> Floats:
    """Return the times of the rows of the last `seconds`, s until the newest."""
    times = scene.times(seconds)
    return times - times[-1] if len(times) else times
