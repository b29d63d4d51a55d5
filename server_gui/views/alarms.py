"""Active alarms, pinned above the tabs: what is wrong, since when, what the robot did, what to check."""

import datetime
import time
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QHBoxLayout, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.marks import age_text
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.choosable import Choosable
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.whole import WholeLabel

WIDE: Final = 760  # at text of 100 %: then the buttons stand beside the words
MOST: Final = 4  # rows before the others are asked for
Told = tuple[Station | None, Active]  # without a robot: of what this window records


class AlarmRow(Choosable):
    """One alarm. `chosen` when it is clicked, or Return or Space is pressed on it."""

    cleared = Signal()
    signal = Signal()
    acknowledged = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__("alarm")
        self._theme = theme
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
        self.clear = QPushButton("Clear fault…")
        self.clear.setToolTip("Reset the drives' fault: they are led to switch on disabled, none is enabled")
        self.show_signal = QPushButton("Show the signal ± 5 s")
        self.acknowledge = QPushButton("Acknowledge")
        self.acknowledge.setToolTip("It is read: shown in one line until it is over")
        self.clear.clicked.connect(self.cleared)
        self.show_signal.clicked.connect(self.signal)
        self.acknowledge.clicked.connect(self.acknowledged)
        buttons = QHBoxLayout()
        buttons.setSpacing(6)
        for button in (self.clear, self.show_signal, self.acknowledge):
            buttons.addWidget(button)
        buttons.addStretch(0)
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._row.setContentsMargins(9, 5, 8, 5)
        self._row.setSpacing(6)
        self._row.addLayout(said, 1)
        self._row.addLayout(buttons)
        theme.changed.connect(self._restyle)
        self._restyle()

    def say(self, station: Station | None, one: Active, *, named: bool, is_open: bool) -> None:
        """Show this alarm; in full where it `is_open`, else what it is alone."""
        alarm = one.alarm
        self._icon.show_mark(alarm.mark)
        self._tone(alarm.mark.colour)
        line = alarm.line if is_open else alarm.brief
        headline = " · ".join(filter(None, (station.title if station and named else "", line)))
        more = [] if alarm.is_now else ["last known"]
        more += ["acknowledged"] if one.is_acknowledged else []
        headline += f" ({', '.join(more)})" if more else ""
        set_text(self.headline, headline)
        now_s = time.time() if station is None else station.robot.now_s()
        set_text(self.details, details(one, now_s) if is_open else "")
        self.details.setVisible(is_open)
        self.clear.setVisible(is_open and alarm.clears)
        self.clear.setEnabled(station is not None and station.is_linked)
        self.show_signal.setVisible(is_open and alarm.channel is not None and one.at_ns is not None)
        self.acknowledge.setVisible(
            is_open and not one.is_acknowledged and alarm.kind is not Kind.NOT_STOPPED
        )
        self.setAccessibleName(headline)
        self.setAccessibleDescription(self.details.text())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        wide = self.width() >= self._theme.px(WIDE)
        way = QBoxLayout.Direction.LeftToRight if wide else QBoxLayout.Direction.TopToBottom
        if self._row.direction() != way:
            self._row.setDirection(way)

    def _tone(self, tone: str) -> None:
        if self.property("tone") != tone:
            self.setProperty("tone", tone)
            self.style().polish(self)

    def _restyle(self) -> None:
        self.headline.setFont(self._theme.text_font(bold=True))
        colours = self._theme.colours
        self.setStyleSheet(
            f"QFrame#alarm {{ background: {colours.card}; border: 1px solid {colours.border}; "
            f"border-left: 4px solid {colours.warn}; border-radius: 4px; }}"
            f'QFrame#alarm[tone="bad"] {{ border-color: {colours.bad}; }}'
            f'QFrame#alarm[tone="dim"], QFrame#alarm[tone="old"] {{ border-left-color: {colours.dim}; }}'
            f"QFrame#alarm:focus {{ border-color: {colours.accent}; }}"
        )


class AlarmStrip(QWidget):
    """No height while nothing is wrong.

    `cleared` asks for a reset of a station's fault; `shown` brings a station, a channel and an instant on the
    axis of its signals (ns).
    """

    cleared = Signal(object)
    shown = Signal(object, str, object)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._open: tuple[str, tuple[Kind, str]] | None = None  # the one that was chosen
        self._all = False
        self._told: tuple[Told, ...] = ()
        self.rows: list[AlarmRow] = []
        self.setAccessibleName("Active alarms")
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(8, 6, 8, 0)
        self._column.setSpacing(4)
        self.more = QPushButton()
        self.more.clicked.connect(self._toggle)
        self._column.addWidget(self.more, 0, Qt.AlignmentFlag.AlignLeft)
        self.hide()

    @property
    def texts(self) -> list[str]:
        """What each row says, in full."""
        return [
            "\n".join(filter(None, (row.headline.text(), row.details.text())))
            for row in self.rows
            if not row.isHidden()
        ]

    def refresh(self) -> None:
        """Show what is wrong now."""
        told = self._told = tuple(self._active())
        shown = told if self._all else told[:MOST]
        while len(self.rows) < len(shown):
            self._add_row()
        opened = self._opened(shown)
        for place, row in enumerate(self.rows):
            row.setVisible(place < len(shown))
            if place < len(shown):
                station, one = shown[place]
                row.say(station, one, named=len(self._desk.stations) > 1, is_open=place == opened)
        hidden = len(told) - MOST
        self.more.setVisible(hidden > 0)
        set_button(self.more, "Show fewer alarms" if self._all else f"Show {hidden} more alarms")
        self.setVisible(bool(told))

    def _active(self) -> list[Told]:
        """Of all robots and the recording; of the one that is looked at first, where they are as bad."""
        selected = self._desk.selected
        found: list[Told] = [(None, one) for one in self._desk.recording.alarms.active]
        found += [(station, one) for station in self._desk.stations for one in station.alarms.active]
        places = {kind: place for place, kind in enumerate(Kind)}
        return sorted(
            found,
            key=lambda told: (
                told[1].is_acknowledged,
                told[1].alarm.kind is not Kind.NOT_STOPPED,
                told[0] is not None and told[0] is not selected,
                places[told[1].alarm.kind],
                told[1].since_s,
            ),
        )

    def _opened(self, shown: tuple[Told, ...]) -> int:
        """Which row is shown in full: the chosen one, else the worst."""
        keys = [_key(told) for told in shown]
        if self._open in keys:
            return keys.index(self._open)
        return 0 if shown and not shown[0][1].is_acknowledged else -1

    def _add_row(self) -> None:
        row, place = AlarmRow(self._theme), len(self.rows)
        row.chosen.connect(lambda: self._choose(place))
        row.cleared.connect(lambda: self.cleared.emit(self._told[place][0]))
        row.signal.connect(lambda: self._show(place))
        row.acknowledged.connect(lambda: self._acknowledge(place))
        self.rows.append(row)
        self._column.insertWidget(place, row)

    def _choose(self, place: int) -> None:
        chosen = _key(self._told[place])
        self._open = None if self._open == chosen else chosen
        self.refresh()

    def _show(self, place: int) -> None:
        station, one = self._told[place]
        if station is not None and one.alarm.channel is not None and one.at_ns is not None:
            self.shown.emit(station, one.alarm.channel, one.at_ns)

    def _acknowledge(self, place: int) -> None:
        station, one = self._told[place]
        (self._desk.recording if station is None else station).alarms.acknowledge(one.alarm.key)
        if station is not None and one.alarm.kind is Kind.RESET:
            station.stopping.was_ended = False
        self._open = None
        self.refresh()

    def _toggle(self) -> None:
        self._all = not self._all
        self.refresh()


def _key(told: Told) -> tuple[str, tuple[Kind, str]]:
    station, one = told
    return "" if station is None else station.name, one.alarm.key


def details(one: Active, now_s: float) -> str:
    """Since when (UTC), what the robot did, and what to check."""
    alarm = one.alarm
    since = datetime.datetime.fromtimestamp(one.since_s, datetime.UTC).astimezone()
    for_s = max(0.0, now_s - one.since_s)
    lines = [f"since {since:%H:%M:%S}, for {lasting(for_s)}"]
    lines += [f"robot: {alarm.did}"] if alarm.did else []
    lines += [f"→ {alarm.check}"] if alarm.check else []
    return "\n".join((" · ".join(lines[:2]), *lines[2:]))


def lasting(for_s: float) -> str:
    """A time that grows, in whole seconds as long as these matter."""
    return f"{for_s:.0f} s" if for_s < 120 else age_text(for_s)


def set_button(button: QPushButton, text: str) -> None:
    """Change a button only where it says something else."""
    if button.text() != text:
        button.setText(text)
