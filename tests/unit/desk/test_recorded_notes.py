"""Notes on a recording that is played: short labels of its session, on the robot's clock."""

from typing import cast

from ml.store.labels import Label
from server_gui.core.archive.labels import SessionLabels
from server_gui.core.archive.playback import Playback, PlayedRobot
from server_gui.core.archive.recorded_notes import NOTE_NS, RecordedNotes
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.flags import Flag, FlagKind
from tests.support.desk import Bench

UTC_NS, STAMP_NS = 1_700_000_000_000_000_000, 5_000_000_000


class Labels:
    """Those of a session, and what was added."""

    def __init__(self) -> None:
        self.added: list[tuple[str, int, int]] = []
        self.labels: tuple[Label, ...] = ()

    def add(self, text: str, began_ns: int, ended_ns: int) -> None:
        self.added.append((text, began_ns, ended_ns))


class Played:
    """A playback of a desk."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk


def test_a_note_is_a_short_label_and_is_shown_where_it_was() -> None:
    bench, labels = Bench(Desk()), Labels()
    notes = RecordedNotes(cast("Playback", Played(bench.desk)), cast("SessionLabels", labels))
    assert notes.problem, "there is no recording yet"
    notes.add("nowhere", 0)
    assert labels.added == []
    bench.add("exo-01").robot = PlayedRobot(row_ns=UTC_NS, stamp_ns=STAMP_NS)
    assert notes.problem == ""
    notes.add("slipped", STAMP_NS - 1_000_000)
    assert labels.added == [("slipped", UTC_NS - 1_000_000, UTC_NS - 1_000_000 + NOTE_NS)]
    begun, ended = UTC_NS - 3_000_000_000, UTC_NS
    labels.labels = (
        Label("exo-01", "s", begun, begun + NOTE_NS, "slipped", "somebody"),
        Label("exo-01", "s", begun, ended, "walk", "somebody"),
    )
    assert notes.flags() == [Flag(STAMP_NS - 3_000_000_000, "slipped", FlagKind.MARK)]
