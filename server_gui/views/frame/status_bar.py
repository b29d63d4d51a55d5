"""The last line: the robot's computer and bus, who uses most of it, what is recorded, what STOP is not."""

import re
from typing import Final

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QApplication, QStatusBar

from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.severity import bus_level, worsened_by
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.desk.busiest import busiest
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import LATE, NOTHING, Tone
from server_gui.core.desk.station import Station
from server_gui.core.processing.bus_health import ORDER, UNKNOWN, BusHealthLevel, load_text, seen, worst
from server_gui.views.frame.recording_chip import TONES
from server_gui.views.resources.bus_card import LEVELS, shown_mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_tone
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel

GAP: Final = 8  # between two facts, at text of 100 %
FRAMES_HINT: Final = (
    "Frames that this window draws a second; while this computer is busy, what is shown is late"
)
FULL: Final = ("▲ this computer is busy", "▲ busy")
LEAST_OF_STOP: Final = "F12: not an emergency stop"  # what it is not goes last of all
STOP: Final = (
    "STOP: F12 or Ctrl+Space · software, not a safety-rated emergency stop",
    "F12: software stop, not an emergency stop",
    LEAST_OF_STOP,
)
STOPS: Final = (  # while a robot is being commissioned
    "F12 or Ctrl+Space stops {whom} · software, not a safety-rated emergency stop",
    "F12 stops {whom}: software, not an emergency stop",
    "F12: software stop, not an emergency stop",
    LEAST_OF_STOP,
)


class StopWords(ShrinkingLabel):
    """It asks for as much room as its fullest wording that `hold` has room for, and so does not give way."""

    def __init__(self) -> None:
        super().__init__()
        self._room = 0
        self.say(*STOP)

    def hold(self, room: int) -> None:
        """Take up to this much room, before all that is beside it."""
        if room != self._room:
            self._room = room
            self.updateGeometry()

    def minimumSizeHint(self) -> QSize:
        wide = [self._width(words) for words in self._wordings]
        return self._size(next((one for one in wide[1:] if one <= self._room), wide[-1]))


class StatusBar(QStatusBar):
    """One line."""

    def __init__(self, desk: Desk, theme: Theme, commissioning: Commissioning | None = None) -> None:
        super().__init__()
        self._desk, self._commissioning = desk, commissioning
        self.computer, self.bus, self.recording = ShrinkingLabel(), ShrinkingLabel(), ShrinkingLabel()
        self._window = ShrinkingLabel()
        self._theme = theme
        self._icon, self._bus_icon = MarkIcon(theme, 11), MarkIcon(theme, 11)
        self.stop = StopWords()
        self.stop.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.addWidget(self.computer)
        self.addWidget(self._bus_icon)
        self.addWidget(self.bus)
        self.addWidget(self._icon)
        self.addWidget(self.recording)
        self.addWidget(self.stop, 1)
        self.addPermanentWidget(self._window)
        self.setSizeGripEnabled(False)
        theme.changed.connect(self._restyle)

    def _restyle(self) -> None:
        """As high as its words at once: else what is around is laid out twice."""
        for label in (self.computer, self.bus, self.recording, self.stop, self._window):
            label.ensurePolished()
        QApplication.sendPostedEvents(self, QEvent.Type.LayoutRequest)

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        self.computer.say(*(("no robot", "") if station is None else _computer(station)))
        mark, words = (LEVELS[BusHealthLevel.UNKNOWN], ("",)) if station is None else _bus(station)
        self._bus_icon.show_mark(mark)
        self._bus_icon.setVisible(station is not None)
        self.bus.say(*dict.fromkeys((*words, re.split("[,:]", words[-1])[0])))
        set_tip(self.bus, words[0])
        self._refresh_recording(station)
        frames = self._desk.frames
        known, is_busy = frames.per_second, frames.is_slow() if station is None else station.is_full()
        rate = "– fps" if known is None else f"{known:.0f} fps" if known >= 1.0 else "<1 fps"
        self._window.say(*(*(f"{busy} · {rate}" for busy in FULL), f"▲ {rate}") if is_busy else (rate,))
        set_tone(self._window, "warn" if is_busy else "")
        set_tip(self._window, FRAMES_HINT)
        self.stop.say(*self._stop_words(station))
        self._hold_stop()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._hold_stop()

    def _hold_stop(self) -> None:
        """Let what the key is not go last, after all that stands beside it."""
        beside = (self.computer, self._bus_icon, self.bus, self._icon, self.recording, self._window)
        seen = [part.minimumSizeHint().width() for part in beside if not part.isHidden()]
        self.stop.hold(self.width() - sum(seen) - (len(seen) + 2) * self._theme.px(GAP))

    def _stop_words(self, station: Station | None) -> tuple[str, ...]:
        """Return what the key stops, the fullest wording first."""
        commissioning = self._commissioning
        if commissioning is None or not commissioning.runs:
            return STOP
        whom = " and ".join(filter(None, ("" if station is None else station.title, commissioning.name)))
        return tuple(words.format(whom=whom) for words in STOPS)

    def _refresh_recording(self, station: Station | None) -> None:
        address, is_live = (None, False) if station is None else (station.address, station.is_live)
        said = self._desk.recording.said(address, is_live=is_live)
        self._icon.show_mark(TONES[said.tone])
        first = said.detail.partition("\n")[0]
        wrong = said.tone in (Tone.WARNING, Tone.BAD) and first
        short = " · ".join(filter(None, (said.text.partition(" · ")[0], said.reason)))
        wordings: tuple[str, ...] = (f"{said.text}: {first}" if wrong else said.text, said.text, short)
        if said.tone is Tone.BAD:  # as before, but never without the reason
            wordings = (wordings[0], short, f"{said.brief} · {said.reason}")
        if said.tone in (Tone.GOOD, Tone.OFF):
            wordings = (*wordings, said.brief)
        if NOTHING in said.text.split(" · "):  # why it is no good, before that it goes on
            brief = " · ".join(filter(None, (NOTHING, said.reason)))
            wordings = (*wordings[:2], f"{short}: {NOTHING}", brief)
        if first == LATE:
            wordings = (LATE.capitalize(), said.text)
        self.recording.say(*dict.fromkeys(wordings))
        set_tip(self.recording, said.detail)


def _bus(station: Station) -> tuple[Mark, tuple[str, ...]]:
    """Return the worst bus; where nothing new comes from the robot, none is known to be good."""
    level, words = worst(station.robot)
    marks = {}
    for bus in seen(station.robot) or ():
        cause = worsened_by(level, bus.name, station.alarms)
        level = max(level, bus_level(level, bus.name, station.alarms), key=ORDER.index)
        marks[bus.name] = shown_mark(level, bus.name, station.alarms, live=station.is_live)
        if cause is not None:  # its mark is of this, not of what is less bad
            load = load_text(bus)
            words = tuple(
                f"CAN {name}{load}: {cause.mark.word}{whom}"
                for name, whom in ((f"{bus.name} ", f" {cause.spoken}"), ("", f" {cause.spoken}"), ("", ""))
            )
    if not station.is_live and level is not BusHealthLevel.ALARM:
        return LEVELS[BusHealthLevel.UNKNOWN], (UNKNOWN, "CAN –")
    told = (mark for mark in marks.values() if mark.colour == LEVELS[level].colour and mark != LEVELS[level])
    return next(told, LEVELS[level]), words


def _computer(station: Station) -> tuple[str, ...]:
    """CPU and memory of the robot's computer, and who uses most; the fullest wording first."""
    seen = station.robot.resources
    if seen is None or not station.is_live:
        return "robot CPU – · memory –", "robot CPU –", "CPU –"
    share = "–" if not seen.memory.total else f"{100 * seen.memory.used / seen.memory.total:.0f} %"
    cpu = "–" if seen.cpu.percent is None else f"{seen.cpu.percent:.0f} %"
    most = busiest(station)
    short = f"robot CPU {cpu} · memory {share}"
    full = () if most is None else (f"{short} · most: {most.name} {most.percent:.0f} % of a core",)
    return *full, short, f"robot CPU {cpu}", f"CPU {cpu}"
