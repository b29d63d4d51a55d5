"""The joint table: a row a joint, what its drive tells, in the units of choice."""

from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.marks import state_mark
from server_gui.views.theme import Theme

Index = QModelIndex | QPersistentModelIndex
# column → quantity, and the SI unit where the robot does not say
COLUMNS: Final = (
    ("Joint", ""),
    ("State", ""),
    ("Angle", "position"),
    ("Target", "target"),
    ("Velocity", "velocity"),
    ("Torque", "torque"),
    ("Current", "current"),
    ("Temp.", "temperature"),
    ("Error", "error_code"),
)
SI: Final = {
    "position": "rad",
    "target": "rad",
    "velocity": "rad/s",
    "torque": "N·m",
    "current": "A",
    "temperature": "°C",
}
SIGNED: Final = frozenset({"position", "target", "velocity", "torque", "current"})
GLYPHS: Final = {"disc": "●", "ring": "○", "half": "◐", "cross": "✕", "square": "■", "triangle": "▲"}


class JointModel(QAbstractTableModel):
    """Texts of the robot that is looked at; only the cells that have changed are drawn again."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._joints: list[str] = []
        self._cells: list[list[str]] = []
        self._colours: list[list[str]] = []

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        joints = [] if station is None else station.robot.names("joint")
        if joints != self._joints:
            self.beginResetModel()
            self._joints, self._cells, self._colours = joints, [], []
            self.endResetModel()
        if station is None or not joints:
            return
        rows = [_row(station, joint, self._desk) for joint in joints]
        cells = [[text for text, _ in row] for row in rows]
        colours = [[colour for _, colour in row] for row in rows]
        if not self._cells:
            self.beginResetModel()
            self._cells, self._colours = cells, colours
            self.endResetModel()
        else:
            self._update(cells, colours)

    def _update(self, cells: list[list[str]], colours: list[list[str]]) -> None:
        before = list(zip(self._cells, self._colours, strict=True))
        self._cells, self._colours = cells, colours
        last = len(COLUMNS) - 1
        for row, known in enumerate(before):
            if known != (cells[row], colours[row]):
                self.dataChanged.emit(self.index(row, 0), self.index(row, last))

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self._cells)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            title, quantity = COLUMNS[section]
            unit = _unit(self._desk, quantity)
            return f"{title} {unit}".rstrip()
        return None

    def data(self, index: Index, role: int = 0) -> Any:
        row, column = index.row(), index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return self._cells[row][column]
            case Qt.ItemDataRole.ForegroundRole:
                return self._theme.colour(self._colours[row][column])
            case Qt.ItemDataRole.TextAlignmentRole if column >= 2:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if column >= 2:
                return self._theme.number_font()
        return None


class JointTable(QTableView):
    """The table of a `JointModel`."""

    def __init__(self, model: JointModel, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setModel(model)
        self.setAccessibleName("Joints")
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.verticalHeader().hide()
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Stretch)
        self.horizontalHeader().setSectionResizeMode(1, QHeaderView.ResizeMode.Fixed)
        self.horizontalHeader().setDefaultAlignment(
            Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        )
        theme.changed.connect(self._restyle)
        self._restyle()

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(21))
        self.horizontalHeader().setMinimumSectionSize(self._theme.px(52))
        self.setColumnWidth(1, self._theme.px(160))
        self.setMinimumHeight(self._theme.px(120))


def _unit(desk: Desk, quantity: str) -> str:
    return desk.shown.units.unit(quantity, SI[quantity]).symbol if quantity in SI else ""


def _row(station: Station, joint: str, desk: Desk) -> list[tuple[str, str]]:
    robot = station.robot
    part = robot.parts[joint]
    gone = part.state in ("stale", "lost")
    stale = gone or robot.is_stale()
    mark = state_mark(part.state if gone else robot.word(f"{joint}.state"))
    age = "" if not gone or part.age_ms is None else f" {part.age_ms / 1000:.1f} s"
    side = joint.partition("_")[0]
    cells = [
        (joint.replace("_", " "), side if side in ("left", "right") else "text"),
        (f"{GLYPHS.get(mark.shape, '◆')} {mark.word}{age}", "old" if robot.is_stale() else mark.colour),
    ]
    for _, quantity in COLUMNS[2:-1]:
        value = _value(station, joint, quantity)
        unit = desk.shown.units.unit(quantity, SI[quantity])
        text = unit.text(value)
        sign = "+" if quantity in SIGNED and value is not None and value >= 0 else ""
        cells.append((f"{sign}{text}", "old" if stale or value is None else "text"))
    code = robot.values.get(f"{joint}.error_code")
    cells.append(("–" if not code else f"0x{int(code):04X}", "bad" if code else "dim"))
    return cells


def _value(station: Station, joint: str, quantity: str) -> float | None:
    """A joint's value; where the drive tells no target, it is its position and its following error."""
    values = station.robot.values
    if quantity != "target":
        return values.get(f"{joint}.{quantity}")
    position, error = values.get(f"{joint}.position"), values.get(f"{joint}.following_error")
    told = values.get(f"{joint}.target_position")
    if told is not None or position is None or error is None:
        return told
    return position + error
