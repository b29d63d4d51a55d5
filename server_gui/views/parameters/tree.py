"""The parameters by component: what the robot holds, what is staged, unit, range, what came of it."""

from collections.abc import Callable, Iterable
from typing import Any, Final

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSortFilterProxyModel, Qt, Signal
from PySide6.QtGui import QStandardItem, QStandardItemModel
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeView,
    QWidget,
)

from gateway.messages import ParameterInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.edits import unit_of
from server_gui.core.desk.station import Station
from server_gui.core.processing.units import Unit
from server_gui.views.theme import Theme

Index = QModelIndex | QPersistentModelIndex
TITLES: Final = ("Parameter", "Robot", "New", "Unit", "Range", "")
NAME, ROBOT, NEW, UNIT, RANGE, SAID = range(6)
NAME_ROLE: Final = Qt.ItemDataRole.UserRole + 1


class NewValue(QStyledItemDelegate):
    """Lets a new value be typed: what is in the field at first is exact, to the last digit."""

    typed = Signal(str, str)  # name, text

    def __init__(self, exact: Callable[[str], str], parent: QWidget) -> None:
        super().__init__(parent)
        self._exact = exact

    def createEditor(self, parent: QWidget, option: QStyleOptionViewItem, index: Index) -> QWidget:
        field = QLineEdit(parent)
        field.setAccessibleName(f"New value of {index.data(NAME_ROLE)}")
        return field

    def setEditorData(self, editor: QWidget, index: Index) -> None:
        if isinstance(editor, QLineEdit):
            editor.setText(self._exact(str(index.data(NAME_ROLE))))
            editor.selectAll()

    def setModelData(self, editor: QWidget, model: Any, index: Index) -> None:
        if isinstance(editor, QLineEdit):
            self.typed.emit(str(index.data(NAME_ROLE)), editor.text())


class Filter(QSortFilterProxyModel):
    """By words in name, object and unit, and by a set of names."""

    def __init__(self) -> None:
        super().__init__()
        self._words: list[str] = []
        self._names: frozenset[str] | None = None
        self.setRecursiveFilteringEnabled(True)

    def show(self, words: str, names: Iterable[str] | None) -> None:
        """Show what has all words, and is one of `names`."""
        wanted = None if names is None else frozenset(names)
        if (words.lower().split(), wanted) != (self._words, self._names):
            self._words, self._names = words.lower().split(), wanted
            self.invalidate()

    def filterAcceptsRow(self, row: int, parent: Index) -> bool:
        index = self.sourceModel().index(row, NAME, parent)
        name = index.data(NAME_ROLE)
        if name is None:
            return False  # a group is shown for what is in it
        if self._names is not None and name not in self._names:
            return False
        text = f"{name} {index.data(Qt.ItemDataRole.ToolTipRole)}".lower()
        return all(word in text for word in self._words)


class ParameterTree(QTreeView):
    """`typed` brings a parameter's name and the text for its new value, `chosen` the one that is selected."""

    typed = Signal(str, str)
    chosen = Signal(str)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._rows: dict[str, list[QStandardItem]] = {}
        self._shape: tuple[object, ...] = ()
        self._model = QStandardItemModel()
        self._model.setHorizontalHeaderLabels(TITLES)
        self.filter = Filter()
        self.filter.setSourceModel(self._model)
        self.setModel(self.filter)
        self.setAccessibleName("Parameters")
        self.setObjectName("framed")
        self.setUniformRowHeights(True)
        self.setIndentation(theme.px(12))
        self.setEditTriggers(
            QAbstractItemView.EditTrigger.DoubleClicked
            | QAbstractItemView.EditTrigger.EditKeyPressed
            | QAbstractItemView.EditTrigger.AnyKeyPressed
        )
        delegate = NewValue(self._exact, self)
        delegate.typed.connect(self.typed)
        self.setItemDelegateForColumn(NEW, delegate)
        self.selectionModel().currentChanged.connect(self._chosen)
        self._size_columns()
        theme.changed.connect(self.refresh)

    def refresh(self) -> None:
        """Show how it is now; rows are made anew only when the robot has others."""
        station = self._desk.selected
        known = {} if station is None else station.known
        shape = (station, *known, self._desk.shown.revision, self._theme.look, self._theme.scale)
        if shape != self._shape:
            self._shape = shape
            self._build(known)
        if station is not None:
            for name, info in known.items():
                self._refresh_row(station, name, info)

    def select_name(self, name: str) -> None:
        """Choose a parameter."""
        if name in self._rows:
            index = self.filter.mapFromSource(self._rows[name][NEW].index())
            self.setCurrentIndex(index)

    @property
    def current_name(self) -> str | None:
        """The parameter that is chosen."""
        name = self.currentIndex().siblingAtColumn(NAME).data(NAME_ROLE)
        return name if isinstance(name, str) else None

    def _build(self, known: dict[str, ParameterInfo]) -> None:
        before = self.current_name
        self._model.removeRows(0, self._model.rowCount())
        self._rows.clear()
        groups: dict[str, QStandardItem] = {}
        for name, info in known.items():
            if info.component not in groups:
                groups[info.component] = self._group(info.component)
            self._rows[name] = self._row(name, info)
            groups[info.component].appendRow(self._rows[name])
        self.expandAll()
        for row in range(self._model.rowCount()):
            self.setFirstColumnSpanned(row, QModelIndex(), True)
        if before is not None:
            self.select_name(before)

    def _group(self, component: str) -> QStandardItem:
        item = QStandardItem(component.replace("_", " "))
        item.setFlags(Qt.ItemFlag.ItemIsEnabled)
        item.setForeground(self._theme.side(component))
        item.setFont(self._theme.text_font(bold=True))
        self._model.appendRow(item)
        return item

    def _row(self, name: str, info: ParameterInfo) -> list[QStandardItem]:
        unit = unit_of(name, info.unit, self._desk.shown.units)
        items = [QStandardItem() for _ in TITLES]
        items[NAME].setText(name.partition(".")[2].replace("_", " "))
        items[UNIT].setText(unit.symbol)
        items[RANGE].setText(range_text(info, unit))
        tip = f"{name}\nobject {info.object} {info.type}\n{info.unit}"
        for place, item in enumerate(items):
            item.setData(name, NAME_ROLE)
            item.setToolTip(tip)
            editable = Qt.ItemFlag.ItemIsEditable if place == NEW else Qt.ItemFlag.NoItemFlags
            item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable | editable)
        for place in (ROBOT, NEW, RANGE):
            items[place].setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        return items

    def _refresh_row(self, station: Station, name: str, info: ParameterInfo) -> None:
        items, held = self._rows[name], station.robot.parameters.get(name)
        unit = unit_of(name, info.unit, self._desk.shown.units)
        staged = station.edits.staged.get(name)
        value = None if held is None else held.value
        elsewhere = staged is not None and staged.base != value
        on_trial = station.writing.trial is not None and name in station.writing.trial.values
        problem = (
            info.problem or (held.problem if held is not None else None) or station.writing.rows.get(name)
        )
        _set(items[ROBOT], "–" if value is None else brief(unit, value))
        _set(items[NEW], "" if staged is None else unit.editable(staged.value))
        said = next(
            word
            for word, so in (
                ("⚠ changed", elsewhere),
                ("●", staged),
                ("◔ trial", on_trial),
                ("✕", problem),
                ("", True),
            )
            if so
        )
        if items[SAID].text() != said:
            items[SAID].setText(said)
            items[SAID].setForeground(self._theme.colour("bad" if said in ("✕", "⚠ changed") else "warn"))
            colour = self._theme.colour("staged") if staged is not None else None
            for item in items:
                item.setData(colour, Qt.ItemDataRole.BackgroundRole)
        items[SAID].setToolTip(problem or "")

    def _exact(self, name: str) -> str:
        station = self._desk.selected
        if station is None or name not in station.known:
            return ""
        unit = unit_of(name, station.known[name].unit, self._desk.shown.units)
        staged, held = station.edits.staged.get(name), station.robot.parameters.get(name)
        value = staged.value if staged is not None else (None if held is None else held.value)
        return "" if value is None else unit.editable(value)

    def _chosen(self, current: QModelIndex, before: QModelIndex) -> None:
        name = current.siblingAtColumn(NAME).data(NAME_ROLE)
        if isinstance(name, str):
            self.chosen.emit(name)

    def _size_columns(self) -> None:
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(self._theme.px(24))
        for column in range(len(TITLES)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)


def range_text(info: ParameterInfo, unit: Unit) -> str:
    """The smallest and largest that are allowed."""
    low = "" if info.min is None else brief(unit, info.min)
    high = "" if info.max is None else brief(unit, info.max)
    return f"{low} … {high}" if low or high else "–"


def brief(unit: Unit, value: float) -> str:
    """For reading in a narrow column: six digits; editing and tooltips have them all."""
    return f"{value * unit.scale:.6g}"


def _set(item: QStandardItem, text: str) -> None:
    if item.text() != text:
        item.setText(text)
