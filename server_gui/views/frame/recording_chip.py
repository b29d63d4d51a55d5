"""The recording in the header: whether it goes on, for how long and as what; start and stop."""

import time
from collections.abc import Callable
from typing import Final

from PySide6.QtWidgets import QLineEdit, QPushButton, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import Recording, Said, Tone
from server_gui.views.confirmation import ask
from server_gui.views.frame.chip import Chip, Words
from server_gui.views.marks import Mark
from server_gui.views.recordings.timeline import clock_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import set_tip

NAME: Final = "recording"
TONES: Final = {
    Tone.GOOD: Mark("disc", "good", "recording"),
    Tone.WARNING: Mark("triangle", "warn", "recording, with a warning"),
    Tone.BAD: Mark("square", "bad", "not recording"),
    Tone.OFF: Mark("ring", "dim", "not recording"),
}


class RecordingChip(Chip):
    """Recording of the shown robot; start and stop are for all that this window records."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        self.turn = QPushButton("Stop")
        self.turn.setAccessibleName("Stop recording")
        super().__init__(theme, NAME, self.turn)
        self._desk = desk
        self.turn.clicked.connect(lambda: ask_recording(self.window(), desk.recording))

    def refresh(self) -> None:
        """Show how it is now."""
        recording, station = self._desk.recording, self._desk.selected
        address = None if station is None else station.address
        said = recording.said(address, is_live=station is None or station.is_live)
        self.say(_words(recording, said, address))
        text = "Start…" if recording.is_paused else "Stop…"
        if self.turn.text() != text:
            self.turn.setText(text)
            self.turn.setAccessibleName(f"{text.rstrip('…')} recording")
        self.offer(recording.can_pause)
        set_tip(self.turn, "Of every robot of this window (Ctrl+R)")


def ask_recording(parent: QWidget, recording: Recording) -> None:
    """Ask for its name and begin it, or ask whether it is to end."""
    if not recording.can_pause:
        return
    if recording.is_paused:
        ask_name(parent, recording.go_on, recording.wearer)
        return
    ask(parent, "Stop recording", stop_question(recording), "Stop recording", recording.pause)


def stop_question(recording: Recording) -> str:
    """Return what is asked before it ends."""
    return (
        f"Stop {_named(recording)}?\n\nRobots are shown as before, and their journals are "
        "still kept; nothing else that they send is kept until you start recording again."
    )


def _named(recording: Recording) -> str:
    """Return what would be stopped: each recording's name, how long it is by now, and of which robot."""
    report, now_s = recording.report, time.time()
    links = {} if report is None else {name: one for name, one in report.robots.items() if one.session}
    told = []
    for robot, link in links.items():
        name = f"“{link.notes}”" if link.notes else "the recording"
        since_s = link.recording_since_utc_s
        length = "" if since_s is None else f", {clock_text(max(0.0, now_s - since_s))},"
        told.append(f"{name}{length} of {robot}")
    return " and ".join(told) or "recording every robot of this window"


def ask_name(parent: QWidget, begin: Callable[[str, str], None], worn_by: str = "") -> None:
    """Ask what a recording is called and whose walk it is of, and begin it; `worn_by`: who it was last."""
    name, wearer = QLineEdit(), QLineEdit(worn_by)
    name.setPlaceholderText("What it is of: trial, settings")
    name.setAccessibleName("Name of the recording")
    wearer.setPlaceholderText("Who wears the robot: a pseudonym, such as P01")
    wearer.setAccessibleName("Wearer")
    text = (
        "A recording of every robot of this window begins. Its name stands among its notes. Where the wearer "
        "is named, the window can learn from the walk."
    )
    question = ask(
        parent,
        "Start recording",
        text,
        "Start",
        lambda: begin(name.text().strip(), wearer.text().strip()),
        field=name,
    )
    if question.field is name:  # else it is asked already
        question.add(wearer)
        wearer.selectAll()  # who types another one does not add to the last


def _words(recording: Recording, said: Said, address: str | None) -> Words:
    link, mark = recording.link(address), TONES[said.tone]
    first, *rest = said.text.split(" · ")
    since_s = None if link is None else link.recording_since_utc_s
    tip = "\n".join(filter(None, (said.text, said.detail)))
    is_off = said.tone in (Tone.BAD, Tone.OFF)
    said_of = tuple(filter(None, (*rest,) if is_off and rest else (said.reason, *rest)))
    if is_off or since_s is None:
        aside = said.reason or next(iter(said_of), "")
        return Words(mark, first, said_of, tip, brief=(said.brief,), aside=aside)
    clock = clock_text(max(0.0, time.time() - since_s))
    parts = (said_of[0], link.notes) if link is not None and link.notes else said_of
    return Words(mark, f"{first} {clock}", parts, tip, brief=(f"{said.brief} {clock}", *parts[:1]))
