"""Browser of the store: tables and robots, with their sessions and files."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHeaderView, QSizePolicy, QTreeWidget, QTreeWidgetItem

from gateway.amounts import size
from ml.store.objects import Object
from server_gui.core.archive.library import Library
from server_gui.core.cloud.usage import Usage
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.views.theme import Theme

WIDE: Final = 600  # at text of 100 %: times have seconds
FINE, COARSE = "%Y-%m-%d %H:%M:%S", "%Y-%m-%d %H:%M"
TITLES: Final = ("Table, robot, file", "Files", "Rows", "Size", "From", "To")
FOLDER_ROLE: Final = Qt.ItemDataRole.UserRole + 1
MOST_FILES: Final = 500  # that are listed below one
READING: Final = "reading …"


class Browser(QTreeWidget):
    """A table's robots below it, and the files below each; these are asked for when they are opened."""

    def __init__(self, library: Library, deliver: Deliver, theme: Theme) -> None:
        super().__init__()
        self._library = library
        self._deliver = deliver
        self._theme = theme
        self._times = COARSE
        self._revision = -1
        self.setHeaderLabels(TITLES)
        self.setAccessibleName("What is in the store")
        self.setAlternatingRowColors(True)
        self.setUniformRowHeights(True)
        self.header().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.itemExpanded.connect(self._opened)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Show what the newest look has found."""
        if self._library.revision == self._revision:
            return
        self._revision = self._library.revision
        opened = {self._name(item) for item in self._tops() if item.isExpanded()}
        self.clear()
        tables: dict[str, list[Usage]] = {}
        for each in self._library.found.usage:
            tables.setdefault(each.table, []).append(each)
        for table, parts in tables.items():
            top = QTreeWidgetItem(self, self._cells(table, parts))
            _numbers(top)
            for part in parts if parts[0].robot is not None else ():
                below = QTreeWidgetItem(top, self._cells(str(part.robot), [part]))
                self._folder(below, f"{table}/", part.robot)
            if parts[0].robot is None:
                self._folder(top, f"{table}/", None)
            top.setExpanded(table in opened and parts[0].robot is not None)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show seconds, too, where there is room for them."""
        super().resizeEvent(event)
        times = FINE if self.width() >= self._theme.px(WIDE) else COARSE
        if times != self._times:
            self._times, self._revision = times, -1  # shown so with the next frame

    def _cells(self, name: str, parts: Sequence[Usage]) -> list[str]:
        begins = [part.first for part in parts if part.first is not None]
        ends = [part.last for part in parts if part.last is not None]
        return [
            name,
            f"{sum(part.files for part in parts):,}",
            f"{sum(part.rows for part in parts):,}",
            size(sum(part.size_bytes for part in parts)),
            f"{min(begins).astimezone():{self._times}}" if begins else "–",
            f"{max(ends).astimezone():{self._times}}" if ends else "–",
        ]

    def _restyle(self) -> None:
        self.setMinimumHeight(self._theme.px(110))

    def _folder(self, item: QTreeWidgetItem, folder: str, robot: str | None) -> None:
        _numbers(item)
        item.setData(0, FOLDER_ROLE, (folder, robot))
        QTreeWidgetItem(item, [READING])

    def _tops(self) -> list[QTreeWidgetItem]:
        found = [self.topLevelItem(row) for row in range(self.topLevelItemCount())]
        return [item for item in found if item is not None]

    def _name(self, item: QTreeWidgetItem) -> str:
        return item.text(0)

    def _opened(self, item: QTreeWidgetItem) -> None:
        asked = item.data(0, FOLDER_ROLE)
        if asked is None:
            return
        folder, robot = asked
        revision = self._revision
        when_done(
            self._library.files(folder),
            self._deliver,
            lambda files: self._found(revision, item, files, robot),
            lambda error: self._say(revision, item, str(error)),
        )

    def _found(
        self, revision: int, item: QTreeWidgetItem, files: Sequence[Object], robot: str | None
    ) -> None:
        mine = [each for each in files if robot is None or f"/robot={robot}/" in each.path]
        if revision != self._revision:
            return  # the item has gone
        item.takeChildren()
        for each in mine[:MOST_FILES]:
            written = f"{each.changed.astimezone():{self._times}}"
            _numbers(QTreeWidgetItem(item, [each.path, "", "", size(each.size_bytes), written, ""]))
        if len(mine) > MOST_FILES:
            QTreeWidgetItem(item, [f"… {len(mine) - MOST_FILES} more (gwrms cloud ls --path {item.text(0)})"])

    def _say(self, revision: int, item: QTreeWidgetItem, text: str) -> None:
        if revision == self._revision:
            item.takeChildren()
            QTreeWidgetItem(item, [text])


def _numbers(item: QTreeWidgetItem) -> None:
    for column in (1, 2, 3):
        item.setTextAlignment(column, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
