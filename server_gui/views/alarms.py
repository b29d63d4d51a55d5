"""Active alarms, pinned above everything: what is wrong, since when, what the robot did, what to check."""

import datetime
import time
from typing import Final

from PySide6.QtCore import QRect, QSize, Qt, Signal
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.marks import age_text
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.choosable import Choosable
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.sheet import Sheet
from server_gui.views.widgets.whole import WholeLabel

WIDE: Final = 1200  # at text of 100 %: then two lines are enough, and the buttons have room beside them
WIDEST: Final = 900  # of the list, likewise
HOLD_S: Final = 0.8  # nobody reads faster: until then a click was meant for the alarm before
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
OVER: Final = Mark("ring", "dim", "over")
Told = tuple[Station | None, Active]  # without a robot: of what this window records
Key = tuple[str, tuple[Kind, str]]


class AlarmRow(QFrame):
    """One alarm in full, as it stands in the list."""

    cleared = Signal()
    signal = Signal()
    acknowledged = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setObjectName("alarm")
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self._icon = MarkIcon(theme, 13)
        self.headline, self.details = WholeLabel(), WholeLabel("dim")
        words = QVBoxLayout()
        words.setSpacing(1)
        words.addWidget(self.headline)
        words.addWidget(self.details)
        said = QHBoxLayout()
        said.setSpacing(8)
        said.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignTop)
        said.addLayout(words, 1)
        self.buttons = AlarmButtons()
        self.clear, self.show_signal = self.buttons.clear, self.buttons.show_signal
        self.acknowledge = self.buttons.acknowledge
        self.clear.clicked.connect(self.cleared)
        self.show_signal.clicked.connect(self.signal)
        self.acknowledge.clicked.connect(self.acknowledged)
        column = QVBoxLayout(self)
        column.setContentsMargins(9, 5, 8, 5)
        column.setSpacing(6)
        column.addLayout(said)
        column.addWidget(self.buttons, 0, Qt.AlignmentFlag.AlignLeft)
        theme.changed.connect(self._restyle)
        self._restyle()

    def say(self, told: Told, *, named: bool, is_over: bool = False) -> None:
        """Show this alarm, or that it `is_over`."""
        station, one = told
        mark = OVER if is_over else one.alarm.mark
        self._icon.show_mark(mark)
        set_tone(self, mark.colour)
        set_text(self.headline, headline(told, named=named, more="over" if is_over else ""))
        set_text(self.details, "\n".join(details(one, now_s(station), each=True)))
        self.buttons.offer(told)
        self.buttons.setVisible(not is_over)
        self.setAccessibleName(self.headline.text())
        self.setAccessibleDescription(self.details.text())

    def _restyle(self) -> None:
        self.headline.setFont(self._theme.text_font(bold=True))
        self.setStyleSheet(style(self._theme))


class AlarmButtons(QWidget):
    """What may be done about an alarm; what does not concern it is not there."""

    def __init__(self) -> None:
        super().__init__()
        self.clear = QPushButton("Clear fault…")
        self.clear.setToolTip("Reset the drives' fault: they are led to switch on disabled, none is enabled")
        self.show_signal = QPushButton("Show the signal ± 5 s")
        self.acknowledge = QPushButton("Acknowledge")
        self.acknowledge.setToolTip("It is read: it gives way to others until it is over")
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(6)
        for button in (self.clear, self.show_signal, self.acknowledge):
            row.addWidget(button)

    def offer(self, told: Told | None, *, all_of_them: bool = True) -> None:
        """Offer what there is for this one; what is not offered at once stands in the list."""
        station, one = told or (None, None)
        alarm = None if one is None else one.alarm
        self.clear.setVisible(alarm is not None and alarm.clears)
        self.clear.setEnabled(station is not None and station.is_linked)
        shows = one is not None and one.alarm.channel is not None and one.at_ns is not None
        self.show_signal.setVisible(all_of_them and shows)
        unread = one is not None and not one.is_acknowledged and one.alarm.kind is not Kind.NOT_STOPPED
        self.acknowledge.setVisible(all_of_them and unread)


class AlarmStrip(Choosable):
    """One line that is always there: the worst alarm, or that there is none. It never changes its height.

    `cleared` asks for a reset of a station's fault; `shown` brings a station, a channel and an instant on the
    axis of its signals (ns). `list` is over `below` when it is asked for: everything there is, in full.
    """

    cleared = Signal(object)
    shown = Signal(object, str, object)

    def __init__(self, desk: Desk, theme: Theme, below: QWidget) -> None:
        super().__init__("alarm")
        self._desk = desk
        self._theme = theme
        self._said: object = None  # what was fitted last
        self._changed_s = -HOLD_S  # when another alarm took the place of one
        self.told: tuple[Told, ...] = ()
        self.setAccessibleName("Active alarms")
        self._icon, self._words = MarkIcon(theme, 13), _Words()
        self.headline, self.details = WholeLabel(), WholeLabel("dim")
        self._words.hold(self.headline, self.details)
        self.buttons, self.more = AlarmButtons(), QPushButton()
        self.more.setToolTip("Every alarm in full, and what may be done about it")
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 3, 12, 3)
        row.setSpacing(8)
        row.addWidget(self._icon)
        row.addWidget(self._words, 1)
        row.addWidget(self.buttons)
        row.addWidget(self.more)
        self.list = AlarmList(self, theme, below)
        self.chosen.connect(self._turn)
        self.more.clicked.connect(self.list.turn)
        self.buttons.clear.clicked.connect(lambda: self.clear(self._first))
        self.buttons.show_signal.clicked.connect(lambda: self.show_signal(self._first))
        self.buttons.acknowledge.clicked.connect(lambda: self.acknowledge(self._first))
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def texts(self) -> list[str]:
        """What there is to say of each alarm, in full."""
        return [
            "\n".join((headline(told, named=self.named), *details(told[1], now_s(told[0]), each=True)))
            for told in self.told
        ]

    @property
    def named(self) -> bool:
        """Whether it must be said whose an alarm is."""
        return len(self._desk.stations) > 1

    def refresh(self) -> None:
        """Show what is wrong now."""
        before, self.told = self.told, tuple(self._active())
        first = self.told[0] if self.told else None
        if before and first is not None and _key(before[0]) != _key(first):
            self._changed_s = time.monotonic()
        self._say(first)
        self.buttons.offer(first, all_of_them=self._is_wide)
        self.buttons.acknowledge.setEnabled(time.monotonic() - self._changed_s >= HOLD_S)
        self.more.setVisible(bool(self.told))
        set_button(self.more, "Details …" if len(self.told) == 1 else f"All {len(self.told)} …")
        self.list.refresh()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._restyle()

    # --- what is done about one

    def clear(self, told: Told) -> None:
        """Ask for a reset of its robot's faults."""
        self.cleared.emit(told[0])

    def show_signal(self, told: Told) -> None:
        """Bring what shows it, around the instant that it began."""
        station, one = told
        if station is not None and one.alarm.channel is not None and one.at_ns is not None:
            self.list.hide()
            self.shown.emit(station, one.alarm.channel, one.at_ns)

    def acknowledge(self, told: Told) -> None:
        """It is read."""
        station, one = told
        (self._desk.recording if station is None else station).alarms.acknowledge(one.alarm.key)
        if station is not None and one.alarm.kind is Kind.RESET:
            station.stopping.was_ended = False
        self.refresh()

    # --- inside

    @property
    def _first(self) -> Told:
        return self.told[0]

    def _turn(self) -> None:
        if self.told or self.list.isVisible():
            self.list.turn()

    def _active(self) -> list[Told]:
        """Of all robots and the recording; of the one that is looked at first, where they are as bad."""
        selected = self._desk.selected
        found: list[Told] = [(None, one) for one in self._desk.recording.alarms.active]
        found += [(station, one) for station in self._desk.stations for one in station.alarms.active]
        return sorted(
            found,
            key=lambda told: (
                told[1].is_acknowledged,
                told[1].alarm.kind is not Kind.NOT_STOPPED,
                told[0] is not None and told[0] is not selected,
                told[1].alarm.rank,
                told[1].since_s,
            ),
        )

    def _say(self, first: Told | None) -> None:
        """As much of it as has room, the cause before all; laid out only when it says something else."""
        if first is None:
            mark, lines, rest = quiet(self._desk.selected)
            wordings: tuple[str, ...] = (lines,)
            fuller: tuple[str, ...] = (rest,)
        else:
            mark = first[1].alarm.mark
            wordings = headline(first, named=self.named), headline(first, named=self.named, is_brief=True)
            wordings = wordings[:1] if first[1].alarm.kind is Kind.NOT_STOPPED else wordings
            said = details(first[1], now_s(first[0]))
            since = said[0].partition(" · ")[0]
            fuller = " · ".join(said), " · ".join((since, *said[1:])), " · ".join(said[1:]), since, ""
        self._icon.show_mark(mark)
        set_tone(self, mark.colour)
        self.setAccessibleDescription("; ".join(filter(None, (wordings[0], fuller[0]))))
        set_tip(self, "\n".join(filter(None, (wordings[0], fuller[0]))) if first is not None else "")
        said_now = (wordings, fuller, self._words.viewport().size(), self.headline.font().key())
        if said_now != self._said:
            self._said = said_now
            self._fit(wordings, fuller)

    def _fit(self, wordings: tuple[str, ...], fuller: tuple[str, ...]) -> None:
        room = self._words.viewport().size()

        def high(label: WholeLabel, text: str) -> int:
            box = QRect(0, 0, max(room.width(), 1), 100_000)
            return label.fontMetrics().boundingRect(box, WRAPPED, text).height() if text else 0

        line = self.details.fontMetrics().lineSpacing()  # that since when, and what to check, have room too
        sizes = {text: high(self.headline, text) for text in wordings}
        fits = [
            text for most in (room.height() - line, room.height()) for text in wordings if sizes[text] <= most
        ]
        main = next(iter(fits), wordings[-1])
        left = room.height() - sizes[main]
        rest = next((text for text in fuller if high(self.details, text) <= left), "")
        set_text(self.headline, main)
        set_text(self.details, rest)
        self.details.setVisible(bool(rest))

    @property
    def _is_wide(self) -> bool:
        return self.width() >= self._theme.px(WIDE)

    def _restyle(self) -> None:
        """As high as so many lines of text, whatever stands in them."""
        self.headline.setFont(self._theme.text_font(bold=True))
        self.details.setFont(self._theme.text_font())
        line = max(QFontMetrics(self.headline.font()).lineSpacing(), self.details.fontMetrics().lineSpacing())
        high = line * (2 if self._is_wide else 3) + 8
        if self.height() != high or self.minimumHeight() != high:
            self.setFixedHeight(high)
        self.setStyleSheet(style(self._theme))
        self._said = None


class AlarmList(Sheet):
    """Every alarm in full. While it is open no row moves: new ones come last, and what is over stays."""

    def __init__(self, strip: AlarmStrip, theme: Theme, below: QWidget) -> None:
        words = QWidget()
        super().__init__("All alarms", words, theme, below, WIDEST)
        self._strip = strip
        self._shown: dict[Key, Told] = {}
        self.rows: list[AlarmRow] = []
        self._column = QVBoxLayout(words)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(4)
        self._none = WholeLabel("dim")
        self._none.setText("No alarms.")
        self._column.addWidget(self._none)
        self._column.addStretch(1)

    def turn(self) -> None:
        self._shown.clear()
        super().turn()
        self.refresh()

    def refresh(self) -> None:
        """Show how each is now."""
        if not self.isVisible():
            return
        now = {_key(told): told for told in self._strip.told}
        self._shown |= now
        while len(self.rows) < len(self._shown):
            self._add_row()
        for row, (key, told) in zip(self.rows, self._shown.items(), strict=False):
            row.say(told, named=self._strip.named, is_over=key not in now)
        for place, row in enumerate(self.rows):
            row.setVisible(place < len(self._shown))
        self._none.setVisible(not self._shown)

    def _add_row(self) -> None:
        row, place = AlarmRow(self._theme), len(self.rows)
        row.cleared.connect(lambda: self._strip.clear(self._at(place)))
        row.signal.connect(lambda: self._strip.show_signal(self._at(place)))
        row.acknowledged.connect(lambda: self._strip.acknowledge(self._at(place)))
        self.rows.append(row)
        self._column.insertWidget(place, row)

    def _at(self, place: int) -> Told:
        return list(self._shown.values())[place]


class _Words(QScrollArea):
    """What has no room is scrolled, and changes the size of nothing around."""

    def hold(self, *labels: QWidget) -> None:
        """Show these below each other."""
        inner = QWidget()
        inner.setObjectName("page")
        column = QVBoxLayout(inner)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addStretch(1)
        for label in labels:
            column.addWidget(label)
        column.addStretch(1)
        self.setWidget(inner)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(1, 1)

    def sizeHint(self) -> QSize:
        return QSize(1, 1)


def quiet(station: Station | None) -> tuple[Mark, str, str]:
    """Return that there is no alarm, where that is known."""
    if station is None:
        return Mark("ring", "dim"), "No robot", ""
    if station.robot.is_recording:
        return Mark("diamond", "accent"), "A recording", "no fault shown"
    if not station.is_live or not station.robot.parts:
        return Mark("ring", "old"), "Alarms not known", "no live data"
    return Mark("disc", "good"), "No alarms", "all ok"


def headline(told: Told, *, named: bool, more: str = "", is_brief: bool = False) -> str:
    """Whose it is, what is wrong, and whether that is now."""
    station, one = told
    alarm = one.alarm
    line = " · ".join(
        filter(None, (station.title if station and named else "", alarm.brief if is_brief else alarm.line))
    )
    marks = [more, "" if alarm.is_now else "last known", "acknowledged" if one.is_acknowledged else ""]
    said = ", ".join(filter(None, marks))
    return f"{line} ({said})" if said else line


def now_s(station: Station | None) -> float:
    """The instant that is shown, UTC."""
    return time.time() if station is None else station.robot.now_s()


def style(theme: Theme) -> str:
    """The frame of an alarm, by its tone."""
    colours = theme.colours
    return (
        f"QFrame#alarm {{ background: {colours.card}; border: 1px solid {colours.border}; "
        f"border-left: 4px solid {colours.warn}; border-radius: 4px; }}"
        f'QFrame#alarm[tone="bad"] {{ border-color: {colours.bad}; }}'
        f'QFrame#alarm[tone="good"] {{ border-left-color: {colours.border}; }}'
        f'QFrame#alarm[tone="dim"], QFrame#alarm[tone="old"] {{ border-left-color: {colours.dim}; }}'
        f"QFrame#alarm:focus {{ border-color: {colours.accent}; }}"
    )


def _key(told: Told) -> Key:
    station, one = told
    return "" if station is None else station.name, one.alarm.key


def details(one: Active, now_s: float, *, each: bool = False) -> list[str]:
    """Since when (UTC) and what the robot did, what it explains (`each` in full), and what to check."""
    alarm = one.alarm
    since = datetime.datetime.fromtimestamp(one.since_s, datetime.UTC).astimezone()
    first = f"since {since:%H:%M:%S}, for {lasting(max(0.0, now_s - one.since_s))}"
    lines = [f"{first} · robot: {alarm.did}" if alarm.did else first]
    if alarm.under:
        lines += [f"with it: {under.line}" for under in alarm.under] if each else [alarm.consequences]
    return [*lines, f"→ {alarm.check}"] if alarm.check else lines


def lasting(for_s: float) -> str:
    """A time that grows, in whole seconds as long as these matter."""
    return f"{for_s:.0f} s" if for_s < 120 else age_text(for_s)


def set_button(button: QPushButton, text: str) -> None:
    """Change a button only where it says something else."""
    if button.text() != text:
        button.setText(text)
