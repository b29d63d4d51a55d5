"""Always in sight: robot, drives, status, link, warnings, what became of a STOP, and STOP itself."""

from collections.abc import Callable
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.stop import StopState
from server_gui.views.marks import Mark, age_text, drives_mark
from server_gui.views.predictions import status
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.stop_button import StopButton

STOP_MARKS: Final = {
    StopState.SENT: Mark("half", "warn", "sent"),
    StopState.CONFIRMED: Mark("disc", "good", "confirmed"),
    StopState.NOT_CONFIRMED: Mark("square", "bad", "NOT CONFIRMED"),
}
Words = tuple[Mark, str, str]


class Chip(QFrame):
    """A mark, what it means, and a line of detail."""

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self.setObjectName("card")
        self.setAccessibleName(name)
        self._icon = MarkIcon(theme, 12)
        self._main, self._detail = ElidedLabel("title"), ElidedLabel("dim")
        words = QVBoxLayout()
        words.setSpacing(0)
        words.addWidget(self._main)
        words.addWidget(self._detail)
        row = QHBoxLayout(self)
        row.setContentsMargins(9, 3, 11, 3)
        row.addWidget(self._icon)
        row.addLayout(words)

    @property
    def main_text(self) -> str:
        return self._main.text()

    def show_words(self, mark: Mark, main: str, detail: str) -> None:
        self._icon.show_mark(mark)
        set_text(self._main, main)
        set_text(self._detail, detail)
        set_tip(self, f"{main}\n{detail}")


class Header(QWidget):
    """`stopped` asks for a STOP of the robot that is looked at, `reset` to end one that is held."""

    stopped = Signal()
    reset = Signal()

    def __init__(self, desk: Desk, theme: Theme, menu: QPushButton) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._is_short = False
        self.setObjectName("header")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._brand = PlainLabel("GWRMS")
        self._brand.setObjectName("brand")
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 5, 12, 5)
        row.setSpacing(8)
        row.addWidget(self._brand)
        names = (("robot", 3), ("drives", 3), ("status", 3), ("link", 4), ("warnings", 4))
        self._chips = {name: Chip(theme, name) for name, _ in names}
        for name, share in names:
            row.addWidget(self._chips[name], share)
        self._outcome = Chip(theme, "what became of the STOP")
        row.addWidget(self._outcome, 4)
        self.reset_button = QPushButton("Reset stop…")
        self.reset_button.setToolTip("Ends a held stop. Every drive stays switched off: nothing is enabled.")
        self.reset_button.clicked.connect(self.reset)
        row.addWidget(self.reset_button)
        self.menu = menu
        row.addWidget(menu)
        self.stop = StopButton()
        self.stop.stopped.connect(self.stopped)
        row.addWidget(self.stop)
        theme.changed.connect(self._restyle)
        self._restyle()

    @property
    def outcome_text(self) -> str:
        """What became of the STOP, as it is shown; empty while nothing is."""
        return self._outcome.main_text if self._outcome.isVisible() else ""

    def be_short(self, is_short: bool) -> None:
        """Leave out what stands elsewhere too, where there is little room: STOP names the robot."""
        self._is_short = is_short
        self._brand.setVisible(not is_short)

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        for name, words in _WORDS.items():
            self._chips[name].setVisible(station is not None and not (self._is_short and name == "robot"))
            if station is not None:
                self._chips[name].show_words(*words(station))
        self._refresh_stop(station)

    def _refresh_stop(self, station: Station | None) -> None:
        set_text_of_button(self.stop, "STOP" if station is None else f"STOP  {station.title}")
        self.stop.setEnabled(station is not None)
        stopping = None if station is None else station.stopping
        shown = stopping is not None and (stopping.state is not StopState.IDLE or stopping.held)
        self._outcome.setVisible(shown)
        self.reset_button.setVisible(stopping is not None and stopping.held)
        self._chips["warnings"].setVisible(station is not None and not shown)
        self._chips["link"].setVisible(station is not None and not (shown and self._is_short))
        if shown and stopping is not None:
            mark = STOP_MARKS.get(stopping.state, Mark("triangle", "warn", "held"))
            main = "STOP held" if stopping.state is StopState.IDLE else f"STOP {stopping.state.value}"
            detail = stopping.text or "until it is reset"
            self._outcome.show_words(mark, main, detail)

    def _restyle(self) -> None:
        self.stop.setFont(self._theme.text_font(1.45, bold=True))
        self._brand.setFont(self._theme.text_font(1.5, bold=True))
        self.stop.setMinimumWidth(self._theme.px(150))
        bold = QFontMetrics(self._theme.text_font(bold=True))
        longest = max(bold.horizontalAdvance(f"STOP {state.value}") for state in StopState)
        self._outcome.setMinimumWidth(longest + self._theme.px(12) + 40)  # of this no word may be missing


def set_text_of_button(button: QPushButton, text: str) -> None:
    """Change a button only where it says something else."""
    if button.text() != text:
        button.setText(text)


def _robot(station: Station) -> Words:
    description = station.robot.description
    role = "" if description is None else f" · {description.role}"
    return Mark("diamond", "accent"), station.title, f"{station.address}{role}"


def _drives(station: Station) -> Words:
    joints = station.robot.names("joint")
    if not station.is_live:
        return Mark("ring", "old"), "Drives not known now", f"–/{len(joints)} enabled · CiA 402"
    mark = drives_mark(station.robot)
    enabled = sum(station.robot.word(f"{joint}.state") == "operation enabled" for joint in joints)
    return mark, mark.word.capitalize(), f"{enabled}/{len(joints)} enabled · CiA 402"


def _status(station: Station) -> Words:
    if not station.is_live:
        return Mark("ring", "old"), "Status not known", "no live data"
    line = status(station)
    if line is not None:
        return line.mark, line.text, line.detail
    gait, why = station.processing.derived().gait, f"by steps; not predicted: {station.predictions.problem}"
    if not gait.walking:
        return Mark("ring", "dim"), "Not walking", why
    cadence = "–" if gait.cadence_spm is None else f"{gait.cadence_spm:.0f}"
    return Mark("diamond", "accent"), f"Walking  {cadence} steps/min", why


def _link(station: Station) -> Words:
    robot, link = station.robot, station.robot.link
    age = age_text(robot.age_s())
    if not station.is_linked:
        return Mark("cross", "bad"), f"No link · {age} old", link.problem or link.state.value
    lost = link.missed + link.dropped
    trip = "–" if link.round_trip_ns is None else f"{link.round_trip_ns / 1e6:.1f} ms"
    detail = f"round trip {trip} · {lost} lost · {link.links} links"
    if robot.is_stale():
        return Mark("triangle", "warn"), f"STALE · {age} old", detail
    return Mark("disc", "warn" if lost else "good"), f"{age} old · {robot.rate_hz():.0f} Hz", detail


def _warnings(station: Station) -> Words:
    bad = station.robot.not_ok()
    if not station.is_live or not station.robot.parts:
        before = (
            f"before: {'; '.join(f'{part.name} {part.state}' for part in bad)}" if bad else "no live data"
        )
        return Mark("ring", "old"), "Warnings not known", before
    if not bad:
        return Mark("disc", "good"), "No warnings", "every component is ok"
    said = "; ".join(f"{part.name} {part.state}: {part.problem or 'no reason known'}" for part in bad)
    word = "1 warning" if len(bad) == 1 else f"{len(bad)} warnings"
    return Mark("triangle", "warn"), word, said


_WORDS: Final[dict[str, Callable[[Station], Words]]] = {
    "robot": _robot,
    "drives": _drives,
    "status": _status,
    "link": _link,
    "warnings": _warnings,
}
