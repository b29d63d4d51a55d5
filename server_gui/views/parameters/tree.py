"""The parameters by component: held, staged, unit, range, default, the file's, stored, what came of it."""

from collections.abc import Callable, Iterable
from typing import Any, Final

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt, Signal
from PySide6.QtGui import QAction, QKeyEvent, QResizeEvent, QStandardItem, QStandardItemModel
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QLineEdit,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeView,
    QWidget,
)

from gateway.parameter_files.comparison import ComparisonVerdict
from gateway.units import Unit, with_minus
from gateway.wire.method import Number
from gateway.wire.parameter import ParameterInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import brief, refusal, unit_of
from server_gui.core.tuning.flash import RULE
from server_gui.views.parameters.filter import NAME_ROLE, Filter
from server_gui.views.theme import Theme
from server_gui.views.widgets.columns import title_widths
from server_gui.views.widgets.plain import set_tip

Index = QModelIndex | QPersistentModelIndex
TITLES: Final = ("Parameter", "Robot", "New", "Unit", "Range", "Default", "File", "Stored", "")
NAME, ROBOT, NEW, UNIT, RANGE, DEFAULT, FILE, STORED, SAID = range(len(TITLES))
IF_ROOM: Final = (FILE, RANGE, DEFAULT, STORED)  # shown while they fit; the chosen one's card has them all
REFUSED: Final = "✕ limit"  # the robot would refuse what is staged
WRONG: Final = ("✕", REFUSED, "⚠ changed")
BEGINS: Final = "0123456789+-.,"  # a number
AROUND_TEXT: Final = 24  # pixels beside the text of a field: its frame, and the cursor
NAME_PX: Final = 110  # that a name has at least; whole names where all else has room beside them


class NewValue(QStyledItemDelegate):
    """Lets a new value be typed: what is in the field at first is exact, to the last digit.

    The field is as wide as that, and as what is allowed (`allowed`), which it shows once it is empty; where
    its column is narrower it lies over its neighbours.
    """

    typed = Signal(str, str)  # name, text

    def __init__(self, exact: Callable[[str], str], allowed: Callable[[str], str], parent: QWidget) -> None:
        super().__init__(parent)
        self._exact, self._allowed = exact, allowed

    def createEditor(self, parent: QWidget, option: QStyleOptionViewItem, index: Index) -> QWidget:
        field = QLineEdit(parent)
        field.setAccessibleName(f"New value of {index.data(NAME_ROLE)}")
        field.setPlaceholderText(self._allowed(str(index.data(NAME_ROLE))))
        return field

    def updateEditorGeometry(self, editor: QWidget, option: QStyleOptionViewItem, index: Index) -> None:
        name, place, parent = str(index.data(NAME_ROLE)), option.rect, editor.parentWidget()
        wide = editor.fontMetrics().horizontalAdvance
        needed = max(wide(self._exact(name)), wide(self._allowed(name))) + AROUND_TEXT
        place.setWidth(max(place.width(), needed))
        if parent is not None:
            place.moveRight(min(place.right(), parent.width() - 1))
        place.setLeft(max(place.left(), 0))
        editor.setGeometry(place)

    def setEditorData(self, editor: QWidget, index: Index) -> None:
        if isinstance(editor, QLineEdit):
            editor.setText(self._exact(str(index.data(NAME_ROLE))))
            editor.selectAll()

    def setModelData(self, editor: QWidget, model: Any, index: Index) -> None:
        if isinstance(editor, QLineEdit):
            self.typed.emit(str(index.data(NAME_ROLE)), editor.text())


LOW: Final = 90  # at text of 100 %: what is below it stays in sight, and where there is more room it grows


class ParameterTree(QTreeView):
    """`typed` brings a name and the text for its new value, `chosen` and `pinned` the name."""

    typed = Signal(str, str)
    chosen = Signal(str)
    pinned = Signal(str)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._rows: dict[str, list[QStandardItem]] = {}
        self._shape: tuple[object, ...] = ()
        self._fitted: tuple[object, ...] = ()
        self._dimmed: object = None  # what the robot's values were dimmed for
        self._closed: set[str] = set()  # groups, by people
        self._looked_at: str | None = None  # the parameter that was chosen last, also while it is left out
        self._filtering = False
        self._model = QStandardItemModel()
        self._model.setHorizontalHeaderLabels(TITLES)
        self.filter = Filter()
        self.filter.setSourceModel(self._model)
        self.setModel(self.filter)
        self.setAccessibleName("Parameters")
        self.setObjectName("framed")
        self.setUniformRowHeights(True)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.setIndentation(theme.px(12))
        self.setEditTriggers(
            QAbstractItemView.EditTrigger.DoubleClicked
            | QAbstractItemView.EditTrigger.EditKeyPressed
            | QAbstractItemView.EditTrigger.AnyKeyPressed
        )
        delegate = NewValue(self._exact, self._allowed, self)
        delegate.typed.connect(self.typed)
        self.setItemDelegateForColumn(NEW, delegate)
        self.selectionModel().currentChanged.connect(self._chosen)
        self.collapsed.connect(lambda index: self._note_group(index, closed=True))
        self.expanded.connect(lambda index: self._note_group(index, closed=False))
        pin = QAction("Pin or unpin", self)
        pin.setShortcut("Ctrl+P")
        pin.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        pin.triggered.connect(self._pin)
        self.addAction(pin)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._size_columns()
        self._scale()
        theme.changed.connect(self.refresh)
        theme.scaled.connect(self._scale)

    def _scale(self) -> None:
        self.setMinimumHeight(self._theme.px(LOW))  # else what is below leaves no row in sight

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._theme.px(LOW))

    def refresh(self) -> None:
        """Show how it is now; rows are made anew only when the robot has others."""
        station = self._desk.selected
        known = {} if station is None else station.known
        file = None if station is None else station.file
        shape = (station, *known, self._desk.shown.revision, self._theme.look, self._theme.scale)
        if shape != self._shape:
            self._shape = shape
            self._build(known)
        if station is not None:
            pinned = self._desk.pins.of(station.title)
            for name, info in known.items():
                self._refresh_row(station, name, info)
                self._refresh_facts(station, name, info, pinned)
            self._dim(is_old=not station.is_linked)
        if (shape, file, self._says) != self._fitted:
            self._fitted = shape, file, self._says
            self._show_columns()

    def _dim(self, *, is_old: bool) -> None:
        """Dim the robot's values where they are old, or no more."""
        if (shown := (self._shape, is_old)) != self._dimmed:
            self._dimmed = shown
            for items in self._rows.values():
                items[ROBOT].setForeground(self._theme.colour("dim" if is_old else "text"))

    def show_only(self, words: str, names: Iterable[str] | None) -> None:
        """Show rows that match all words and are one of `names`, with open groups; the selection stays."""
        self._filtering = True
        if self.filter.show(words, names):
            self._open_groups(everything=bool(words) or names is not None)
            self._choose_again()
        self._filtering = False

    def select_name(self, name: str) -> None:
        """Choose a parameter."""
        if name in self._rows:
            index = self.filter.mapFromSource(self._rows[name][NEW].index())
            self.setCurrentIndex(index)

    def edit_name(self, name: str) -> None:
        """Choose a parameter, and let its new value be typed."""
        self.select_name(name)
        if self.current_name == name:
            self.setFocus(Qt.FocusReason.OtherFocusReason)
            self.scrollTo(self.currentIndex())
            self.edit(self.currentIndex())

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
        self._open_groups(everything=False)
        if before is not None:
            self.select_name(before)

    def _open_groups(self, *, everything: bool) -> None:
        """Those that people have closed stay so, unless everything is to be seen."""
        closed = set() if everything else self._closed
        self._filtering = True
        for row in range(self.filter.rowCount()):
            index = self.filter.index(row, NAME)
            self.setFirstColumnSpanned(row, QModelIndex(), True)
            self.setExpanded(index, index.data() not in closed)
        self._filtering = False

    def _choose_again(self) -> None:
        """Select the same row again; none if it was filtered out."""
        if self._looked_at is None:
            return
        known = self._rows.get(self._looked_at)
        index = QModelIndex() if known is None else self.filter.mapFromSource(known[NEW].index())
        if index.row() != self.currentIndex().row() or index.parent() != self.currentIndex().parent():
            self.setCurrentIndex(index)

    def _note_group(self, index: QModelIndex, *, closed: bool) -> None:
        if not self._filtering:
            (self._closed.add if closed else self._closed.discard)(str(index.data()))

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
        items[UNIT].setText(unit.symbol)
        items[RANGE].setText(range_text(info.min, info.max, unit))
        items[DEFAULT].setText("–" if info.default is None else brief(unit, info.default))
        tip = f"{name}\nobject {info.object} {info.type}\n{info.unit}"
        for place, item in enumerate(items):
            item.setData(name, NAME_ROLE)
            set_tip(item, tip)
            editable = Qt.ItemFlag.ItemIsEditable if place == NEW else Qt.ItemFlag.NoItemFlags
            item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable | editable)
        set_tip(items[RANGE], f"{exact(unit, info.min)} … {exact(unit, info.max)} {unit.symbol}")
        items[STORED].setToolTip(RULE)
        for place in (ROBOT, NEW, RANGE, DEFAULT, FILE):
            items[place].setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        return items

    def _refresh_row(self, station: Station, name: str, info: ParameterInfo) -> None:
        items, held = self._rows[name], station.robot.parameters.get(name)
        unit = unit_of(name, info.unit, self._desk.shown.units)
        staged = station.edits.staged.get(name)
        value = None if held is None else held.value
        is_read = name not in station.reverted.awaited
        elsewhere = staged is not None and staged.base != value
        on_trial = station.writing.trial is not None and name in station.writing.trial.values
        refused = None if staged is None else refusal(staged.value, value, info, unit)
        problem = (
            refused
            or info.problem
            or (held.problem if held is not None else None)
            or station.writing.rows.get(name)
        )
        _set(items[ROBOT], "…" if not is_read else "–" if value is None else brief(unit, value))
        _set(items[NEW], "" if staged is None else unit.editable(staged.value))
        said = next(
            word
            for word, so in (
                (REFUSED, refused),
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
            items[SAID].setForeground(self._theme.colour("bad" if said in WRONG else "warn"))
            items[NEW].setForeground(self._theme.colour("bad" if refused else "text"))
            colour = self._theme.colour("staged") if staged is not None else None
            for item in items:
                item.setData(colour, Qt.ItemDataRole.BackgroundRole)
        for item in (items[NEW], items[SAID]):
            set_tip(item, problem or "")

    def _refresh_facts(
        self, station: Station, name: str, info: ParameterInfo, pinned: frozenset[str]
    ) -> None:
        """Set the facts beside its value."""
        items = self._rows[name]
        short = name.partition(".")[2].replace("_", " ")
        _set(items[NAME], f"★ {short}" if name in pinned else short)
        _set(items[STORED], "yes" if station.is_stored(name) else "unknown")
        row = None if station.file is None else station.file.rows.get(name)
        value = None if row is None else row.file
        unit = unit_of(name, info.unit, self._desk.shown.units)
        _set(items[FILE], "" if value is None else brief(unit, value))
        same = row is None or row.verdict is ComparisonVerdict.SAME
        items[FILE].setForeground(self._theme.colour("dim" if same else "warn"))

    def _exact(self, name: str) -> str:
        station = self._desk.selected
        if station is None or name not in station.known:
            return ""
        unit = unit_of(name, station.known[name].unit, self._desk.shown.units)
        staged, held = station.edits.staged.get(name), station.robot.parameters.get(name)
        value = staged.value if staged is not None else (None if held is None else held.value)
        return "" if value is None else unit.editable(value)

    def _allowed(self, name: str) -> str:
        station = self._desk.selected
        info = None if station is None else station.known.get(name)
        if info is None:
            return ""
        return range_text(info.min, info.max, unit_of(name, info.unit, self._desk.shown.units))

    def _pin(self) -> None:
        if self.current_name is not None:
            self.pinned.emit(self.current_name)

    def _chosen(self, current: QModelIndex, before: QModelIndex) -> None:
        name = current.siblingAtColumn(NAME).data(NAME_ROLE)
        if isinstance(name, str) and not self._filtering:
            self._looked_at = name
            self.chosen.emit(name)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Edits the row's new value, whichever of its cells was clicked."""
        current = self.currentIndex()
        begins = event.key() == Qt.Key.Key_F2 or (event.text() and event.text() in BEGINS)
        if begins and current.column() != NEW and isinstance(current.data(NAME_ROLE), str):
            self.setCurrentIndex(current.siblingAtColumn(NEW))
        super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show_columns()
        if self.currentIndex().isValid():
            self.scrollTo(self.currentIndex())  # what is told of it below takes room from here

    @property
    def _says(self) -> bool:
        """Whether anything is said beside a value: else that column gives its room to names."""
        return any(items[SAID].text() for items in self._rows.values())

    def _show_columns(self) -> None:
        station = self._desk.selected
        self.setColumnHidden(SAID, not self._says)
        titles = title_widths(self)
        wide = [max(self.sizeHintForColumn(column), title) for column, title in enumerate(titles)]
        always = sum(wide[column] for column in (ROBOT, NEW, UNIT))
        always += 0 if self.isColumnHidden(SAID) else wide[SAID]
        room = self.viewport().width() - self._theme.px(NAME_PX) - always
        for column in IF_ROOM:
            wanted = column != FILE or (station is not None and station.file is not None)
            room -= wide[column] if wanted else 0
            self.setColumnHidden(column, not wanted or room < 0)

    def _size_columns(self) -> None:
        header = self.header()
        header.setStretchLastSection(False)
        header.setMinimumSectionSize(self._theme.px(24))
        for column in range(len(TITLES)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)


def range_text(least: Number | None, most: Number | None, unit: Unit) -> str:
    """Return the smallest and the largest value that are allowed, in four digits."""
    low = "" if least is None else with_minus(f"{least * unit.scale:.4g}")
    high = "" if most is None else with_minus(f"{most * unit.scale:.4g}")
    return f"{low} … {high}" if low or high else "–"


def exact(unit: Unit, value: float | None) -> str:
    """Return every digit."""
    return "" if value is None else unit.editable(value)


def _set(item: QStandardItem, text: str) -> None:
    if item.text() != text:
        item.setText(text)
