"""The process table: sorts both ways on every column, keeps the selection and where one has scrolled to."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QAbstractItemView

from gateway.plain_text import plain
from gateway.wire.resource import ProcessUse
from server_gui.core.processing.process_names import arguments_of, command_of, labels
from server_gui.views.theme import Theme
from server_gui.views.widgets.columns import fit, prepare
from server_gui.views.widgets.plain import tip
from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable

TITLES: Final = ("Name", "Command", "PID", "CPU %", "Memory MiB")
NAME, COMMAND, PID, CPU, MEMORY = range(5)
MIB: Final = 1 << 20
LEAST: Final = {COMMAND: 140, NAME: 150}  # wide, at text of 100 %, where there is room for less than all
SPARE: Final = (COMMAND, PID, MEMORY)  # left out in this order; a name that two have holds its process id


class ProcessModel(RowsModel[ProcessUse]):
    """A row a process."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda process: (process.pid, process.name), (CPU, MEMORY))
        self._theme = theme
        self.labels: dict[int, str] = {}

    def take(self, rows: Iterable[ProcessUse]) -> None:
        processes = list(rows)
        before, self.labels = self.labels, labels(processes)
        super().take(processes)
        if any(before.get(pid, label) != label for pid, label in self.labels.items()):  # another has its name
            self.dataChanged.emit(self.index(0, NAME), self.index(len(self.rows) - 1, NAME))

    def data(self, index: Index, role: int = 0) -> Any:
        process, column = self.rows[index.row()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_text(process, column, self.labels))
            case _ if role == SORT_ROLE:
                return _key(process, column, self.labels)
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
        prepare(self)
        theme.changed.connect(self._restyle)
        self._restyle()

    def take(self, processes: Iterable[ProcessUse]) -> None:
        """Show these from now on."""
        self.processes.take(processes)
        self._make_room()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._make_room()

    def _make_room(self) -> None:
        """Leave out the command, then the process id, before a name is cut: it tells processes apart."""
        fit(self, {column: self._theme.px(width) for column, width in LEAST.items()}, SPARE)

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(20))
        self._make_room()


def _text(process: ProcessUse, column: int, called: Mapping[int, str]) -> str:
    match column:
        case 0:
            return called.get(process.pid, process.name)
        case 1:
            return arguments_of(process)
        case 2:
            return str(process.pid)
        case 3:
            return "–" if process.cpu_percent is None else f"{process.cpu_percent:.1f}"
        case _:
            return f"{process.memory_bytes / MIB:.1f}"


def _key(process: ProcessUse, column: int, called: Mapping[int, str]) -> str | float:
    match column:
        case 0:
            return called.get(process.pid, process.name).lower()
        case 1:
            return arguments_of(process).lower()
        case 2:
            return process.pid
        case 3:
            return -1.0 if process.cpu_percent is None else process.cpu_percent
        case _:
            return float(process.memory_bytes)
