"""One card of something over the last minutes: curves, and their names with the newest values."""

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtGui import QShowEvent

from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plot import Curve, Plot, css
from server_gui.views.widgets.wrapping_legend import WrappingLegend

Floats = npt.NDArray[np.float64]
LEAST_HIGH: Final = 60  # a plot, at text of 100 %: its legend leaves it so much
OLD_S: Final = 5.0  # what has had no value for so long has none now
SPANS_S: Final = (30.0, 60.0, 120.0, 300.0, 600.0)  # of the past, the shortest that holds what there is


class Trend(Card):
    """`least` is the smallest range that is shown, in the unit of `scale` times what comes.

    The `unit` stands beside the title, or as `symbol` behind each value, which has so many `digits`.
    """

    def __init__(
        self,
        theme: Theme,
        title: str,
        least: float,
        scale: float = 1.0,
        *,
        unit: str = "",
        symbol: str = "",
        digits: int = 1,
    ) -> None:
        super().__init__(title)
        self.set_note(unit, unit.partition(" ")[0], "")
        self._theme = theme
        self._name, self._least, self._scale = title, least, scale
        self._symbol, self._digits = symbol, digits
        self._shown: tuple[object, ...] = ()
        self._rows = object()  # another one where what is drawn is no longer only added to
        self.legend = WrappingLegend(f"Values of {title}", named=True)
        self.body.addWidget(self.legend)
        theme.scaled.connect(self._resize)

    @cached_property
    def plot(self) -> Plot:
        """Made when it is first shown: a window that opens on another tab need not wait for it."""
        made = Plot(self._theme, SPANS_S[0], self._least)
        made.setAccessibleName(self._name)
        self.body.addWidget(made, 1)
        made.setMinimumHeight(self._theme.px(LEAST_HIGH))
        return made

    def showEvent(self, event: QShowEvent) -> None:
        self.plot.show()
        super().showEvent(event)

    def show_rows(
        self,
        source: object,
        times: Floats,
        curves: Sequence[Curve],
        columns: Sequence[Floats],
        *,
        live: bool,
    ) -> None:
        """Draw a column a curve over the times (s, rising); nothing where there are none."""
        length_s = times[-1] - times[0] if len(times) else 0.0
        span = next((seconds for seconds in SPANS_S if length_s < seconds), SPANS_S[-1])
        if self.plot.seconds != span:
            self.plot.set_seconds(span)
        if (source, tuple(curves)) != self._shown:
            self._shown, self._rows = (source, tuple(curves)), object()
            self.plot.set_curves(curves)
        self.plot.draw(self._rows, times, columns, live=live, scale=self._scale)
        self._say(curves, times, columns, live=live)

    def _resize(self) -> None:
        if "plot" in self.__dict__:  # it has been shown
            self.plot.setMinimumHeight(self._theme.px(LEAST_HIGH))

    def _say(self, curves: Sequence[Curve], times: Floats, columns: Sequence[Floats], *, live: bool) -> None:
        """Say the newest values; of what has none any more, as a process that has ended, none."""
        said = []
        for curve, values in zip(curves, columns, strict=True):
            known = np.flatnonzero(~np.isnan(values))
            is_now = bool(len(known)) and times[-1] - times[known[-1]] < OLD_S
            value = f"{values[known[-1]] * self._scale:.{self._digits}f}" if is_now else "–"
            said.append(
                (
                    css(self._theme, curve.colour if live and is_now else "old"),
                    "━",
                    f"{curve.channel} {value}{self._symbol}",
                )
            )
        self.legend.say(said)
        self.plot.setAccessibleDescription(self.legend.accessibleDescription())


def since_restart(rows: Floats) -> Floats:
    """Return the rows since the robot's clock has begun anew; the time is their first column."""
    restarts = np.flatnonzero(np.diff(rows[:, 0]) < 0)
    return rows[restarts[-1] + 1 :] if len(restarts) else rows
