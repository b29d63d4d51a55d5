"""An XY plot: curves over another one instead of over time; what is longer ago is fainter."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QMenu

from gateway.units import Unit
from server_gui.views.theme import Theme
from server_gui.views.widgets.dragging import TakesCurves
from server_gui.views.widgets.plot import css
from server_gui.views.widgets.value_axis import ValueAxis
from server_gui.views.widgets.wrapping_legend import WrappingLegend
from server_gui.views.workspace.unit_plot import Drawn, colours_of, legend_row

Floats = npt.NDArray[np.float64]
BANDS: Final = 5  # shades of age
FAINTEST: Final = 0.15
MOST_POINTS: Final = 1000  # of a curve: more are not to be seen apart
EVERY: Final = 6  # frames between two drawings


class XYPlot(TakesCurves):
    """`x` is what the others are drawn over; a dot is where they are now."""

    def __init__(
        self, theme: Theme, place: int, x: Drawn, units: tuple[Unit, Unit], curves: Sequence[Drawn]
    ) -> None:
        self.x_unit, self.unit = units
        over = f"{x.name} ({self.x_unit.symbol})" if self.x_unit.symbol else x.name
        names = ", ".join(curve.name for curve in curves)
        super().__init__(f"{place + 1} · {names} ({self.unit.symbol}) over {over}")
        self.over, self.curves, self.menu = x, tuple(curves), QMenu(self)
        self.drawn = tuple(curve.text for curve in curves if not curve.problem)
        self._theme, self._frame = theme, 0
        self._legend = WrappingLegend(f"Values of {self.accessibleName()}")
        self.plot = pg.PlotWidget(enableMenu=False, axisItems={"left": ValueAxis()})
        self.plot.setAccessibleName(self.accessibleName())
        self.plot.getPlotItem().hideButtons()
        for widget in (self.plot, self.plot.viewport()):
            widget.setAcceptDrops(False)
        self._colours = dict(zip(self.drawn, colours_of(self.drawn), strict=True))
        self._lines = {text: [self.plot.plot() for _ in range(BANDS)] for text in self.drawn}
        self._dots = {text: self.plot.plot(symbol="o", symbolSize=7) for text in self.drawn}
        self.body.addLayout(legend_row(theme, self._legend, self.menu, f"Plot {place + 1}: curves and kind"))
        self.body.addWidget(self.plot, 1)
        self.setMinimumHeight(theme.px(160))
        self._restyle()

    def draw(self, xs: Floats, columns: Sequence[Floats], *, live: bool) -> None:
        """Draw columns over `xs`, in SI, row by row, the last the newest; grey where not `live`."""
        self._frame += 1
        if self._frame % EVERY != 1:
            return
        for text, ys in zip(self.drawn, columns, strict=True):
            self._draw(text, xs * self.x_unit.scale, ys * self.unit.scale, live=live)

    def show_values(
        self, x: float | None, values: Sequence[float | None], *, live: bool = True, when: str = ""
    ) -> None:
        """Show where it is; grey where not `live`."""
        by = {curve.text: curve.name for curve in self.curves}
        told = [
            (
                css(self._theme, self._colours[text] if live else "old"),
                "━",
                f"{by[text]} {self.unit.text(value)}",
            )
            for text, value in zip(self.drawn, values, strict=True)
        ]
        told.append(
            (css(self._theme, "text" if live else "old"), "→", f"{self.over.name} {self.x_unit.text(x)}")
        )
        bad = css(self._theme, "bad")
        told += [(bad, "▲", f"{one.name}: {one.problem}") for one in self.curves if one.problem]
        self._legend.say(told)
        self.set_note(when or "fainter is longer ago")

    def _draw(self, text: str, xs: Floats, ys: Floats, *, live: bool) -> None:
        step = max(1, -(-len(xs) // MOST_POINTS))
        xs, ys = xs[::-step][::-1], ys[::-step][::-1]  # the newest is always there
        ink = self._theme.colour(self._colours[text] if live else "old")
        edges = np.linspace(0, len(xs), BANDS + 1).astype(int)
        for band, line in enumerate(self._lines[text]):
            begin, end = int(edges[band]), int(edges[band + 1])
            begin = max(begin - 1, 0)  # joins it to the one before
            line.setData(xs[begin:end], ys[begin:end], pen=pg.mkPen(_faded(ink, band)), connect="finite")
        known = len(xs) > 0 and bool(np.isfinite(xs[-1] + ys[-1]))
        at = slice(-1, None) if known else slice(0, 0)
        self._dots[text].setData(xs[at], ys[at], symbolBrush=ink, symbolPen=ink)

    def _restyle(self) -> None:
        self.plot.setBackground(self._theme.colour("card"))
        for name in ("left", "bottom"):
            axis = self.plot.getPlotItem().getAxis(name)
            axis.setPen(self._theme.colour("border"))
            axis.setTextPen(self._theme.colour("dim"))
            axis.setTickFont(self._theme.text_font(0.85))
            axis.enableAutoSIPrefix(False)


def _faded(ink: QColor, band: int) -> QColor:
    """Return a band's colour; the oldest is the faintest."""
    faded = QColor(ink)
    faded.setAlphaF(FAINTEST + (1.0 - FAINTEST) * (band + 1) / BANDS)
    return faded
