"""What the cursors read of the curves that are drawn."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from server_gui.core.desk.measuring import measure, row_at
from server_gui.core.workspace.scene import Scene
from server_gui.views.workspace.drawing import columns
from server_gui.views.workspace.measuring import Row
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
) -> Readings | None:
    """Return what every curve is at the cursors, and over the window in sight; None without any row."""
    times, (left, right) = seconds_ago(scene, seconds), window
    if not len(times):
        return None
    a, b = (row_at(times, cursor) for cursor in at_s)
    first, last = np.searchsorted(times, left), np.searchsorted(times, right, "right")
    rows = [
        (name, plot.unit, measure(values, a, b, int(first), int(last)))
        for plot in plots
        for text in plot.drawn
        for name, values in columns(scene, text, scene.times(seconds))
    ]
    a_s, b_s = (s if at is None else float(times[at]) for s, at in zip(at_s, (a, b), strict=True))
    return Readings(a_s, b_s, rows)


def seconds_ago(scene: Scene, seconds: float) -> Floats:
    """Return the times of the rows of the last `seconds`, s until the newest."""
    times = scene.times(seconds)
    return times - times[-1] if len(times) else times
