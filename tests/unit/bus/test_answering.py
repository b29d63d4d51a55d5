"""How a node answers: round trips, silence and lateness by SDO, and PDOs that are missing."""

import random

import pytest

from drivers.bus.frame_losses import FEWEST, FrameLosses
from drivers.bus.sdo.round_trips import RoundTrips
from drivers.findings import FindingState
from drivers.samples import Finding

MS = 1_000_000
SECOND_NS = 1000 * MS


def test_another_check_is_another_finding_with_its_own_beginning() -> None:
    noted = FindingState()
    for at, words, check in ((1, "a", "x"), (2, "b", "x"), (3, "c", "y")):
        noted.note(at, words, check)
        assert noted.finding == Finding({1: 1, 2: 1, 3: 3}[at], words, check)


def text(trips: RoundTrips | FrameLosses, now_ns: int = 0) -> str:
    found = trips.findings if isinstance(trips, RoundTrips) else (trips.finding,)
    return "; ".join(one.text(now_ns) for one in found if one is not None)


def test_round_trips_are_those_of_the_last_minute() -> None:
    trips = RoundTrips(0.5)
    assert trips.median_and_longest_ms(0) is None
    for number, trip_ms in enumerate((1, 2, 9)):
        trips.answered(number * SECOND_NS, number * SECOND_NS + trip_ms * MS, given_up=False)
    assert trips.median_and_longest_ms(3 * SECOND_NS) == (2.0, 9.0)
    assert trips.median_and_longest_ms(61 * SECOND_NS) == (9.0, 9.0)
    assert trips.median_and_longest_ms(100 * SECOND_NS) is None


def test_silence_is_told_after_a_while_and_ends_with_an_answer() -> None:
    trips = RoundTrips(0.5)
    for at_ms in (500, 1000):
        trips.unanswered(at_ms * MS)
    assert text(trips) == ""
    trips.unanswered(1500 * MS)
    said = text(trips, 10_500 * MS)
    assert said.startswith("it answers no SDO, 3 requests in a row (for 10 s): is another SDO client")
    trips.answered(2000 * MS, 2001 * MS, given_up=False)
    assert text(trips) == ""


def test_an_answer_that_nobody_waits_for_any_more_is_late_until_several_are_in_time() -> None:
    trips = RoundTrips(0.5)
    trips.answered(0, 100 * MS, given_up=True)  # interrupted by something urgent, and in time
    assert (trips.late, text(trips)) == (0, "")
    trips.answered(0, 800 * MS, given_up=True)
    assert trips.late == 1
    assert "it answers SDO after 800 ms, later than sdo_timeout_s = 0.5" in text(trips)
    for _ in range(3):
        assert text(trips) != ""
        trips.answered(0, MS, given_up=False)
    assert text(trips) == ""


def arriving(
    arrivals: FrameLosses, seconds: float, kept: float = 1.0, late_ms: float = 0.0, begin_s: float = 0.0
) -> None:
    """Frames each 10 ms, of which a share comes, each up to so much too late."""
    chance, last_ns = random.Random(1), 0
    for number in range(round(seconds * 100)):
        due_ns = round((begin_s + number / 100) * SECOND_NS)
        if chance.random() < kept:
            last_ns = max(last_ns, due_ns + round(chance.random() * late_ms * MS))
            arrivals.stamps.append(last_ns)
        arrivals.look(due_ns)


@pytest.mark.parametrize("kept", [0.8, 0.9])
def test_missing_frames_are_told_with_their_share_until_they_come_again(kept: float) -> None:
    arrivals = FrameLosses()
    arriving(arrivals, 5.0, kept)
    assert arrivals.missing == pytest.approx(1 - kept, abs=0.05)
    assert "% of its PDOs are missing" in text(arrivals)
    arriving(arrivals, 6.0, begin_s=5.0)
    assert text(arrivals) == ""
    assert arrivals.missing == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("late_ms", [0.0, 3.0, 9.0])
def test_frames_that_come_unevenly_are_not_missing(late_ms: float) -> None:
    arrivals = FrameLosses()
    arriving(arrivals, 20.0, late_ms=late_ms)
    assert text(arrivals) == ""


def test_what_has_no_pace_is_not_judged() -> None:
    arrivals = FrameLosses()
    arrivals.stamps.extend(round(SECOND_NS * number**2) for number in range(FEWEST * 3))
    arrivals.look(SECOND_NS)
    arrivals.look(3 * SECOND_NS)
    assert (arrivals.missing, text(arrivals)) == (None, "")
