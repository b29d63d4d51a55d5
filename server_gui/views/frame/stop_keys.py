"""F12 and Ctrl+Space, in whatever window or menu of ours the keyboard is."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeyEvent, QWindow

KEYS: Final = frozenset(
    {
        (Qt.Key.Key_F12, Qt.KeyboardModifier.NoModifier),
        (Qt.Key.Key_Space, Qt.KeyboardModifier.ControlModifier),
    }
)


class StopKeys(QObject):
    """`pressed` is emitted before any widget sees the key.

    Keys come to the window that has the focus first, also those for an open menu: it is enough to look there.
    """

    pressed = Signal()

    def __init__(self, application: QGuiApplication) -> None:
        super().__init__(application)
        application.focusWindowChanged.connect(self._look_at)
        self._look_at(application.focusWindow())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if not isinstance(event, QKeyEvent) or event.type() != QEvent.Type.KeyPress:
            return super().eventFilter(watched, event)
        if (Qt.Key(event.key()), event.modifiers()) not in KEYS:
            return super().eventFilter(watched, event)
        if not event.isAutoRepeat():
            self.pressed.emit()
        return True

    def _look_at(self, window: QWindow | None) -> None:
        if window is not None:
            window.installEventFilter(self)  # once, however often it is asked for
