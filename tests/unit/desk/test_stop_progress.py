"""A STOP as the window knows it: by its answer, the drives' rows, the link and the robot's journal."""

import time

import msgspec
import pytest
from msgspec.structs import replace

from gateway.client import ClockOffset
from gateway.wire.stop import Stopped
from server_gui.core.tuning.stop import Proof, StopProgress, StopState, is_off

JOINTS = ("left_knee", "right_knee")
ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


def written(number: int, what: str, **more: object) -> dict[str, object]:
    return {"n": number, "hash": str(number), "who": "gwrms", "what": what, "utc_ns": number, **more}


RESET = written(6, "reset", held=False)


def test_a_confirmed_stop_that_was_reset_while_there_was_no_link_is_not_shown_any_more() -> None:
    """Header and table said that it is confirmed while the robot walked."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping.read([written(5, "stop")])
    stopping.described(held=False, reason=None)
    assert (stopping.state, stopping.is_let_go) == (StopState.CONFIRMED, True), "who says that it was reset?"
    stopping.read([RESET])
    assert (stopping.stage, stopping.was_ended) == ((StopState.IDLE, False), True)
    stopping.answered(stopping.sent(), ALL)
    stopping.described(held=False, reason=None)  # it may be older than this stop
    assert stopping.state is StopState.CONFIRMED
    stopping.read([RESET, written(7, "stopped again", drive="left_knee"), written(8, "stop")])
    assert stopping.stage == (StopState.CONFIRMED, True)
    stopping.read([written(9, "reset", held=False)])
    assert stopping.stage == (StopState.IDLE, False)


def test_a_reset_before_a_stop_does_not_end_it() -> None:
    stopping = StopProgress()
    stopping.read([written(4, "stop")])
    stopping.answered(stopping.sent(), ALL)
    stopping.read([RESET])
    assert stopping.stage == (StopState.CONFIRMED, True)
    stopping.read([RESET, written(7, "stopped again")])
    stopping.read([written(8, "reset", held=False)])
    assert stopping.stage == (StopState.IDLE, False)


def test_of_a_reset_before_the_window_came_nobody_knows_what_was_enabled_since() -> None:
    stopping = StopProgress()
    stopping.read([written(5, "stop"), RESET])
    assert (stopping.stage, stopping.was_ended) == ((StopState.IDLE, False), False)
    stopping.read([written(7, "stop"), written(8, "reset", held=False, utc_ns=9_000_000_000)])
    assert (stopping.was_ended, stopping.since_s) == (True, 9.0)


def test_a_stop_in_a_journal_that_begins_anew_is_read() -> None:
    stopping = StopProgress()
    stopping.read([written(500, "stop"), written(501, "reset", held=False)])
    stopping.read([written(1, "begun"), written(2, "stop", reason="door")])
    assert stopping.held


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (Stopped({}, held=True), "no drive answered"),
        (Stopped(ALL.drives, held=True, controllers={"gait": "unreachable"}), "controller gait unreachable"),
    ],
)
def test_a_stop_is_confirmed_by_drives_and_every_controller_or_not_at_all(said: Stopped, why: str) -> None:
    stopping = StopProgress()
    old, new = stopping.sent(), stopping.sent()
    stopping.failed(old, "the link of the one before broke")
    assert stopping.state is StopState.SENT
    stopping.answered(new, said)
    assert (stopping.state, stopping.why) == (StopState.NOT_CONFIRMED, why)


def test_the_answer_dates_no_drive_that_has_not_confirmed_the_stop() -> None:
    stopping = StopProgress()
    number = stopping.sent(at_ns=0)
    columns = {"left_knee": ["quick stop active"], "right_knee": ["quick stop active"]}
    stopping.show([200_000_000], columns, 0)
    said = Stopped({"left_knee": "confirmed", "right_knee": "unconfirmed"}, held=True)
    stopping.answered(number, said, at_ns=100_000_000)
    assert {name: proof.after_ms for name, proof in stopping.proofs.items()} == {
        "left_knee": 100.0,
        "right_knee": 200.0,
    }


BOOT = "a3c1"
SENT_NS = 10_000_000_000
CLOCK = ClockOffset(5_000_000_000, 1000)  # the robot's is 5 s before ours
UNREACHABLE = Stopped({"left_knee": "unreachable"}, held=True)


def at(number: int, what: str, ours_ns: int, boot_id: str = BOOT, **more: object) -> dict[str, object]:
    return written(number, what, monotonic_ns=ours_ns + CLOCK.offset_ns, boot_id=boot_id, **more)


@pytest.mark.parametrize("said", [ALL, UNREACHABLE])
@pytest.mark.parametrize("boot_id", [BOOT, "of the boot before"])
def test_a_stop_and_its_reset_that_are_older_than_ours_do_not_end_it(said: Stopped, boot_id: str) -> None:
    """The journal was read at the first link after a STOP that no drive had confirmed: its alarm was gone."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=SENT_NS, clock=CLOCK, boot_id=BOOT), said)
    stage = stopping.stage
    before_ns = SENT_NS - 1_000_000_000 if boot_id == BOOT else SENT_NS + 1_000_000_000
    older = [at(1, "stop", before_ns, boot_id), at(2, "reset", before_ns, boot_id, held=False)]
    stopping.read(older, BOOT)
    assert stopping.stage == stage
    stopping.read([*older, at(3, "stop", SENT_NS + 3_000_000)], BOOT)
    assert stopping.stage == stage
    stopping.read([at(4, "reset", SENT_NS + 9_000_000_000, held=False)], BOOT)
    assert stopping.stage == (StopState.IDLE, False)


def test_a_stop_is_timed_by_the_drives_that_it_has_stopped() -> None:
    """One that was off before took no time, and one that was not asked says nothing of this stop."""
    stopping = StopProgress()
    number = stopping.sent(off=["right_knee"], at_ns=0)
    columns = {
        "left_knee": ["quick stop active"],
        "right_knee": ["switch on disabled"],
        "bench": ["switch on disabled"],
    }
    stopping.show([20_000_000], {**columns, "bench": ["operation enabled"]}, 0)
    stopping.show([70_000_000], columns, 0)
    stopping.answered(number, ALL, at_ns=90_000_000)
    assert stopping.text == "STOP confirmed by all 2 drives in 20 ms"


def test_a_stop_whose_drives_are_not_all_in_the_rows_is_timed_by_its_answer() -> None:
    stopping = StopProgress()
    number = stopping.sent(at_ns=0)
    stopping.show([20_000_000], {"left_knee": ["quick stop active"]}, 0)
    stopping.answered(number, ALL, at_ns=90_000_000)
    assert stopping.text == "STOP confirmed by all 2 drives in 90 ms"


def test_a_stop_of_drives_that_are_off_already_gives_no_time() -> None:
    """STOP ALL made 4 ms of the 95 ms in which a robot had come to a stop."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=0), ALL, at_ns=95_000_000)
    assert stopping.text == "STOP confirmed by all 2 drives in 95 ms"
    again = stopping.sent(off=ALL.drives, at_ns=5_000_000_000)
    stopping.answered(again, ALL, at_ns=5_004_000_000)
    assert stopping.text == "STOP confirmed by all 2 drives, already off"


def test_rows_from_before_a_stop_that_come_late_say_which_drives_were_off_already() -> None:
    """A second STOP had a new time for drives that the first one had stopped."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=5_000_000_000), ALL, at_ns=5_095_000_000)
    assert stopping.text.endswith("in 95 ms")
    on, off = "operation enabled", "switch on disabled"
    columns = {"left_knee": [on, off], "right_knee": [off, on]}
    stopping.show([4_200_000_000, 4_700_000_000], columns, 0)
    stopping.show([5_010_000_000], {drive: [off] for drive in ALL.drives}, 0)
    assert stopping.already_off == {"left_knee"}
    assert stopping.proofs["left_knee"].was_so
    assert stopping.text == "STOP confirmed by all 2 drives in 10 ms", "that of the right knee"


def test_a_drive_that_was_enabled_just_before_a_stop_was_not_off_already() -> None:
    """The newest row at the STOP was of before somebody had enabled it."""
    stopping = StopProgress()
    number = stopping.sent(off=ALL.drives, at_ns=5_000_000_000)
    stopping.show([4_990_000_000], {"left_knee": ["operation enabled"]}, 0)
    stopping.show([5_020_000_000], {drive: ["switch on disabled"] for drive in ALL.drives}, 0)
    stopping.answered(number, ALL, at_ns=5_095_000_000)
    assert stopping.already_off == {"right_knee"}
    assert stopping.text.endswith("in 20 ms")


@pytest.mark.parametrize(("uncertainty_ns", "off"), [(1000, ALL.drives), (200_000_000, {})])
def test_a_row_that_may_be_of_after_the_stop_does_not_say_that_a_drive_was_off(
    uncertainty_ns: int, off: dict[str, str]
) -> None:
    stopping = StopProgress()
    number = stopping.sent(at_ns=SENT_NS, clock=ClockOffset(0, uncertainty_ns))
    columns = {drive: ["switch on disabled"] for drive in ALL.drives}
    stopping.show([SENT_NS - 10_000_000], columns, 0)
    stopping.answered(number, ALL)
    assert stopping.already_off == frozenset()
    stopping.show([SENT_NS - 100_000_000], columns, 0)
    assert stopping.already_off == off.keys()


def test_drives_that_were_enabled_since_are_proven_anew() -> None:
    """Somebody else had reset and enabled them: nobody had read that yet."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=0), ALL, at_ns=22_000_000)
    stopping.answered(stopping.sent(off=[], at_ns=5_000_000_000), ALL, at_ns=5_900_000_000)
    assert stopping.text.endswith("in 900 ms")


def test_a_stop_that_repeats_one_without_an_answer_is_timed_from_that() -> None:
    stopping = StopProgress()
    stopping.sent(at_ns=0)
    again = stopping.sent(off=ALL.drives, at_ns=796_000_000)
    stopping.answered(again, ALL, at_ns=800_000_000)
    assert stopping.text.endswith("in 800 ms"), "not the 4 ms of the second"


def test_a_stop_that_a_robot_lost_as_it_started_again_is_not_called_reset() -> None:
    """Its disk was full: the stop was held, but not beyond its gateway, and whoever enabled it was green."""
    problem = "this stop is held, but not beyond this gateway: No space left on device"
    stopping = StopProgress()
    said = replace(ALL, problem=problem)
    stopping.answered(stopping.sent(at_ns=SENT_NS, clock=CLOCK, boot_id=BOOT), said)
    assert stopping.problem == problem
    stopping.read([at(1, "stop", SENT_NS + 1_000_000)], BOOT)
    stopping.described(held=False, reason=None)
    stopping.read([at(1, "stop", SENT_NS + 1_000_000)], "another")
    assert stopping.is_let_go
    stopping.was_reset(held=False)
    assert (stopping.stage, stopping.problem) == ((StopState.IDLE, False), "")


@pytest.mark.parametrize(("after_s", "is_held"), [(-60.0, True), (5.0, False)])
def test_a_reset_before_the_robots_own_word_is_not_of_the_stop_that_it_holds(
    after_s: float, is_held: bool
) -> None:
    """The stop since was in no journal: the disk was full."""
    stopping = StopProgress()
    stopping.described(held=True, reason="door", problem="not beyond this gateway")
    at_ns = round((time.time() + after_s) * 1e9)
    stopping.read([written(1, "stop", utc_ns=at_ns - 1), written(2, "reset", held=False, utc_ns=at_ns)])
    assert stopping.held is is_held
    assert stopping.problem == ("not beyond this gateway" if is_held else "")
    stopping.read([written(3, "reset", held=False, utc_ns=at_ns)])
    assert not stopping.held, "this was written since"


def test_a_clock_is_believed_no_further_than_it_says() -> None:
    stopping = StopProgress()
    unsure = ClockOffset(CLOCK.offset_ns, 200_000_000)
    stopping.answered(stopping.sent(at_ns=SENT_NS, clock=unsure, boot_id=BOOT), ALL)
    stopping.read([at(1, "stop", SENT_NS - 80_000_000)], BOOT)
    stopping.read([at(2, "reset", SENT_NS + 3_000_000_000, held=False)], BOOT)
    assert stopping.stage == (StopState.IDLE, False)


def test_a_stop_of_somebody_else_is_held_also_if_it_is_older_than_ours() -> None:
    """Ours was not answered, theirs held: there was no way to reset it."""
    stopping = StopProgress()
    stopping.failed(stopping.sent(at_ns=SENT_NS, clock=CLOCK, boot_id=BOOT), "no answer within 5 s")
    before_ns = SENT_NS - 1_000_000_000
    stopping.read([at(1, "stop", before_ns, reason="door", who="ada")], BOOT)
    assert (stopping.stage, stopping.reason) == ((StopState.NOT_CONFIRMED, True), "door, by ada")


def test_of_a_repeated_stop_only_drives_that_were_off_at_each_are_called_so() -> None:
    stopping = StopProgress()
    stopping.sent(off=ALL.drives, at_ns=0)
    again = stopping.sent(off=["right_knee"], at_ns=700_000_000)
    stopping.answered(again, ALL, at_ns=800_000_000)
    assert stopping.text.endswith("in 800 ms")
    stopping.show([790_000_000], {"left_knee": ["quick stop active"]}, 0)
    assert not stopping.proofs["left_knee"].was_so


def test_a_state_without_a_word_proves_nothing() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=0), ALL, at_ns=90_000_000)
    stopping.show([20_000_000], {drive: ["99"] for drive in ALL.drives}, 0)
    assert not stopping.proofs
    assert not is_off("99")
    assert not is_off(None)


@pytest.mark.parametrize("clock", [None, ClockOffset(CLOCK.offset_ns, 3_000_000_000)])
def test_where_nobody_can_tell_which_was_first_no_reset_ends_a_stop_that_is_not_confirmed(
    clock: ClockOffset | None,
) -> None:
    """The first look at a journal brought an old stop, its reset and ours: the alarm went."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=SENT_NS, clock=clock, boot_id=BOOT), UNREACHABLE)
    before_ns = SENT_NS - 2_000_000_000
    old = [at(1, "stop", before_ns), at(2, "reset", before_ns, held=False)]
    stopping.read([*old, at(3, "stop", SENT_NS + 1_000_000)], BOOT)
    assert stopping.stage == (StopState.NOT_CONFIRMED, True)


def test_a_stop_of_somebody_else_that_was_reset_is_not_held_though_ours_is_not_confirmed() -> None:
    """Danger was not judged any more: a stop seemed to be held."""
    stopping = StopProgress()
    stopping.failed(stopping.sent(at_ns=SENT_NS, clock=CLOCK, boot_id=BOOT), "no answer")
    stopping.read([at(1, "stop", SENT_NS - 1_000_000_000)], BOOT)
    stopping.read([at(2, "reset", SENT_NS + 8_000_000_000, held=False)], BOOT)
    assert stopping.stage == (StopState.NOT_CONFIRMED, False)


def test_a_stop_by_an_outdated_file_is_not_confirmed() -> None:
    """A drive that the file names by now would have walked on beside a green word."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(), msgspec.structs.replace(ALL, outdated="robot.toml: is broken"))
    assert stopping.state is StopState.NOT_CONFIRMED
    assert stopping.why == "robot.toml: is broken"


def test_a_stop_of_what_is_stopped_does_not_make_it_stopped_since_now() -> None:
    """The line said since now, the alarm since when it was."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping._stood_s = stopping.since_s = first_s = 1000.0
    stopping.answered(stopping.sent(off=JOINTS), ALL)
    assert stopping.since_s == first_s
    assert stopping.text == "STOP confirmed by all 2 drives, already off"
    stopping.answered(stopping.sent(off=JOINTS[:1]), ALL)  # the other one had been enabled again
    assert stopping.since_s is not None
    assert stopping.since_s > first_s


def test_a_stop_that_fails_while_another_is_held_is_not_confirmed_since_now() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping._stood_s = stopping.since_s = first_s = 1000.0
    stopping.failed(stopping.sent(off=JOINTS), "no link")
    assert stopping.state is StopState.NOT_CONFIRMED
    assert stopping.since_s is not None
    assert stopping.since_s > first_s


def test_a_stop_that_is_found_held_is_not_held_since_the_reset_before_it() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping.read([written(5, "stop")])
    stopping.was_reset(held=False, at_s=100.0)
    stopping.described(held=True, reason="door")
    assert (stopping.held, stopping.was_ended, stopping.since_s) == (True, False, None)
    stopping.read([written(7, "stop", utc_ns=200_000_000_000)])
    assert stopping.since_s == 200.0


def test_the_journals_time_is_told_by_our_calendar_and_never_later_than_now() -> None:
    """A robot whose clock was an hour ahead had stopped in an hour."""
    stopping, now_ns = StopProgress(), time.time_ns()
    stopping.calendar_ns = 3600 * 10**9
    stopping.read([written(7, "stop", utc_ns=now_ns + 3590 * 10**9)])
    assert stopping.since_s == pytest.approx(now_ns / 1e9 - 10.0)
    other = StopProgress()
    other.read([written(7, "stop", utc_ns=now_ns + 3600 * 10**9)])
    assert other.since_s is not None
    assert other.since_s <= time.time()


def test_proofs_of_a_stop_that_is_over_are_not_those_of_the_next_one() -> None:
    """Another one's stop was "already off" at every drive, which had been enabled."""
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=0), ALL, at_ns=90_000_000)
    stopping.show([20_000_000], {"left_knee": ["quick stop active"]}, 0)
    stopping.read([written(8, "stop")])
    stopping.was_reset(held=False)
    assert stopping.proofs, "how it was stands there until drives are enabled"
    stopping.read([written(9, "stop", reason="fell")])
    assert (stopping.held, stopping.proofs) == (True, {})
    stopping.was_reset(held=False)
    stopping.proofs = {"left_knee": Proof(20.0, "quick stop active")}
    stopping.goes_on()
    assert (stopping.was_ended, stopping.proofs) == (False, {})


def test_what_a_held_stop_has_shown_stays_while_a_drive_is_enabled_again() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(at_ns=0), ALL, at_ns=90_000_000)
    stopping.show([20_000_000], {"left_knee": ["quick stop active"]}, 0)
    stopping.goes_on()
    assert stopping.proofs


def test_what_failed_and_moved_on_has_not_stood_since_then() -> None:
    """Ten minutes in which it still moved counted as stopped."""
    stopping = StopProgress()
    stopping.failed(stopping.sent(), "no answer")
    stopping._sent_s = stopping.since_s = 1000.0
    stopping.answered(stopping.sent(off=JOINTS), ALL)
    assert stopping.since_s is not None
    assert stopping.since_s > 1000.0


def test_a_stop_that_never_went_out_does_not_shorten_how_long_it_has_stood() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping._stood_s = stopping.since_s = 1000.0
    stopping.failed(stopping.sent(off=JOINTS), "nothing was sent: no link")
    assert stopping.since_s > 1000.0, "not confirmed since just now"
    stopping.answered(stopping.sent(off=JOINTS), ALL)
    assert stopping.since_s == 1000.0


def test_rows_that_come_late_correct_since_when_it_has_stood() -> None:
    stopping = StopProgress()
    stopping.answered(stopping.sent(), ALL)
    stopping._stood_s = stopping.since_s = 1000.0
    stopping.answered(stopping.sent(off=JOINTS, at_ns=10**12), ALL, at_ns=10**12 + 9)
    assert stopping.since_s == 1000.0
    enabled: dict[str, list[str | None]] = {"left_knee": ["operation enabled", "quick stop active"]}
    stopping.show([10**12 - 10**9, 10**12 + 20_000_000], enabled, 0)
    assert stopping.since_s > 1000.0, "it had been enabled"


def test_a_stop_that_the_robot_holds_is_as_old_as_its_own_entry_not_as_one_that_was_reset() -> None:
    """With a history of two hours, STOPPED was since the oldest stop in it."""
    stopping = StopProgress()
    stopping.described(held=True, reason="door", problem="not beyond this gateway")
    now_s = time.time()
    past = [(1, "stop", 7200.0), (2, "reset", 7100.0), (3, "stop", 120.0)]
    stopping.read(
        [
            written(
                number,
                what,
                utc_ns=round((now_s - ago_s) * 1e9),
                **({"held": False} if what == "reset" else {}),
            )
            for number, what, ago_s in past
        ]
    )
    assert stopping.held
    assert stopping.since_s == pytest.approx(now_s - 120.0, abs=1.0)
    assert stopping.problem == "not beyond this gateway", "the resets before are not of it"


def test_what_was_wrong_with_a_stop_that_is_over_is_not_said_of_the_next() -> None:
    stopping = StopProgress()
    stopping.described(held=True, reason="door", problem="not beyond this gateway")
    stopping.described(held=False, reason=None)
    assert stopping.problem == ""
    stopping.described(held=True, reason="door", problem="not beyond this gateway")
    stopping.held = False
    stopping.read([written(1, "stop", reason="other")])
    assert (stopping.held, stopping.problem) == (True, "")
