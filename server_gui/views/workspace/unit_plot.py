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
HERE, BESIDE = "━", "─"  # as thick as the curves are
RECORDINGS: Final = ("green", "pink")  # where a plot has one channel of two: colours that belong to no side


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
    """One plot; `menu` is filled by whoever shows it.

    With `names`, of what is looked at and of what is beside it, each curve is there twice: what is beside is
    thin, and of another colour.
    """

    def __init__(
        self,
        theme: Theme,
        place: int,
        unit: Unit,
        curves: Sequence[Drawn],
        seconds: float,
        names: tuple[str, str] | None = None,
    ) -> None:
        super().__init__(_title(place, unit, curves, of_two=names is not None))
        self.unit = unit
        self.curves = tuple(curves)
        self.channels = tuple(curve.text for curve in curves)
        self.drawn = tuple(curve.text for curve in curves if not curve.problem)
        self.menu = QMenu(self)
        self.plot = takes_no_drops(Plot(theme, seconds, least=1e-3, mouse=Mouse.ALL))
        self._theme = theme
        self._both = names or ("", "")
        here, beside = _colours(self.channels, of_two=names is not None)
        self._curves = [Curve(text, here[text]) for text in self.drawn]
        self._beside = [Curve(text, beside[text], thin=True) for text in self.drawn] if names else []
        self.plot.set_curves([*self._curves, *self._beside])
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
        notes: Sequence[str] = ("",),
    ) -> None:
        """Show a value of each curve behind its name, `theirs` of what is beside.

        `notes` stand at the title, the fullest wording first.
        """
        self._places = places(self.unit.digits, self.plot.range_shown, self._places)
        told = []
        for number, (curve, value) in enumerate(zip(self._curves, values, strict=True)):
            name = "" if theirs and len(self._curves) == 1 else self._names[curve.channel]
            said = " ".join(filter(None, (name, self._both[0], self._text(value))))
            told.append((self._ink(curve, live=live), HERE, said))
            if theirs:
                told += self._compared(value, theirs[number], self._beside[number], live=live)
        bad = css(self._theme, "bad")
        told += [(bad, "▲", f"{one.name}: {one.problem}") for one in self.curves if one.problem]
        self._legend.say(told)
        self.set_note(*notes)
        self.plot.setAccessibleDescription(self._legend.accessibleDescription())

    def _compared(
        self, value: float | None, other: float | None, curve: Curve, *, live: bool
    ) -> list[tuple[str, str, str]]:
        """Return the value of what is beside, and how much more that is, as both are shown."""
        said = "–"
        if value is not None and other is not None:
            before, after = (round(one * self.unit.scale, self._places) for one in (value, other))
            said = rounded(after - before, self._places, "+")
        return [
            (self._ink(curve, live=live), BESIDE, f"{self._both[1]} {self._text(other)}"),
            (
                css(self._theme, "text" if live else "old"),
                "",
                f"difference {said} {self.unit.symbol}".rstrip(),
            ),
        ]

    def _ink(self, curve: Curve, *, live: bool) -> str:
        return css(self._theme, curve.colour if live else "old")

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


def _title(place: int, unit: Unit, curves: Sequence[Drawn], *, of_two: bool) -> str:
    """Return the measured quantities with their unit: a unit alone says too little.

    One channel of two robots or recordings is named here, so that their names have room below.
    """
    drawn = [curve for curve in curves if not curve.problem]
    if of_two and len(drawn) == 1:
        quantities = [drawn[0].name.replace(".", " ").replace("_", " ")]
    else:
        quantities = [*dict.fromkeys(map(_quantity, drawn))]
    said = ", ".join(quantities).capitalize()
    return f"{place + 1} · {said} ({unit.symbol})" if unit.symbol else f"{place + 1} · {said}"


def _quantity(curve: Drawn) -> str:
    is_channel = curve.text == curve.name and " " not in curve.name
    return curve.name.rpartition(".")[2].replace("_", " ") if is_channel else curve.name


def _colours(channels: Sequence[str], *, of_two: bool) -> tuple[dict[str, str], dict[str, str]]:
    """Return the colours of the channels, and those of the same channels of what is beside."""
    if of_two and len(channels) == 1:
        here, beside = ([one] for one in RECORDINGS)
    else:
        here = colours_of(channels)
        free = [one for one in OTHERS if one not in here] or OTHERS
        beside = [free[place % len(free)] for place in range(len(channels))]
    return dict(zip(channels, here, strict=True)), dict(zip(channels, beside, strict=True))


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
