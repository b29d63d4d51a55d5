"""A simulated walk in which a gain is made worse, followed as a desk follows a robot."""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import pytest
from msgspec.structs import replace

from gateway.wire.control import JournalEntries
from server_gui.core.evidence.comparison import Word
from server_gui.core.evidence.edits import EditState
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.evidence.robot_evidence import MISSED, OUTSIDE, Recorded, RobotEvidence
from server_gui.core.follow.events import Described, Event, Journalled, Telemetry, replaced
from tests.support.desk import described
from tests.unit.evidence.synthetic import cycles
from tests.unit.evidence.walks import GAIN, Edit, entry, telemetry, walk

WORSE = Edit(18.0, f"left_knee.{GAIN}", 2200.0)
DIFFER = (Word.BETTER, Word.WORSE, Word.CHANGED)
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def events() -> list[Event]:
    """What the robot's feed tells: 36 s of walking, left to themselves but for one edit."""
    return list(walk(36.0, seed=7, person=2, edits=[WORSE]))


def followed(
    events: Iterable[Event | Recorded], robot: RobotEvidence | None = None
) -> dict[int, EditEvidence]:
    """Return what is known in the end, by write."""
    robot = robot or RobotEvidence("exo-01")
    told = [one for event in events for one in robot.take(event)]
    return {one.edit.write: one for one in (*told, *robot.end())}


@pytest.fixture(scope="module")
def worse(events: list[Event]) -> EditEvidence:
    """What is known of the edit where nothing is amiss."""
    return followed(events)[WORSE.write]


def words(told: EditEvidence) -> dict[str, Word]:
    return {one.series: one.word for one in told.evidence.metrics}


def changed(events: Sequence[Event], change: Callable[[Telemetry], Event | None]) -> list[Event]:
    """The same, with other telemetry; None: it never came."""
    made = [change(event) if isinstance(event, Telemetry) else event for event in events]
    return [event for event in made if event is not None]


def test_a_worse_gain_is_seen_at_its_joint_and_at_no_other(worse: EditEvidence) -> None:
    assert words(worse)["left_knee.error_rms"] is Word.WORSE
    assert [one for one, word in words(worse).items() if word in DIFFER and "left_knee" not in one] == []
    assert worse.evidence.strongest.startswith("left_knee.")
    assert worse.edit.state is EditState.KEPT
    assert worse.evidence.notes == ()


def test_evidence_grows_while_a_trial_counts_down(events: list[Event]) -> None:
    robot, seen = RobotEvidence("exo-01"), []
    for number, event in enumerate(events):
        robot.take(event)
        seen += robot.look() if number % 20 == 0 else []
    of_gain = [told for told in seen if told.edit.write == WORSE.write]
    assert of_gain[0].evidence.word is Word.FEW
    assert of_gain[-1].evidence.word is Word.WORSE
    assert not any(told.is_final for told in of_gain)
    counts = [told.evidence.cycles_after for told in of_gain]
    assert counts == sorted(counts)
    assert robot.look() == []  # nothing new has come


def test_a_link_that_is_lost_in_the_middle_costs_the_cycles_it_has_cut(
    events: list[Event], worse: EditEvidence
) -> None:
    whole = worse.evidence
    lost = changed(events, lambda one: one if not 25e9 < one.batch.stamps_ns[0] < 27e9 else None)
    cut = followed(lost)[WORSE.write].evidence
    assert whole.cycles_after - 12 <= cut.cycles_after < whole.cycles_after
    assert cut.word is Word.WORSE


def test_a_drive_that_is_not_enabled_is_left_out_and_counted(events: list[Event]) -> None:
    def disabled(one: Telemetry) -> Telemetry:
        columns = one.batch.columns | {"left_knee.state": [6.0] * len(one.batch.stamps_ns)}
        return replaced(one, one.batch.stamps_ns, columns)

    evidence = followed(changed(events, disabled))[WORSE.write].evidence
    found = {one.series: one for one in evidence.metrics}
    assert found["left_knee.error_rms"].word is Word.NO_DATA
    assert found["right_knee.error_rms"].word is Word.SAME
    assert evidence.left_out["left_knee: its drive was not enabled"] > 15


def test_stale_values_are_no_values(events: list[Event]) -> None:
    """A gap in one channel costs the cycles that it lies in, not a wrong number."""

    def stale(one: Telemetry) -> Telemetry:
        if one.batch.stamps_ns[0] % (6 * SECOND) > SECOND // 2:
            return one
        empty: list[float | None] = [None] * len(one.batch.stamps_ns)
        return replaced(one, one.batch.stamps_ns, one.batch.columns | {"left_knee.following_error": empty})

    found = {one.series: one for one in followed(changed(events, stale))[WORSE.write].evidence.metrics}
    error, torque = found["left_knee.error_rms"], found["left_knee.torque_rms"]
    assert error.cycles_before < torque.cycles_before
    assert error.word in (Word.WORSE, Word.FEW)


def test_a_robot_that_starts_again_ends_what_was_followed(events: list[Event]) -> None:
    robot = RobotEvidence("exo-01")
    for event in events:
        robot.take(event)
    again = dataclasses.replace(described(), description=replace(described().description, boot_id="boot-2"))
    ended = robot.take(again)
    assert {told.edit.write for told in ended} == {WORSE.write}
    assert all(told.is_final for told in ended)
    assert robot.take(described()) == []
    assert robot.end() == []


def test_a_trial_that_nobody_follows_any_more_is_not_on_trial_for_ever(events: list[Event]) -> None:
    """The robot starts anew, or the desk ends: how the trial ended is not known, and that is what is kept."""

    def on_trial(event: Event) -> Event:
        if not isinstance(event, Journalled):
            return event
        done = {"write done": "trial begun"}
        made = [one | {"what": done.get(one["what"], one["what"])} for one in event.journal.entries]
        return Journalled(JournalEntries(made))

    told = followed(map(on_trial, events))[WORSE.write]
    assert (told.edit.state, told.is_final) == (EditState.ASKED, True)
    assert told.evidence.word is Word.WORSE


def test_what_a_missed_part_of_the_journal_told_is_compared_with_nothing(events: list[Event]) -> None:
    """The trial was taken back, or another edit was made, in entries that nobody here has seen."""
    robot = RobotEvidence("exo-01")
    seen: list[EditEvidence] = []
    for event in events:
        if isinstance(event, Journalled):
            made = [one | {"what": "trial begun"} for one in event.journal.entries if one["n"] == 2]
            robot.take(Journalled(JournalEntries([*event.journal.entries[:1], *made])))
            continue
        robot.take(event)
        if robot.newest_ns > 28 * SECOND and not seen:
            late = entry(900, robot.newest_ns, "stop", 0)
            robot.take(Journalled(JournalEntries([late])))
            seen = robot.look()
    (told,) = robot.end()
    assert told.edit.state is EditState.ASKED, "no trial is on for ever"
    assert MISSED in told.evidence.notes
    assert told.evidence.cycles_after <= 4, "from the last look at the journal on nobody knows what was held"
    assert [one.edit.state for one in seen] == [EditState.ASKED]


def test_edits_of_before_it_was_followed_are_not_judged(events: list[Event]) -> None:
    first = next(event for event in events if isinstance(event, Telemetry)).batch.stamps_ns[0]
    early = Journalled(
        JournalEntries(
            [entry(1, first - SECOND, "write", 1, {"a.b": 1.0}), entry(2, first - 1, "write done", 1)]
        )
    )
    head = [event for event in events[:200] if isinstance(event, Described | Telemetry)]
    assert followed([*head, early]) == {}


def test_the_whole_tail_again_makes_no_edit_twice(events: list[Event]) -> None:
    journals = [event for event in events if isinstance(event, Journalled)]
    assert len(followed([*events, *journals, *journals])) == 1


def test_what_models_say_now_and_then_cuts_no_walk_in_pieces(events: list[Event]) -> None:
    """Most of a stride counts; what is said of it otherwise for a moment does not."""
    robot = RobotEvidence("exo-01")
    for number, event in enumerate(events):
        robot.take(event)
        if isinstance(event, Telemetry):
            robot.label(event.batch.stamps_ns[-1], "unknown" if number % 5 == 0 else "walk")
    (told,) = robot.end()
    assert told.evidence.word is Word.WORSE
    assert "the activity changed" not in told.evidence.left_out


def test_values_that_no_joint_can_have_are_no_values(events: list[Event]) -> None:
    """Infinite currents after the edit say nothing of it; least of all that they became worse."""

    def broken(one: Telemetry) -> Telemetry:
        late = one.batch.stamps_ns[0] > WORSE.at_s * SECOND
        current: list[float | None] = [float("inf") if late else 1.0] * len(one.batch.stamps_ns)
        huge: list[float | None] = [1e200 if late else 1.0] * len(one.batch.stamps_ns)
        columns = one.batch.columns | {"right_hip.current": current, "right_hip.torque": huge}
        return replaced(one, one.batch.stamps_ns, columns)

    found = words(followed(changed(events, broken))[WORSE.write])
    assert found["right_hip.current_rms"] is Word.FEW
    assert found["right_hip.torque_rms"] is Word.FEW
    assert found["left_knee.error_rms"] is Word.WORSE


def test_an_edit_that_nobody_heard_the_end_of_cuts_the_walk_short(
    events: list[Event], worse: EditEvidence
) -> None:
    """Whether its values are in force is not known: the strides after it say nothing of the one before."""
    (told,) = (one for one in events if isinstance(one, Journalled))
    asked = entry(3, 26 * SECOND, "write", 26, {"left_knee.max_torque": 40.0})
    both = Journalled(JournalEntries([*told.journal.entries, asked]))
    evidence = followed([*events, both])[WORSE.write].evidence
    assert evidence.cycles_after < worse.evidence.cycles_after // 2 + 2
    assert "leaves fewer cycles after this one" in evidence.notes[0]


def test_a_long_trial_is_judged_by_what_was_before_it() -> None:
    robot = RobotEvidence("exo-01")
    robot.take(described())
    for second in range(0, 480, 10):  # nobody walks any more: the cycles are there already
        robot.take(telemetry(["left_hip.position"], [(second * SECOND, [0.0])]))
        if second == 0:
            robot.cycles.extend(cycles())
    assert robot.cycles[0].began_ns == 0


def test_what_went_wrong_once_does_not_end_the_evidence(events: list[Event]) -> None:
    robot = RobotEvidence("exo-01")
    for event in events[:20]:
        robot.take(event)
    again = [event for event in events if not isinstance(event, Described)]
    assert words(followed(again, robot.anew())[WORSE.write])["left_knee.error_rms"] is Word.WORSE


def test_an_edit_that_another_has_ended_costs_no_more_looks(events: list[Event]) -> None:
    robot = RobotEvidence("exo-01")
    (told,) = (one for one in events if isinstance(one, Journalled))
    after = [entry(3, 22 * SECOND, "write", 22, {"a.b": 1.0}), entry(4, 22 * SECOND, "write done", 22)]
    counted = dict.fromkeys((WORSE.write, 22), 0)
    for number, event in enumerate(events):
        robot.take(event)
        if not isinstance(event, Telemetry):
            continue
        if event.batch.stamps_ns[0] // SECOND == 22:
            robot.take(Journalled(JournalEntries([*told.journal.entries, *after])))
        for one in robot.look() if number % 10 == 0 else ():
            counted[one.edit.write] += event.batch.stamps_ns[0] > 33 * SECOND
    assert counted[WORSE.write] <= 1
    assert counted[22] >= 2


def split(events: Sequence[Event], at_s: float, *names: str) -> list[Event | Recorded]:
    """The same walk in recordings of these names, the second from a time (s) on; a third at its end."""
    first = next(
        place
        for place, event in enumerate(events)
        if isinstance(event, Telemetry) and event.batch.stamps_ns[0] >= at_s * SECOND
    )
    return [Recorded(names[0]), *events[:first], Recorded(names[1]), *events[first:]]


@pytest.mark.parametrize("at_s", [10.0, 26.0])
def test_nobody_is_compared_with_who_wears_the_robot_next(
    events: list[Event], worse: EditEvidence, at_s: float
) -> None:
    robot = RobotEvidence("exo-01")
    told = followed(split(events, at_s, "anna", "bert"), robot)[WORSE.write]
    assert robot.session_of(told.edit) == ("bert" if at_s < WORSE.at_s else "anna")
    assert OUTSIDE in told.evidence.notes
    assert (worse.evidence.word, told.evidence.word) == (Word.WORSE, Word.FEW)


def test_what_is_walked_in_no_recording_belongs_to_none(events: list[Event]) -> None:
    """Recording was stopped, somebody else put the robot on, and it was started again."""
    robot = RobotEvidence("exo-01")
    told = followed(split(events, 19.0, "anna", ""), robot)[WORSE.write]
    assert told.evidence.word is Word.FEW
