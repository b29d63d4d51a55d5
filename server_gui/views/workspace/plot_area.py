"""The plots of a workspace, below each other or in two columns; how curves come into them and out."""

from collections.abc import Callable, Sequence
from typing import Final

from PySide6.QtCore import QPoint, QRect, Qt, Signal
from PySide6.QtGui import QDragEnterEvent, QDragMoveEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QGridLayout, QMenu

from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.workspace import Refused
from server_gui.views.theme import Theme
from server_gui.views.widgets.dragging import dropped
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.workspace.curve_menus import channel_menu, plot_menu
from server_gui.views.workspace.drawing import AnyPlot
from server_gui.views.workspace.unit_plot import Drawn, EmptyPlot, UnitPlot
from server_gui.views.workspace.xy_plot import XYPlot

TWO: Final = 600  # wide at least, at text of 100 %: two columns
COLUMNS: Final = 2
NO_CURVES: Final = "Tick channels at the left to see them here, or drag them to a place."


class PlotArea(QFrame):
    """`arranged` says that something was, or why not; the other signals are those of the plots over time."""

    arranged = Signal(str)
    zoomed = Signal(float, float)
    moved = Signal(int, float)
    hovered = Signal(object)
    fitted = Signal()

    def __init__(self, scene: Scene, theme: Theme) -> None:
        super().__init__()
        self._scene = scene
        self._theme = theme
        self.cards: list[AnyPlot] = []
        self.built = -1  # revision of the workspace that the plots are of
        self.empty = PlainLabel(NO_CURVES)
        self.empty.setWordWrap(True)
        self.empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.empty.setObjectName("dim")
        self.is_paired = False  # in two columns where there is room: left and right beside each other
        self._columns = 1
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.addWidget(self.empty, 0, 0, 1, COLUMNS)
        self.below = PlainLabel("Drop it here for a plot of its own")
        self.below.setObjectName("banner")
        self.below.setProperty("tone", "plain")
        self.below.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._grid.addWidget(self.below, 1, 0, 1, COLUMNS)  # before it is hidden: else it has another's font
        self.below.hide()
        self.setAcceptDrops(True)

    @property
    def plots(self) -> list[UnitPlot]:
        """Those over time."""
        return [card for card in self.cards if isinstance(card, UnitPlot)]

    def in_sight(self, seconds: float) -> tuple[float, float]:
        """Return the part of the last `seconds` that is in sight, s until the newest row."""
        return self.plots[0].plot.window_s if self.plots else (-seconds, 0.0)

    def offer_below(self, wanted: bool) -> None:
        """Offer room below the lowest plot, to drop a curve there."""
        self.below.setVisible(wanted and bool(self.cards))

    def build(self, seconds: float, window: tuple[float, float] | None) -> None:
        """Make a card for each plot, of the last `seconds`, of which the `window` is in sight."""
        for card in self.cards:
            self._grid.removeWidget(card)
            card.hide()
            card.deleteLater()
        self.cards = [self._card(place, seconds) for place in range(len(self._scene.workspace.plots))]
        for place, card in enumerate(self.cards):
            self._bind(card, place)
            if isinstance(card, UnitPlot):
                for signal, mine in (
                    (card.plot.zoomed, self.zoomed),
                    (card.plot.moved, self.moved),
                    (card.plot.hovered, self.hovered),
                    (card.plot.fitted, self.fitted),
                ):
                    signal.connect(mine)
                if window is not None and window[0] >= -seconds:
                    card.plot.show_window(*window)
        self._place()
        self.built = self._scene.workspace.revision
        self.empty.setVisible(not self.cards)

    def pair(self, on: bool) -> None:
        """Place plots in two columns where there is room, or below each other."""
        self.is_paired = on
        self._place()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._fitting != self._columns:
            self._place()

    @property
    def _fitting(self) -> int:
        is_wide = self.is_paired and len(self.cards) > 1 and self.width() >= self._theme.px(TWO)
        return COLUMNS if is_wide else 1

    def _place(self) -> None:
        """Place every card; the last of an odd number is as wide as two."""
        self._columns, grid = self._fitting, self._grid
        for row in range(grid.rowCount()):
            grid.setRowStretch(row, 0)
        wide = COLUMNS // self._columns
        for place, card in enumerate(self.cards):
            row, column = divmod(place, self._columns)
            is_last_alone = place + 1 == len(self.cards) and column == 0
            grid.addWidget(card, row, column * wide, 1, COLUMNS if is_last_alone else wide)
            grid.setRowStretch(row, 1)
        for column in range(COLUMNS):
            grid.setColumnStretch(column, 1)
        grid.addWidget(self.below, len(self.cards) + 1, 0, 1, COLUMNS)

    def _bind(self, card: AnyPlot, place: int) -> None:
        card.taken.connect(lambda texts: self._drop(texts, place))
        card.menu.aboutToShow.connect(lambda: plot_menu(card.menu, self._scene, place, self.do))

    def _card(self, place: int, seconds: float) -> AnyPlot:
        scene = self._scene
        spec, unit = scene.workspace.plots[place], scene.unit(place)
        curves = [Drawn(text, scene.meaning(text).name, scene.drawn(text, unit)) for text in spec.curves]
        x = scene.meaning(spec.x) if spec.is_xy else None
        if unit is None or (x is not None and x.unit is None):
            lacks = [] if x is None or not x.problem else [Drawn(x.text, x.name, x.problem)]
            return EmptyPlot(self._theme, place, [*lacks, *(one for one in curves if one.problem)])
        if x is not None and x.unit is not None:
            return XYPlot(self._theme, place, Drawn(x.text, x.name), (x.unit, unit), curves)
        return UnitPlot(self._theme, place, unit, curves, seconds, scene.names)

    # --- curves

    def do(self, do: Callable[[], object]) -> None:
        """Change what is arranged, or say why not."""
        refused = ""
        try:
            do()
        except Refused as why:
            refused = str(why)
        self.arranged.emit(refused)

    def put(self, text: str) -> None:
        """Draw a curve where its like is, else in a plot of its own."""
        self.do(lambda: self._scene.workspace.put(self._scene.meaning(text), self._scene.units()))

    def offer(self, text: str, at: QPoint) -> QMenu:
        """Open the menu of what can be done with a channel."""
        menu = QMenu(self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        channel_menu(menu, self._scene, text, self.do)
        menu.popup(at)
        return menu

    def _drop(self, texts: Sequence[str], place: int) -> None:
        scene = self._scene

        def all_of_them() -> None:
            for text in texts:
                scene.workspace.add(scene.meaning(text), place, scene.unit(place))

        self.do(all_of_them)

    # --- what is dropped between the plots, or below them

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        if dropped(event.mimeData()):
            event.acceptProposedAction()

    def dragMoveEvent(self, event: QDragMoveEvent) -> None:
        event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        event.acceptProposedAction()
        scene, texts, at = self._scene, dropped(event.mimeData()), event.position().toPoint()
        place = sum(_is_before(card.geometry(), at, self._columns) for card in self.cards)

        def all_of_them() -> None:
            for number, text in enumerate(texts):
                scene.workspace.new_plot(scene.meaning(text), place=place + number)

        self.do(all_of_them)


def _is_before(card: QRect, at: QPoint, columns: int) -> bool:
    """Return whether a card is read before a place."""
    if columns == 1:
        return card.center().y() < at.y()
    return card.bottom() < at.y() or (card.top() <= at.y() and card.center().x() < at.x())
