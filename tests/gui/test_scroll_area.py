"""Pages that are scrolled: the wheel scrolls, and what has just come is brought into sight."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QSpinBox, QVBoxLayout, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets.scroll_area import ScrollArea, bring_into_sight
from tests.gui import rules
from tests.gui.fakes import destroy


class Page(ScrollArea):
    """A choice and a number at the top, words far below."""

    def __init__(self) -> None:
        super().__init__()
        self.choice, self.number, self.last = QComboBox(), QSpinBox(), QLabel("at the end")
        self.choice.addItems(["a", "b", "c"])
        view = QWidget()
        column = QVBoxLayout(view)
        for part in (self.choice, self.number, QLabel("\n" * 40), self.last):
            column.addWidget(part)
        self.setWidget(view)


@pytest.fixture
def page(theme: Theme) -> Iterator[Page]:
    made = Page()
    made.resize(200, 150)
    made.show()
    made.setFocus()
    rules.settle()
    yield made
    destroy(made)


def test_the_wheel_changes_only_what_has_the_keyboard(page: Page) -> None:
    choice, number = page.choice, page.number
    for field in (choice, number):
        wheel(field)
    assert (choice.currentIndex(), number.value()) == (0, 0)
    number.setFocus()
    page.activateWindow()
    rules.settle()
    assert number.hasFocus()
    wheel(number, 1)
    assert number.value() == 1


def test_what_has_just_come_is_brought_into_sight(page: Page) -> None:
    last = page.last
    assert last.visibleRegion().isEmpty()
    bring_into_sight(last)
    rules.settle()
    assert not last.visibleRegion().isEmpty()


def wheel(field: QWidget, way: int = -1) -> None:
    """Turn the wheel over it."""
    at = QPointF(field.rect().center())
    turned = QWheelEvent(
        at,
        field.mapToGlobal(at),
        QPoint(),
        QPoint(0, 120 * way),
        Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase,
        False,
    )
    QApplication.sendEvent(field, turned)
