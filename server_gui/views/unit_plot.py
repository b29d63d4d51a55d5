"""All chosen channels of one unit in one plot, with their newest values as its legend."""

from collections.abc import Sequence
from itertools import cycle
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from gateway.units import Unit
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import rich
from server_gui.views.widgets.plot import Curve, Mouse, Plot, css

# Okabe & Ito's colours for what is neither the first left nor the first right channel of its plot.
OTHERS: Final = ("#009e73", "#cc79a7", "#d55e00", "#f0e442", "#8f8fd6", "#7fb36b")


class UnitPlot(Card):
    """One plot."""

    def __init__(self, theme: Theme, unit: Unit, channels: Sequence[str], seconds: float) -> None:
        super().__init__(_title(unit, channels))
        self.unit = unit
        self.channels = tuple(channels)
        self.plot = Plot(theme, seconds, least=1e-3, mouse=Mouse.ALL)
        self._curves = [
            Curve(name, colour) for name, colour in zip(channels, _colours(channels), strict=True)
        ]
        self.plot.set_curves(self._curves)
        self._theme = theme
        self._legend = QLabel()
        self._legend.setTextFormat(Qt.TextFormat.RichText)
        self._legend.setWordWrap(True)
        self.body.addWidget(self._legend)
        self.body.addWidget(self.plot)
        self.setMinimumHeight(theme.px(120))

    def show_values(self, values: Sequence[float | None]) -> None:
        """Show the newest value of each curve, behind its name."""
        names = (
            f'<span style="color:{css(self._theme, curve.colour)}">━ {rich(curve.channel)} '
            f"<b>{rich(self.unit.text(value))}</b></span>"
            for curve, value in zip(self._curves, values, strict=True)
        )
        set_text(self._legend, "&nbsp;&nbsp; ".join(names))


def _title(unit: Unit, channels: Sequence[str]) -> str:
    """What is measured, and in which unit: a unit alone says too little."""
    quantities = dict.fromkeys(name.rpartition(".")[2].replace("_", " ") for name in channels)
    said = ", ".join(quantities).capitalize()
    return f"{said} ({unit.symbol})" if unit.symbol else said


def _colours(channels: Sequence[str]) -> list[str]:
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
