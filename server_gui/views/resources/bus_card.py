"""One bus: its load, its counters, its traffic by kind, and its senders, worst first."""

from typing import Final

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
)

from gateway.wire.bus import CLOSED, BusInfo
from server_gui.core.alarms.alarm import Alarms
from server_gui.core.alarms.marks import GLYPHS, Mark
from server_gui.core.alarms.severity import bus_level, bus_mark
from server_gui.core.desk.bus_page import Row, rows, told_kinds
from server_gui.core.desk.station import Station
from server_gui.core.processing.bus_health import (
    ACTIVE,
    BUSY_PERCENT,
    FULL_PERCENT,
    OFF,
    BusHealthLevel,
    level,
    load_text,
)
from server_gui.core.processing.bus_senders import total
from server_gui.views.resources.load_bar import LoadBar
from server_gui.views.resources.trend import Floats, Trend
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_tone
from server_gui.views.widgets.columns import title_widths
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.plot import Curve, css
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.wrapping_legend import WrappingLegend

MOST: Final = 100.0  # percent: what is counted above it is the count's own error
LEAST_LOAD: Final = 20.0  # percent: less than that is no hill
LEVELS: Final = {
    BusHealthLevel.GOOD: Mark("disc", "good", "ok"),
    BusHealthLevel.UNKNOWN: Mark("ring", "old", "not known"),
    BusHealthLevel.WARNING: Mark("triangle", "warn", "warning"),
    BusHealthLevel.ALARM: Mark("square", "bad", "ALARM"),
}
TITLES: Final = (
    "Node",
    "Sender",
    "State",
    "Share",
    "Frames/s",
    "Sends",
    "SDO p50 / max",
    "Unanswered",
    "PDOs missing",
)
NODE, SENDER, STATE, SHARE, FRAMES, SENDS, TRIPS, UNANSWERED, MISSING = range(len(TITLES))
# Left out in this order where there is less room, before a name is shortened.
SPARE: Final = (SENDS, TRIPS, UNANSWERED, SHARE, MISSING, NODE, FRAMES)
NUMBERS: Final = (SHARE, FRAMES, TRIPS, UNANSWERED, MISSING)
SENDERS_HINT: Final = (
    "Each node has the frames that it sends itself. A PDO or request to a node is listed by its kind: "
    "the bus does not tell who sends it. “gateway or filtered”: sent by the gateway, or not let through "
    "by its interface."
)


class BusCard(Card):
    """One bus."""

    def __init__(self, theme: Theme) -> None:
        super().__init__("Bus")
        self._theme = theme
        self._icon, self.load, self._bar = MarkIcon(theme, 13), ShrinkingLabel("title"), LoadBar(theme)
        self._counters = WrappingLegend("Counters of the bus")
        self._controller = WrappingLegend("The gateway's CAN controller")
        self._kinds = WrappingLegend("Traffic by kind")
        self._past = Trend(theme, "Load over time", LEAST_LOAD, symbol=" %", digits=0)
        self._past.setObjectName("part")  # of this card: no frame of its own
        self.table = QTableWidget(0, len(TITLES))
        self.table.setHorizontalHeaderLabels(TITLES)
        self.table.setAccessibleName("Senders on the bus")
        set_tip(self.table, SENDERS_HINT)
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.table.setShowGrid(False)
        self.table.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.table.verticalHeader().hide()
        self.table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.table.horizontalHeader().setSectionResizeMode(SENDER, QHeaderView.ResizeMode.Stretch)
        self.table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        theme.changed.connect(self._forget)
        self.head.insertWidget(0, self._icon)  # of the bus, not of its load
        said = (self._counters, self._controller, self._kinds)
        for part in (self.load, self._bar, *said, self.table, self._past):
            self.body.addWidget(part)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _forget(self) -> None:
        """Rows and letters are of the size before."""
        self.table.setRowCount(0)

    def show_bus(self, bus: BusInfo, station: Station) -> None:
        """Show it as bad as what is told of it and of its nodes; nothing of a stale robot is good."""
        live, alarms = station.is_live, station.alarms
        bad = bus_level(level(bus), bus.name, alarms)
        self._icon.show_mark(shown_mark(bad, bus.name, alarms, live=live))
        rate = "" if bus.bitrate is None else f" of {bus.bitrate / 1e6:g} Mbit/s"
        word = "FULL: " if bad is BusHealthLevel.ALARM and (bus.load_percent or 0.0) >= FULL_PERCENT else ""
        self.load.say(f"{word}{load_text(bus)}{rate}", f"{word}{load_text(bus)}")
        self._bar.show_load(bus.load_percent, _colour_of(bus.load_percent or 0.0) if live else "old")
        set_tone(self.load, "" if live else "old")
        self.set_title(f"Bus {bus.name}")
        self._counters.say(self._counted(bus))
        self._controller.say([self._controlled(bus, live=live)])
        told = told_kinds(bus)
        dim = css(self._theme, "dim")
        self._kinds.say(
            [(dim, "", one) for one in (f"Frames/s by kind: {told[0]}", *told[1:])] if told else []
        )
        self._show_past(station.processing.bus_loads.recent(bus.name), live=live)
        self._show_senders(rows(bus, station.robot.parts, alarms, live=live))

    def _show_past(self, past: Floats, *, live: bool) -> None:
        times, load = past[:, 0], past[:, 1]
        known = load[~np.isnan(load)]
        self._past.set_note(f"peak {min(known.max(), MOST):.0f} %" if len(known) else "")
        held = np.minimum(load, MOST)
        self._past.show_rows(self._past, times, [Curve("load", "accent")], [held], live=live)

    def _counted(self, bus: BusInfo) -> list[tuple[str, str, str]]:
        text, wrong = css(self._theme, "text"), css(self._theme, "warn")
        frames = total(bus)
        parts = [(text, "", f"{'–' if frames is None else f'{frames:.0f}'} frames/s")]
        for count, one, many in (
            (bus.error_frames, "error frame", "error frames"),
            (bus.dropped, "frame lost on its way to the gateway", "frames lost on their way to the gateway"),
        ):
            words = f"{count} {one if count == 1 else many}"
            parts.append((wrong if count else text, "▲" if count else "", words))
        return parts

    def _controlled(self, bus: BusInfo, *, live: bool) -> tuple[str, str, str]:
        is_well = bus.state == ACTIVE and not bus.bus_offs
        colour = "bad" if bus.state in (OFF, CLOSED) else "text" if is_well else "warn"
        mark = "" if is_well else "■" if colour == "bad" else "▲"
        return css(self._theme, colour), mark, controller_text(bus, live=live)

    def _show_senders(self, shown: list[Row]) -> None:
        if self.table.rowCount() != len(shown):
            self.table.setRowCount(len(shown))
            height = self._theme.px(22)
            self.table.verticalHeader().setDefaultSectionSize(height)
            self.table.setFixedHeight(
                height * max(len(shown), 1) + self.table.horizontalHeader().sizeHint().height() + 4
            )
        for place, row in enumerate(shown):
            for column, said in enumerate(_texts(row)):
                self._set(place, column, said, row.colour)
        self._fit()

    def _fit(self) -> None:
        """Leave out parts without room as a whole: no number is cut, and no name while a part can go."""
        shown = self._columns()
        for column in range(len(TITLES)):
            self.table.setColumnHidden(column, column not in shown)

    def _columns(self) -> set[int]:
        titles = title_widths(self.table)
        widths = [max(self.table.sizeHintForColumn(column), title) for column, title in enumerate(titles)]
        shown = set(range(len(TITLES)))
        for column in SPARE:
            if sum(widths[known] for known in shown) > self.table.viewport().width():
                shown.discard(column)
        return shown

    def _set(self, row: int, column: int, text: str, colour: str) -> None:
        item = self.table.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            self.table.setItem(row, column, item)
            if column in NUMBERS:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                item.setFont(self._theme.number_font())
        if item.text() != text:
            item.setText(text)
        if item.foreground().color() != self._theme.colour(colour):
            item.setForeground(self._theme.colour(colour))


def shown_mark(bad: BusHealthLevel, bus: str, alarms: Alarms, *, live: bool) -> Mark:
    """Return the mark of a bus: that of the alarm by which it is so bad; what is old is not good."""
    if bad is BusHealthLevel.GOOD and not live:
        return LEVELS[BusHealthLevel.UNKNOWN]
    return bus_mark(bad, bus, alarms) or LEVELS[bad]


def controller_text(bus: BusInfo, *, live: bool) -> str:
    """Return the state of the gateway's own controller on a bus, in words."""
    state = f"{bus.state} (normal)" if live and bus.state == ACTIVE else bus.state
    offs = {0: "never bus off", 1: "once bus off"}.get(bus.bus_offs, f"{bus.bus_offs} times bus off")
    opened = "opened once" if bus.opened == 1 else f"opened {bus.opened} times"
    return f"gateway's CAN controller: {state}, {offs}, {opened}"


def _colour_of(load_percent: float) -> str:
    """Return the colour of a load by itself, whatever else is wrong with its bus."""
    return "bad" if load_percent >= FULL_PERCENT else "warn" if load_percent >= BUSY_PERCENT else "accent"


def _sender(row: Row) -> str:
    """Name who sends; of what is not one of the robot's nodes the identifiers, too."""
    return f"{row.name} {row.ids}".rstrip()


def _state(row: Row) -> str:
    return "" if row.mark is None else f"{GLYPHS[row.mark.shape]} {row.mark.word}"


def _texts(row: Row) -> tuple[str, ...]:
    return (
        row.node,
        _sender(row),
        _state(row),
        row.share,
        row.frames,
        row.sends,
        row.trips,
        row.unanswered,
        row.missing,
    )
