"""The joint table: what each drive tells, in the units of choice, with bars where there is a limit."""

from collections.abc import Callable
from typing import Any, Final

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QRectF, QSize, Qt
from PySide6.QtGui import QFontMetrics, QPainter, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyleOptionViewItem,
    QTableView,
)

from server_gui.core.desk.desk import Desk
from server_gui.views.overview.joint_cells import (
    ANGLE,
    COLUMNS,
    CURRENT,
    ENABLED_AGAIN,
    ERROR,
    JOINT,
    NONE,
    NOT_KNOWN,
    SI,
    STATE,
    STOP,
    TEMPERATURE,
    TORQUE,
    VELOCITY,
    Bar,
    Cell,
    at_fault,
    row_of,
    unit_of,
)
from server_gui.views.theme import Theme
from server_gui.views.widgets.elided import SentenceDelegate
from server_gui.views.widgets.plain import tip

Index = QModelIndex | QPersistentModelIndex
SPARE: Final = (CURRENT, VELOCITY, TEMPERATURE, STOP)  # left out in this order where there is less room
BELOW, ABOVE = "↓", "↑"  # where its words stand
HINT: Final = (
    "Time from the latest STOP until this window knew that the drive was off, by its state or its "
    "confirmation: drives that are told of together have one time. “already off”: it was not enabled before "
    "that STOP. “no proof”: it has not reported such a state since"
)
MOST_ERROR: Final = 280  # wide, in words
# A drive's states where there is little room; in alarms and on cards they stand in full.
FEW_WORDS: Final = {
    "not ready to switch on": "not ready",
    "ready to switch on": "ready",
    "switch on disabled": "off",
    "operation enabled": "enabled",
    "quick stop active": "quick stop",
    "fault reaction active": "fault",
}
LEAST_ERROR: Final = "0x0000"  # its words stand below the table then
ROW: Final = 19  # high, at text of 100 %
MOST_ROW: Final = 44  # likewise, where the table fills its page: a line is still followed by the eye
BAR_SHARE: Final = 0.21  # of a row's height
BAR = Qt.ItemDataRole.UserRole + 1


class JointModel(QAbstractTableModel):
    """Texts of the robot that is looked at; only the rows that have changed are drawn again."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._joints: list[str] = []
        self._cells: list[list[Cell]] = []
        self.at_fault: frozenset[int] = frozenset()  # columns that an active fault is about

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        joints = [] if station is None else station.robot.names("joint")
        rows = [] if station is None else [row_of(station, joint, self._desk) for joint in joints]
        self.at_fault = frozenset() if station is None else at_fault(station, joints)
        if joints != self._joints or not self._cells:
            self.beginResetModel()
            self._joints, self._cells = joints, rows
            self.endResetModel()
            return
        before, self._cells = self._cells, rows
        for row, known in enumerate(before):
            if known != rows[row]:
                self.dataChanged.emit(self.index(row, 0), self.index(row, len(COLUMNS) - 1))

    def widest(self, column: int, metrics: QFontMetrics, said: Callable[[str], str] = str) -> int:
        """Return how wide a column is at least, so that nothing in it is cut, as it is `said`."""
        texts = {said(row[column].text) for row in self._cells}
        texts.add(str(self.headerData(column, Qt.Orientation.Horizontal, Qt.ItemDataRole.DisplayRole)))
        return max(metrics.horizontalAdvance(text) for text in texts)

    @property
    def errors(self) -> list[tuple[str, str]]:
        """Each joint with which something is wrong, and what."""
        return [(row[JOINT].text, row[ERROR].text) for row in self._cells if row[ERROR].tip]

    @property
    def has_limit(self) -> bool:
        """Whether the torque of some drive is limited, as far as is known."""
        return any(row[TORQUE].bar is not None or " / " in row[TORQUE].text for row in self._cells)

    @property
    def tone(self) -> str:
        """How bad the worst of it is."""
        return "bad" if any(row[ERROR].colour == "bad" for row in self._cells if row[ERROR].tip) else "warn"

    def empty(self) -> set[int]:
        """Return the columns that say nothing yet: no stop was sent."""
        return {STOP} if all(row[STOP].text == NONE for row in self._cells) else set()

    @property
    def is_stop_news(self) -> bool:
        """Whether what the latest STOP did is looked for: not every drive is enabled again."""
        return any(row[STOP].text not in (NONE, ENABLED_AGAIN) for row in self._cells)

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return 0 if parent.isValid() else len(self._cells)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008 - Qt's own default
        return len(COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = 0) -> Any:
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            title, quantity = COLUMNS[section]
            return f"{title} {unit_of(self._desk, quantity).symbol}" if quantity in SI else title
        if section == STOP and role == Qt.ItemDataRole.ToolTipRole:
            return HINT
        if role == Qt.ItemDataRole.TextAlignmentRole and ANGLE <= section <= TEMPERATURE:
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None

    def data(self, index: Index, role: int = 0) -> Any:
        cell, column = self._cells[index.row()][index.column()], index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return cell.text
            case Qt.ItemDataRole.ForegroundRole:
                return self._theme.colour(cell.colour)
            case Qt.ItemDataRole.TextAlignmentRole if ANGLE <= column <= TEMPERATURE:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if ANGLE <= column <= TEMPERATURE:
                return self._theme.number_font()
            case Qt.ItemDataRole.ToolTipRole if cell.tip:
                return tip(cell.tip)
            case _ if role == BAR:
                return cell.bar
        return None


class BarDelegate(SentenceDelegate):
    """Draws a cell's bar below its text: from the middle, as far as its share.

    Of an error its code where `is_short`, else all of it; where `is_tight`, states in fewer words.
    """

    def __init__(self, theme: Theme) -> None:
        super().__init__(ERROR)
        self._theme = theme
        self.is_short = self.is_tight = False
        self.pointer = BELOW

    def initStyleOption(self, option: QStyleOptionViewItem, index: Index) -> None:
        super().initStyleOption(option, index)
        text = str(index.data())
        if self.is_short and index.column() == ERROR and text not in (NONE, NOT_KNOWN):
            option.text = text.partition(" ")[0] if text.startswith("0x") else self.pointer
        elif self.is_tight and index.column() == STATE:
            option.text = in_few_words(text)

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        high = round(option.rect.height() * BAR_SHARE)
        text = QStyleOptionViewItem(option)
        if any(isinstance(index.sibling(index.row(), one).data(BAR), Bar) for one in (ANGLE, TORQUE)):
            text.rect = option.rect.adjusted(0, 0, 0, -high - 1)  # all words of a row on one line
        super().paint(painter, text, index)
        bar = index.data(BAR)
        if not isinstance(bar, Bar):
            return
        box = QRectF(option.rect.adjusted(6, 0, -6, -1))
        bar_box = QRectF(box.left(), box.bottom() - high, box.width(), high)
        field = bar_box.adjusted(0, high / 4, 0, -high / 4)
        painter.fillRect(field, self._theme.colour("border"))
        share = min(max(bar.share, -1.0), 1.0)
        middle, reach = field.center().x(), field.width() / 2 * abs(share)
        left = middle if share >= 0 else middle - reach
        painter.fillRect(QRectF(left, bar_box.top(), reach, high), self._theme.colour(bar.colour))
        painter.fillRect(QRectF(middle - 0.5, bar_box.top(), 1, high), self._theme.colour("dim"))


class JointTable(QTableView):
    """The table of a `JointModel`: as high as its rows; where it is narrow, without its spare columns.

    Where it `fills` its page its rows are higher.
    """

    def __init__(self, model: JointModel, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._model = model
        self._bars = BarDelegate(theme)
        self._fills = False
        self.setModel(model)
        self.setItemDelegate(self._bars)
        self.setAccessibleName("Joints")
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setShowGrid(False)
        self.setAlternatingRowColors(True)
        self.setTextElideMode(Qt.TextElideMode.ElideRight)  # of an error the code stays
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.verticalHeader().hide()
        self.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.Fixed)
        self.horizontalHeader().setSectionResizeMode(ERROR, QHeaderView.ResizeMode.Stretch)
        self.horizontalHeader().setDefaultAlignment(
            Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
        )
        theme.changed.connect(self._restyle)
        model.modelReset.connect(self._restyle)
        model.dataChanged.connect(self._fit)
        self._restyle()

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(150), self.sizeHint().height())

    def sizeHint(self) -> QSize:
        return QSize(self._theme.px(600), self._high(ROW))

    def fill(self, on: bool) -> None:
        """Take the height that there is, up to `MOST_ROW` a row; or no more than needed."""
        if on is not self._fills:
            self._fills = on
            self._restyle()

    def point_to_words(self, *, above: bool) -> None:
        """Say where the words stand that have no room in their column."""
        self._bars.pointer = ABOVE if above else BELOW

    @property
    def unsaid(self) -> list[tuple[str, str]]:
        """Each joint with which something is wrong, and what, where that has no room in its column."""
        return self._model.errors if self._bars.is_short else []

    @property
    def tone(self) -> str:
        """How bad the worst of that is."""
        return self._model.tone

    @property
    def bars(self) -> frozenset[int]:
        """The columns with bars that are shown; without a known limit a torque has none."""
        bars = {ANGLE} | ({TORQUE} if self._model.has_limit else set())
        return frozenset(column for column in bars if not self.isColumnHidden(column))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_rows()
        self._fit()

    def _restyle(self) -> None:
        self.setMinimumHeight(self._high(ROW))
        self.setMaximumHeight(self._high(MOST_ROW if self._fills else ROW))
        self._fit_rows()
        self._fit()

    @property
    def _rows(self) -> int:
        return max(self._model.rowCount(), 1)

    @property
    def _around_rows(self) -> int:
        return self.horizontalHeader().sizeHint().height() + 2

    def _high(self, row: int) -> int:
        """Return how high it is with rows of this height, at text of 100 %."""
        return self._rows * self._theme.px(row) + self._around_rows

    def _fit_rows(self) -> None:
        """Share the height among the rows."""
        least, most = (self._theme.px(high) for high in (ROW, MOST_ROW))
        share = (self.height() - self._around_rows) // self._rows
        high = min(max(share, least), most) if self._fills else least
        if high != self.verticalHeader().defaultSectionSize():
            self.verticalHeader().setDefaultSectionSize(high)

    def _fit(self) -> None:
        """Every column as wide as what is in it; what has no room is left out whole."""
        before = self._bars.is_short, self._bars.is_tight
        widths, shown = self._fitting()
        if before != (self._bars.is_short, self._bars.is_tight):
            self.viewport().update()
        spare = max(self.viewport().width() - sum(widths[known] for known in shown), 0) // max(len(shown), 1)
        for column, width in enumerate(widths):
            self.setColumnHidden(column, column not in shown)
            wanted = width + (spare if column != ERROR else 0)
            if column in shown and column != ERROR and abs(self.columnWidth(column) - wanted) > 1:
                self.setColumnWidth(column, wanted)

    def _fitting(self) -> tuple[list[int], set[int]]:
        """Return how wide each column is, and those that are shown, at the fullest that has room."""
        room = self.viewport().width()
        for is_tight in (False, True):
            self._bars.is_tight = is_tight
            widths = [self._width(column) for column in range(len(COLUMNS))]
            shown = self._with_room(widths)
            of_error = room - sum(widths[known] for known in shown if known != ERROR)
            self._bars.is_short = any(
                self._text_width(text) > of_error for text in {text for _, text in self._model.errors}
            )
            if self._bars.is_short:
                widths[ERROR] = max(self._text_width(LEAST_ERROR), self._text_width(COLUMNS[ERROR][0]))
                shown = self._with_room(widths)
            if sum(widths[known] for known in shown) <= room:
                break
        has_errors = bool(self._model.errors)  # which stand below the table, too
        least = (TORQUE, ANGLE, ERROR) if has_errors else (ERROR, TORQUE, ANGLE)
        last = (STOP,) if self._model.is_stop_news else ()  # the proof of a STOP goes after all else
        for column in (*least, *last):
            if sum(widths[known] for known in shown) > room:
                shown.discard(column)
        if has_errors and sum(widths[known] for known in shown) + widths[ERROR] <= room:
            shown.add(ERROR)
        return widths, shown

    def _with_room(self, widths: list[int]) -> set[int]:
        """Return the columns that are shown, without the spare ones that have no room."""
        shown = set(range(len(COLUMNS))) - self._model.empty()
        kept = self._model.at_fault | ({STOP} if self._model.is_stop_news else set())
        for column in (column for column in SPARE if column not in kept):
            if sum(widths[known] for known in shown) > self.viewport().width():
                shown.discard(column)
        return shown

    def _text_width(self, text: str) -> int:
        return QFontMetrics(self._theme.text_font()).horizontalAdvance(text) + self._around

    @property
    def _around(self) -> int:
        """What is beside the text of a cell."""
        return self._theme.px(9 if self._bars.is_tight else 16)

    def _width(self, column: int) -> int:
        numbers = ANGLE <= column <= TEMPERATURE
        metrics = QFontMetrics(self._theme.number_font() if numbers else self._theme.text_font())
        few = self._bars.is_tight and column == STATE
        widest = self._model.widest(column, metrics, in_few_words if few else str) + self._around
        return min(widest, self._theme.px(MOST_ERROR)) if column == ERROR else widest


def in_few_words(state: str) -> str:
    """Return a state as it is said where there is little room."""
    return next((state.replace(full, few) for full, few in FEW_WORDS.items() if full in state), state)
