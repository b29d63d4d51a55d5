"""The table of a device's objects: it knows which rows are in sight, and has the columns that have room."""

from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QAction, QFontMetrics, QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from gateway.wire.dictionary import ObjectInfo
from server_gui.views.objects.objects_model import (
    ACCESS,
    AGE,
    HOLDS,
    LIMITS,
    NAME,
    OBJECT,
    OTHER,
    PARAMETER,
    PDO,
    TITLES,
    TYPE,
    UNIT,
    WIDEST,
    ObjectsModel,
    ShownObjects,
)
from server_gui.views.theme import Theme

IF_ROOM: Final = (
    AGE,
    PARAMETER,
    OTHER,
    TYPE,
    ACCESS,
    LIMITS,
    UNIT,
    PDO,
)  # shown in this order while they fit
STATIC: Final = (OBJECT, TYPE, ACCESS, PARAMETER, LIMITS, UNIT, PDO)
NAME_PX: Final = 150  # that a name has at least, at text of 100 %
MOST_PX: Final = 160
LOW: Final = 170  # px: what is below it stays in sight
SAMPLES: Final = 4  # the longest texts of a column, which are measured
PADDING: Final = 16
AGES: Final = ("59 min", "119 s")


class ObjectsTable(QTableView):
    """`chosen` when another row is; `wanted` when a row is to be edited, `pinned` and `copied` likewise."""

    chosen = Signal()
    wanted = Signal()
    pinned = Signal()
    copied = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._model = ObjectsModel(theme)
        self._widths: dict[int, int] = {}
        self._measured: object = None
        self._address: str | None = None  # of the chosen row, also while it is left out
        self.setModel(self._model)
        self.setAccessibleName("Objects of the device")
        self.setObjectName("framed")
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setTabKeyNavigation(False)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)  # names of sub-indices end apart
        self.verticalHeader().hide()
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setHighlightSections(False)
        self.doubleClicked.connect(lambda _index: self.wanted.emit())
        self.selectionModel().currentRowChanged.connect(self._chosen)
        for title, key, signal in (
            ("Pin or unpin", "Ctrl+P", self.pinned),
            ("Copy its address", "Ctrl+C", self.copied),
        ):
            action = QAction(title, self)
            action.setShortcut(key)
            action.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
            action.triggered.connect(signal)
            self.addAction(action)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        theme.scaled.connect(self._restyle)
        self._restyle()

    def sizeHint(self) -> QSize:
        return QSize(super().sizeHint().width(), self._theme.px(LOW))

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(NAME_PX), self._theme.px(LOW))

    @property
    def rows(self) -> list[ObjectInfo]:
        """The shown objects."""
        return list(self._model.rows)

    @property
    def current(self) -> ObjectInfo | None:
        """The chosen object."""
        row = self.currentIndex().row()
        return self._model.rows[row] if 0 <= row < len(self._model.rows) else None

    @property
    def in_sight(self) -> list[ObjectInfo]:
        """The objects of which something is on the screen."""
        first, last = self._first_and_last
        return list(self._model.rows[first : last + 1])

    def take(self, rows: list[ObjectInfo], shown: ShownObjects, device: object) -> None:
        """Show these; columns are measured anew for another `device`."""
        is_other = device != self._measured
        address = self._address
        if self._model.take(rows, shown):
            self._choose(address)
        if is_other:
            self._measured = device
            self._measure()
        first, last = self._first_and_last
        self._model.changed(first, last)
        self._grow(first, last)

    def choose(self, address: str) -> None:
        """Choose this object, where it is shown."""
        self._choose(address)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_F2, Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.wanted.emit()
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._show_columns()

    # --- inside

    @property
    def _first_and_last(self) -> tuple[int, int]:
        high = self.viewport().height()
        first, last = max(0, self.rowAt(0)), self.rowAt(high - 1)
        return first, len(self._model.rows) - 1 if last < 0 else last

    def _choose(self, address: str | None) -> None:
        row = next((row for row, info in enumerate(self._model.rows) if info.object == address), None)
        if row is not None:
            self.setCurrentIndex(self._model.index(row, NAME))

    def _chosen(self) -> None:
        current = self.current
        if current is not None:
            self._address = current.object
        self.chosen.emit()

    def _restyle(self) -> None:
        self.verticalHeader().setDefaultSectionSize(self._theme.px(21))
        self._measure()

    def _measure(self) -> None:
        """As wide as what they say, which the rows in sight alone do not tell; live ones grow."""
        texts = {column: sorted(self._all(column), key=len)[-SAMPLES:] for column in STATIC}
        texts |= {HOLDS: ["0x0000 (ready)"], AGE: list(AGES), OTHER: [self._model.shown.compared.title]}
        self._widths = {column: self._width(column, said) for column, said in texts.items()}
        self._show_columns()

    def _all(self, column: int) -> set[str]:
        return {self._model.text(info, column) for info in self._model.rows}

    def _width(self, column: int, texts: list[str]) -> int:
        is_number = column in (OBJECT, HOLDS, OTHER, LIMITS)
        font = self._theme.number_font() if is_number else self._theme.text_font()
        metrics = QFontMetrics(font)
        said = max((metrics.horizontalAdvance(text) for text in texts), default=0) + self._theme.px(PADDING)
        title = QFontMetrics(self._theme.text_font()).horizontalAdvance(TITLES[column]) + self._theme.px(
            PADDING
        )
        return max(title, min(said, self._theme.px(WIDEST.get(column, MOST_PX))))

    def _grow(self, first: int, last: int) -> None:
        """Fit the live column to visible values; it never shrinks, so that nothing jumps."""
        before = dict(self._widths)
        rows = self._model.rows[first : last + 1]
        for column in (HOLDS, OTHER):
            texts = [self._model.text(info, column) for info in rows if not self._is_problem(info)]
            self._widths[column] = max(self._widths.get(column, 0), self._width(column, texts))
        if self._widths != before:
            self._show_columns()

    def _is_problem(self, info: ObjectInfo) -> bool:
        held = self._model.shown.held(info)
        return held is not None and held.told.problem is not None

    def _show_columns(self) -> None:
        """Whole columns or none: what has no room stands among the facts of the chosen one."""
        room = self.viewport().width() - self._theme.px(NAME_PX)
        for column in (OBJECT, HOLDS):
            room -= self._widths.get(column, 0)
        for column in IF_ROOM:
            room -= self._widths.get(column, 0)
            self.setColumnHidden(column, room < 0)
        for column, width in self._widths.items():
            self.setColumnWidth(column, width)
        beside = self._widths.get(OBJECT, 0) + self._theme.px(NAME_PX)
        most = max(self.viewport().width() - beside, self._theme.px(NAME_PX))
        self.setColumnWidth(HOLDS, min(self._widths.get(HOLDS, 0), most))
