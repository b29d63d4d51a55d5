"""What happened, newest first, with what still lasts on top: links, faults, writes, stops, control."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from gateway.plain_text import plain
from server_gui.core.alarms.alarm import Active, Alarms
from server_gui.core.alarms.marks import GLYPHS, Mark
from server_gui.core.alarms.severity import event_mark
from server_gui.core.alarms.texts import LEFT
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import WHO
from server_gui.core.desk.resetting import RESET_MARK
from server_gui.core.desk.station import Station
from server_gui.core.follow.news import Item, NewsKind
from server_gui.views.alarms.words import in_order
from server_gui.views.marks import time_of_day
from server_gui.views.theme import Theme
from server_gui.views.widgets.elided import SentenceDelegate
from server_gui.views.widgets.plain import tip

Index = QModelIndex | QPersistentModelIndex
COLUMNS: Final = 4
ROBOT: Final = 2  # its column
# What of them is shown; active alarms are whatever is chosen.
CHOICES: Final[dict[str, frozenset[NewsKind]]] = {
    "Everything": frozenset(NewsKind),
    "Faults and stops": frozenset({NewsKind.FAULT, NewsKind.STOP, NewsKind.NOT_STOPPED, NewsKind.RESET}),
    "Lost, stale, links": frozenset({NewsKind.LOST, NewsKind.STALE, NewsKind.LINK}),
    "Warnings": frozenset({NewsKind.WARNING}),
    "Writes and control": frozenset({NewsKind.PARAMETER, NewsKind.CONTROL}),
}


At = tuple[Station, str, int]  # a robot, a channel or none, and an instant on the axis of its signals


@dataclass(frozen=True, slots=True)
class EventRow:
    """A row: when, of what sort, of which robot, what; and what is seen of it in the signals."""

    when: str
    mark: Mark
    robot: str
    text: str
    at: At | None = None
    utc_s: float | None = None  # of what is over
    whose: str = ""  # the robot's name at the desk, which stays


class NewsModel(QAbstractTableModel):
    """Active alarms, then the desk's news as they are chosen."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._kinds = CHOICES["Everything"]
        self._words: Sequence[str] = ()
        self.lines: list[EventRow] = []
        self.pinned = 0  # lines that are active alarms
        self._revision: object = None
        self._titles: dict[str, str] = {}  # of robots by their names, also of those that were removed

    def refresh(self) -> None:
        """Take what is new."""
        alarms = (
            self._desk.alarms,
            self._desk.recording.alarms,
            *(one.alarms for one in self._desk.stations),
        )
        titles = {one.name: one.title for one in self._desk.stations}
        revision = (
            self._desk.news.revision,
            self._desk.selected,
            *(one.revision for one in alarms),
            *titles.values(),
        )
        if revision != self._revision:
            self._revision = revision
            self._titles |= titles
            self._take()

    def choose(self, kinds: frozenset[NewsKind], words: Sequence[str]) -> None:
        """Show only these kinds, and what has all of these words in it."""
        self._kinds, self._words = kinds, words
        self._take()

    def _take(self) -> None:
        active = [_of_alarm(*told) for told in in_order(self._desk)]  # as above the pages
        alarms = {one.name: one.alarms for one in self._desk.stations}
        news = (
            _of_item(item, self._title(item), _mark(item, alarms.get(item.robot)))
            for item in self._desk.news.items
            if item.kind in self._kinds
        )
        self.beginResetModel()
        self.pinned = len(active)
        self.lines = [*active, *(line for line in news if self._has_words(line))]
        self.endResetModel()

    def _title(self, item: Item) -> str:
        """Return what the robot was called then, or has been called since where it had no name yet."""
        return item.title or self._titles.get(item.robot, item.robot)

    def instant(self, line: EventRow) -> At | None:
        """Return where a line is seen in the signals; None: it is of no robot, or nothing came from it."""
        station = next((one for one in self._desk.stations if one.name == line.whose), None)
        if line.at is not None or line.utc_s is None or station is None:
            return line.at
        newest_ns, age_s = station.rings.newest_ns, station.robot.age_s()
        if newest_ns is None or age_s is None:
            return None
        return station, "", newest_ns - round(max(0.0, time.time() - age_s - line.utc_s) * 1e9)

    @property
    def only(self) -> Station | None:
        """The robot, where there is one alone: its name on each line would take the room of what is said."""
        stations = self._desk.stations
        return stations[0] if len(stations) == 1 else None

    def _said(self, line: EventRow) -> str:
        """Return the text, with the robot unless its column shows it or there is only one."""
        only = self.only
        return line.text if only is None or line.robot == only.title else f"{line.robot}: {line.text}"

    def _has_words(self, line: EventRow) -> bool:
        said = f"{line.mark.word} {line.robot} {line.text}".lower()
        return all(word in said for word in self._words)

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self.lines)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return COLUMNS

    def data(self, index: Index, role: int = 0) -> Any:
        line, column = self.lines[index.row()], index.column()
        is_pinned = index.row() < self.pinned
        match role:
            case Qt.ItemDataRole.DisplayRole:
                kind = f"{GLYPHS.get(line.mark.shape, '◆')} {line.mark.word}"
                return (line.when, kind, plain(line.robot), plain(self._said(line)))[column]
            case Qt.ItemDataRole.ForegroundRole if column < 2:
                return self._theme.colour(line.mark.colour if column else "dim")
            case Qt.ItemDataRole.FontRole if is_pinned:
                return self._theme.text_font(bold=True)
            case Qt.ItemDataRole.ToolTipRole:
                return tip(line.text)
            case Qt.ItemDataRole.AccessibleTextRole:
                return f"{'active: ' if is_pinned else ''}{line.mark.word} {line.robot} {line.text}"
        return None


class EventsPanel(QWidget):
    """Active alarms, then the newest; `shown` brings a robot, a channel and an instant that was chosen."""

    shown = Signal(object, str, object)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._news = NewsModel(desk, theme)
        self.setObjectName("page")
        self.words, self.kinds = QLineEdit(), QComboBox()
        self.words.setPlaceholderText("Filter events")
        self.words.setAccessibleName("Filter of the events: words")
        self.words.setClearButtonEnabled(True)
        self.words.textChanged.connect(self._choose)
        self.kinds.addItems(list(CHOICES))
        self.kinds.setAccessibleName("Filter of the events: kinds")
        self.kinds.currentIndexChanged.connect(self._choose)
        self.table = QTableView()
        self.table.setModel(self._news)
        self.table.setAccessibleName("Events of all robots; Return shows the signals at that instant")
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setTabKeyNavigation(False)
        self.table.setShowGrid(False)
        self.table.setWordWrap(False)
        self.table.setItemDelegate(SentenceDelegate(COLUMNS - 1))
        self.table.verticalHeader().hide()
        header = self.table.horizontalHeader()
        header.hide()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(COLUMNS - 1, QHeaderView.ResizeMode.Stretch)
        header.setResizeContentsPrecision(0)  # as wide as what is in sight, not all there is
        # Without a bar: it hides a row, columns get narrower by that, it goes, and comes again: for ever.
        self.table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.table.activated.connect(self._activated)
        self.tools = QWidget()
        tools = QHBoxLayout(self.tools)
        tools.setContentsMargins(4, 1, 4, 1)
        tools.addWidget(self.words, 1)
        tools.addWidget(self.kinds)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(0)
        self._column.addWidget(self.table, 1)
        self.hold_tools()
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def lines(self) -> Sequence[EventRow]:
        """What is shown, the active alarms first."""
        return self._news.lines

    @property
    def pinned(self) -> Sequence[EventRow]:
        """The active alarms."""
        return self._news.lines[: self._news.pinned]

    def refresh(self) -> None:
        """Take what is new."""
        self._news.refresh()
        self.table.setColumnHidden(ROBOT, self._news.only is not None)
        self._hold_rows()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._hold_rows()

    def _hold_rows(self) -> None:
        """Show whole rows: one that is cut is not read."""
        row, frame = self.table.verticalHeader().defaultSectionSize(), 2 * self.table.frameWidth()
        own = self.tools.height() if self.tools.parentWidget() is self and self.tools.isVisible() else 0
        room = self.height() - own - frame
        left = room % row if room > 2 * row else 0  # of a row, below the last whole one
        if self._column.contentsMargins().bottom() != left:
            self._column.setContentsMargins(0, 0, 0, left)

    def hold_tools(self) -> None:
        """Have the filter above the events: where no title bar has it."""
        self._column.insertWidget(0, self.tools)

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(120), self._theme.px(40))

    def _choose(self) -> None:
        self._news.choose(CHOICES[self.kinds.currentText()], self.words.text().lower().split())

    def _activated(self, index: QModelIndex) -> None:
        at = self._news.instant(self._news.lines[index.row()])
        if at is not None:
            self.shown.emit(*at)

    def _restyle(self) -> None:
        self.table.verticalHeader().setDefaultSectionSize(self._theme.px(19))
        self.table.setMinimumHeight(self._theme.px(40))
        self._hold_rows()


def _mark(item: Item, alarms: Alarms | None) -> Mark:
    return RESET_MARK if item.kind is NewsKind.RESET else event_mark(item, alarms)


def _of_alarm(station: Station | None, one: Active) -> EventRow:
    alarm = one.alarm
    where = alarm.where or alarm.subject.replace("_", " ")
    text = ": ".join(filter(None, (where, alarm.what)))
    known = station is not None and alarm.channel is not None and one.at_ns is not None
    at = (station, str(alarm.channel), one.at_ns or 0) if station is not None and known else None
    who = WHO if station is None else station.title
    if alarm.kind in LEFT:
        who, text = where, alarm.what
    return EventRow(f"since {time_of_day(one.since_s)}", alarm.mark, who, text, at)


def _of_item(item: Item, title: str, mark: Mark) -> EventRow:
    again = "" if item.first_s is None else f"{item.count} times since {time_of_day(item.first_s)}: "
    text = f"{again}{item.text}"  # what has no room stands at the end
    return EventRow(time_of_day(item.utc_s), mark, title, text, utc_s=item.utc_s, whose=item.robot)
