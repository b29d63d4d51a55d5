"""What happened in a recording: found in its marks, journal and drives' states; no fault is called ok."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from drivers.error_codes import error_text
from gateway.client import Batch
from server_gui.core.archive.playback import DRIVE_STATES, PlayedRobot, _description, _words
from server_gui.core.archive.timeline_events import PIECE_NS, TimelineEvents
from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.flags import FlagKind
from server_gui.core.follow.events import Described, Telemetry

BEGIN_NS = 1_700_000_000_000_000_000
SECOND_NS = 1_000_000_000
NAMES = {
    "left_knee.position": "rad",
    "left_knee.state": "",
    "left_knee.error_code": "",
    "left_insole.force": "N",
}


@dataclass
class Session:
    robot: str = "exo-01"


@dataclass
class FaultTape:
    """Ten minutes of a knee that walks and, after six, is in fault."""

    session: Session = field(default_factory=Session)
    units: dict[str, str] = field(default_factory=lambda: dict(NAMES))
    events: tuple[dict[str, Any], ...] = ()
    first_ns: int = BEGIN_NS
    last_ns: int = BEGIN_NS + 600 * SECOND_NS
    asked: list[tuple[str, ...]] = field(default_factory=list)

    def read(self, begin_ns: int, end_ns: int, channels: list[str]) -> Rows:
        self.asked.append(tuple(channels))
        utc_ns = np.arange(max(begin_ns, self.first_ns), min(end_ns, self.last_ns + 1), SECOND_NS)
        is_well = utc_ns < BEGIN_NS + 360 * SECOND_NS
        codes = {name: (0.0, 0x2310) if name.endswith(".error_code") else (4.0, 7.0) for name in channels}
        return Rows(
            utc_ns,
            utc_ns - BEGIN_NS,
            {name: np.where(is_well, before, since) for name, (before, since) in codes.items()},
        )


def at_once(work: Callable[[], Any]) -> "Future[Any]":
    future: Future[Any] = Future()
    future.set_result(work())
    return future


def found(tape: FaultTape) -> TimelineEvents:
    made = TimelineEvents(at_once, lambda call: call())
    made.open(cast("Tape", tape), {"left_knee.state": DRIVE_STATES})
    return made


def test_a_fault_anywhere_in_a_recording_is_found_by_its_drives_states_alone() -> None:
    tape = FaultTape()
    happened = found(tape)
    assert [(flag.kind, flag.at_ns - BEGIN_NS) for flag in happened.flags] == [
        (FlagKind.FAULT, 360 * SECOND_NS)
    ]
    assert [flag.text for flag in happened.flags] == [f"left knee: fault {error_text(0x2310)}"]
    states, coded = ("left_knee.state",), ("left_knee.state", "left_knee.error_code")
    assert set(tape.asked) == {states, coded}
    assert tape.asked.count(states) == 1 + 600 * SECOND_NS // PIECE_NS
    assert tape.asked.count(coded) == 1, "only of the piece with the fault"
    assert not happened.is_looking


def test_of_the_journal_counts_what_was_while_it_was_recorded() -> None:
    happened = found(FaultTape())
    at = [BEGIN_NS - SECOND_NS, BEGIN_NS + 30 * SECOND_NS, BEGIN_NS + 3600 * SECOND_NS]
    happened.tell({"what": "stop", "who": "ada", "reason": "test", "utc_ns": utc_ns} for utc_ns in at)
    stops = [flag for flag in happened.flags if flag.kind is FlagKind.STOP]
    assert [flag.at_ns for flag in stops] == [at[1]]
    assert [flag.kind for flag in happened.flags] == [FlagKind.STOP, FlagKind.FAULT]


def test_what_cannot_be_read_is_said() -> None:
    future: Future[Any] = Future()
    future.set_exception(OSError("the disk is gone"))
    made = TimelineEvents(lambda _work: future, lambda call: call())
    made.open(cast("Tape", FaultTape()), {"left_knee.state": DRIVE_STATES})
    assert made.problem == "the disk is gone"
    assert not made.is_looking


def test_a_drive_in_fault_and_a_sensor_without_a_value_are_not_ok_in_a_recording() -> None:
    robot, tape = PlayedRobot(), cast("Tape", FaultTape())
    robot.apply(Described(_description(tape, 1, _words(tape, {}))))
    for state, force, wrong in (
        (4.0, 300.0, {}),
        (7.0, 300.0, {"left_knee": "fault"}),
        (4.0, None, {"left_insole": "lost"}),
    ):
        columns: dict[str, list[float | None]] = {
            "left_knee.position": [0.1],
            "left_knee.state": [state],
            "left_knee.error_code": [0x2310],
            "left_insole.force": [force],
        }
        robot.apply(Telemetry(1, Batch([1], columns, 0, 0, 0, 1, 1), None))
        robot.judge({})
        assert {part.name: part.state for part in robot.not_ok()} == wrong
    robot.values["left_knee.state"] = 7.0
    robot.judge({})
    assert robot.parts["left_knee"].problem == f"the drive is in fault: {error_text(0x2310)}"


def test_the_same_recording_opened_twice_tells_each_fault_once() -> None:
    late: list[Callable[[], None]] = []
    twice = TimelineEvents(at_once, late.append)
    tape = FaultTape()
    for _ in range(2):
        twice.open(cast("Tape", tape), {"left_knee.state": DRIVE_STATES})
    while late:
        late.pop(0)()
    assert [flag.at_ns for flag in twice.flags] == [flag.at_ns for flag in found(FaultTape()).flags]
