"""Notes on the time axis: kept where marks of a recording are kept, and nowhere else."""

from collections.abc import Sequence
from typing import Final, Protocol

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.flags import Flag

LONGEST_NOTE: Final = 100  # letters


class Notes(Protocol):
    """Takes notes of instants on the clock of the robot that is looked at."""

    @property
    def problem(self) -> str:
        """Why no note can be kept now; empty where one can."""
        ...

    def add(self, text: str, at_ns: int) -> None:
        """Keep a note; what came of it is told where marks are told."""
        ...

    def flags(self) -> Sequence[Flag]:
        """Return those that are no flags of the robot anyway."""
        ...


class LiveNotes:
    """Marks in the recordings that go on."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk

    @property
    def problem(self) -> str:
        recording = self._desk.recording
        if recording.is_paused:
            return "nothing is recorded: it was stopped here"
        return (
            ""
            if recording.can_ask
            else f"nobody records: {recording.why or recording.problem or 'not known why'}"
        )

    def add(self, text: str, at_ns: int) -> None:
        station = self._desk.selected
        if station is not None and station.rings.newest_ns is not None:
            behind_s = (station.rings.newest_ns - at_ns) / 1e9
            ago_s = behind_s + (station.robot.age_s() or 0.0)
            self._desk.recording.mark(text, ago_s if behind_s > 0 else 0.0)

    def flags(self) -> Sequence[Flag]:
        return ()
