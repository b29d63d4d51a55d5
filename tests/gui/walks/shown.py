"""`python -m tests.gui.walks.shown SOCKET ARGUMENTS`: `gwrms ARGUMENTS`, which tells where what stands.

It answers only about what is visible, in lines of JSON at SOCKET, and does nothing to the window itself.
"""

import contextlib
import json
import sys
import time
from collections.abc import Iterator
from typing import Any, Final

from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QWindow
from PySide6.QtNetwork import QLocalServer, QLocalSocket
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QApplication,
    QComboBox,
    QLabel,
    QLineEdit,
    QListView,
    QMenu,
    QTabBar,
    QTableView,
    QToolButton,
    QWidget,
)

from gateway.main import main
from server_gui.views.frame.application import application
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from tests.gui import rules

PAINTED_S: Final = 5.0

Place = tuple[str, QRect]  # what stands there, on the screen


def visible() -> Iterator[QWidget]:
    """Menus first: what is open above all else is what a hand means."""
    tops = reversed(QApplication.topLevelWidgets())
    for top in sorted(tops, key=lambda top: not isinstance(top, QMenu)):
        if top.isVisible():
            yield top
            yield from rules.seen(top)


def places() -> Iterator[Place]:
    """Everything that a hand could go to, by each of its names."""
    for widget in visible():
        area = _on_screen(widget, widget.visibleRegion().boundingRect())
        if isinstance(widget, QMenu):
            for action in widget.actions():
                yield _plain(action.text()), _on_screen(widget, widget.actionGeometry(action))
        elif isinstance(widget, QTabBar):
            for tab in range(widget.count()):
                yield _plain(widget.tabText(tab)), _on_screen(widget, widget.tabRect(tab))
        elif isinstance(widget, QAbstractItemView):
            yield widget.accessibleName(), area
            yield from _cells(widget)
        elif widget.isEnabled():  # nobody clicks what is grey
            for name in _names(widget):
                yield name, area


def texts() -> list[str]:
    """Everything that can be read."""
    found = []
    for widget in visible():
        if isinstance(widget, ShrinkingLabel):
            found.append(widget.shown)
        elif isinstance(widget, QLabel):
            found.append(widget.text())
        elif isinstance(widget, QAbstractButton):
            found.append(_plain(widget.text()))
        elif isinstance(widget, QLineEdit):
            found.append(widget.text() or widget.placeholderText())
        elif isinstance(widget, QComboBox):
            found.append(widget.currentText())
        elif isinstance(widget, QAbstractItemView):
            found += [text for text, _ in _cells(widget)]
        else:
            found += [widget.accessibleName(), widget.accessibleDescription()]
    return [text for text in found if text]


def painted() -> None:
    """Let every window be on the screen that is open: of one that comes, what was there before is seen."""
    ends_s = time.monotonic() + PAINTED_S
    while time.monotonic() < ends_s and not all(map(_is_on_screen, QApplication.topLevelWindows())):
        QApplication.processEvents()
    rules.settle()
    for top in QApplication.topLevelWidgets():
        if top.isVisible():
            top.repaint()


def _is_on_screen(window: QWindow) -> bool:
    return window.isExposed() or not window.isVisible()


def broken() -> list[str]:
    """What of the rules for every picture of the window is not kept."""
    found = []
    for window in QApplication.topLevelWidgets():
        if isinstance(window, MainWindow) and window.isVisible():
            found += [f"cut: {one}" for one in rules.halved_numbers(window)]
            found += [f"out of reach: {one}" for one in rules.out_of_reach(window)]
            found += [f"nameless: {one}" for one in rules.nameless(window)]
            stop, screen = window.header.stop, window.screen().geometry()
            if not screen.contains(_on_screen(stop, stop.rect())):
                found.append("STOP is not whole on the screen")
    return found


def _answer(asked: dict[str, Any]) -> object:
    match asked:
        case {"where": name, **more}:
            there = [(text, area) for text, area in places() if not area.isEmpty()]
            found = [area for text, area in there if text == name]
            if not found and not more.get("exactly"):
                found = [area for text, area in there if text.startswith(name)]
            return [(one.center().x(), one.center().y(), one.width(), one.height()) for one in found]
        case {"picture": path}:
            painted()
            return QApplication.primaryScreen().grabWindow(0).save(path)
        case {"texts": _}:
            return texts()
        case {"places": _}:
            return [(text, area.x(), area.y()) for text, area in places() if text]
        case {"broken": _}:
            return broken()
        case {"focus": _}:
            popup, modal = QApplication.activePopupWidget(), QApplication.activeModalWidget()
            shown = [top for top in QApplication.topLevelWidgets() if top.isVisible() and top.isWindow()]
            main_windows = [top for top in shown if isinstance(top, MainWindow)]
            top = popup or modal or next(iter(main_windows), None)
            return None if top is None else int(top.winId())
    return None


def _names(widget: QWidget) -> Iterator[str]:
    if isinstance(widget, QAbstractButton | QLabel):
        yield _plain(widget.text())
    if isinstance(widget, QLineEdit):
        yield widget.placeholderText()
    if isinstance(widget, QToolButton) and widget.defaultAction() is not None:
        yield _plain(widget.defaultAction().text())
    yield widget.accessibleName()
    yield widget.objectName()


def _cells(view: QAbstractItemView) -> Iterator[Place]:
    model, port = view.model(), view.viewport()
    if model is None:
        return
    root = view.rootIndex()
    stack = [model.index(row, 0, root) for row in range(model.rowCount(root))]
    for first in stack:
        stack += (
            [model.index(row, 0, first) for row in range(model.rowCount(first))]
            if not isinstance(view, QTableView)
            else []
        )
        columns = 1 if isinstance(view, QListView) else model.columnCount(first.parent())
        for column in range(columns):
            index = first.siblingAtColumn(column)
            area = view.visualRect(index) & port.rect()
            if area.isValid() and area.height() > 4:
                yield str(index.data(Qt.ItemDataRole.DisplayRole) or ""), _on_screen(port, area)


def _on_screen(widget: QWidget, area: QRect) -> QRect:
    return QRect(widget.mapToGlobal(area.topLeft()), area.size())


def _plain(text: str) -> str:
    return text.replace("&", "")


class Answers(QLocalServer):
    """One question a line, one answer a line."""

    def __init__(self, path: str) -> None:
        super().__init__()
        self.newConnection.connect(self._take)
        self.listen(path)

    def _take(self) -> None:
        link = self.nextPendingConnection()
        link.readyRead.connect(lambda: self._read(link))

    def _read(self, link: QLocalSocket) -> None:
        while link.canReadLine():
            answer = _answer(json.loads(bytes(link.readLine().data())))
            link.write(json.dumps(answer).encode() + b"\n")
            link.flush()


if __name__ == "__main__":
    application()
    answers = Answers(sys.argv[1])
    with contextlib.suppress(KeyboardInterrupt):
        raise SystemExit(main(sys.argv[2:]))
