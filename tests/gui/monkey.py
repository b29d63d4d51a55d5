"""A monkey at the window: clicks, types, drags and turns the wheel at random, wherever it can."""

import random
from collections.abc import Callable

from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QKeyEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QFileDialog, QWidget

TEXTS = ("0.42", "-1e9", "nan", "left", "192.0.2.7:7420", "12,5", "", "ü→", "0x6072")
KEYS = (
    *(Qt.Key.Key_Tab, Qt.Key.Key_Backtab, Qt.Key.Key_Return, Qt.Key.Key_Escape, Qt.Key.Key_Space),
    *(Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Home, Qt.Key.Key_End),
    *(Qt.Key.Key_F2, Qt.Key.Key_Delete, Qt.Key.Key_Backspace, Qt.Key.Key_PageDown, Qt.Key.Key_A),
)
CHORDS = (
    *((Qt.Key.Key_F, Qt.KeyboardModifier.ControlModifier), (Qt.Key.Key_O, Qt.KeyboardModifier.AltModifier)),
    *((Qt.Key.Key_S, Qt.KeyboardModifier.AltModifier), (Qt.Key.Key_R, Qt.KeyboardModifier.AltModifier)),
    *(
        (Qt.Key.Key_A, Qt.KeyboardModifier.ControlModifier),
        (Qt.Key.Key_C, Qt.KeyboardModifier.ControlModifier),
    ),
)


class Monkey:
    """`act` does one thing; `last` says what, for whoever asks after an accident."""

    def __init__(self, seed: int, window: QWidget) -> None:
        self._random = random.Random(seed)
        self._window = window
        self.last = ""
        self._acts: tuple[tuple[Callable[[QWidget], None], int], ...] = (
            (self._click, 10),
            (self._double_click, 3),
            (self._drag, 2),
            (self._turn, 3),
            (self._key, 6),
            (self._type, 3),
            (self._right_click, 1),
        )

    def act(self) -> None:
        """One thing, in an open menu where there is one; in no dialog that could change files of others."""
        for dialog in QApplication.topLevelWidgets():
            if isinstance(dialog, QFileDialog):
                dialog.close()
        widget = QApplication.activePopupWidget() or self._anywhere()
        acts, shares = zip(*self._acts, strict=True)
        (act,) = self._random.choices(acts, shares)
        self.last = f"{act.__name__} {type(widget).__name__} {widget.accessibleName() or widget.objectName()}"
        act(widget)

    def _anywhere(self) -> QWidget:
        tops = [top for top in QApplication.topLevelWidgets() if top.isVisible()]
        found = [part for top in tops for part in top.findChildren(QWidget) if part.isVisible()]
        return self._random.choice(found or [self._window])

    def _place(self, widget: QWidget) -> QPoint:
        return QPoint(
            self._random.randrange(max(1, widget.width())), self._random.randrange(max(1, widget.height()))
        )

    def _click(self, widget: QWidget) -> None:
        QTest.mouseClick(widget, Qt.MouseButton.LeftButton, pos=self._place(widget))

    def _right_click(self, widget: QWidget) -> None:
        QTest.mouseClick(widget, Qt.MouseButton.RightButton, pos=self._place(widget))

    def _double_click(self, widget: QWidget) -> None:
        QTest.mouseDClick(widget, Qt.MouseButton.LeftButton, pos=self._place(widget))

    def _drag(self, widget: QWidget) -> None:
        QTest.mousePress(widget, Qt.MouseButton.LeftButton, pos=self._place(widget))
        QTest.mouseMove(widget, self._place(widget))
        QTest.mouseRelease(widget, Qt.MouseButton.LeftButton, pos=self._place(widget))

    def _turn(self, widget: QWidget) -> None:
        place = QPointF(self._place(widget))
        angle = QPoint(0, self._random.choice((-240, -120, 120, 240)))
        event = QWheelEvent(
            place,
            widget.mapToGlobal(place),
            QPoint(),
            angle,
            Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier,
            Qt.ScrollPhase.NoScrollPhase,
            False,
        )
        QApplication.sendEvent(widget, event)

    def _key(self, widget: QWidget) -> None:
        target = self._target(widget)
        if self._random.random() < 0.2:
            QTest.keyClick(target, *self._random.choice(CHORDS))
        else:
            QTest.keyClick(target, self._random.choice(KEYS))

    def _type(self, widget: QWidget) -> None:
        for letter in self._random.choice(TEXTS):  # QTest itself types nothing but ASCII
            for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
                event = QKeyEvent(kind, 0, Qt.KeyboardModifier.NoModifier, letter)
                QApplication.sendEvent(self._target(widget), event)

    @staticmethod
    def _target(widget: QWidget) -> QWidget:
        """Keys go where the keyboard is, as a person's do."""
        return QApplication.activePopupWidget() or QApplication.focusWidget() or widget
