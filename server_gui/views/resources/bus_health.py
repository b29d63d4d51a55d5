"""Bus health: the alarms about each CAN bus and what is on it, in their own lines, and a card a bus."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtWidgets import QVBoxLayout, QWidget

from gateway.wire.bus import BusInfo
from server_gui.core.alarms.simulated import advised, is_simulated
from server_gui.core.desk.bus_page import checks, lines
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.processing.bus_health import seen
from server_gui.views.alarms.words import in_window
from server_gui.views.resources.bus_card import BusCard
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import unbroken
from server_gui.views.widgets.wrapping_label import WrappingLabel

READ: Final = 6  # frames between two looks
TOO_OLD: Final = "The robot's gateway does not report its buses: it is an older version."
NOT_NOW: Final = "The state of the buses is not known now."


class BusHealthView(QWidget):
    """The buses of the robot that is looked at, with what is wrong with them above."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._frame = 0
        self.cards: list[BusCard] = []
        self.setObjectName("page")
        self.said, self.checks = WrappingLabel("banner"), WrappingLabel("dim")
        self._check = Card("What to check")
        self._check.body.addWidget(self.checks)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(8, 8, 8, 8)
        self._column.setSpacing(8)
        self._column.addWidget(self.said)
        self._column.addWidget(self._check)
        self._column.addStretch(1)

    def read_now(self) -> None:
        """Let the next frame show it anew: what stands above the tab is shown anew then."""
        self._frame = 0

    def refresh(self) -> None:
        """Show how it is now; called each frame while the tab is visible."""
        self._frame += 1
        station = self._desk.selected
        if station is None or self._frame % READ != 1:
            return
        buses = seen(station.robot)
        self._say(station, buses)
        shown = buses or ()
        while len(self.cards) < len(shown):
            self.cards.append(BusCard(self._theme))
            self._column.insertWidget(len(self.cards), self.cards[-1])
        for place, card in enumerate(self.cards):
            card.setVisible(place < len(shown))
            if place < len(shown):
                card.show_bus(shown[place], station)

    def _say(self, station: Station, buses: Sequence[BusInfo] | None) -> None:
        found = lines(buses or (), station.alarms)
        if buses is None:
            is_old = (
                station.is_linked and station.robot.buses_at_ns is not None and station.robot.buses is None
            )
            text = TOO_OLD if is_old else NOT_NOW
        elif not buses:
            text = "This robot has no CAN bus."
        else:
            text = "\n".join(line for _, line in found)
        simulated = is_simulated(station.robot)
        found_checks = (advised(one, simulated=simulated) for one in checks(buses or (), station.alarms))
        to_check = [*dict.fromkeys(map(in_window, found_checks))]
        set_text(self.checks, "\n".join(f"→ {check}" for check in to_check))
        self._check.setVisible(bool(to_check))
        tone = "bad" if any(bad for bad, _ in found) else ""
        if self.said.property("tone") != tone:
            self.said.setProperty("tone", tone)
            self.said.style().polish(self.said)
        set_text(self.said, unbroken(text))
        self.said.setVisible(bool(text))
