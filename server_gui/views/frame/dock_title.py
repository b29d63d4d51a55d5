"""Title bar of a panel whose tools stand in it: so much more of the panel is in sight."""

from collections.abc import Callable
from typing import Final, Protocol, runtime_checkable

from PySide6.QtWidgets import QDockWidget, QHBoxLayout, QStyle, QToolButton, QWidget

from server_gui.views.widgets.plain import PlainLabel, set_tip

ICONS: Final = QStyle.StandardPixmap
FLOAT_HINT: Final = "Take this panel out of the window, or put it back"
CLOSE_HINT: Final = "Close this panel; View shows it again"


@runtime_checkable
class HasTools(Protocol):
    """A panel with a row of tools, which it holds itself where it has no title bar."""

    tools: QWidget

    def hold_tools(self) -> None:
        """Take them back."""


class DockTitle(QWidget):
    """Name, tools, and buttons of a dock; it is dragged by its name."""

    def __init__(self, dock: QDockWidget, panel: HasTools) -> None:
        super().__init__()
        self.setObjectName("dockTitle")
        self.name = PlainLabel(dock.windowTitle())
        self.name.setObjectName("title")
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 0, 4, 0)
        row.addWidget(self.name)
        row.addWidget(panel.tools, 1)
        turn = "Float", FLOAT_HINT, lambda: dock.setFloating(not dock.isFloating())
        row.addWidget(self._button(dock, ICONS.SP_TitleBarNormalButton, *turn))
        row.addWidget(self._button(dock, ICONS.SP_TitleBarCloseButton, "Close", CLOSE_HINT, dock.close))

    def _button(
        self,
        dock: QDockWidget,
        icon: QStyle.StandardPixmap,
        does: str,
        hint: str,
        done: Callable[[], object],
    ) -> QToolButton:
        button = QToolButton()
        button.setAutoRaise(True)
        button.setIcon(self.style().standardIcon(icon))
        button.setAccessibleName(f"{does} {dock.windowTitle()}")
        set_tip(button, hint)
        button.clicked.connect(lambda: done())
        return button
