"""Signals: curves in plots as somebody arranges them; pause, zoom, measure, compare while data go on."""

import datetime
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit, QTreeWidgetItem, QVBoxLayout, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.settings.server_file import default_file
from server_gui.core.workspace.exporting import save_csv
from server_gui.core.workspace.layouts import Layout, Layouts
from server_gui.core.workspace.notes import LiveNotes, Notes
from server_gui.core.workspace.scene import Scene, layout_of
from server_gui.core.workspace.trigger import Condition
from server_gui.views.refresh_rate import RefreshRate
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.scroll_area import bring_into_sight
from server_gui.views.widgets.split import Split
from server_gui.views.workspace.beside_menu import BesideMenu, others_of
from server_gui.views.workspace.channel_tree import NAME_ROLE, ChannelTree
from server_gui.views.workspace.drawing import AnyPlot, draw, flag, read
from server_gui.views.workspace.expression_bar import ExpressionBar
from server_gui.views.workspace.jump import Jump, event_beside, happened, jump_to
from server_gui.views.workspace.layout_menu import LayoutMenu
from server_gui.views.workspace.note import ask_note
from server_gui.views.workspace.plot_area import PlotArea
from server_gui.views.workspace.refusal import Refusal
from server_gui.views.workspace.state_words import state_words
from server_gui.views.workspace.tools import SPANS_S, Tools
from server_gui.views.workspace.trigger_bar import TriggerBar
from server_gui.views.workspace.two_cursors import TwoCursors
from server_gui.views.workspace.unit_plot import UnitPlot

Floats = npt.NDArray[np.float64]
LIST, LOW, MARGIN = 150, 90, 8  # the channels at least: wide, high; beside everything
NARROW: Final = 380  # wide: with less the plots stand below the channels
AROUND_S: Final = 5.0  # that are shown before and after an event


class Signals(QWidget):
    """Channels at the left, plots at the right. `others` can be shown beside; `step` plays a recording."""

    def __init__(
        self,
        desk: Desk,
        theme: Theme,
        notes: Notes | None = None,
        others: Callable[[], Sequence[Station]] | None = None,
        step: Callable[[], None] | None = None,
        layouts: Layouts | None = None,
    ) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._notes = notes or LiveNotes(desk)
        self._others = others or (lambda: others_of(desk, None))
        self._step_beside = step
        self.scene = Scene(desk.shown)
        self.area = PlotArea(self.scene, theme)
        self.area.arranged.connect(self._looked_again)
        self.area.zoomed.connect(self._zoomed)
        self.two = TwoCursors(self.scene, self.area, theme, lambda: self._seconds, self.read_now)
        self.area.moved.connect(self.two.move)
        self.area.fitted.connect(self._follow)
        self.area.hovered.connect(self._hovered)
        self._begun = False
        self._pace = RefreshRate()
        self._jump: Jump | None = None
        self._met: Station | None = None  # the robot that is shown
        self._is_gone = False  # the instant that was asked for last
        self._told = ""  # what came of what was done last
        self._hover: float | None = None
        self.setObjectName("page")
        self.channels = ChannelTree()
        self.channels.itemChanged.connect(self._ticked)
        self.channels.asked.connect(self.area.offer)
        self.channels.dragging.connect(self.area.offer_below)
        self._words = QLineEdit(placeholderText="Filter channels")
        self._words.setAccessibleName("Filter of the channels")
        self._words.textChanged.connect(self.channels.show_only)
        self.measuring = self.two.measuring
        self.expression = ExpressionBar(theme, self.scene.meaning)
        self.expression.written.connect(self.area.put)
        self.trigger = TriggerBar(theme)
        self.trigger.armed.connect(self._arm)
        self.trigger.ended.connect(self.scene.disarm)
        folder = default_file().with_name("layouts")
        self.layouts = LayoutMenu(layouts or Layouts(folder), self.layout_now, self.show_layout, self.tell)
        self.beside = BesideMenu(self.scene, self._others, self.tell)
        self.tools = tools = Tools(self, (self.layouts, self.beside))
        self.span, self.pause, self.fit, self.box = tools.span, tools.pause, tools.follow, tools.box
        self.cursors, self.said = tools.cursors, tools.said
        self._bind()
        self._lay_out()
        self._restyle()
        theme.changed.connect(self._restyle)

    def read_now(self) -> None:
        """Let the next frame say also what is read: what stands beside it is said anew then."""
        self._pace.hurry()

    def show_tools(self, on: bool) -> None:
        """Show what arranges plots, above and beside them; without, plots have its room."""
        for part in (self.tools, self._left):
            part.setVisible(on)

    @property
    def cards(self) -> Sequence[AnyPlot]:
        """Every plot."""
        return self.area.cards

    @property
    def empty(self) -> PlainLabel:
        """Label with instructions, while there are no plots."""
        return self.area.empty

    @property
    def plots(self) -> list[UnitPlot]:
        """Those over time."""
        return self.area.plots

    def refresh(self) -> None:
        """Draw what is arranged; while it stands still, what was there then."""
        station = self._desk.selected
        if station is None:
            return
        self._meet(station)
        self._look_beside()
        self._look(station)
        self._take_the_rest(station)
        self.scene.look_for_trigger(self._seconds)
        draw(self.scene, self.cards, station, self._seconds, self._window)
        if self._pace.is_due(station):
            said = state_words(self.scene, station, self.chosen, self._jump, is_gone=self._is_gone)
            set_text(self.said, said + self._told)
            set_tip(self.said, self.said.text())
            self._say_more()
            self._flag(station)
            read(self.scene, self.cards, station, self._read_s)
            self.two.read()

    def _meet(self, station: Station) -> None:
        """Show another robot as it is: nobody has paused that one."""
        if self._met not in (None, station):
            self.pause.setChecked(False)
        self._met = station

    @property
    def chosen(self) -> list[str]:
        """The channels that are ticked, in the robot's order."""
        return self.channels.chosen

    def choose(self, names: Sequence[str]) -> None:
        """Show exactly these, channels or expressions, in this order; those of one unit share a plot."""
        self.channels.choose(names)
        if self._desk.selected is not None:
            self._meet(self._desk.selected)
            self._arrange(self._desk.selected, names)
        self._build()

    def show_around(self, names: Sequence[str], at_ns: int) -> None:
        """Choose these, if any, and stand still with the seconds around an instant of the robot's clock."""
        if names:
            self.choose(names)
            bring_into_sight(self.area, first=True)  # below its tools on a small screen
        self._told = ""
        if not self.show_at(at_ns):
            self.pause.setChecked(False)  # nothing else is shown in its place as if it were that
            self._is_gone = True
            self._follow()
            self.read_now()

    def save_csv(self, path: Path) -> None:
        """Save what is on screen, in SI units, a row a time."""
        texts = list(dict.fromkeys(text for card in self.plots for text in card.drawn))
        save_csv(self.scene, texts, self._seconds, self._window, path)

    def save_png(self, path: Path) -> None:
        """Save what is on screen, as a picture."""
        if not self.grab().save(str(path), "PNG"):
            raise OSError(f"the picture could not be written: is there room in {path.parent}, and may you?")

    def layout_now(self) -> Layout:
        """Return the present arrangement as a layout."""
        return layout_of(self.scene, self.layouts.current, self._seconds)

    def show_layout(self, layout: Layout) -> None:
        """Show this one, whatever of it the robot lacks."""
        self.scene.intend(None if layout.trigger is None else layout.trigger.condition)
        self._begun = True
        self.scene.workspace.show(layout.plots)
        nearest_span = min(range(len(SPANS_S)), key=lambda place: abs(SPANS_S[place] - layout.span_s))
        self.span.setCurrentIndex(nearest_span)
        self._looked_again()
        if layout.trigger is not None:
            self.trigger.show_condition(layout.trigger.condition)
            self.tools.trigger.setChecked(True)

    def tell(self, text: str) -> None:
        """Say what came of something."""
        self._told = self.refused.take(text)
        self.read_now()

    # --- how it is put together

    def _lay_out(self) -> None:
        everything, splitter = QVBoxLayout(self), Split(self._theme, NARROW)
        everything.setContentsMargins(MARGIN, MARGIN, MARGIN, 0)
        everything.addWidget(self.tools)
        everything.addWidget(splitter, 1)
        left, right = self._left, _ = QWidget(splitter), QWidget(splitter)
        left_box, right_box = QVBoxLayout(left), QVBoxLayout(right)
        left_box.setContentsMargins(0, 0, 0, 8)
        right_box.setContentsMargins(0, 0, 0, 8)
        left_box.addWidget(self._words)
        left_box.addWidget(self.channels, 1)
        self.beside_said = ElidedLabel("dim")
        self.refused = Refusal()
        for bar in (self.expression, self.trigger, self.beside_said, self.refused):
            right_box.addWidget(bar)
        right_box.addWidget(self.area, 1)
        right_box.addWidget(self.measuring)
        splitter.setStretchFactor(1, 1)
        splitter.setSizes([self._theme.px(190), self._theme.px(700)])

    def _bind(self) -> None:
        self.tools.looked.connect(self._look_wider)
        self.tools.turned.connect(self._turn)
        self.tools.noted.connect(self._note)
        self.span.currentIndexChanged.connect(self._span_changed)
        self.pause.toggled.connect(self._paused)
        self.fit.clicked.connect(self._follow)
        self.box.toggled.connect(self._choose_by_box)
        self.cursors.toggled.connect(self.two.show)
        self.tools.expression.toggled.connect(self.expression.open)
        self.tools.trigger.toggled.connect(self._show_trigger)
        self.tools.as_csv.clicked.connect(lambda: self._ask("csv", self.save_csv))
        self.tools.as_png.clicked.connect(lambda: self._ask("png", self.save_png))

    def _build(self) -> None:
        """Make the plots anew; what part of the time is in sight stays."""
        self.area.build(self._seconds, self._window if self.plots else None)
        self._choose_by_box(self.box.isChecked())
        self.two.mark()
        self.scene.keep_more(self._window[0])
        self.trigger.show_choices(self.scene)
        self.read_now()

    def _restyle(self) -> None:
        self.channels.setIndentation(self._theme.px(10))
        self.channels.setMinimumSize(self._theme.px(LIST), self._theme.px(LOW))
        self._build()

    # --- curves

    def _look(self, station: Station) -> None:
        """Notice another robot, other channels or units, and what has been arranged."""
        if self.channels.show_channels(station, self._desk.shown.units, self._desk.shown.revision):
            self.scene.look(station)
            if not self._begun:
                self._begun = bool(self.channels.items)
                self._arrange(station, self.chosen)
            self.channels.choose(self.scene.workspace.curves)
            self.expression.show_channels([*self.scene.channels])
            self._build()
        elif self.scene.look(station) or self.area.built != self.scene.workspace.revision:
            self._build()

    def _looked_again(self, refused: str = "") -> None:
        """Look again after something was arranged, or refused."""
        self.refused.take(f"▲ {refused}" if refused else "")
        if self._desk.selected is not None:
            self.scene.look(self._desk.selected)
        self.channels.choose(self.scene.workspace.curves)
        self._build()

    def _arrange(self, station: Station, names: Sequence[str]) -> None:
        self.scene.look(station)
        self.scene.workspace.arrange(map(self.scene.meaning, names))
        self.scene.look(station)

    def _ticked(self, item: QTreeWidgetItem) -> None:
        text, workspace = str(item.data(0, NAME_ROLE)), self.scene.workspace
        if item.checkState(0) is Qt.CheckState.Checked:
            self.area.put(text)
        else:
            self.area.do(lambda: workspace.remove(text))

    # --- what people do

    @property
    def _seconds(self) -> float:
        return float(SPANS_S[self.span.currentIndex()])

    @property
    def _window(self) -> tuple[float, float]:
        """The visible part of the past, s until the newest row."""
        return self.area.in_sight(self._seconds)

    def _look_wider(self, wider: float, later: float) -> None:
        """See so many times of the time, moved by a share of it."""
        left, right = self._window
        span = min((right - left) * wider, self._seconds)
        end = min(right + later * span, 0.0)
        begin = max(end - span, -self._seconds)
        self._zoomed(begin, min(begin + span, 0.0))

    def _span_changed(self, _place: int = 0) -> None:
        for plot in self.plots:
            plot.plot.set_seconds(self._seconds)

    def _paused(self, on: bool) -> None:
        self._jump, self._is_gone = None, False
        self.scene.go_on()
        if on and (station := self._desk.selected) is not None:
            self.scene.look(station)
            self.scene.freeze()

    def _follow(self) -> None:
        for plot in self.plots:
            plot.plot.follow_again()
        self._span_changed()

    def _zoomed(self, left: float, right: float) -> None:
        """Every plot shows the same time."""
        for plot in self.plots:
            plot.plot.show_window(left, right)

    def _choose_by_box(self, on: bool) -> None:
        for plot in self.plots:
            plot.plot.choose_by_box(on)

    def _hovered(self, at_s: float | None) -> None:
        """All plots are read at one time."""
        self._hover = at_s
        for plot in self.plots:
            plot.plot.show_hover(at_s)
        if self._desk.selected is not None:
            read(self.scene, self.cards, self._desk.selected, self._read_s)

    @property
    def _read_s(self) -> float | None:
        """The time that is read, s until the newest row: of the pointer, else of what one has jumped to."""
        newest_ns = self.scene.newest_ns
        if self._hover is not None or self._jump is None or newest_ns is None:
            return self._hover
        return (self._jump.read_ns - newest_ns) / 1e9

    def _note(self) -> None:
        """Ask for a note of the instant at the active cursor, else of the newest row."""
        problem, newest_ns = self._notes.problem, self.scene.newest_ns
        if problem or newest_ns is None:
            self.tell(f"▲ no note: {problem or 'no row has come yet'}")
            return
        at_s = self.two.at[self.two.active] if self.two.are_shown else 0.0
        at_ns = newest_ns + round(at_s * 1e9)
        ask_note(self, self._desk, at_s, lambda text: self._notes.add(text, at_ns), self.tell)

    # --- the trigger, and what is beside

    def _show_trigger(self, on: bool) -> None:
        self.trigger.setVisible(on)
        if not on:
            self.scene.disarm()

    def _arm(self, condition: Condition) -> None:
        if problem := self.scene.trigger_problem(condition):
            self.tell(f"▲ {problem}")
            return
        self.pause.setChecked(False)
        self.scene.arm(condition)
        self.read_now()

    def _look_beside(self) -> None:
        beside = self.scene.beside
        if beside is None:
            return
        if beside.station not in self._others():
            self.scene.put_beside(None)
            self.tell("the robot or recording beside is gone")
        elif beside.station.robot.is_recording and self._step_beside is not None:
            self._step_beside()

    def _say_more(self) -> None:
        scene = self.scene
        set_text(self.beside_said, scene.beside_text())
        self.beside_said.setVisible(bool(self.beside_said.text()))
        self.trigger.say(scene.trigger_text() or "off: live data is shown")

    # --- what happened

    def show_at(self, stamp_ns: int, around_s: float = AROUND_S) -> bool:
        """Stand still with this instant of the robot's clock in the middle; False where it is gone by now."""
        station = self._desk.selected
        if station is None:
            return False
        self._meet(station)
        self.pause.setChecked(False)  # else it would be what was seen before
        self.pause.setChecked(True)
        jump, newest_ns = jump_to(self.scene, station, stamp_ns, around_s), self.scene.newest_ns
        if jump is None or newest_ns is None:
            return False
        needed_s = around_s + max((newest_ns - stamp_ns) / 1e9, around_s if jump.comes else 0.0)
        wanted = next((place for place, span in enumerate(SPANS_S) if span >= needed_s), len(SPANS_S) - 1)
        self.span.setCurrentIndex(wanted)
        self._show_jump(jump)
        self._jump = jump
        self.read_now()
        return True

    def _show_jump(self, jump: Jump) -> None:
        self._zoomed(*jump.window(self.scene.newest_ns or 0, self._seconds))
        jump.shown = self._window

    def _take_the_rest(self, station: Station) -> None:
        """Show what comes of the seconds after the instant that was asked for."""
        jump, before_ns = self._jump, self.scene.newest_ns or 0
        if jump is not None and jump.take_more(self.scene, station, self._window):
            self.two.shift((before_ns - (self.scene.newest_ns or 0)) / 1e9)
            self._show_jump(jump)

    def _turn(self, way: int) -> None:
        """Turn to the next event, or the one before: of where one has jumped to, else of the newest."""
        station = self._desk.selected
        one = None if station is None else event_beside(self._jump, station, way)
        if one is not None:
            self.tell(f"{one.kind.value}: {one.text}" if self.show_at(one.at_ns) else "that is too long ago")

    def _flag(self, station: Station) -> None:
        """Every plot shows what happened in its time."""
        newest_ns, triggered = self.scene.newest_ns, self.scene.trigger_flag()
        if newest_ns is None:
            return
        found = happened(self._jump, station, self._notes.flags(), newest_ns)
        flag(self.scene, self.cards, [*found, *([] if triggered is None else [triggered])], newest_ns)
        for button in (self.tools.before, self.tools.next):
            button.setEnabled(bool(len(station.flags)))

    # --- what is said

    def _ask(self, kind: str, save: Callable[[Path], None]) -> None:
        station = self._desk.selected
        robot = "signals" if station is None else station.title
        name = f"{robot}-{datetime.datetime.now().astimezone():%Y%m%d-%H%M%S}"
        ask_save(self, f"Export as {kind.upper()}", kind, lambda path: self.export(save, path), name)

    def export(self, save: Callable[[Path], None], path: Path) -> None:
        """Save what is on screen, and say what came of it."""
        self.tell(save_whole(save, path))
