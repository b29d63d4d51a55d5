"""The status bar: where data come from and how well, what is recorded, what STOP is not."""

import collections
import time
from typing import Final

from PySide6.QtWidgets import QStatusBar

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import Tone
from server_gui.core.desk.station import Station
from server_gui.views.marks import Mark, age_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip

FRAMES: Final = 60
TONES: Final = {
    Tone.GOOD: Mark("disc", "good", "recording"),
    Tone.WARNING: Mark("triangle", "warn", "recording, with a warning"),
    Tone.BAD: Mark("square", "bad", "not recording"),
    Tone.OFF: Mark("ring", "dim", "not recording"),
}


class StatusBar(QStatusBar):
    """One line."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._frames: collections.deque[float] = collections.deque(maxlen=FRAMES)
        self._link, self.recording, self._window = ElidedLabel(), ElidedLabel(), PlainLabel()
        self._icon = MarkIcon(theme, 11)
        stop = ElidedLabel()
        stop.setText("STOP: F12 or Ctrl+Space · software, not a safety-rated emergency stop")
        self.addWidget(self._link, 5)
        self.addWidget(self._icon)
        self.addWidget(self.recording, 5)
        self.addWidget(stop, 4)
        self.addPermanentWidget(self._window)
        self.setSizeGripEnabled(False)

    def frame(self) -> None:
        """Count a frame that was drawn."""
        self._frames.append(time.monotonic())

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        set_text(self._link, "no robot" if station is None else _line(station))
        self._refresh_recording(None if station is None else station.address)
        set_text(self._window, f"{self._rate():.0f} frames/s")

    def _refresh_recording(self, address: str | None) -> None:
        said = self._desk.recording.said(address)
        self._icon.show_mark(TONES[said.tone])
        first = said.detail.partition("\n")[0]
        wrong = said.tone in (Tone.WARNING, Tone.BAD) and first
        set_text(self.recording, f"{said.text}: {first}" if wrong else said.text)
        set_tip(self.recording, said.detail)

    def _rate(self) -> float:
        if len(self._frames) < 2:
            return 0.0
        return (len(self._frames) - 1) / max(self._frames[-1] - self._frames[0], 1e-6)


def _line(station: Station) -> str:
    robot, link = station.robot, station.robot.link
    trip = "–" if link.round_trip_ns is None else f"{link.round_trip_ns / 1e6:.1f} ms"
    return (
        f"{station.title}  {station.address}  {link.state.value} · round trip {trip} · "
        f"{robot.rate_hz():.0f} rows/s · data {age_text(robot.age_s())} old · "
        f"{link.missed + link.dropped} lost"
    )
