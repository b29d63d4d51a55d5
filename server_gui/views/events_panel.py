"""What happened, newest first: links, states, faults, writes, stops, who had control."""

import datetime
from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from gateway.plain import plain
from server_gui.core.desk.desk import Desk
from server_gui.core.follow.news import Item
from server_gui.views.joint_table import GLYPHS
from server_gui.views.marks import NEWS
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import tip

Index = QModelIndex | QPersistentModelIndex
COLUMNS: Final = 4


class NewsModel(QAbstractTableModel):
    """The desk's news."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._items: list[Item] = []
        self._revision = -1

    def refresh(self) -> None:
        """Take what is new."""
        news = self._desk.news
        if news.revision == self._revision:
            return
        self.beginResetModel()
        self._revision, self._items = news.revision, list(news.items)
        self.endResetModel()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self._items)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return COLUMNS

    def data(self, index: Index, role: int = 0) -> Any:
        item = self._items[index.row()]
        mark = NEWS[item.kind]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                when = datetime.datetime.fromtimestamp(item.utc_s, datetime.UTC).astimezone()
                glyph = GLYPHS.get(mark.shape, "◆")
                return (f"{when:%H:%M:%S}", f"{glyph} {mark.word}", plain(item.robot), plain(item.text))[
                    index.column()
                ]
            case Qt.ItemDataRole.ForegroundRole if index.column() < 2:
                return self._theme.colour(mark.colour if index.column() else "dim")
            case Qt.ItemDataRole.ToolTipRole:
                return tip(item.text)
        return None


class EventsPanel(QTableView):
    """The newest at the top."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._news = NewsModel(desk, theme)
        self.setModel(self._news)
        self.setAccessibleName("Events of all robots")
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.verticalHeader().hide()
        self.horizontalHeader().hide()
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.horizontalHeader().setSectionResizeMode(COLUMNS - 1, QHeaderView.ResizeMode.Stretch)
        self.horizontalHeader().setResizeContentsPrecision(0)  # as wide as what is in sight, not all there is
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Take what is new."""
        self._news.refresh()

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(19))
        self.setMinimumHeight(self._theme.px(60))
