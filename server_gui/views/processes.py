"""The process table: sorts both ways on every column, keeps the selection and where one has scrolled to."""

from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QSortFilterProxyModel, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from gateway.messages import ProcessUse
from server_gui.views.theme import Theme

Index = QModelIndex | QPersistentModelIndex
TITLES: Final = ("Name", "PID", "CPU %", "Memory MiB")
NAME, PID, CPU, MEMORY = range(4)
SORT_ROLE: Final = Qt.ItemDataRole.UserRole + 1
MIB: Final = 1 << 20


class ProcessModel(QAbstractTableModel):
    """A row a process; a look changes rows by their PID and never resets the table."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._rows: list[ProcessUse] = []

    def take(self, processes: list[ProcessUse]) -> None:
        """Show these from now on."""
        found = {(process.pid, process.name): process for process in processes}
        for row in reversed(range(len(self._rows))):
            if (self._rows[row].pid, self._rows[row].name) not in found:
                self.beginRemoveRows(QModelIndex(), row, row)
                del self._rows[row]
                self.endRemoveRows()
        self._rows = [found.pop((known.pid, known.name)) for known in self._rows]
        if self._rows:
            self.dataChanged.emit(self.index(0, CPU), self.index(len(self._rows) - 1, MEMORY))
        if found:
            self.beginInsertRows(QModelIndex(), len(self._rows), len(self._rows) + len(found) - 1)
            self._rows.extend(found.values())
            self.endInsertRows()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self._rows)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return len(TITLES)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return TITLES[section]
        return None

    def data(self, index: Index, role: int = 0) -> Any:
        process, column = self._rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return _text(process, column)
            case _ if role == SORT_ROLE:
                return _key(process, column)
            case Qt.ItemDataRole.TextAlignmentRole if column != NAME:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if column != NAME:
                return self._theme.number_font()
        return None


class ProcessTable(QTableView):
    """Highest CPU first, until somebody clicks another column."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.processes = ProcessModel(theme)
        self.sorted = QSortFilterProxyModel()
        self.sorted.setSourceModel(self.processes)
        self.sorted.setSortRole(SORT_ROLE)
        self.sorted.setFilterKeyColumn(NAME)
        self.sorted.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.setModel(self.sorted)
        self.setSortingEnabled(True)
        self.sortByColumn(CPU, Qt.SortOrder.DescendingOrder)
        self.setAccessibleName("Processes of the robot's computer")
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.verticalHeader().hide()
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        theme.changed.connect(self._restyle)
        self._restyle()

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(20))
        for column, width in ((PID, 58), (CPU, 68), (MEMORY, 98)):
            self.setColumnWidth(column, self._theme.px(width))


def _text(process: ProcessUse, column: int) -> str:
    match column:
        case 0:
            return process.name
        case 1:
            return str(process.pid)
        case 2:
            return "–" if process.cpu_percent is None else f"{process.cpu_percent:.1f}"
        case _:
            return f"{process.memory_bytes / MIB:.1f}"


def _key(process: ProcessUse, column: int) -> str | float:
    match column:
        case 0:
            return process.name.lower()
        case 1:
            return process.pid
        case 2:
            return -1.0 if process.cpu_percent is None else process.cpu_percent
        case _:
            return float(process.memory_bytes)
