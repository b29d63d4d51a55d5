"""What no picture of the window may show: green for the unknown, half a number, a control out of reach."""

import re
from collections.abc import Iterable, Iterator

from PySide6.QtCore import QModelIndex, Qt
from PySide6.QtGui import QColor, QFontMetrics
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QApplication,
    QHeaderView,
    QLabel,
    QScrollArea,
    QTabBar,
    QTableView,
    QWidget,
)

from server_gui.views.frame.chip import Chip
from server_gui.views.overview.now_line import Fact
from server_gui.views.robots.others_bar import RobotChip
from server_gui.views.robots.panel import RobotCard
from server_gui.views.theme import Theme
from server_gui.views.widgets.elided import ElidedLabel, PathLabel
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.stop_button import StopButton

DIGIT = re.compile(r"\d")
QTS_OWN = ("qt_", "ScrollLeftButton", "ScrollRightButton")  # parts of other controls


def seen(window: QWidget) -> Iterator[QWidget]:
    """Everything of which something is on the screen."""
    return (widget for widget in shown(window) if not widget.visibleRegion().isEmpty())


def shown(window: QWidget) -> Iterator[QWidget]:
    """Everything that is not hidden, also what is scrolled out of sight."""
    return (widget for widget in window.findChildren(QWidget) if widget.isVisible())


def broken(window: QWidget) -> Iterator[str]:
    """Every rule that is not kept, but for what is green, by one look at all that is shown."""
    every = list(shown(window))
    sight = [widget for widget in every if not widget.visibleRegion().isEmpty()]
    yield from (f"half a number: {one}" for one in halved_numbers(window, sight))
    yield from (f"out of reach: {one}" for one in out_of_reach(window, every))
    yield from (f"nameless: {one}" for one in nameless(window, every))
    yield from (f"no room for: {one}" for one in cut_words(window, sight))
    yield from (f"no room for the title: {one}" for one in cut_titles(window, sight))
    yield from (f"state cut: {one}" for one in cut_states(sight))


def green(window: QWidget, theme: Theme) -> list[str]:
    """Everything that is drawn as good."""
    good, shown = theme.colour("good"), list(seen(window))
    found = [
        f"{_path(one)}: {one.accessibleName()}"
        for one in shown
        if isinstance(one, MarkIcon) and one._mark.colour == "good"
    ]
    found += [
        f"{_path(one)}: {one.text()}"
        for one in shown
        if isinstance(one, QLabel) and one.property("tone") == "good"
    ]
    for view in shown:
        if isinstance(view, QTableView):
            for row, column in _cells(view):
                index = view.model().index(row, column)
                ink = index.data(Qt.ItemDataRole.ForegroundRole)
                if ink is not None and QColor(ink) == good:
                    found.append(f"{_path(view)}: {index.data()}")
    return found


def halved_numbers(window: QWidget, sight: Iterable[QWidget] | None = None) -> list[str]:
    """Every number of which a digit is missing for want of room."""
    found = []
    for widget in seen(window) if sight is None else sight:
        if (
            isinstance(widget, QLabel)
            and _has_number(widget)
            and (
                _is_cut(widget)
                or _is_clipped(widget)
                or not (_is_inside(widget, window) or _is_scrolled(widget))
            )
        ):
            found.append(f"{_path(widget)}: {widget.text()}")
        if isinstance(widget, ShrinkingLabel) and DIGIT.search(widget.shown) and not widget.is_whole:
            found.append(f"{_path(widget)}: {widget.shown}")
        if isinstance(widget, StopButton):
            found += [] if widget.is_whole else [f"{_path(widget)}: {widget.lines}"]
        elif isinstance(widget, QAbstractButton) and DIGIT.search(widget.text()):
            whole = widget.width() >= widget.fontMetrics().horizontalAdvance(widget.text())
            found += [] if whole else [f"{_path(widget)}: {widget.text()}"]
        if isinstance(widget, QTableView):
            found += _halved_cells(widget)
    return found


def cut_words(window: QWidget, sight: Iterable[QWidget] | None = None) -> list[str]:
    """Every text of several lines of which some have no room."""
    return [
        f"{_path(label)}: {label.text()}"
        for label in (seen(window) if sight is None else sight)
        if isinstance(label, QLabel)
        and label.wordWrap()
        and label.text()
        and label.heightForWidth(label.width()) > label.height() + label.fontMetrics().descent()
    ]


def cut_titles(window: QWidget, sight: Iterable[QWidget] | None = None) -> list[str]:
    """Every title of a column of which letters have no room."""
    across = Qt.Orientation.Horizontal
    return [
        f"{_path(header)}: {header.model().headerData(place, across)}"
        for header in (seen(window) if sight is None else sight)
        if isinstance(header, QHeaderView) and header.orientation() is across
        for place in range(header.count())
        if not header.isSectionHidden(place) and header.sectionSize(place) < _title_wide(header, place)
    ]


def cut_states(sight: Iterable[QWidget]) -> Iterator[str]:
    """Every state in headline, chips and cards of which letters have no room."""
    for widget in sight:
        if isinstance(widget, Fact):
            labels = (widget.main, widget.detail)
            yield from (f"{_path(widget)}: {one.shown}" for one in labels if not one.is_whole)
        if isinstance(widget, Chip) and widget.accessibleName() != "robot":
            for label in (widget._main, widget._detail):
                if label.fontMetrics().horizontalAdvance(label.text()) > label.contentsRect().width():
                    yield f"{_path(widget)}: {label.text()}"
        if isinstance(widget, Chip) and widget._words.shorter:
            label, word = widget._detail, widget._words.shorter
            wide = label.fontMetrics().horizontalAdvance(label.text())
            if word not in label.text() or wide > label.contentsRect().width():
                yield f"{_path(widget)}: {label.text()} for {word}"
        elif isinstance(widget, RobotCard) and not widget._state.is_whole:
            yield f"{_path(widget)}: {widget._state.shown}"
        elif isinstance(widget, RobotChip) and not widget.state.is_whole:
            yield f"{_path(widget)}: {widget.state.shown}"


def out_of_reach(window: QWidget, every: Iterable[QWidget] | None = None) -> list[str]:
    """Every control that is not whole on the screen, and to which nothing scrolls."""
    found = []
    for widget in shown(window) if every is None else every:
        if not widget.focusPolicy() & Qt.FocusPolicy.TabFocus:
            continue
        is_lost = not _is_inside(widget, window) and not _is_scrolled(widget)
        if (is_lost or _is_clipped(widget)) and not _is_behind(widget):
            found.append(f"{_path(widget)} at {widget.mapTo(window, widget.rect().topLeft()).toTuple()}")
    return found


def nameless(window: QWidget, every: Iterable[QWidget] | None = None) -> list[str]:
    """Every place where Tab stops without a word of what it is."""
    found = []
    for widget in shown(window) if every is None else every:
        if not widget.isEnabled():
            continue
        if not widget.focusPolicy() & Qt.FocusPolicy.TabFocus or widget.objectName().startswith(QTS_OWN):
            continue
        text = widget.text() if isinstance(widget, QAbstractButton) else ""
        if isinstance(widget, QTabBar) or re.search(r"\w", widget.accessibleName() or text):
            continue
        found.append(_path(widget))
    return found


def _has_number(label: QLabel) -> bool:
    """Names may have digits, too, and are elided in their middle."""
    parent = label.parentWidget()
    of_chip = isinstance(parent, Chip) and parent.accessibleName() == "robot"
    of_robot = (of_chip or isinstance(parent, RobotCard)) and label.objectName() == "title"
    is_name = of_robot or isinstance(label, PathLabel)
    return bool(DIGIT.search(label.text())) and not is_name


def _is_cut(label: QLabel) -> bool:
    if label.wordWrap() or label.textFormat() is Qt.TextFormat.RichText:
        return False
    room, metrics = label.contentsRect().width(), label.fontMetrics()
    widest = max(metrics.horizontalAdvance(line) for line in label.text().splitlines())
    if type(label) is ElidedLabel or isinstance(label, ElidedLabel):
        shown = metrics.elidedText(label.text(), label._mode, room)
        return DIGIT.findall(shown) != DIGIT.findall(label.text())
    return type(label).paintEvent is QLabel.paintEvent and widest > room


def _title_wide(header: QHeaderView, place: int) -> int:
    title = str(header.model().headerData(place, header.orientation()) or "")
    return max(map(header.fontMetrics().horizontalAdvance, title.split("\n")))


def _halved_cells(view: QTableView) -> Iterator[str]:
    for row, column in _cells(view):
        index = view.model().index(row, column)
        text, font = str(index.data() or ""), index.data(Qt.ItemDataRole.FontRole)
        right = index.data(Qt.ItemDataRole.TextAlignmentRole)
        is_number = right is not None and bool(Qt.AlignmentFlag(right) & Qt.AlignmentFlag.AlignRight)
        metrics = view.fontMetrics() if font is None else QFontMetrics(font)
        left, wide = view.columnViewportPosition(column), view.columnWidth(column)
        is_cut_off = left < view.viewport().width() < left + wide and view.horizontalScrollBar().value() == 0
        if is_number and (metrics.horizontalAdvance(text) > wide or is_cut_off):
            yield f"{_path(view)}: {text}"


def _cells(view: QTableView) -> Iterator[tuple[int, int]]:
    model = view.model()
    if model is None:
        return
    for row in range(min(model.rowCount(QModelIndex()), 30)):
        for column in range(model.columnCount(QModelIndex())):
            if not view.isColumnHidden(column):
                yield row, column


def _is_inside(widget: QWidget, window: QWidget) -> bool:
    corners = (widget.rect().topLeft(), widget.rect().bottomRight())
    return all(window.rect().contains(widget.mapTo(window, corner)) for corner in corners)


def _is_scrolled(widget: QWidget) -> bool:
    parent = widget.parentWidget()
    while parent is not None:
        if isinstance(parent, QScrollArea | QAbstractItemView | QAbstractScrollArea):
            return True
        parent = parent.parentWidget()
    return False


def _is_clipped(widget: QWidget) -> bool:
    """Whether it is cut at the side by a view that does not scroll there."""
    parent = widget.parentWidget()
    while parent is not None:
        off = Qt.ScrollBarPolicy.ScrollBarAlwaysOff
        if isinstance(parent, QScrollArea) and parent.horizontalScrollBarPolicy() is off:
            view = parent.viewport()
            ends = (
                widget.mapTo(view, corner).x()
                for corner in (widget.rect().topLeft(), widget.rect().bottomRight())
            )
            if not all(0 <= x < view.width() for x in ends):
                return True
        parent = parent.parentWidget()
    return False


def _is_behind(widget: QWidget) -> bool:
    """Whether it belongs to a tab that is not in front."""
    return widget.visibleRegion().isEmpty()


def _path(widget: QWidget) -> str:
    names: list[str] = []
    one: QWidget | None = widget
    while one is not None and len(names) < 4:
        names.append(f"{type(one).__name__}({one.accessibleName() or one.objectName()})")
        one = one.parentWidget()
    return " < ".join(names)


def settle() -> None:
    """Let layouts come to rest."""
    for _ in range(3):
        QApplication.processEvents()
