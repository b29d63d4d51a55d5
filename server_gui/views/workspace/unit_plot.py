"""Curves of one unit in one plot, with their newest values, or those at the pointer, as its legend."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QMenu, QToolButton, QWidget

from gateway.units import Unit, rounded
from server_gui.core.workspace.decimals import places
from server_gui.views.theme import Theme
from server_gui.views.widgets.dragging import TakesCurves
from server_gui.views.widgets.plot import Curve, Mouse, Plot, css
from server_gui.views.widgets.wrapping_legend import WrappingLegend

# Of what is neither the first left nor the first right channel of its plot.
OTHERS: Final = ("green", "pink", "vermilion", "yellow", "violet", "lime")
BESIDE: Final = "┅"


@dataclass(frozen=True, slots=True)
class Drawn:
    """A curve: its text, what it is called, and why it is not drawn, where that is so."""

    text: str
    name: str
    problem: str = ""


def legend_row(theme: Theme, legend: WrappingLegend, menu: QMenu, name: str) -> QHBoxLayout:
    """Return a plot's legend, with a button for all that can be done with the plot."""
    button = QToolButton()
    button.setText("⋯")
    button.setAccessibleName(name)
    button.setToolTip("Curves, kind and place of this plot")
    button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
    button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
    button.setMenu(menu)
    button.setStyleSheet("QToolButton { padding: 0; } QToolButton::menu-indicator { image: none; }")
    button.setFixedSize(theme.px(26), theme.px(18))
    row = QHBoxLayout()
    row.addWidget(legend, 1)
    row.addWidget(button, 0, Qt.AlignmentFlag.AlignTop)
    return row


def takes_no_drops(plot: Plot) -> Plot:
    """Let what is dropped on it go to what is around."""
    plot.setAcceptDrops(False)
    plot.viewport().setAcceptDrops(False)
    return plot


class UnitPlot(TakesCurves):
    """One plot. Of what is `beside`, each curve is drawn dashed; `menu` is filled by whoever shows it."""

    def __init__(
        self, theme: Theme, place: int, unit: Unit, curves: Sequence[Drawn], seconds: float, beside: str = ""
    ) -> None:
        super().__init__(_title(place, unit, curves))
        self.unit = unit
        self.curves = tuple(curves)
        self.channels = tuple(curve.text for curve in curves)
        self.drawn = tuple(curve.text for curve in curves if not curve.problem)
        self.menu = QMenu(self)
        self.plot = takes_no_drops(Plot(theme, seconds, least=1e-3, mouse=Mouse.ALL))
        self._theme = theme
        self._beside = beside
        colours = dict(zip(self.channels, colours_of(self.channels), strict=True))
        self._curves = [Curve(text, colours[text]) for text in self.drawn]
        self.plot.set_curves(
            [*self._curves, *(Curve(one.channel, one.colour, dashed=True) for one in self._curves if beside)]
        )
        self.plot.setAccessibleName(self.accessibleName())
        self._places = unit.digits
        self._names = {curve.text: curve.name for curve in curves}
        self._legend = WrappingLegend(f"Values of {self.accessibleName()}")
        self.body.addLayout(legend_row(theme, self._legend, self.menu, f"Plot {place + 1}: curves and kind"))
        self.body.addWidget(self.plot)
        self.setMinimumHeight(theme.px(120))

    def show_values(
        self,
        values: Sequence[float | None],
        theirs: Sequence[float | None] = (),
        *,
        live: bool = True,
        when: str = "",
    ) -> None:
        """Show a value of each curve behind its name, `theirs` of what is beside; `when` tells the time."""
        self._places = places(self.unit.digits, self.plot.range_shown, self._places)
        told = []
        for number, (curve, value) in enumerate(zip(self._curves, values, strict=True)):
            ink = css(self._theme, curve.colour if live else "old")
            told.append((ink, "━", f"{self._names[curve.channel]} {self._text(value)}"))
            if theirs:
                told.append((ink, BESIDE, self._text(theirs[number])))
        bad = css(self._theme, "bad")
        told += [(bad, "▲", f"{one.name}: {one.problem}") for one in self.curves if one.problem]
        self._legend.say(told)
        self.set_note(when)
        self.plot.setAccessibleDescription(self._legend.accessibleDescription())

    def _text(self, value: float | None) -> str:
        return "–" if value is None else rounded(value * self.unit.scale, self._places)


class EmptyPlot(TakesCurves):
    """A plot of which nothing can be drawn on this robot: it says what is missing, and takes curves."""

    def __init__(self, theme: Theme, place: int, curves: Sequence[Drawn]) -> None:
        super().__init__(f"{place + 1} · nothing to draw here")
        self.menu = QMenu(self)
        self.legend = WrappingLegend(f"Missing in plot {place + 1}")
        self.body.addLayout(legend_row(theme, self.legend, self.menu, f"Plot {place + 1}: curves and kind"))
        bad = css(theme, "bad")
        self.legend.say([(bad, "▲", f"{one.name}: {one.problem}") for one in curves])
        self.body.addWidget(QWidget(), 1)


def _title(place: int, unit: Unit, curves: Sequence[Drawn]) -> str:
    """Return the measured quantities with their unit: a unit alone says too little."""
    quantities = dict.fromkeys(_quantity(curve) for curve in curves if not curve.problem)
    said = ", ".join(quantities).capitalize()
    return f"{place + 1} · {said} ({unit.symbol})" if unit.symbol else f"{place + 1} · {said}"


def _quantity(curve: Drawn) -> str:
    is_channel = curve.text == curve.name and " " not in curve.name
    return curve.name.rpartition(".")[2].replace("_", " ") if is_channel else curve.name


def colours_of(channels: Sequence[str]) -> list[str]:
    """Return the colour of each: blue of the first left one, orange of the first right one."""
    others, taken = cycle(OTHERS), set()
    colours: list[str] = []
    for name in channels:
        side = name.partition("_")[0]
        if side in ("left", "right") and side not in taken:
            taken.add(side)
            colours.append(side)
        else:
            colours.append(next(others))
    return colours
