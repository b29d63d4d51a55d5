"""One recording in the views of a robot, marked as what it is: play, jump, choose a span, label, export."""

from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QHBoxLayout,
    QMenu,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from gateway.plain_text import plain
from ml.store.sessions import Session
from server_gui.core.alarms.explaining_signals import explaining_signals
from server_gui.core.archive.archive import Archive
from server_gui.core.archive.cycle_remarks import CycleRemarks
from server_gui.core.archive.playback import SPEEDS, Playback, PlayedRobot
from server_gui.core.archive.recorded_notes import RecordedNotes
from server_gui.core.archive.recording_names import short_names
from server_gui.core.archive.side_by_side import SideBySide
from server_gui.core.cloud.actions import FORMATS, export
from server_gui.core.cloud.selection import Choice
from server_gui.core.cloud.tape import Tape, as_time
from server_gui.core.desk.flags import Flag
from server_gui.core.desk.station import Station
from server_gui.core.workspace.alignment import Align
from server_gui.core.workspace.workspace import PlotSpec
from server_gui.views.alarms.strip import AlarmStrip
from server_gui.views.overview.page import Overview
from server_gui.views.overview.sections import REPLAYED
from server_gui.views.predictions import STOPPED, UNSEEN, status
from server_gui.views.recordings.beside_bar import BesideBar
from server_gui.views.recordings.label_bar import LabelBar
from server_gui.views.recordings.timeline import SECOND_NS, Timeline, clock_text, day_text
from server_gui.views.refresh_rate import RefreshRate
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.cursors import FLAGS
from server_gui.views.widgets.files import ask_save
from server_gui.views.widgets.mark import mark_icon
from server_gui.views.widgets.plain import NO_BREAK, PlainLabel, set_tip
from server_gui.views.widgets.scroll_area import ScrollArea, bring_into_sight
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.workspace.page import AROUND_S, Signals
from server_gui.views.workspace.plot_area import NO_CURVES

ROOMY: Final = 440  # high, at text of 100 %: what is lower shows plots alone beside labels
ALL: Final = 960  # high, likewise: what is lower begins with all of the robot rather than with what labels it
EVENTS_HINT: Final = "Its events; choose one to see its instant"
NO_EVENTS_HINT: Final = (
    "Nothing happened in it: no gap, no mark, no change of a drive, no line of the journal"
)
NOT_REPLAYED: Final = (
    "· trouble of its buses was not recorded",
    "· buses not recorded",
)  # where there is room
NOT_REPLAYED_HINT: Final = (
    "What is replayed are the robot's signals: it was recorded by another version, without its buses' trouble"
)
READING: Final = "reading both recordings …"
SETTLES: Final = 8  # frames until all plots are there
SIGNALS: Final = 1  # of the two views
AROUND_NS: Final = round(AROUND_S * SECOND_NS)
TOLD_NS: Final = SECOND_NS // 10  # after its state a drive tells why it is in fault


class Player(QWidget):
    """Player of the archive's playback; `left` is emitted to return to the list."""

    left = Signal()

    def __init__(self, archive: Archive, theme: Theme) -> None:
        super().__init__()
        self.setObjectName("playback")  # with a frame: it looks like what is live
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._archive = archive
        self._playback = archive.playback
        self._theme = theme
        self._pace = RefreshRate()
        self._told: dict[Playback, object] = {}  # the recording and the journal that it knows of
        self.overview = Overview(self._playback.desk, theme)
        self.overview.arrangements = REPLAYED
        self.overview.is_numbers_first = False  # a walk is replayed for how it looked, until a drive fails
        notes = RecordedNotes(self._playback, archive.labels)
        self.beside = SideBySide(self._playback, archive.settings, archive.reading.do, archive.deliver)
        self.signals = Signals(
            self._playback.desk,
            theme,
            notes,
            others=lambda: self.beside.second.desk.stations,
            step=self.beside.step,
        )
        self.beside_bar = BesideBar(self.beside, theme)
        self.beside_bar.closed.connect(self._end_comparing)
        self.beside_bar.arranged.connect(self.signals.show_tools)
        self.beside_bar.measured.connect(self.signals.cursors.setChecked)
        self.signals.cursors.toggled.connect(self.beside_bar.cursors.setChecked)
        self._before: list[PlotSpec] | None = None  # the plots, before two recordings were compared
        self._remarked: object = None  # the comparison that the remarks are of
        self._views = (self.overview, self.signals)
        self._settling = 0  # frames until what is beside has its place
        self._was_wrong = False  # in what was played of it
        self._around: tuple[str, int] | None = None  # a channel and an instant, to be shown once it is read
        self._stack = QStackedWidget()
        for view in self._views:
            self._stack.addWidget(ScrollArea(view))
        self.alarms = AlarmStrip(self._playback.desk, theme, self)
        self.alarms.setAccessibleName("Alarms of the recording")
        self.alarms.shown.connect(lambda _station, channel, at_ns: self.show_around(channel, at_ns))
        self.alarms.hide()
        self.banner = PlainLabel()
        self.banner.setObjectName("banner")
        self.banner.setWordWrap(True)
        self.banner.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.timeline = Timeline(theme)
        self.timeline.moved.connect(self._playback.seek)
        self.timeline.toggled.connect(self._toggle)
        self.timeline.turned.connect(self._turn)
        self._flags: tuple[tuple[Flag, ...], tuple[Flag, ...]] = ((), ())  # of it, and of what is beside it
        self.labels = LabelBar(archive.labels, archive.hits, self.timeline, theme)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.setSpacing(6)
        everything.addLayout(self._head())
        everything.addWidget(self.beside_bar)
        everything.addWidget(self.alarms)
        everything.addWidget(self._stack, 1)
        everything.addWidget(self.timeline)
        everything.addLayout(self._transport())
        everything.addWidget(self.labels)
        self._is_roomy, self._has_room_for_all = True, True

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Show or hide labels as the height begins or ends to be enough; else leave them to the user."""
        super().resizeEvent(event)
        self._is_roomy = self.height() >= self._theme.px(ROOMY)
        has_room = self.height() >= self._theme.px(ALL)
        if has_room is not self._has_room_for_all:
            self._has_room_for_all = has_room
            self.labelling.setChecked(has_room)
        self._make_room()

    def _make_room(self) -> None:
        """Keep what is labelled in sight while somebody labels: the plots, beside what it was then."""
        alone = not self._has_room_for_all and self.labelling.isChecked()
        with_now = self._is_roomy or not (alone or self._was_wrong)  # an alarm says more of the drives
        self.overview.show_plots_alone(alone, with_now=with_now)
        self.timeline.be_low(not self._has_room_for_all)

    def heightForWidth(self, width: int) -> int:
        """As low as it can be: what scrolls it would give the views all that they would like to have."""
        layout = self.layout()
        return -1 if layout is None else layout.totalMinimumHeightForWidth(width)

    def show_tape(self) -> None:
        """Show another recording."""
        if self._playback.tape is not None:
            self.unseen.say(*([""] if self._playback.tape.tells_of_buses else [*NOT_REPLAYED, ""]))
            self.timeline.show_tape(self._playback.tape)
            self.timeline.setFocus()
            self._speed.setCurrentIndex(SPEEDS.index(self._playback.speed))
            self._around = None
            self.beside.close()
            self.beside_bar.refresh()
            self._end_comparing()
            self._was_wrong = self.overview.is_numbers_first = False
            self._make_room()
            self.alarms.list.hide()
            self.alarms.hide()

    def show_beside(self, session: Session) -> None:
        """Show another recording in the same plots: what is played goes on with it from its beginning."""
        self._end_comparing()
        self.beside.open(session)
        self.beside_bar.refresh()
        self.signals.show_tools(on=False)
        self.labelling.setChecked(self._has_room_for_all)
        self._choice.button(SIGNALS).click()

    def show_around(self, channel: str, at_ns: int) -> None:
        """Show what explains a channel before and after an instant: what comes after it is read first.

        Then the recording stands at that instant: values and alarms are of it.
        """
        robot = self._playback.desk.stations[0].robot
        if isinstance(robot, PlayedRobot) and robot.row_ns is not None and robot.stamp_ns is not None:
            self._playback.play(on=False)
            self._playback.seek(at_ns + robot.row_ns - robot.stamp_ns + AROUND_NS)
            self._around = (channel, at_ns)
            self._choice.button(SIGNALS).click()

    def refresh(self) -> None:
        """Go on playing, and draw a frame."""
        playback = self._playback
        playback.step()
        if playback.tape is None:
            return
        if self._around is not None and not playback.is_loading:
            self._stand_at(*self._around)
        self._refresh_beside()
        self._views[self._stack.currentIndex()].refresh()
        self.timeline.show_position(playback.position_ns)
        self.timeline.show_outline(playback.outline)
        self._refresh_clock(playback.tape)
        shown = playback.playing or (playback.position_ns, playback.is_loading)
        if self._pace.is_due((playback.tape, shown)):
            self._refresh_words()

    def _stand_at(self, channel: str, at_ns: int) -> None:
        """Let the plots keep what is around an instant, and go back to where a drive has told its code."""
        self._around, robot = None, self._playback.desk.stations[0].robot
        self.signals.refresh()
        self.signals.show_around(explaining_signals(robot.description, channel), at_ns)
        if isinstance(robot, PlayedRobot) and robot.row_ns is not None and robot.stamp_ns is not None:
            a_row_ns = round(SECOND_NS / robot.rows_per_s) if robot.rows_per_s else 0
            self._playback.seek(at_ns + robot.row_ns - robot.stamp_ns + max(TOLD_NS, a_row_ns))
            self._playback.step()

    def _refresh_beside(self) -> None:
        """Bring the second recording into the plots once it is there."""
        station, scene = self.beside.station, self.signals.scene
        is_read = self.beside.session is None or bool(self.beside.problem)
        set_text(self.signals.empty, NO_CURVES if is_read else READING)
        if station is not None and scene.beside is None and self._before is not None:
            self.beside_bar.close_button.click()  # it was put away in the menu of the signals
        elif station is not None and (scene.beside is None or scene.beside.station is not station):
            self._put_beside(station)
        elif self._settling and self.signals.cards:
            if self._before is None:
                self._before = list(scene.workspace.plots)
                scene.workspace.split()
                self.signals.area.pair(on=True)
                self.signals.show_tools(on=False)
                self._make_room()
            self._settling -= 1
            bring_into_sight(self.signals.cards[0], first=True)
        self._remark()

    def _put_beside(self, station: Station) -> None:
        """Compare both: in plots of a channel each, which have the room of the tools."""
        scene, (first, second) = (
            self.signals.scene,
            (one.tape for one in (self._playback, self.beside.second)),
        )
        if first is None or second is None:
            return
        scene.put_beside(station, short_names(first, second))
        scene.align = Align.NOW
        self._settling = SETTLES
        self._archive.compared.open(first.session, second.session)

    def _remark(self) -> None:
        """Say of each curve what the gait cycles of both say, once that is known."""
        scene, compared, first = self.signals.scene, self._archive.compared, self._playback.tape
        seen = compared.revision, scene.beside, tuple(scene.workspace.curves), self._archive.shown_units
        if scene.beside is None or first is None or seen == self._remarked:
            return
        self._remarked = seen
        remarks = CycleRemarks(compared, first.session, self._playback.desk.shown.units)
        scene.remarks = {text: remarks.of(text) for text in scene.workspace.curves}
        self.beside_bar.cadence.say(*remarks.cadence)

    def _end_comparing(self) -> None:
        """Arrange the plots as they were, with the tools."""
        before, self._before, self._settling = self._before, None, 0
        for button in (self.beside_bar.cursors, self.beside_bar.tools):
            button.setChecked(False)
        self.signals.area.pair(on=False)
        self.signals.show_tools(on=True)
        if before is not None:
            self.signals.scene.workspace.show(before)
        self._make_room()

    # --- how it is put together

    def _head(self) -> QHBoxLayout:
        back = QPushButton("← All")
        back.setAccessibleName("All recordings")
        back.setToolTip("All recordings")
        back.clicked.connect(self._back)
        row = QHBoxLayout()
        row.addWidget(back)
        row.addWidget(self.banner, 1)
        self._choice = QButtonGroup(self)
        for place, name in enumerate(("Overview", "Signals")):
            button = QPushButton(name)
            button.setCheckable(True)
            button.setChecked(place == 0)
            button.setAccessibleName(f"{name} of the recording")
            self._choice.addButton(button, place)
            row.addWidget(button)
        self._choice.idClicked.connect(self._stack.setCurrentIndex)
        return row

    def _transport(self) -> QHBoxLayout:
        self.play = QPushButton("Play")
        self.play.clicked.connect(self._toggle)
        self._speed = QComboBox()
        self._speed.addItems([f"{speed:g} ×" for speed in SPEEDS])
        self._speed.setAccessibleName("Speed of the playback")
        self._speed.currentIndexChanged.connect(self._set_speed)
        self.place = PlainLabel()
        self.unseen = ShrinkingLabel("dim")
        set_tip(self.unseen, NOT_REPLAYED_HINT)
        self.export = QPushButton("Export")
        menu = QMenu(self.export)
        for kind in FORMATS:
            menu.addAction(f"{kind.upper()} …").triggered.connect(lambda _=False, kind=kind: self._ask(kind))
        self.export.setMenu(menu)
        self.export.setToolTip("The chosen span, or all of it, as a file; made in the background")
        self.events = QPushButton("Events")
        self.events.setAccessibleName("Events of the recording")
        happened = QMenu(self.events)
        happened.aboutToShow.connect(lambda: self._list_events(happened))
        self.events.setMenu(happened)
        row = QHBoxLayout()
        for widget in (self.play, self._speed, self.events, self.place):
            row.addWidget(widget)
        row.addWidget(self.unseen, 1)
        self.labelling = QPushButton("Labels")
        self.labelling.setCheckable(True)
        self.labelling.setChecked(True)
        self.labelling.setToolTip("Show or hide the bar for labels")
        self.labelling.toggled.connect(self.labels.setVisible)
        self.labelling.toggled.connect(lambda _on: self._make_room())
        row.addWidget(self.labelling)
        row.addWidget(self.export)
        return row

    # --- what is read

    def _refresh_clock(self, tape: Tape) -> None:
        """Say the instant that is drawn, with every frame: on a busy computer the next look may be late."""
        playback, happened = self._playback, self._playback.happened
        set_text(self.banner, self._title())
        since, length = ((at - tape.first_ns) / SECOND_NS for at in (playback.position_ns, tape.last_ns))
        known = f" · events not known: {happened.problem}" if happened.problem else ""
        looking = " · looking for events …" if happened.is_looking else known
        set_text(self.place, f"{clock_text(since, 1)} of {clock_text(length, 1)}{looking}")

    def _refresh_words(self) -> None:
        playback, tape = self._playback, self._playback.tape
        if tape is None:
            return
        self._tone("bad" if playback.problem else "")
        set_tip(self.banner, self.banner.text())
        text = "Pause" if playback.playing else "Play"
        if self.play.text() != text:
            self.play.setText(text)
        self._refresh_flags()
        has_events = bool(self._in_order)  # as the time axis shows them
        self.events.setEnabled(has_events)
        set_tip(self.events, EVENTS_HINT if has_events else NO_EVENTS_HINT)
        self._refresh_alarms()
        self.beside_bar.refresh()
        self.labels.refresh(tape)

    def _refresh_alarms(self) -> None:
        """Show what was wrong then; once something was, its line stays, so that nothing moves again."""
        self.alarms.refresh()
        if self.alarms.told and not self._was_wrong:
            self._was_wrong = self.overview.is_numbers_first = True
            self._make_room()
            self.overview.read_now()  # its joints come first from now on
            self.overview.refresh()
        is_low = not self._is_roomy and self._stack.currentIndex() == SIGNALS
        is_in_the_way = is_low and not self.alarms.told
        self.alarms.setVisible(self._was_wrong and not is_in_the_way)

    def _refresh_flags(self) -> None:
        self._archive.journals.look()
        for playback in (self._playback, self.beside.second):
            if playback.tape is not None:
                self._tell(playback, playback.tape)
        flags = tuple(self._playback.happened.flags), tuple(self.beside.flags)
        if flags != self._flags:
            self._flags = flags
            names = self.signals.scene.names
            self.timeline.show_flags(*flags, "" if names is None else names[1])

    def _tell(self, playback: Playback, tape: Tape) -> None:
        """Tell it what the robot's journal has of that time."""
        journals = self._archive.journals
        kept, told = journals.found.by_robot.get(tape.session.robot), (tape, journals.revision)
        if kept is not None and self._told.get(playback) != told:
            self._told[playback] = told
            entries = [entry for stretch in kept.stretches for entry in stretch]
            playback.happened.tell(entries, playback.parameters.described)
            playback.parameters.tell(entries, tape.first_ns, tape.last_ns)

    def _list_events(self, menu: QMenu) -> None:
        tape = self._playback.tape
        menu.clear()
        if tape is None:
            return
        for flag in self._in_order:
            at = clock_text((flag.at_ns - tape.first_ns) / SECOND_NS, 1)
            text = plain(f"{at}  {self.timeline.told(flag)}").replace("&", "&&")
            action = menu.addAction(mark_icon(self._theme, FLAGS[flag.kind]), text)
            action.triggered.connect(lambda _=False, flag=flag: self._playback.seek(flag.at_ns))

    @property
    def _in_order(self) -> list[Flag]:
        """What happened in both, within the time of the first."""
        tape, (ours, beside) = self._playback.tape, self._flags
        within = (one for one in beside if tape is not None and tape.first_ns <= one.at_ns <= tape.last_ns)
        return sorted((*ours, *within), key=lambda one: one.at_ns)

    def _turn(self, way: int) -> None:
        at_ns = self._playback.position_ns
        found = [flag for flag in self._in_order if self.timeline.is_within(flag)]
        later = (flag for flag in found if flag.at_ns > at_ns)
        earlier = (flag for flag in reversed(found) if flag.at_ns < at_ns)
        flag = next(later if way > 0 else earlier, None)
        if flag is not None:
            self._playback.seek(flag.at_ns)

    def _title(self) -> str:
        playback, tape = self._playback, self._playback.tape
        if tape is None:
            return ""
        what = f"▶ PLAYBACK, not live: {tape.session.robot}, {day_text(playback.position_ns)}"
        if self.beside.session is not None:  # when each began stands below
            since = clock_text((playback.position_ns - tape.first_ns) / SECOND_NS, 1)
            what = f"▶ PLAYBACK, not live: two recordings at {since}"
        if playback.problem:
            return f"{what}. It cannot be read: {playback.problem}"
        if playback.is_loading:
            return f"{what} · reading …"
        then = status(playback.desk.stations[0])
        if then is None:
            return what
        is_said = then.mark.word not in (STOPPED, UNSEEN)
        said = then.text.replace(" ", NO_BREAK)
        return f"{what} · {f'predicted then: {said}' if is_said else then.text.lower()}"

    def _tone(self, tone: str) -> None:
        if self.banner.property("tone") != tone:
            self.banner.setProperty("tone", tone)
            self.banner.style().polish(self.banner)

    # --- what people do

    def _toggle(self) -> None:
        self._playback.play(on=not self._playback.playing)

    def _set_speed(self, place: int) -> None:
        self._playback.speed = SPEEDS[place]

    def _back(self) -> None:
        self.beside.close()
        self._end_comparing()
        self._playback.close()
        self.left.emit()

    def _ask(self, kind: str) -> None:
        tape = self._playback.tape
        name = "recording" if tape is None else tape.session.session
        ask_save(self, f"Export as {kind.upper()}", kind, lambda file: self.export_to(kind, file), name)

    def export_to(self, kind: str, file: Path) -> None:
        """Export the chosen span, or all of it, in the background."""
        tape, span = self._playback.tape, self.timeline.span_ns
        if tape is None:
            return
        begin, end = (None, None) if span is None else map(as_time, span)
        work = export(self._archive.settings, tape.session, Choice(begin=begin, end=end), kind, file)
        self._archive.jobs.add(f"Export {file.name}", work)
