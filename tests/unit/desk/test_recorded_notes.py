"""Notes on a recording that is played: short labels of its session, on the robot's clock."""

from datetime import UTC, datetime, timedelta
from typing import cast

from ml.store.labels import Label
from ml.store.sessions import Session
from server_gui.core.archive.labelling import check
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
        self.session: Session | None = None

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


def test_a_note_of_a_word_that_models_learn_from_stays_a_note() -> None:
    bench, labels = Bench(Desk()), Labels()
    notes = RecordedNotes(cast("Playback", Played(bench.desk)), cast("SessionLabels", labels))
    bench.add("exo-01").robot = PlayedRobot(row_ns=UTC_NS, stamp_ns=STAMP_NS)
    for text in ("fall", "left_heel_strike", "wearer Anna", "regression set", "fell"):
        notes.add(text, STAMP_NS)
    assert [text for text, _, _ in labels.added] == [
        "note: fall", "note: left_heel_strike", "note: wearer Anna", "note: regression set", "fell",
    ]  # fmt: skip


def test_a_note_at_the_last_row_ends_with_its_session() -> None:
    bench, labels = Bench(Desk()), Labels()
    notes = RecordedNotes(cast("Playback", Played(bench.desk)), cast("SessionLabels", labels))
    bench.add("exo-01").robot = PlayedRobot(row_ns=UTC_NS, stamp_ns=STAMP_NS)
    last = datetime.fromtimestamp(UTC_NS // 10**9, UTC)
    labels.session = Session("exo-01", "s", last - timedelta(hours=1), ended=last)
    notes.add("stops here", STAMP_NS)
    ((_, begun_ns, ended_ns),) = labels.added
    check([Label("exo-01", "s", begun_ns, ended_ns, "stops here", "somebody")], [], labels.session)
