"""Pages that are scrolled: the wheel scrolls, and what has just come is brought into sight."""

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QSpinBox, QVBoxLayout, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets.scrolled import Scrolled, bring_into_sight
from tests.gui import rules
from tests.gui.fakes import destroy


@pytest.fixture
def page(theme: Theme) -> Iterator[Scrolled]:
    view, made = QWidget(), Scrolled()
    column = QVBoxLayout(view)
    for part in (QComboBox(), QSpinBox(), QLabel("\n" * 40), QLabel("at the end")):
        column.addWidget(part)
    view.findChild(QComboBox).addItems(["a", "b", "c"])
    made.setWidget(view)
    made.resize(200, 150)
    made.show()
    made.setFocus()
    rules.settle()
    yield made
    destroy(made)


def test_the_wheel_changes_only_what_has_the_keyboard(page: Scrolled) -> None:
    choice, number = page.findChild(QComboBox), page.findChild(QSpinBox)
    for field in (choice, number):
        wheel(field)
    assert (choice.currentIndex(), number.value()) == (0, 0)
    number.setFocus()
    page.activateWindow()
    rules.settle()
    assert number.hasFocus()
    wheel(number, 1)
    assert number.value() == 1


def test_what_has_just_come_is_brought_into_sight(page: Scrolled) -> None:
    last = page.findChildren(QLabel)[-1]
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
