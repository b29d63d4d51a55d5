"""All chosen channels of one unit in one plot, with their newest values as its legend."""

from collections.abc import Sequence
from itertools import cycle
from typing import Final

from gateway.units import Unit
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plot import Curve, Mouse, Plot, css
from server_gui.views.widgets.wrapped import Wrapped

# Of what is neither the first left nor the first right channel of its plot.
OTHERS: Final = ("green", "pink", "vermilion", "yellow", "violet", "lime")


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
        self.plot.setAccessibleName(self.accessibleName())
        self._legend = Wrapped(f"Values of {self.accessibleName()}")
        self.body.addWidget(self._legend)
        self.body.addWidget(self.plot)
        self.setMinimumHeight(theme.px(120))

    def show_values(self, values: Sequence[float | None]) -> None:
        """Show the newest value of each curve, behind its name."""
        told = [
            (curve, f"{curve.channel} {self.unit.text(value)}")
            for curve, value in zip(self._curves, values, strict=True)
        ]
        self._legend.say([(css(self._theme, curve.colour), "━", text) for curve, text in told])
        self.plot.setAccessibleDescription(self._legend.accessibleDescription())


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
