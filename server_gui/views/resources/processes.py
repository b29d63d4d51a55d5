"""The process table: sorts both ways on every column, keeps the selection and where one has scrolled to."""

from typing import Any, Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView

from gateway.plain_text import plain
from gateway.wire.resource import ProcessUse
from server_gui.core.processing.process_names import arguments_of, command_of
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import tip
from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable

TITLES: Final = ("Name", "Command", "PID", "CPU %", "Memory MiB")
NAME, COMMAND, PID, CPU, MEMORY = range(5)
MIB: Final = 1 << 20
ROOM: Final = {NAME: 460, PID: 370}  # wide at least, at text of 100 %, for these columns beside the command


class ProcessModel(RowsModel[ProcessUse]):
    """A row a process."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda process: (process.pid, process.name), (CPU, MEMORY))
        self._theme = theme

    def data(self, index: Index, role: int = 0) -> Any:
        process, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_text(process, column))
            case _ if role == SORT_ROLE:
                return _key(process, column)
            case Qt.ItemDataRole.ToolTipRole:
                return tip(command_of(process))
            case Qt.ItemDataRole.TextAlignmentRole if column >= PID:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if column >= PID:
                return self._theme.number_font()
        return None


class ProcessTable(RowsTable):
    """Highest CPU first."""

    def __init__(self, theme: Theme) -> None:
        self.processes = ProcessModel(theme)
        self.sorted = Filtered(self.processes)
        super().__init__(self.sorted, "Processes of the robot's computer", CPU)
        self._theme = theme
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setSectionResizeMode(COMMAND, QHeaderView.ResizeMode.Stretch)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # how a command begins and ends tells it apart
        theme.changed.connect(self._restyle)
        self._restyle()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._make_room()

    def _make_room(self) -> None:
        """Show the command if there is not room for all columns: it tells processes apart."""
        for column, least in ROOM.items():
            self.setColumnHidden(column, self.width() < self._theme.px(least))

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(20))
        for column, width in ((NAME, 96), (PID, 62), (CPU, 68), (MEMORY, 104)):
            self.setColumnWidth(column, self._theme.px(width))
        self._make_room()


def _text(process: ProcessUse, column: int) -> str:
    match column:
        case 0:
            return process.name
        case 1:
            return arguments_of(process)
        case 2:
            return str(process.pid)
        case 3:
            return "–" if process.cpu_percent is None else f"{process.cpu_percent:.1f}"
        case _:
            return f"{process.memory_bytes / MIB:.1f}"


def _key(process: ProcessUse, column: int) -> str | float:
    match column:
        case 0:
            return process.name.lower()
        case 1:
            return arguments_of(process).lower()
        case 2:
            return process.pid
        case 3:
            return -1.0 if process.cpu_percent is None else process.cpu_percent
        case _:
            return float(process.memory_bytes)
