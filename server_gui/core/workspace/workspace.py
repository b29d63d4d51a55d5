"""Assignment of curves to plots; curves that cannot share an axis are refused, with the reason."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from gateway.units import Unit
from server_gui.core.workspace.curve_binding import CurveBinding

MOST_CURVES: Final = 24
MOST_PLOTS: Final = 12


class Refused(Exception):
    """A curve cannot be placed there; with the reason, and the alternatives."""


@dataclass(slots=True)
class PlotSpec:
    """Curves as they are written; with `x`, another such text, drawn over that instead of over time."""

    curves: list[str] = field(default_factory=list)
    x: str = ""

    @property
    def is_xy(self) -> bool:
        """Whether it is an XY plot."""
        return bool(self.x)


class Workspace:
    """`revision` rises with each change."""

    def __init__(self) -> None:
        self.plots: list[PlotSpec] = []
        self.revision = 0

    @property
    def curves(self) -> list[str]:
        """All that are drawn, each once."""
        return list(dict.fromkeys(text for plot in self.plots for text in plot.curves))

    @property
    def room(self) -> int:
        """Number of curves that may be added."""
        return MOST_CURVES - sum(len(plot.curves) for plot in self.plots)

    def arrange(self, curves: Iterable[CurveBinding]) -> None:
        """Begin anew: those of one unit share a plot; as many as may be drawn."""
        by_unit: dict[Unit | None, PlotSpec] = {}
        for meant in list(curves)[:MOST_CURVES]:
            by_unit.setdefault(meant.unit, PlotSpec()).curves.append(meant.text)
        self.show(list(by_unit.values()))

    def show(self, plots: Sequence[PlotSpec]) -> None:
        """Show exactly these."""
        self.plots = [PlotSpec(list(plot.curves), plot.x) for plot in plots]
        self.revision += 1

    def split(self) -> None:
        """Give each curve over time a plot of its own, as far as there is room for plots."""
        found: list[PlotSpec] = []
        for number, plot in enumerate(self.plots):
            later = len(self.plots) - number - 1
            fits = not plot.is_xy and len(found) + len(plot.curves) + later <= MOST_PLOTS
            found += [PlotSpec([text]) for text in plot.curves] if fits else [plot]
        self.show([PlotSpec(list(plot.curves), plot.x) for plot in found])

    def put(self, meant: CurveBinding, units: Sequence[Unit | None]) -> None:
        """Put a curve where its like is, else into a plot of its own; `units` has that of each plot.

        Raises:
            Refused: there is no room.

        """
        fits = (
            place for place, unit in enumerate(units) if unit == meant.unit and not self.plots[place].is_xy
        )
        place = next(fits, None)
        self.new_plot(meant) if place is None else self.add(meant, place, units[place])

    def add(self, meant: CurveBinding, place: int, unit: Unit | None) -> None:
        """Put a curve into a plot, whose curves are in `unit`, None while nobody knows.

        Raises:
            Refused: the plot has another unit, or there is no room.

        """
        plot = self.plots[place]
        if meant.text in plot.curves:
            return
        if meant.problem:
            raise Refused(f"{meant.name} cannot be drawn: {meant.problem}")
        if unit is not None and plot.curves and meant.unit != unit:
            theirs, its = (said(each) for each in (unit, meant.unit))
            raise Refused(
                f"{meant.name} is in {its}, plot {place + 1} in {theirs}, and an axis has one unit: "
                "drop it between plots or below them, or use New plot"
            )
        self._hold_room()
        plot.curves.append(meant.text)
        self.revision += 1

    def new_plot(self, meant: CurveBinding | None = None, over: str = "", place: int | None = None) -> int:
        """Make a plot, with a curve in it where one is given, `over` another one; return its place.

        Raises:
            Refused: there is no room.

        """
        if len(self.plots) >= MOST_PLOTS:
            raise Refused(f"there are {MOST_PLOTS} plots, and no room for more: remove one first")
        if meant is not None:
            if meant.problem:
                raise Refused(f"{meant.name} cannot be drawn: {meant.problem}")
            self._hold_room()
        place = len(self.plots) if place is None else min(max(place, 0), len(self.plots))
        self.plots.insert(place, PlotSpec([] if meant is None else [meant.text], over))
        self.revision += 1
        return place

    def remove(self, text: str, place: int | None = None) -> None:
        """Take a curve out of a plot, or out of all; a plot that is empty then goes."""
        for number, plot in enumerate(self.plots):
            if text in plot.curves and place in (None, number):
                plot.curves.remove(text)
                self.revision += 1
        self.plots = [plot for plot in self.plots if plot.curves]

    def remove_plot(self, place: int) -> None:
        """Take a plot away, with all that is in it."""
        del self.plots[place]
        self.revision += 1

    def turn(self, place: int, x: str) -> None:
        """Draw a plot over a curve instead of over time; over time again where `x` is empty."""
        self.plots[place].x = x
        self.revision += 1

    def _hold_room(self) -> None:
        if self.room <= 0:
            raise Refused(f"{MOST_CURVES} curves are drawn, and no more at a time: remove one first")


def said(unit: Unit | None) -> str:
    """Return a unit for a sentence."""
    return "an unknown unit" if unit is None else unit.symbol or "no unit"
