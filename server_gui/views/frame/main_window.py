"""The main window: header with STOP, robots left, tabs in the middle, parameters right, events below."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QEvent, QSettings, QSize, QTimer, Signal
from PySide6.QtGui import (
    QCloseEvent,
    QKeySequence,
    QResizeEvent,
    QShortcut,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QApplication,
    QDockWidget,
    QHBoxLayout,
    QMainWindow,
    QMenu,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.alarms.explaining_signals import explaining_signals
from server_gui.core.archive.archive import Archive
from server_gui.core.commissioning.alarm import unstopped
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.stages import Stage
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.frame_time import one_moment
from server_gui.views.alarms.events_panel import EventsPanel
from server_gui.views.alarms.strip import AlarmStrip
from server_gui.views.confirmation import Watched, ask
from server_gui.views.experiments.bar import ExperimentBar
from server_gui.views.frame.closing import COMMISSIONING
from server_gui.views.frame.docks import Area, Docks
from server_gui.views.frame.empty import EmptyView
from server_gui.views.frame.header import Header
from server_gui.views.frame.help import Help
from server_gui.views.frame.keys_sheet import KeysSheet
from server_gui.views.frame.on_screen import onto_screen, opening_size
from server_gui.views.frame.page_bar import PageBar
from server_gui.views.frame.pages import Pages
from server_gui.views.frame.recording_chip import ask_recording
from server_gui.views.frame.saved_state import keep_bytes, kept_bytes
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.frame.view_choices import add_choices
from server_gui.views.parameters.panel import ParametersPanel
from server_gui.views.parameters.trial_bar import TrialBar
from server_gui.views.predictions import activity
from server_gui.views.refresh_rate import RefreshRate
from server_gui.views.robots.others_bar import OthersBar
from server_gui.views.robots.panel import HINT_ALL, RobotsPanel
from server_gui.views.robots.reset import ask_clear, ask_reset
from server_gui.views.robots.stop_all_bar import StopAllBar
from server_gui.views.theme import Theme
from server_gui.views.widgets.scroll_area import ScrollArea
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.visibility import has_focus_in, is_all_seen

EVENTS: Final = 2  # among the docks
EVENTS_LIVE: Final = "Events, live"  # beside a recording that is played
ROBOTS: Final = 9  # that have a key
ALL_WIDE: Final = 160  # STOP ALL beside the pages, at text of 100 %, at most
LEAST: Final = 240  # high, at text of 100 %


class MainWindow(QMainWindow):
    """`stopped` and `stop_all` ask for a STOP, `added`, `removed` bring a robot, `simulator` asks for one."""

    stopped = Signal()
    stop_all = Signal()
    added = Signal(str)
    removed = Signal(object)
    simulator = Signal()
    closed = Signal()

    def __init__(
        self,
        desk: Desk,
        theme: Theme,
        settings: QSettings,
        archive: Archive | None = None,
        commissioning: Commissioning | None = None,
    ) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.kept = settings
        desk.pins.take(settings.value("pinned"))
        self._pace = RefreshRate()
        self._is_arranged = False  # the panels, which may wait for the window to be shown
        self.setWindowTitle("GWRMS")
        self.resize(opening_size(self.screen().availableSize(), theme.scale))
        self._make(desk, theme, archive, commissioning)
        self._restore()
        self._opened_as = self.size()
        theme.scaled.connect(self._scaled)

    def _make(
        self, desk: Desk, theme: Theme, archive: Archive | None, commissioning: Commissioning | None
    ) -> None:
        menu = QPushButton("View")
        self.header = Header(desk, theme, menu)
        self.header.stopped.connect(self.stopped)
        self.header.reset.connect(lambda station: ask_reset(self, station, self._watched))
        # Rooms before what is in them: Qt styles all of a widget anew wherever it is put into another.
        self._middle = QWidget()
        self.setCentralWidget(self._middle)
        self._pages = QStackedWidget()
        self._pages.setMinimumHeight(1)  # of what is in the middle they yield, not what is below them
        column = _column(self._middle)
        column.addWidget(self._pages, 1)
        self.alarms = AlarmStrip(desk, theme, self._pages)
        self.alarms.cleared.connect(lambda station: ask_clear(self, station, self._watched))
        self.alarms.is_beside_replay = lambda: self.tabs.shows_playback
        self.alarms.shown.connect(self.show_around)
        self.alarms.resources.connect(self._show_resources)
        self.robots = RobotsPanel(desk, theme)
        self.robots.stop_all.connect(self.stop_all)
        self.stopped_all = StopAllBar(desk, theme)
        self.others = OthersBar(desk, theme, self.robots)
        self.robots.added.connect(self.added)
        self.robots.removed.connect(self.removed)
        self.parameters = ParametersPanel(desk, theme)
        self.trial = TrialBar(desk, of_all=True)
        self.trial.keep.connect(lambda: self.trial.station.keep_trial() if self.trial.station else None)
        self.trial.take_back.connect(lambda: self.trial.station.end_trial() if self.trial.station else None)
        self.experiment = ExperimentBar(desk)
        self.events = EventsPanel(desk, theme)
        self.events.shown.connect(self.show_around)
        self.help, self.help_button = Help(theme), QPushButton("?")
        self.empty = EmptyView(theme)
        self.empty.added.connect(self.added)
        self.empty.pairing.connect(self.robots.begin_pairing)
        self.empty.simulator.connect(self.simulator)
        nobody = ScrollArea()
        self._pages.addWidget(nobody)
        nobody.setWidget(self.empty)
        self.tabs = Pages(desk, theme, archive, commissioning)
        self.tabs.edited.connect(self._edit_parameter)
        self.tabs.tried_again.connect(self._try_again)
        self.empty.recordings.connect(self.tabs.look_at_recordings)
        for bar in (self.trial, self.parameters.trial):
            bar.compare.connect(lambda station: self.tabs.edits.compare(station))
        self._pages.addWidget(self.tabs)
        self.tabs.currentChanged.connect(self._share_room)
        self._commissioning = commissioning
        self._is_closing = self._is_ending = False
        if commissioning is not None:
            desk.commissions = lambda: commissioning.wish is not None
            self.header.commissioned = lambda: commissioning.name if commissioning.runs else ""
            self.alarms.commissioned = lambda: commissioning
            desk.commissioned_alarms = lambda: unstopped(commissioning)
            self.empty.offer_commissioning(self.tabs.look_at_commissioning)
        self._bar = StatusBar(desk, theme, commissioning)
        self.setStatusBar(self._bar)
        self.page_bar = PageBar(self.tabs, self._help_corner())
        for row in (self.stopped_all, self.experiment, self.trial):  # below: when one comes, no tab moves
            column.addWidget(row)
        self._build()
        self._bind_keys()
        menu.setMenu(self._view_menu())

    @property
    def _watched(self) -> tuple[Watched, ...]:
        """What is looked at before a stop is ended: what became of it, each drive, all of them, the rest."""
        results = (self.header, self.alarms, self.stopped_all, self.others, *self.robots.cards)
        each, all_of_them = self.tabs.overview.drives
        return results, (each,), (all_of_them,), (self._bar,)

    def refresh(self) -> None:
        """Draw a frame: what moves each time, what is read now and then, and only what is visible."""
        with one_moment():  # however long it takes, all of it is of one
            self._draw()

    def _draw(self) -> None:
        if self._is_closing and self._commissioning is not None and not self._commissioning.runs:
            self._is_closing = False
            if self._commissioning.stage is not Stage.NOT_CONFIRMED:  # that somebody has to see
                self.close()
                return
        self._desk.frames.count()
        due = self._is_due()
        if due:
            self.tabs.read_now()  # what header, alarms and page say is of the same moment
        shown = self._desk.selected is not None or not self.tabs.is_of_a_robot
        try:
            if shown:
                self.tabs.view.refresh()
        finally:  # whatever becomes of a page: STOP, alarms and what is known of the robot go on
            if due:
                self._draw_around(shown=shown)
            # New words are drawn in new places.
            QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest)

    def _draw_around(self, *, shown: bool) -> None:
        """All but the page."""
        self._pages.setCurrentIndex(1 if shown else 0)
        self.page_bar.setVisible(shown)
        if self._panels.hold_back(is_held=not self._desk.stations):
            self._fit()
            self._share_room()
        elif self.parameters.is_in_use:
            self._panels.come_back()
        self._panels.settle()
        self.header.refresh()
        self.stopped_all.refresh()
        self.alarms.refresh()
        self._hold_header()
        self.others.refresh()
        self.robots.refresh()
        self.parameters.refresh()
        self._panels.say_whose(self.docks[1], self._desk.whose)
        self.events.refresh()
        self._panels.call(self.docks[EVENTS], EVENTS_LIVE if self.tabs.shows_playback else "Events")
        self._offer_stop_all()
        self._bar.refresh()
        now, is_decided_there = self.tabs.overview.now, self.parameters.trial.can_be_decided
        now.offer(not is_decided_there)
        self.experiment.refresh()
        self.trial.refresh(shown=not (is_decided_there or now.can_be_decided))

    def _share_room(self) -> None:
        """Give the room of the parameters to pages that are not of a robot, unless these are worked at."""
        if self.tabs.is_of_a_robot:
            self._panels.come_back()
        elif not self.parameters.is_in_use:
            self._panels.give_way(self.docks[1])

    def _offer_stop_all(self) -> None:
        """Have it in sight beside the pages where the one below the robots is not, or is cut."""
        is_needed = len(self._desk.stations) > 1 and not is_all_seen(self.robots.all_stop)
        self.stop_everyone.allow(self._theme.px(ALL_WIDE))
        if self.stop_everyone.isHidden() is is_needed:
            self.stop_everyone.setVisible(is_needed)
            self.page_bar.arrange()  # now: else what is below moves a frame later

    def _is_due(self) -> bool:
        """Return whether occasional readings are due: at once if they are about something else.

        Another robot is named, a STOP goes on, or its wearer does something else, as the ring shows at once.
        """
        station, page = self._desk.selected, self.tabs.currentIndex()
        commissioned = None if self._commissioning is None else self._commissioning.stage
        if station is None:
            return self._pace.is_due((page, station, commissioned))
        about = (
            station.is_live,
            *station.stopping.stage,
            activity(station).mark.word,
            self._desk.stopped_all,
            commissioned,
        )
        return self._pace.is_due((page, station, *about))

    def show_signals(self, globs: Sequence[str]) -> None:
        """Begin with these channels in sight."""
        self.tabs.signals.channels.usual = globs
        self.tabs.look_at(self.tabs.signals)

    def show_around(self, station: Station, channel: str, at_ns: int) -> None:
        """Show what explains a channel, or what is shown, around an instant of a robot's signals."""
        self._desk.select(station)
        signals = self.tabs.signals
        self.tabs.look_at(signals)
        signals.refresh()
        explaining = explaining_signals(station.robot.description, channel) if channel else ()
        signals.show_around(explaining, at_ns)

    def _show_resources(self, station: Station) -> None:
        """Show what keeps a robot's computer busy."""
        self._desk.select(station)
        self.tabs.look_at(self.tabs.resources)

    def closeEvent(self, event: QCloseEvent) -> None:
        if self._commissioning is not None and self._commissioning.runs and not self._is_ending:
            event.ignore()
            self._ask_to_end(self._commissioning)
            return
        keep_bytes(self.kept, "geometry", self.saveGeometry())
        if self._is_arranged:
            keep_bytes(self.kept, "state", self._panels.state)
        self.kept.setValue("look", self._theme.look.value)
        self.kept.setValue("scale", round(self._theme.scale * 100))
        self.kept.setValue("units", dict(self._desk.shown.units.by_si))
        self.kept.setValue("pinned", self._desk.pins.to_keep())
        self.robots.end_pairing()
        super().closeEvent(event)
        self.closed.emit()

    def _ask_to_end(self, commissioning: Commissioning) -> None:
        """Close the window when the shutdown has ended, without waiting."""

        def end() -> None:
            self._is_closing = True
            commissioning.interrupt()

        ask(self, "A robot is being commissioned", COMMISSIONING, "End it and close", end)

    def end(self) -> None:
        """Close without a question: nobody may be there to answer. Qt asks every window before it quits."""
        self._is_ending = True
        QApplication.quit()

    def reset_layout(self) -> None:
        """Everything where it was at first."""
        self._panels.reset(self.docks)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.header.refresh()  # what it has no robot for takes room from STOP
        self._hold_header()
        QTimer.singleShot(0, self, self._settle)

    def _settle(self) -> None:
        """Once it is shown, with the frame that the screen's manager has given it."""
        if not self._is_arranged:
            self._arrange()
        if self.size() == self._opened_as:
            onto_screen(self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def show_help(self) -> None:
        """Show the manual's section on the panel with the keyboard, or on the tab."""
        tab = self.tabs.tabText(self.tabs.currentIndex()).replace("&", "")
        self.help.show_section("Parameters" if has_focus_in(self.parameters) else tab)
        self.bring(self._manual)

    def bring(self, dock: QDockWidget) -> None:
        """Show a panel, in front of those that are at its place."""
        self._panels.bring(dock)

    def _find(self) -> None:
        """Words that are typed are seen, also where the panel was hidden."""
        self.bring(self.docks[1])
        self.parameters.find_parameter()

    def _press(self, button: QPushButton) -> None:
        """Press a button of the parameters, and have these in sight with what comes of it."""
        self.bring(self.docks[1])
        self.parameters.refresh()
        button.click()

    def _edit_parameter(self, name: str) -> None:
        self._panels.bring(self.docks[1])
        self.parameters.edit_parameter(name)

    def _try_again(self, values: dict[str, float]) -> None:
        """Stage these (SI), and show what would be written."""
        self._panels.bring(self.docks[1])
        for name, value in values.items():
            self.parameters.stage(name, value)
        self.parameters.begin_review()

    def _end_trial(self, *, keep: bool) -> None:
        station = self._desk.selected
        if station is not None and station.writing.trial is not None:
            (station.keep_trial if keep else station.end_trial)()

    def _choose_robot(self, place: int) -> None:
        if place < len(self._desk.stations):
            self._desk.select(self._desk.stations[place])

    # --- how it is put together

    def _build(self) -> None:
        self.keys = KeysSheet(self._theme, self._pages)
        above = QWidget()
        self.setMenuWidget(above)
        top = _column(above)
        top.addWidget(self.header)
        top.addWidget(self.alarms)
        top.addWidget(self.others)
        top.addWidget(self.page_bar)
        left, right, below = Area.LeftDockWidgetArea, Area.RightDockWidgetArea, Area.BottomDockWidgetArea
        panels = {
            "Robots": (self.robots, left),
            "Parameters": (self.parameters, right),
            "Events": (self.events, below),
            "Help": (self.help, right),
        }
        self._panels = Docks(self, self._theme, panels, (above, self.stopped_all))
        *self.docks, self._manual = self._panels.all

    def _scaled(self) -> None:
        self._fit(scaled=True)

    def _fit(self, *, scaled: bool = False) -> None:
        """Do with the room that there is."""
        if not self._is_arranged:
            return
        is_narrow, was_narrow = not self._panels.has_room, self._panels.is_narrow
        if is_narrow != was_narrow:
            for part in (self.header, self.parameters):
                part.be_short(is_narrow)
            self.panels_button.setVisible(is_narrow)
            self.page_bar.arrange()  # now: else what is below moves a frame later
        self._panels.fit(scaled=scaled)
        if is_narrow != was_narrow:
            self._share_room()

    def _hold_header(self) -> None:
        """Keep it as wide as the header, which Qt does not see to, and no larger than the screen."""
        needed = QSize(self.header.minimumSizeHint().width(), self._theme.px(LEAST))
        self.setMinimumSize(needed.boundedTo(self.screen().availableSize()))

    def _help_corner(self) -> QWidget:
        self.help_button.setAccessibleName("Help")
        self.help_button.setToolTip("The manual on this page (F1)")
        self.help_button.clicked.connect(self.show_help)
        self.panels_button = QPushButton("Panels")
        self.panels_button.setToolTip("Hide robots, parameters and events, or show them again (F9)")
        self.panels_button.clicked.connect(lambda: self._panels.put_away())
        self.panels_button.hide()
        self.stop_everyone = StopButton("robot_stop")
        self.stop_everyone.name("ALL")
        self.stop_everyone.setAccessibleName("STOP every robot")
        self.stop_everyone.setAccessibleDescription(HINT_ALL)
        self.stop_everyone.setToolTip(HINT_ALL)
        self.stop_everyone.stopped.connect(self.stop_all)
        self.stop_everyone.hide()
        corner = QWidget()
        row = QHBoxLayout(corner)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(2)
        row.addWidget(self.stop_everyone)
        row.addSpacing(12)
        row.addWidget(self.panels_button)
        row.addWidget(self.help_button)
        return corner

    def _bind_keys(self) -> None:
        QShortcut(QKeySequence.StandardKey.HelpContents, self, self.show_help)
        QShortcut(QKeySequence.StandardKey.Find, self, self._find)
        QShortcut(QKeySequence("?"), self, self.keys.turn)
        panel = self.parameters
        for keys, button in (("Ctrl+Return", panel.review_button), ("Ctrl+Z", panel.undo)):
            QShortcut(QKeySequence(keys), self, lambda button=button: self._press(button))
        QShortcut(QKeySequence("Ctrl+K"), self, lambda: self._end_trial(keep=True))
        QShortcut(QKeySequence("Ctrl+T"), self, lambda: self._end_trial(keep=False))
        for place in range(ROBOTS):
            QShortcut(QKeySequence(f"Ctrl+{place + 1}"), self, lambda place=place: self._choose_robot(place))

    def _view_menu(self) -> QMenu:
        menu = QMenu(self)
        menu.setToolTipsVisible(True)
        for dock in (*self.docks, self._manual):
            menu.addAction(dock.toggleViewAction())
        hide = menu.addAction("Hide panels, or show them")
        hide.setShortcut(QKeySequence("F9"))
        hide.triggered.connect(self._panels.put_away)
        menu.addAction("Keys").triggered.connect(self.keys.turn)
        recording = menu.addAction("Stop recording, or start it")
        recording.setShortcut(QKeySequence("Ctrl+R"))
        recording.triggered.connect(lambda: ask_recording(self, self._desk.recording))
        menu.addAction("Reset layout").triggered.connect(self.reset_layout)
        menu.addSeparator()
        add_choices(menu, self._desk, self._theme)
        return menu

    def _restore(self) -> None:
        geometry = kept_bytes(self.kept, "geometry")
        if geometry is not None:
            self.restoreGeometry(geometry)
            onto_screen(self)
        if not self.isMaximized():
            self._arrange()

    def _arrange(self) -> None:
        """Lay the panels out as they were kept; in a window that will be maximised once it is.

        Of what is restored before, Qt keeps a second copy until then, and crashes in that when the panels are
        arranged anew (QMainWindowLayout::restoreState, Qt 6.11).
        """
        self._is_arranged = True
        state = kept_bytes(self.kept, "state")
        if state is not None:
            self._panels.restore(state)
        if self.isVisible():
            self._fit(scaled=True)


def _column(widget: QWidget) -> QVBoxLayout:
    """Nothing around, nothing between."""
    column = QVBoxLayout(widget)
    column.setContentsMargins(0, 0, 0, 0)
    column.setSpacing(0)
    return column
