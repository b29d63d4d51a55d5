"""A second recording beside the one that is played: what cannot be read now is read later."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from datetime import UTC, datetime, timedelta
from typing import Any, cast

import numpy as np
import pytest

from ml.store import StoreError
from ml.store.sessions import Session
from server_gui.core.archive.playback import Playback, PlayedRobot
from server_gui.core.archive.side_by_side import AGAIN_S, CLOSED, NO_STEPS, NOT_READ, By, SideBySide
from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.desk import Shown
from server_gui.core.desk.flags import FlagKind
from server_gui.core.recording.rows import Floats, Ints
from server_gui.core.settings.server_file import ServerSettings

SECOND_NS = 1_000_000_000
LENGTH_S = 60


class KneeTape:
    """A minute of a knee's position; while the store is `away`, nothing of it can be read."""

    events = ()
    units: Mapping[str, str] = {"left_knee.position": "rad"}

    def __init__(self, name: str, first_s: int) -> None:
        first = datetime.fromtimestamp(first_s, UTC)
        last = first + timedelta(seconds=LENGTH_S)
        self.session = Session("exo-01", name, first=first, last=last, rows=LENGTH_S * 10)
        self.first_ns, self.last_ns = first_s * SECOND_NS, (first_s + LENGTH_S) * SECOND_NS
        self.away = False
        self.reads = 0

    def read(self, begin_ns: int, end_ns: int, channels: Sequence[str] | None = None) -> Rows:
        if channels is None:  # as it is played
            self.reads += 1
        if self.away:
            raise StoreError("the store is away")
        utc_ns = np.arange(max(begin_ns, self.first_ns), min(end_ns, self.last_ns), SECOND_NS // 10)
        return Rows(utc_ns, utc_ns - 1000 * SECOND_NS, self.columns(utc_ns))

    def columns(self, utc_ns: Ints) -> dict[str, Floats]:
        """What is in these rows."""
        return {"left_knee.position": utc_ns / 1e18}


class SteppingTape(KneeTape):
    """A left insole too, which stands on the ground, and from `lands_s` on lands each second."""

    units: Mapping[str, str] = {"left_knee.position": "rad", "left_insole.force": "N"}

    def __init__(self, name: str, first_s: int, lands_s: int) -> None:
        super().__init__(name, first_s)
        self.lands_s = lands_s

    def columns(self, utc_ns: Ints) -> dict[str, Floats]:
        since_s = (utc_ns - self.first_ns) / 1e9
        is_up = (since_s > self.lands_s - 0.55) & (since_s % 1.0 > 0.45)
        return super().columns(utc_ns) | {"left_insole.force": np.where(is_up, 0.0, 700.0)}


class SetTape(SteppingTape):
    """Its computer's UTC is set on by three seconds after twenty."""

    def read(self, begin_ns: int, end_ns: int, channels: Sequence[str] | None = None) -> Rows:
        rows = super().read(begin_ns, end_ns, channels)
        set_on = np.where(rows.utc_ns - self.first_ns > 20 * SECOND_NS, 3 * SECOND_NS, 0)
        return Rows(rows.utc_ns, rows.stamps_ns - set_on, rows.columns)


class Beside:
    """Both of them, in a thread that does at once what it is given, and a clock that a test moves."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, first: KneeTape | None = None, second: KneeTape | None = None
    ) -> None:
        self.tape = first or KneeTape("first", 1_700_000_000)
        self.second = second or KneeTape("second", 1_700_100_000)
        self.now_s = 100.0
        self.held: list[Callable[[], None]] | None = None  # what is done later, while a test holds it
        monkeypatch.setattr(Tape, "open", lambda _settings, _session: self.second)
        self.first = Playback(_done, lambda call: call(), Shown())
        self.first.open(cast("Tape", self.tape))
        settings = cast("ServerSettings", None)
        self.both = SideBySide(self.first, settings, _done, self._deliver, lambda: self.now_s)

    def _deliver(self, call: Callable[[], None]) -> None:
        if self.held is None:
            call()
        else:
            self.held.append(call)

    def draw(self, frames: int = 8) -> None:
        for _ in range(frames):
            self.first.step()
            self.both.step()

    def jump(self, seconds: float) -> None:
        self.first.seek(self.tape.first_ns + round(seconds * SECOND_NS))
        self.draw()

    @property
    def is_together(self) -> bool:
        """Whether both have been read at the same time since their beginnings, and show it."""
        each = (self.first, self.tape), (self.both.second, self.second)
        since = [None if one._fed_ns is None else one._fed_ns - tape.first_ns for one, tape in each]
        return since[0] == since[1]


def _done(work: Callable[[], Any]) -> "Future[Any]":
    future: Future[Any] = Future()
    try:
        future.set_result(work())
    except StoreError as error:
        future.set_exception(error)
    return future


@pytest.fixture
def beside(monkeypatch: pytest.MonkeyPatch) -> Beside:
    """Both stand still at their beginnings."""
    made = Beside(monkeypatch)
    made.both.open(made.second.session)
    made.draw()
    return made


@pytest.mark.parametrize("wish", ["jump", "play", "wait"])
def test_a_second_that_could_not_be_read_is_tried_again_by_a_jump_by_play_and_after_some_seconds(
    beside: Beside, wish: str
) -> None:
    beside.second.away = True
    beside.jump(45.0)
    assert beside.both.problem == "the store is away"
    station = beside.both.station
    assert station is not None
    assert station.robot.is_stale(), "what is seen is of another instant"
    reads = beside.second.reads
    beside.draw(50)
    assert (beside.second.reads, beside.is_together) == (reads, False), "not with every frame"
    beside.second.away = False
    if wish == "jump":
        beside.jump(46.0)
    elif wish == "play":
        beside.first.play(on=True)
        beside.first.play(on=False)
    else:
        beside.now_s += AGAIN_S
    beside.draw()
    assert (beside.both.problem, beside.is_together, station.robot.is_stale()) == ("", True, False)


def test_what_is_read_already_is_shown_while_what_comes_next_cannot_be_read(beside: Beside) -> None:
    beside.second.away = True
    beside.jump(22.0)
    assert beside.both.problem
    beside.jump(3.0)
    assert beside.is_together


def test_a_second_that_is_read_when_the_first_was_closed_is_put_away_with_a_word(beside: Beside) -> None:
    beside.held = []
    beside.both.open(beside.second.session)
    beside.first.close()
    for call in beside.held:
        call()
    assert (beside.both.session, beside.both.second.tape, beside.both.problem) == (None, None, CLOSED)
    beside.held = None
    beside.first.open(cast("Tape", beside.tape))
    beside.both.open(beside.second.session)
    beside.draw()
    assert (beside.both.problem, beside.is_together) == ("", True)


def test_a_recording_that_is_read_when_nobody_wants_it_any_more_is_not_shown(beside: Beside) -> None:
    beside.held = []
    beside.both.open(beside.second.session)
    beside.both.close()
    for call in beside.held:
        call()
    assert (beside.both.second.tape, beside.both.station, beside.both.problem) == (None, None, "")


def test_without_a_heel_strike_the_beginnings_stay_aligned(beside: Beside) -> None:
    assert beside.both.remark == NO_STEPS
    for by in (By.LAST_STRIKE, By.FIRST_STRIKE):
        assert "no left heel strike" in beside.both.align(by)
    assert beside.both.by is By.START
    beside.jump(5.0)
    assert beside.is_together


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> Beside:
    """The left foot lands first after five seconds, in the second one after two."""
    tapes = (SteppingTape("first", 1_700_000_000, 5), SteppingTape("second", 1_700_100_000, 2))
    made = Beside(monkeypatch, *tapes)
    made.both.open(made.second.session)
    made.draw()
    return made


def apart_s(beside: Beside) -> float:
    """How much later the second is shown than the first, since their beginnings."""
    first, second = beside.first.position_ns, beside.both.second.position_ns
    return (second - beside.second.first_ns - first + beside.tape.first_ns) / 1e9


def test_both_are_aligned_by_their_first_left_heel_strike_until_somebody_chooses_their_beginnings(
    steps: Beside,
) -> None:
    assert (steps.both.by, steps.both.remark) == (By.FIRST_STRIKE, "")
    steps.jump(20.0)
    assert apart_s(steps) == pytest.approx(-3.0, abs=0.01)
    assert not steps.both.align(By.START)
    steps.jump(21.0)
    assert (steps.both.by, apart_s(steps)) == (By.START, 0.0)
    assert not steps.both.align(By.FIRST_STRIKE)
    steps.jump(22.0)
    assert apart_s(steps) == pytest.approx(-3.0, abs=0.01)


def test_before_its_beginning_the_second_has_no_row_and_then_its_first(steps: Beside) -> None:
    station = steps.both.station
    assert station is not None
    for seconds in (1.0, 20.0, 1.0):
        steps.jump(seconds)
        assert (station.rings.newest_ns is None) is (seconds < 3.0), "its first row is of another instant"
    assert station.robot.description is not None, "its channels can be chosen"
    steps.jump(4.0)
    assert isinstance(station.robot, PlayedRobot)
    assert station.robot.row_ns == steps.second.first_ns + SECOND_NS, "the row at it is shown"


def test_a_heel_strike_is_of_the_utc_of_its_own_row(monkeypatch: pytest.MonkeyPatch) -> None:
    tapes = (SteppingTape("first", 1_700_000_000, 5), SetTape("second", 1_700_100_000, 2))
    made = Beside(monkeypatch, *tapes)
    made.both.open(made.second.session)
    made.draw()
    made.jump(10.0)
    assert made.both.by is By.FIRST_STRIKE
    assert apart_s(made) == pytest.approx(-3.0, abs=0.01)


def test_steps_that_cannot_be_read_are_not_called_none(beside: Beside) -> None:
    beside.tape.away = True
    beside.both.open(beside.second.session)
    assert (beside.both.by, beside.both.remark) == (By.START, NOT_READ)


def test_what_happened_in_the_second_stands_on_the_axis_of_the_first(beside: Beside) -> None:
    at_ns = beside.second.first_ns + 12 * SECOND_NS
    beside.both.second.happened.tell([{"what": "stop", "who": "ada", "utc_ns": at_ns}])
    (flag,) = beside.both.flags
    assert (flag.kind, flag.at_ns - beside.tape.first_ns) == (FlagKind.STOP, 12 * SECOND_NS)
    beside.both._offset_ns += 2 * SECOND_NS
    assert beside.both.flags[0].at_ns - beside.tape.first_ns == 10 * SECOND_NS
    beside.both.close()
    assert not beside.both.flags
