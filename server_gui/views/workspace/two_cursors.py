"""Two cursors over every plot, and what they read."""

from collections.abc import Callable
from typing import Final

from server_gui.core.desk.measuring import nearest
from server_gui.core.workspace.scene import Scene
from server_gui.views.theme import Theme
from server_gui.views.widgets.scroll_area import bring_into_sight
from server_gui.views.workspace.measuring import Measuring
from server_gui.views.workspace.plot_area import PlotArea
from server_gui.views.workspace.readings import readings, seconds_ago

AT_FIRST: Final = (1 / 3, 2 / 3)  # of what is in sight


class TwoCursors:
    """`seconds` tells how much of the past plots have; `moved` is called where there is more to be said."""

    def __init__(
        self,
        scene: Scene,
        area: PlotArea,
        theme: Theme,
        seconds: Callable[[], float],
        moved: Callable[[], None],
    ) -> None:
        self._scene, self._area, self._seconds, self._moved = scene, area, seconds, moved
        self.at = [0.0, 0.0]  # s until the newest row
        self.active = 0
        self.measuring = Measuring(theme)
        self.measuring.chosen.connect(lambda cursor: self.move(cursor, self.at[cursor]))
        self.measuring.stepped.connect(self._step)

    @property
    def are_shown(self) -> bool:
        """Whether somebody has asked for them."""
        return not self.measuring.isHidden()

    def show(self, on: bool) -> None:
        """Show them within what is in sight of the rows, with the table of what they read; or neither."""
        left, right = self._area.in_sight(self._seconds())
        times = seconds_ago(self._scene, self._seconds())
        if len(times) and times[0] < right:
            left = max(left, float(times[0]))
        self.at = [left + (right - left) * share for share in AT_FIRST]
        self.measuring.setVisible(on)
        if on:
            self.measuring.setFocus()
            bring_into_sight(self.measuring)
        self.mark()
        self._moved()  # measure at once

    def move(self, cursor: int, to_s: float) -> None:
        """Put one of them to a time (s until the newest row); the keys move that one from now on."""
        self.active, self.at[cursor] = cursor, to_s
        self.mark()
        self._moved()

    def shift(self, by_s: float) -> None:
        """Move both: rows have come, and they stay where they are in the curves."""
        self.at = [at_s + by_s for at_s in self.at]
        self.mark()

    def mark(self) -> None:
        """Every plot shows where they are."""
        for plot in self._area.plots:
            plot.plot.show_cursors(tuple(self.at) if self.are_shown else (), self.active)

    def read(self) -> None:
        """Read every curve at the cursors, where there are samples, and over what is in sight."""
        if self.are_shown:
            seconds = self._seconds()
            found = readings(self._scene, self._area.plots, self.at, self._area.in_sight(seconds), seconds)
            self.measuring.show_readings(found.a_s, found.b_s, self.active, found.rows)

    def _step(self, samples: int) -> None:
        """Move the active cursor by so many samples."""
        times = seconds_ago(self._scene, self._seconds())
        row = nearest(times, self.at[self.active])
        if row is not None:
            self.move(self.active, float(times[min(max(row + samples, 0), len(times) - 1)]))
