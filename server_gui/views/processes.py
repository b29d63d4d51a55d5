"""The process table: sorts both ways on every column, keeps the selection and where one has scrolled to."""

from typing import Any, Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView

from gateway.plain import plain
from gateway.wire.messages import ProcessUse
from server_gui.views.theme import Theme
from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable

TITLES: Final = ("Name", "PID", "CPU %", "Memory MiB")
NAME, PID, CPU, MEMORY = range(4)
MIB: Final = 1 << 20


class ProcessModel(RowsModel[ProcessUse]):
    """A row a process."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda process: (process.pid, process.name))
        self._theme = theme

    def data(self, index: Index, role: int = 0) -> Any:
        process, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_text(process, column))
            case _ if role == SORT_ROLE:
                return _key(process, column)
            case Qt.ItemDataRole.TextAlignmentRole if column != NAME:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if column != NAME:
                return self._theme.number_font()
        return None


class ProcessTable(RowsTable):
    """Highest CPU first."""

    def __init__(self, theme: Theme) -> None:
        self.processes = ProcessModel(theme)
        self.sorted = Filtered(self.processes, NAME)
        super().__init__(self.sorted, "Processes of the robot's computer", CPU)
        self._theme = theme
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
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
