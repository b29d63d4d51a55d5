"""The panels around the tabs: beside them where there is room, else one behind the other at the right."""

from collections.abc import Mapping, Sequence
from typing import Final

from PySide6.QtCore import QByteArray, QEvent, QObject, QPoint, QRect, Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow, QScrollArea, QTabBar, QTabWidget, QWidget

from server_gui.views.frame.dock_sizes import DockSizes
from server_gui.views.frame.dock_title import DockTitle, HasTools
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.visibility import let_go

LAYOUT: Final = 1  # rises when a stored layout no longer fits
ROOMY: Final = 1200  # wide, at text of 100 %: what is narrower has no room for everything at once
TIGHT: Final = 800  # wide, likewise: what is narrower begins without panels, which would hide the robot
STACK: Final = 356  # wide, likewise: panels that are one behind the other
BUTTONS: Final = 80  # wide, likewise: what stands beside a panel's title
IN_TAB: Final = 100  # wide, likewise: the robot's name, where panels are one behind the other
MOVES: Final = (QEvent.Type.Move, QEvent.Type.Resize, QEvent.Type.Show)
Area = Qt.DockWidgetArea


class Docks(QObject):
    """Docks of a window, whose `fit` is called whenever its size, or that of the text, has changed.

    The last panel is seen only when it is asked for. What people have arranged in a roomy window is kept
    while it is narrow, and over the end of the program. However they are arranged, they are scrolled rather
    than make the window larger than its screen. One that floats goes out of the way of `uncovered`, the first
    of which is the window's top: whichever of the two moves or grows.
    """

    def __init__(
        self,
        window: QMainWindow,
        theme: Theme,
        panels: Mapping[str, tuple[QWidget, Area]],
        uncovered: Sequence[QWidget],
    ) -> None:
        super().__init__(window)
        self._window = window
        self._uncovered = uncovered
        self._theme = theme
        self.is_narrow = self._is_tight = False
        window.setCorner(Qt.Corner.BottomLeftCorner, Area.LeftDockWidgetArea)
        window.setCorner(Qt.Corner.BottomRightCorner, Area.RightDockWidgetArea)
        window.setTabPosition(Area.AllDockWidgetAreas, QTabWidget.TabPosition.North)
        self._panels: dict[QDockWidget, QWidget] = {}
        self.all = [self._dock(title, widget, area) for title, (widget, area) in panels.items()]
        self.all[-1].hide()
        self._put_away: list[QDockWidget] = []
        self._is_put_away_for_room = False
        self._seen: list[QDockWidget] = []  # that are shown where all have room, or have given way
        self._is_held, self._held = False, list[QDockWidget]()
        self._gave_way: list[QDockWidget] = []
        self._sizes = DockSizes(window, theme, self.all)
        self._sizes.give()
        self._usual = self._roomy = window.saveState(LAYOUT)
        for one in {window, *(around for part in uncovered for around in _within(part, window))}:
            one.installEventFilter(self)

    @property
    def state(self) -> QByteArray:
        """State to be saved."""
        self.hold_back(is_held=False)  # that is not what people have arranged
        self.come_back()
        return self._roomy if self.is_narrow else self._window.saveState(LAYOUT)

    def restore(self, state: QByteArray) -> None:
        """Arrange them as it was kept, with their sizes; as they were at first where Qt cannot."""
        if self._restore(state):
            self._roomy = state  # also where the window begins narrow
            self._sizes.restored()

    def _restore(self, state: QByteArray) -> bool:
        # Qt makes new bars of tabs, and draws the old ones over the pages until it deletes them later.
        for bar in self._window.findChildren(QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly):
            bar.hide()
        if self._window.restoreState(state, LAYOUT):
            return True
        self._window.restoreState(self._usual, LAYOUT)
        return False

    def reset(self, shown: Sequence[QDockWidget]) -> None:
        """Everything where it was at first, and these in sight."""
        self._gave_way = []
        self._sizes.forget()
        self._roomy = self._usual
        self._restore(self._usual)
        for dock in shown:
            dock.show()
        if self.is_narrow:
            self._stack()

    def settle(self) -> None:
        """Keep how people have arranged them, where they have room; called once a frame."""
        is_roomy = not self.is_narrow and self.has_room and self._window.isVisible()
        if is_roomy and not self._is_held and self._sizes.take(self._in_sight):
            self._seen = [dock for dock in self.all if not dock.isHidden() or dock in self._gave_way]
            self._roomy = self._roomy if self._gave_way else self._window.saveState(LAYOUT)
        for bar in self._window.findChildren(QTabBar, options=Qt.FindChildOption.FindDirectChildrenOnly):
            bar.setFocusPolicy(Qt.FocusPolicy.TabFocus if bar.count() else Qt.FocusPolicy.NoFocus)

    def put_away(self) -> None:
        """Leave all the room to the tabs; or, where that is so, show what was there again."""
        in_sight = self._in_sight
        again = [] if in_sight else self._put_away or self.all[:-1]
        for dock in in_sight or again:
            let_go(dock)
            dock.setVisible(not in_sight)
        self._put_away = [*in_sight, *self._gave_way]
        self._gave_way = []

    def give_way(self, dock: QDockWidget) -> None:
        """Hide one whose room is needed, until `come_back`; who asks for it meanwhile sees it."""
        if dock in self._in_sight and not self.is_narrow:  # there it takes no room of its own
            let_go(dock)
            dock.hide()
            self._gave_way.append(dock)

    def come_back(self) -> None:
        """Show again what has given way."""
        for dock in self._gave_way:
            dock.show()
        self._gave_way = []

    def hold_back(self, *, is_held: bool) -> bool:
        """Hide them as long as there is nothing for them to show; return whether they are shown again."""
        if is_held is self._is_held:
            return False
        if is_held:
            self.settle()
        self._is_held = is_held
        if is_held:
            self._held = [*self._in_sight, *self._gave_way]
            self._gave_way = []
        for dock in self._held:
            dock.setVisible(not is_held)
        if not is_held:
            self._held = []
            if not self.is_narrow:
                self._sizes.give()
        return not is_held

    def bring(self, dock: QDockWidget) -> None:
        """Show this one, in front of those that are at its place, whose names stand beside its own."""
        for one in (*(self.all[:-1] if self.is_narrow else ()), dock):
            one.show()
        dock.raise_()

    def say_whose(self, dock: QDockWidget, name: str) -> None:
        """Name the robot in a panel's title, cut in its middle where it has no room; "" names none."""
        title, metrics = dock.objectName(), dock.fontMetrics()
        if name:
            before = f"{title} – "
            beside = metrics.horizontalAdvance(before) + self._theme.px(BUTTONS)
            room = self._theme.px(IN_TAB) if self.is_narrow else dock.width() - beside
            title = before + metrics.elidedText(name, Qt.TextElideMode.ElideMiddle, room)
        if dock.windowTitle() != title:
            dock.setWindowTitle(title)
            dock.toggleViewAction().setText(dock.objectName())

    @property
    def has_room(self) -> bool:
        """Whether all of them have room beside the tabs."""
        return self._window.width() >= self._theme.px(ROOMY)

    def fit(self, *, scaled: bool = False) -> None:
        """Arrange them for the room that there is; where text has another size, as wide as it needs."""
        was_held = self._is_held
        if self.has_room is self.is_narrow:
            self.hold_back(is_held=False)
            self.come_back()
            self.is_narrow = not self.has_room
            if self.is_narrow:
                self._stack()
            else:
                self._unstack()
            self.hold_back(is_held=was_held)
        if not self._is_held:
            self._fit_tight()
        if scaled:
            self._sizes.scale()
        if not self.is_narrow:
            self._sizes.give_other()
        elif scaled:
            self._stand()

    def _fit_tight(self) -> None:
        """Put them away where they would leave too little room to the tabs, until there is more again."""
        is_tight = self._window.width() < self._theme.px(TIGHT)
        if is_tight is self._is_tight:
            return
        self._is_tight = is_tight
        is_due = bool(self._in_sight) if is_tight else self._is_put_away_for_room and not self._in_sight
        self._is_put_away_for_room = is_tight and is_due
        if is_due:
            self.put_away()

    @property
    def _in_sight(self) -> list[QDockWidget]:
        return [dock for dock in self.all if not dock.isHidden() and not dock.isFloating()]

    def _dock(self, title: str, widget: QWidget, area: Area) -> QDockWidget:
        dock = QDockWidget(title)
        dock.setObjectName(title)
        self._window.addDockWidget(area, dock)
        room = _room()
        dock.setWidget(room)
        room.setWidget(widget)
        self._panels[dock] = widget
        self._give_title(dock)
        dock.installEventFilter(self)
        dock.visibilityChanged.connect(lambda on: self._shown(dock) if on else None)
        return dock

    def _shown(self, dock: QDockWidget) -> None:
        """Note that somebody has asked for what had given way."""
        self._gave_way = [one for one in self._gave_way if one is not dock]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() in MOVES:
            for dock in [watched] if isinstance(watched, QDockWidget) else self.all:
                if dock.isFloating() and dock.isVisible():
                    self._uncover(dock)
        return False

    def _uncover(self, dock: QDockWidget) -> None:
        """Move it up or down to the nearest place where it covers nothing of what is to be seen."""
        whole = [QRect(one.mapToGlobal(QPoint()), one.size()) for one in self._uncovered if one.isVisible()]
        frame, lowest = dock.frameGeometry(), dock.screen().availableGeometry().bottom() - dock.height()

        def is_free(y: int) -> bool:
            return not any(frame.translated(0, y - frame.y()).intersects(one) for one in whole)

        if is_free(frame.y()):
            return
        places = [y for one in whole for y in (one.bottom() + 1, one.top() - frame.height())]
        free = [
            y for y in places if y > whole[0].top() and is_free(y)
        ]  # never above: its title could be off the screen
        dock.move(frame.x(), min(free, key=lambda y: (y > lowest, abs(y - frame.y()))))

    def call(self, dock: QDockWidget, name: str) -> None:
        """Call it so in its title bar, where it has one with its name."""
        bar = dock.titleBarWidget()
        if isinstance(bar, DockTitle):
            set_text(bar.name, name)

    def _stack(self) -> None:
        """One behind the other; their tabs say what they are, so that they need no title."""
        first = self.all[0]
        for dock in self.all:
            if not dock.isFloating():
                self._give_title(dock, QWidget())
                self._window.addDockWidget(Area.RightDockWidgetArea, dock)
                if dock is not first:
                    self._window.tabifyDockWidget(first, dock)
        first.raise_()
        self._stand()

    def _stand(self) -> None:
        """As wide as text of this size needs, where they are one behind the other."""
        self._window.resizeDocks(self.all[:1], [self._theme.px(STACK)], Qt.Orientation.Horizontal)

    def _unstack(self) -> None:
        for dock in self.all:
            self._give_title(dock)
        self._restore(self._roomy)
        if self._seen:
            for dock in self.all:
                dock.setVisible(dock in self._seen)
        self._sizes.give()
        self._sizes.give_anew()

    def _give_title(self, dock: QDockWidget, bar: QWidget | None = None) -> None:
        """Give it this title bar; by default the usual one, with the tools of its panel where it has some."""
        panel, before = self._panels[dock], dock.titleBarWidget()
        if isinstance(panel, HasTools):
            panel.hold_tools()
            bar = bar or DockTitle(dock, panel)
        dock.setTitleBarWidget(bar)  # type: ignore[arg-type]
        if before is not None:
            before.deleteLater()


def _within(part: QWidget, window: QWidget) -> list[QWidget]:
    """Return it and what it is within, with which it moves, up to the window."""
    parent = part.parentWidget()
    return [part] if parent is None or parent is window else [part, *_within(parent, window)]


def _room() -> QScrollArea:
    """Return a scroll area for a panel, which may need more than there is."""
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return area
