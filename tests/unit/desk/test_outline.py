"""A recording's outline: all of it in one picture, gaps as gaps, and never another one's."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import pytest

from server_gui.core.archive.outline import PIECE_NS, STRETCHES, Outline, shown
from server_gui.core.cloud.tape import Rows, Tape

BEGIN_NS = 1_700_000_000_000_000_000
SECOND_NS = 1_000_000_000
LENGTH_S = 600


@dataclass
class KneeTape:
    """Ten minutes of a knee that bends further each second; nothing was recorded in the fifth minute."""

    units: dict[str, str] = field(default_factory=lambda: {"left_knee.position": "rad", "gait.phase": ""})
    first_ns: int = BEGIN_NS
    last_ns: int = BEGIN_NS + LENGTH_S * SECOND_NS
    asked: int = 0

    def read(self, begin_ns: int, end_ns: int, channels: list[str]) -> Rows:
        self.asked += 1
        utc_ns = np.arange(max(begin_ns, BEGIN_NS), min(end_ns, self.last_ns + 1), SECOND_NS // 10)
        since_s = (utc_ns - BEGIN_NS) / SECOND_NS
        kept = (since_s < 240) | (since_s >= 300)
        utc_ns, since_s = utc_ns[kept], since_s[kept]
        return Rows(utc_ns, utc_ns - BEGIN_NS, dict.fromkeys(channels, since_s))


def at_once(work: Callable[[], Any]) -> "Future[Any]":
    future: Future[Any] = Future()
    try:
        future.set_result(work())
    except OSError as error:
        future.set_exception(error)
    return future


def opened(tape: KneeTape) -> Outline:
    made = Outline(at_once, lambda call: call())
    made.open(cast("Tape", tape))
    return made


def test_the_whole_recording_is_in_it_piece_by_piece_and_a_gap_is_no_value() -> None:
    tape = KneeTape()
    outline = opened(tape)
    least, most = (found["left_knee.position"] for found in (outline.least, outline.most))
    a_stretch_s = LENGTH_S / STRETCHES
    assert least[50] == pytest.approx(50 * a_stretch_s, abs=0.2)
    assert most[50] == pytest.approx(51 * a_stretch_s, abs=0.2)
    assert most[-1] == LENGTH_S
    nothing = np.flatnonzero(np.isnan(least)) * a_stretch_s
    assert (nothing[0], nothing[-1] + a_stretch_s) == pytest.approx((240, 300), abs=1.1 * a_stretch_s)
    assert tape.asked == 1 + LENGTH_S * SECOND_NS // PIECE_NS
    assert outline.read_share == 1.0


def test_what_cannot_be_read_is_not_known_and_not_taken_for_nothing_recorded() -> None:
    class GoesAway(KneeTape):
        def read(self, begin_ns: int, end_ns: int, channels: list[str]) -> Rows:
            if self.asked:
                raise OSError("the store is away")
            return super().read(begin_ns, end_ns, channels)

    outline = opened(GoesAway())
    assert outline.read_share == pytest.approx(PIECE_NS / (LENGTH_S * SECOND_NS))
    known = np.flatnonzero(~np.isnan(outline.least["left_knee.position"])) / STRETCHES
    assert known.max() < outline.read_share


def test_a_clock_that_jumped_by_decades_makes_no_more_reads_than_there_are_stretches() -> None:
    late: list[Callable[[], None]] = []
    outline, tape = Outline(at_once, late.append), KneeTape(first_ns=0)
    outline.open(cast("Tape", tape))
    while late:
        late.pop(0)()
    assert outline.read_share == 1.0
    assert tape.asked <= STRETCHES + 1


def test_rows_of_a_recording_that_is_no_longer_shown_are_not_drawn_into_another() -> None:
    late: list[Callable[[], None]] = []
    outline = Outline(at_once, late.append)
    outline.open(cast("Tape", KneeTape()))
    outline.open(cast("Tape", KneeTape(units={})))
    for call in late:
        call()
    assert outline.least == {}


def test_an_infinity_does_not_make_all_else_flat() -> None:
    class Odd(KneeTape):
        def read(self, begin_ns: int, end_ns: int, channels: list[str]) -> Rows:
            rows = super().read(begin_ns, end_ns, channels)
            odd = {
                name: np.where(rows.stamps_ns == 0, np.inf, column) for name, column in rows.columns.items()
            }
            return Rows(rows.utc_ns, rows.stamps_ns, odd)

    outline = opened(Odd())
    assert np.nanmax(outline.most["left_knee.position"]) == LENGTH_S


def test_the_same_recording_opened_twice_is_read_once_from_its_second_piece_on() -> None:
    late: list[Callable[[], None]] = []
    outline, tape = Outline(at_once, late.append), KneeTape()
    outline.open(cast("Tape", tape))
    outline.open(cast("Tape", tape))
    while late:
        late.pop(0)()
    assert tape.asked == 2 + LENGTH_S * SECOND_NS // PIECE_NS
    assert outline.most["left_knee.position"][-1] == LENGTH_S


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (["l_hip.position", "l_knee.position", "r_knee.position"], ["l_knee.position", "r_knee.position"]),
        (["a.position", "b.position", "c.position"], ["a.position", "b.position"]),
        (["sole.force"], ["sole.force"]),
        (["imu.tilt_forward"], []),
    ],
)
def test_knees_show_best_what_went_on_then_other_joints_then_load(
    names: list[str], wanted: list[str]
) -> None:
    assert shown(names) == wanted
