"""F12 and Ctrl+Space, and Shift+F12 for all, in whatever window or menu of ours the keyboard is."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QWindow

KEYS: Final = frozenset(
    {
        (Qt.Key.Key_F12, Qt.KeyboardModifier.NoModifier),
        (Qt.Key.Key_Space, Qt.KeyboardModifier.ControlModifier),
    }
)
ALL: Final = (Qt.Key.Key_F12, Qt.KeyboardModifier.ShiftModifier)


class StopKeys(QObject):
    """`pressed`, or `all_pressed`, is emitted before any widget sees the key.

    Keys come to the window that has the focus first, also those for an open menu: it is enough to look there.
    """

    pressed = Signal()
    all_pressed = Signal()

    def __init__(self, application: QGuiApplication) -> None:
        super().__init__(application)
        application.focusWindowChanged.connect(self._look_at)
        self._look_at(application.focusWindow())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress:
            return super().eventFilter(watched, event)
        key = Qt.Key(event.key()), event.modifiers()
        if key not in KEYS and key != ALL:
            return super().eventFilter(watched, event)
        if not event.isAutoRepeat():
            (self.all_pressed if key == ALL else self.pressed).emit()
        return True

    def _look_at(self, window: QWindow | None) -> None:
        if window is not None:
            window.installEventFilter(self)  # once, however often it is asked for
