"""Every robot with its worst state and its STOP, where the cards of the list are out of sight."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QSizePolicy, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.robots.panel import RobotsPanel, state_tip, state_words
from server_gui.views.theme import Theme
from server_gui.views.widgets.clickable_frame import ClickableFrame
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.scroll_area import ScrollArea
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.visibility import let_go

A_STATE: Final = 150  # wide, at text of 100 %: STOP NOT CONFIRMED has room
STOP_SHARE: Final = 0.5  # of a chip's width at most, which its STOP with the robot's name may take
AROUND: Final = 6  # pixels at both sides
SHARE: Final = 3  # of the window's height at most: what has no room then is scrolled to


class RobotChip(ClickableFrame):
    """A robot's mark and state, in the words of its card, and its STOP, which names it."""

    def __init__(self, station: Station, theme: Theme) -> None:
        super().__init__("card")
        self._theme = theme
        self.station = station
        self._icon, self.state = MarkIcon(theme, 12), ShrinkingLabel()
        self.stop = StopButton("robot_stop")
        row = QHBoxLayout(self)
        row.setContentsMargins(9, 1, 3, 1)
        row.addWidget(self._icon)
        row.addWidget(self.state, 1)
        row.addWidget(self.stop)

    def refresh(self, *, selected: bool) -> None:
        """Show how it is now."""
        words, title = state_words(self.station), self.station.title
        self._icon.show_mark(self.station.mark)
        self.state.say(*words)
        self.stop.name(title)
        self.setAccessibleName(f"Robot {title}")
        self.setAccessibleDescription(words[0])
        leads = f"{title} is shown" if selected else f"Look at {title}"
        set_tip(self, "\n".join(filter(None, (leads, state_tip(self.station)))))
        if self.property("selected") != selected:
            self.setProperty("selected", selected)
            self.style().polish(self)

    def needs(self, room: int) -> int:
        """Return how wide it is with its state and, of so much room for all of it, the name on its STOP."""
        self.stop.allow(round(room * STOP_SHARE))
        state = max(self._theme.px(A_STATE), self.state.minimumSizeHint().width())
        return self.minimumSizeHint().width() - self.state.minimumSizeHint().width() + state


class OthersBar(ScrollArea):
    """Hidden while `panel` shows the card of every robot whole.

    Each robot keeps its place, also the one that is looked at: the next click meets no other robot's STOP.
    """

    def __init__(self, desk: Desk, theme: Theme, panel: RobotsPanel) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._panel = panel
        self.chips: list[RobotChip] = []
        self._places: dict[RobotChip, tuple[int, int]] = {}
        self.setAccessibleName("Other robots")
        page = QWidget()
        page.setObjectName("dock")
        self._grid = QGridLayout(page)
        self._grid.setContentsMargins(AROUND, 2, AROUND, 2)
        self._grid.setSpacing(4)
        self.setWidget(page)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self.hide()

    def refresh(self) -> None:
        """Show how they are now; before the panel does, whose new cards have no places yet."""
        stations = self._desk.stations
        for chip in [chip for chip in self.chips if chip.station not in stations]:
            self.chips.remove(chip)
            self._places.pop(chip, None)
            let_go(chip)
            chip.hide()
            chip.deleteLater()
        for station in stations[len(self.chips) :]:
            self._add(station)
        is_needed = len(stations) > 1 and not self._panel.shows_all
        if not is_needed:
            let_go(self)
        self.setVisible(is_needed)
        if is_needed:
            for chip in self.chips:
                chip.refresh(selected=chip.station is self._desk.selected)
            self._arrange()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def _add(self, station: Station) -> None:
        chip = RobotChip(station, self._theme)
        chip.chosen.connect(lambda: self._desk.select(station))
        chip.stop.stopped.connect(lambda: station.stop("stop button beside the pages"))
        self.chips.append(chip)

    def _arrange(self) -> None:
        """Arrange as many beside each other as have room, and be as high as they need."""
        grid, room = self._grid, self.viewport().width() - 2 * AROUND
        columns = max(
            min(room // max((chip.needs(room) for chip in self.chips), default=1), len(self.chips)), 1
        )
        places = {chip: divmod(number, columns) for number, chip in enumerate(self.chips)}
        moved = [chip for chip, place in places.items() if self._places.get(chip) != place]
        self._places = places
        for chip in moved:
            grid.removeWidget(chip)
        for chip in moved:  # one that is hidden meanwhile loses the keyboard
            grid.addWidget(chip, *places[chip])
            chip.show()
        for column in range(len(self.chips)):
            grid.setColumnStretch(column, int(column < columns))
        high = min(grid.sizeHint().height(), self.window().height() // SHARE)
        if self.minimumHeight() != high or self.maximumHeight() != high:
            self.setFixedHeight(high)
