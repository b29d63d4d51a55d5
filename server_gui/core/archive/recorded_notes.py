"""Notes on the time axis of a recording that is played: short labels of its session."""

from collections.abc import Sequence
from typing import Final

from ml.store.labels import counts
from server_gui.core.archive.labelling import span
from server_gui.core.archive.labels import SessionLabels
from server_gui.core.archive.playback import Playback, PlayedRobot
from server_gui.core.desk.flags import Flag, FlagKind

NOTE_NS: Final = 1_000_000  # a label has a length
NOTE: Final = "note: "


class RecordedNotes:
    """Notes on the recording in `playback`; they are withdrawn as labels are."""

    def __init__(self, playback: Playback, labels: SessionLabels) -> None:
        self._playback = playback
        self._labels = labels

    @property
    def problem(self) -> str:
        """Why no note can be kept now; empty where one can."""
        return "" if self._behind_ns() is not None else "no row is shown yet"

    def add(self, text: str, at_ns: int) -> None:
        """Label the instant `at_ns` of the robot's clock; what counts as a label is marked as a note."""
        behind_ns, session = self._behind_ns(), self._labels.session
        if behind_ns is None:
            return
        began_ns = at_ns - behind_ns
        ends_ns = began_ns + NOTE_NS if session is None else span(session)[1]
        if began_ns <= ends_ns < began_ns + NOTE_NS:  # the last row: the note ends with its session
            began_ns = ends_ns - NOTE_NS
        self._labels.add(f"{NOTE}{text}" if counts(text) else text, began_ns, began_ns + NOTE_NS)

    def flags(self) -> Sequence[Flag]:
        """Return every note of the session."""
        behind_ns = self._behind_ns()
        short = (one for one in self._labels.labels if one.ended_utc_ns - one.began_utc_ns <= NOTE_NS)
        if behind_ns is None:
            return ()
        return [Flag(one.began_utc_ns + behind_ns, one.label, FlagKind.MARK) for one in short]

    def _behind_ns(self) -> int | None:
        """Return the robot's clock minus UTC, at the newest shown row."""
        station = self._playback.desk.selected
        robot = None if station is None else station.robot
        if not isinstance(robot, PlayedRobot) or robot.row_ns is None or robot.stamp_ns is None:
            return None
        return robot.stamp_ns - robot.row_ns
