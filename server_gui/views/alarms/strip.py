"""The active alarms' line: the worst, always in the same place, so that nothing moves when one comes."""

import time
from collections.abc import Callable
from typing import Final

from PySide6.QtCore import QRect, QSize, Qt, Signal
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QScrollArea, QVBoxLayout, QWidget

from server_gui.core.alarms.alarm import MORE
from server_gui.core.alarms.texts import UNSTOPPED, Kind
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.desk.desk import Desk
from server_gui.views.alarms.full_list import AlarmButtons, AlarmList, style
from server_gui.views.alarms.words import (
    REMEDY,
    SINCE,
    Told,
    details,
    fewer,
    going_on,
    headline,
    in_order,
    key_of,
    lasting,
    leading,
    now_s,
    quiet,
)
from server_gui.views.marks import Mark, time_of_day
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.clickable_frame import ClickableFrame
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

WIDE: Final = 1200  # at text of 100 %: then two lines are enough, and the buttons have room beside them
HOLD_S: Final = 0.8  # nobody reads faster: until then a click was meant for the alarm before
LIVE: Final = "Live: "  # beside a recording that is played, whose alarms are with it
NEWS_S: Final = 60.0
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value


class AlarmStrip(ClickableFrame):
    """One line that is always there: the worst alarm, or that there is none. It never changes its height.

    `cleared` asks for a reset of a station's fault; `shown` brings a station, a channel and an instant on the
    axis of its signals (ns), `resources` a station whose computer is to be looked at. `list` is over `below`
    when it is asked for: everything there is, in full.
    """

    cleared = Signal(object)
    shown = Signal(object, str, object)
    resources = Signal(object)

    def __init__(self, desk: Desk, theme: Theme, below: QWidget) -> None:
        super().__init__("alarm")
        self._desk = desk
        self._theme = theme
        self._said: object = None  # what was fitted last
        self._changed_s = -HOLD_S  # when another alarm took the place of one
        self.told: tuple[Told, ...] = ()
        self.commissioned: Callable[[], Commissioning | None] = lambda: None
        self.is_beside_replay: Callable[[], bool] = lambda: False
        self.setAccessibleName("Active alarms")
        self._icon, self._words = MarkIcon(theme, 13), _Words()
        self.headline, self.details = WrappingLabel(), WrappingLabel("dim")
        self._words.hold(self.headline, self.details)
        self.buttons, self.more = AlarmButtons(), QPushButton()
        self.more.setToolTip("Every alarm in full, with its actions")
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
        self.buttons.show_resources.clicked.connect(lambda: self.show_resources(self._first))
        self.buttons.acknowledge.clicked.connect(lambda: self.acknowledge(self._first))
        again = Qt.ConnectionType.QueuedConnection  # buttons that come beside it take room from the words
        self._words.resized.connect(self._say_again, again)
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
        return self._desk.has_several

    def refresh(self) -> None:
        """Show what is wrong now."""
        before, self.told = self.told, tuple(in_order(self._desk))
        first = self.told[0] if self.told else None
        if before and first is not None and key_of(before[0]) != key_of(first):
            self._changed_s = time.monotonic()
        self._say(first)
        self.buttons.offer(first, all_of_them=self._is_wide)
        self.buttons.acknowledge.setEnabled(time.monotonic() - self._changed_s >= HOLD_S)
        self.more.setVisible(bool(self.told))
        set_button(self.more, "Details …" if len(self.told) == 1 else f"All {len(self.told)} …")
        self.list.refresh()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._size()

    # --- what is done about one

    def clear(self, told: Told) -> None:
        """Ask for a reset of its robot's faults."""
        self.cleared.emit(told[0])

    def show_signal(self, told: Told) -> None:
        """Bring what shows it, around the instant that it began."""
        station, one = told
        if station is not None and one.alarm.channel is not None and one.at_ns is not None:
            self.list.hide()
            is_fault = one.alarm.kind is Kind.FAULT
            at_ns = one.at_ns
            at_ns = station.flags.instant_of_fault(one.alarm.subject, at_ns) if is_fault else at_ns
            self.shown.emit(station, one.alarm.channel, at_ns)

    def show_resources(self, told: Told) -> None:
        """Bring the page of what keeps its robot's computer busy."""
        if told[0] is not None:
            self.list.hide()
            self.resources.emit(told[0])

    def acknowledge(self, told: Told) -> None:
        """Acknowledge the alarm."""
        station, one = told
        self._desk.acknowledge(station, one.alarm)
        self.refresh()

    # --- inside

    @property
    def _first(self) -> Told:
        return self.told[0]

    def _beside(self) -> tuple[Mark, str, str]:
        """Return what is no alarm of a robot here: of one that is commissioned, or none."""
        commissioned = self.commissioned()
        if commissioned is not None and _is_news(commissioned):
            mark = commissioned.look_of.mark
            since_s, said = commissioned.since_s, commissioned.look_of.words
            since = f"{SINCE}{time_of_day(since_s)}, for {lasting(max(0.0, time.time() - since_s))}"
            return mark, f"{commissioned.name} · {mark.word}", f"{since} · {said}"
        mark, main, rest = quiet(self._desk.selected, self._desk.recording)
        return mark, f"{LIVE}{main[:1].lower()}{main[1:]}" if self.is_beside_replay() else main, rest

    def _turn(self) -> None:
        if self.told or self.list.isVisible():
            self.list.turn()

    def _say_again(self) -> None:
        self._say(self.told[0] if self.told else None)

    def _say(self, first: Told | None) -> None:
        """As much of it as has room, the cause before all; laid out only when it says something else."""
        if first is None:
            mark, main, rest = self._beside()
            wordings: tuple[str, ...] = (main,)
            fuller: tuple[str, ...] = (rest,)
        else:
            mark, lead = leading(first, self.told)
            wordings = self._wordings(first) if lead is first else self._after_reset(first, lead)
            fuller = fewer(details(first[1], now_s(first[0])))
        self._icon.show_mark(mark)
        set_tone(self, "urgent" if first is not None and first[1].alarm.kind in UNSTOPPED else mark.colour)
        self.setAccessibleDescription("; ".join(filter(None, (wordings[0], fuller[0]))))
        set_tip(self, "\n".join(filter(None, (wordings[0], fuller[0]))) if first is not None else "")
        said_now = (wordings, fuller, self._words.room, self.headline.font().key())
        if said_now != self._said:
            self._said = said_now
            self._fit(wordings, fuller)

    def _wordings(self, told: Told) -> tuple[str, ...]:
        """Return its line for less and less room; nothing is cut of why a stop is not confirmed."""
        said = tuple(headline(told, named=self.named, brief=brief) for brief in range(4))
        alarm = told[1].alarm
        return said[: 2 if alarm.aside else 1] if alarm.kind in UNSTOPPED else said

    def _after_reset(self, told: Told, worse: Told) -> tuple[str, ...]:
        return going_on(told, worse[1].alarm, named=self.named)

    def _fit(self, wordings: tuple[str, ...], fuller: tuple[str, ...]) -> None:
        room = self._words.room

        def high(label: WrappingLabel, text: str) -> int:
            box = QRect(0, 0, max(room.width(), 1), 100_000)
            return label.fontMetrics().boundingRect(box, WRAPPED, text).height() if text else 0

        sizes = {text: high(self.headline, text) for text in wordings}
        rests = {text: high(self.details, text) for text in fuller}
        fits = [
            (main, rest) for main in wordings for rest in fuller if sizes[main] + rests[rest] <= room.height()
        ]
        main, rest = min(fits, key=_lacks, default=(wordings[-1], ""))
        self._words.have_bar(wanted=not fits)
        set_text(self.headline, main)
        set_text(self.details, rest)
        self.details.setVisible(bool(rest))

    @property
    def _is_wide(self) -> bool:
        return self.width() >= self._theme.px(WIDE)

    def _restyle(self) -> None:
        self.headline.setFont(self._theme.text_font(bold=True))
        self.details.setFont(self._theme.text_font())
        self.setStyleSheet(style(self._theme))
        self._size()

    def _size(self) -> None:
        """As high as so many lines of text, whatever stands in them."""
        line = max(QFontMetrics(self.headline.font()).lineSpacing(), self.details.fontMetrics().lineSpacing())
        high = line * (2 if self._is_wide else 3) + 8
        if self.height() != high or self.minimumHeight() != high:
            self.setFixedHeight(high)
        self._said = None


def _is_news(commissioned: Commissioning) -> bool:
    """Return whether how it is belongs before how others are: of what has ended well, only for a while."""
    look = commissioned.look_of
    is_over = look.mark.colour == "warn" and not look.runs
    is_old = is_over and time.time() - commissioned.since_s > NEWS_S
    return look.mark.colour in ("warn", "bad") and not is_old


def _lacks(said: tuple[str, str]) -> tuple[bool, ...]:
    """Return what cause and details lack, the worst first; of several that lack as much the fullest comes."""
    main, rest = said
    has_remedy, is_timed = REMEDY in rest, rest.startswith(SINCE)
    return not has_remedy, has_remedy and not is_timed, MORE in rest, not rest, MORE in main


class _Words(QScrollArea):
    """Text that scrolls if there is no room, and never resizes its surroundings."""

    resized = Signal()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.resized.emit()

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

    def have_bar(self, *, wanted: bool) -> None:
        """Have a scroll bar only for what does not fit without one: it takes room, and would need itself."""
        policy = Qt.ScrollBarPolicy
        self.setVerticalScrollBarPolicy(policy.ScrollBarAsNeeded if wanted else policy.ScrollBarAlwaysOff)

    def sizeHint(self) -> QSize:
        return QSize(1, 1)

    @property
    def room(self) -> QSize:
        """Room for text without a scroll bar, which what fits does not need, whether one is there or not."""
        return self.maximumViewportSize()


def set_button(button: QPushButton, text: str) -> None:
    """Change a button only where it says something else."""
    if button.text() != text:
        button.setText(text)
