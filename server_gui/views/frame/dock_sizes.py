"""How wide and high panels are: as people have made them, with each width of the window; else as usual."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow

from server_gui.views.theme import Theme

# Robots and parameters, by how wide the window is at text of 100 %: in all but the last, parameters are shown
# with range and default.
WIDTHS: Final = ((1600, (225, 600)), (1340, (190, 492)), (0, (225, 400)))
BELOW: Final = (120, 86)  # high, likewise: events, where the window is `HIGH` and where it is not
HIGH: Final = 820
BESIDE: Final = Qt.DockWidgetArea.LeftDockWidgetArea | Qt.DockWidgetArea.RightDockWidgetArea


class DockSizes:
    """Of the docks of a window in which all have room; the first three have a usual size.

    As a window is made narrow Qt squeezes them, which is not what people have made of them. So they are given
    their sizes in the first frame with another width of it; what is other later, somebody has moved.
    """

    def __init__(self, window: QMainWindow, theme: Theme, docks: Sequence[QDockWidget]) -> None:
        self._window, self._theme, self._docks = window, theme, docks
        self._own: dict[QDockWidget, int] = {}
        self._given: dict[QDockWidget, int] = {}  # that they have had since
        self._width = 0  # of the window, then
        self._usual: tuple[int, int] | None = None  # those of the width for which they were given last
        self._are_restored = False

    def restored(self) -> None:
        """Note that Qt has arranged them as they were kept: what they have in the next frame is their own."""
        self._are_restored = True
        self.give_anew()

    def forget(self) -> None:
        """Have the usual ones again."""
        self._own, self._usual, self._are_restored = {}, None, False
        self.give_anew()

    def scale(self) -> None:
        """Have the usual ones for text of another size; what was kept is for this one."""
        if not self._are_restored:
            self.forget()

    def give_anew(self) -> None:
        """Give them with the next frame, too, which knows how wide the window is."""
        self._width = 0

    def take(self, docks: Sequence[QDockWidget]) -> bool:
        """Take what somebody has made of these since the last frame; False in the first of another width."""
        sizes = {dock: self._size(dock) for dock in docks}
        if self._window.width() != self._width:
            self._width, self._given = self._window.width(), {}
            if self._are_restored:
                self._own, self._are_restored = sizes, False
            self.give()
            return False
        self._own |= {dock: size for dock, size in sizes.items() if size != self._given.get(dock, size)}
        self._given = sizes
        return True

    def give_other(self) -> None:
        """Give them where others are usual by now."""
        if self._usual != self._usual_widths:
            self.give()

    def give(self) -> None:
        """Give each its own size, or the usual one; none while what was kept is not taken yet."""
        if self._are_restored:
            return
        px = self._theme.px
        self._usual = self._usual_widths
        high = BELOW[0] if self._window.height() >= px(HIGH) else BELOW[1]
        sizes = dict(zip(self._docks, (*map(px, self._usual), px(high)), strict=False)) | self._own
        for way, is_beside in ((Qt.Orientation.Horizontal, True), (Qt.Orientation.Vertical, False)):
            docks = [dock for dock in sizes if self._is_beside(dock) is is_beside]
            self._window.resizeDocks(docks, [sizes[dock] for dock in docks], way)

    @property
    def _usual_widths(self) -> tuple[int, int]:
        width = self._window.width()
        return next(widths for least, widths in WIDTHS if width >= self._theme.px(least))

    def _size(self, dock: QDockWidget) -> int:
        """Return how wide or high it is: what is beside the pages is as high as these."""
        return dock.width() if self._is_beside(dock) else dock.height()

    def _is_beside(self, dock: QDockWidget) -> bool:
        return bool(self._window.dockWidgetArea(dock) & BESIDE)
