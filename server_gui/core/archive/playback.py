"""A recorded session played on a desk of its own: never among the live robots, and never taken for one."""

import time
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final, cast

import numpy as np
from msgspec import UNSET

from drivers.error_codes import error_text
from gateway.client import Batch, ConnectionState
from gateway.wire.component import ChannelInfo, ComponentInfo
from gateway.wire.parameter import ParameterInfo, ParameterValue
from gateway.wire.robot import Clock, Description, GuardInfo
from gateway.wire.stop import StopInfo
from server_gui.core.archive.outline import Outline
from server_gui.core.archive.recorded_parameters import RecordedParameters
from server_gui.core.archive.recorded_predictions import PastPrediction
from server_gui.core.archive.timeline_events import TimelineEvents
from server_gui.core.cloud.tape import Rows, Tape
from server_gui.core.desk.desk import Desk, Shown
from server_gui.core.desk.flags import Flag, FlagKind, fault_codes
from server_gui.core.desk.station import Station
from server_gui.core.desk.ticks import drawable, nullable
from server_gui.core.follow.events import Described, LinkChanged, Telemetry
from server_gui.core.follow.robot import STALE_NS, Robot
from server_gui.core.prediction.newest_predictions import Recalled
from server_gui.core.prediction.news import Serves
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands

PIECE_NS: Final = 20_000_000_000  # that are read at once
PIECES: Final = 8  # that are kept
LEAD_NS: Final = 12_000_000_000  # of the past that are shown after a jump
FIRST_NS: Final = 1_000_000  # a session's beginning is told in ms, and its first row is seen there
LATE_S: Final = 0.5  # a frame that took longer does not make the recording jump
SPEEDS: Final = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
NOT_PREDICTED: Final = "nothing was said then: gwrms predict --session says it now"
FAULTS: Final = ("fault", "fault reaction active")
# CiA 402-2, "state coding", as a gateway numbers them: recordings hold numbers, and no robot need be there.
DRIVE_STATES: Final = {
    str(number): word
    for number, word in enumerate(
        (
            "not ready to switch on",
            "switch on disabled",
            "ready to switch on",
            "switched on",
            "operation enabled",
            "quick stop active",
            "fault reaction active",
            "fault",
        )
    )
}
LATER: Final = "which comes a moment later"  # the code of a fault
KINDS: Final = {"cell_0": "insole", "force": "insole", "tilt_forward": "imu", "position": "joint"}


class IsRecording(Exception):
    """Something was asked of a robot that is a recording."""


class NoRobot:
    """Takes the place of a robot's commands; every one of them is refused."""

    def __getattr__(self, name: str) -> "Callable[..., Future[Any]]":
        return _refused


def _refused(*_: object) -> "Future[Any]":
    future: Future[Any] = Future()
    future.set_exception(IsRecording("this is a recording: there is no robot behind it"))
    return future


@dataclass(slots=True)
class PlayedRobot(Robot):
    """Its values are as old as they were at the instant of the recording that is shown."""

    shown_ns: int = 0  # UTC
    row_ns: int | None = None  # UTC of the newest row
    stamp_ns: int | None = None  # and on the robot's clock
    began_ns: int | None = None  # UTC of the recording's first row
    rows_per_s: float = 0.0
    is_recording: bool = True
    # Parameters of its start, where nobody knows of later changes: then these are not known now.
    at_start: dict[str, ParameterValue] = field(default_factory=dict)

    def now_s(self) -> float:
        return self.shown_ns / 1e9

    def session_s(self, stamp_ns: int) -> float | None:
        """Return how long after its beginning this was, on the robot's clock; None where not known."""
        if self.row_ns is None or self.stamp_ns is None or self.began_ns is None:
            return None
        return (stamp_ns + self.row_ns - self.stamp_ns - self.began_ns) / 1e9

    def age_s(self, now_ns: int | None = None) -> float | None:  # noqa: ARG002 - a recording has its own now
        return None if self.row_ns is None else max(0, self.shown_ns - self.row_ns) / 1e9

    def is_stale(self, now_ns: int | None = None) -> bool:  # noqa: ARG002 - a recording has its own now
        return self.row_ns is None or self.shown_ns - self.row_ns > STALE_NS

    def rate_hz(self, now_ns: int | None = None) -> float:  # noqa: ARG002 - a recording has its own now
        return self.rows_per_s

    def judge(self, codes: Mapping[str, int]) -> None:
        """Show each component's state of that time, as far as its channels tell.

        `codes` are those of the faults until then by the components' names, also where they come later.
        """
        described = () if self.description is None else self.description.channels
        held = {info.component for info in described if self.values.get(info.name) is not None}
        for part in self.parts.values():
            state, problem = "ok", None
            if self.word(f"{part.name}.state") in FAULTS:
                code = self.values.get(f"{part.name}.error_code")
                state = "fault"
                later = codes.get(part.name.replace("_", " "))
                said = error_text(int(code)) if code else f"{error_text(later)}, {LATER}" if later else ""
                problem = f"the drive is in fault: {said}" if said else ""
            elif part.name not in held and part.kind != "device":
                state, problem = "lost", "the recording has no value of it here"
            self.parts[part.name] = replace(part, state=state, problem=problem)


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of a recording: its rows, and what models said of them then, in time's order."""

    rows: Rows
    said: Sequence[PastPrediction]

    def between(self, begin_ns: int, end_ns: int) -> "Piece":
        """Return the rows and predictions from `begin_ns` up to before `end_ns`."""
        first, last = (bisect_left(self.said, at, key=lambda one: one.utc_ns) for at in (begin_ns, end_ns))
        return Piece(self.rows.between(begin_ns, end_ns), self.said[first:last])


Read = Callable[[Callable[[], Any]], "Future[Any]"]  # does it in a thread
Recall = Callable[
    [int, int], Sequence[PastPrediction]
]  # what was said from one instant up to before another; blocks


def nothing_said(_begin_ns: int, _end_ns: int) -> Sequence[PastPrediction]:
    """Return the predictions of a recording without any."""
    return ()


class Playback:
    """For the window's thread; `read` does what it is given in another one.

    `desk` holds the one station that is a recording; views of a desk show it as they show a robot. After a
    jump it begins anew, some seconds before the instant that was asked for. Times are UTC in ns.
    """

    def __init__(self, read: Read, deliver: Deliver, shown: Shown) -> None:
        self.desk = Desk()
        self.desk.shown = shown
        self.tape: Tape | None = None
        self.playing = False
        self.speed = 1.0
        self.position_ns = 0
        self.problem = ""  # why there is nothing to see
        self.wishes = 0  # how often somebody has wished to be elsewhere, or to play
        self._read = read
        self._deliver = deliver
        self._robot = PlayedRobot()
        self._words: Mapping[str, dict[str, str]] = {}
        self._recall: Recall = nothing_said
        self.happened = TimelineEvents(read, deliver)
        self.outline = Outline(read, deliver)
        self.parameters = RecordedParameters()
        self._said: dict[str, PastPrediction] = {}  # the newest of each task
        self._pieces: dict[int, Piece] = {}
        self._reading: int | None = None
        self._fed_ns: int | None = None  # up to where the station has seen the recording; None: it jumps
        self._jumps = 0
        self._stepped_s: float | None = None

    def open(
        self,
        tape: Tape,
        words: Mapping[str, dict[str, str]] = MappingProxyType({}),
        recall: Recall = nothing_said,
    ) -> None:
        """Show this one from its beginning; `words` are those of the channels that are states."""
        self.close()
        self.tape, self._words, self._recall = tape, _words(tape, words), recall
        station = Station(
            tape.session.robot, "a recording", cast("Commands", NoRobot()), self._deliver, self.desk.news
        )
        station.robot = self._robot = PlayedRobot(rows_per_s=_rate(tape))
        station.take([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns())])
        self.desk.stations = [station]
        self.desk.select(station)
        self.happened.open(tape, _words(tape, words))
        self.outline.open(tape)
        self.parameters.open(tape)
        self.seek(tape.first_ns)

    def close(self) -> None:
        """Show nothing more."""
        self.tape, self.playing, self.problem, self.speed = None, False, "", 1.0
        self._pieces, self._reading, self._fed_ns = {}, None, None
        self.desk.stations = []
        self.desk.select(None)

    def play(self, on: bool) -> None:
        """Go on, or stand still; from the beginning where it had come to the end."""
        if on and self.tape is not None and self.position_ns >= self.tape.last_ns:
            self.seek(self.tape.first_ns)
        self.wishes += 1
        self.playing, self.problem, self._stepped_s = on, "", None

    def seek(self, position_ns: int) -> None:
        """Jump there, or as near as the recording goes."""
        self.wishes += 1
        if self.tape is not None:
            self.position_ns = min(max(position_ns, self.tape.first_ns), self.tape.last_ns)
            self._fed_ns, self.problem = None, ""

    @property
    def is_loading(self) -> bool:
        """Whether what is to be shown has not been read yet."""
        return self.tape is not None and not self.problem and self._fed_ns != self.position_ns

    def step(self) -> None:
        """Advance to the present time of playback, and show its data."""
        if self.tape is None or self.problem:
            return
        now_s = time.monotonic()
        took_s = 0.0 if self._stepped_s is None else min(now_s - self._stepped_s, LATE_S)
        self._stepped_s = now_s
        target_ns = self.position_ns
        if self.playing and self._fed_ns is not None:
            target_ns = min(target_ns + round(took_s * self.speed * 1e9), self.tape.last_ns)
        if self._show_until(self.tape, target_ns):
            self.position_ns = self._robot.shown_ns = target_ns
            self._show_said(target_ns)
            self.playing = self.playing and target_ns < self.tape.last_ns

    # --- what is shown

    def _show_until(self, tape: Tape, target_ns: int) -> bool:
        """Feed what is between; False where that must be read first."""
        begin_ns = self._fed_ns
        if begin_ns is None:
            begin_ns = max(tape.first_ns, target_ns - LEAD_NS)
        wanted = range(self._place(tape, begin_ns), self._place(tape, target_ns) + 1)
        missing = [place for place in wanted if place not in self._pieces]
        ahead = [] if self._place(tape, tape.last_ns) in wanted else [wanted[-1] + 1]
        self._fetch(tape, next((place for place in [*missing, *ahead] if place not in self._pieces), None))
        if missing:
            return False
        if self._fed_ns is None:
            self._begin_anew(tape)
        end_ns = 1 + (target_ns if target_ns > tape.first_ns else target_ns + FIRST_NS)  # with the row at it
        if end_ns > begin_ns:
            shown = [self._pieces[place].between(begin_ns, end_ns) for place in wanted]
            self._feed(Rows.joined([piece.rows for piece in shown]))
            self._said |= {one.prediction.task: one for piece in shown for one in piece.said}
        self._fed_ns = target_ns
        held, told = self.parameters.at(target_ns), self.parameters.told
        self._robot.parameters, self._robot.at_start = (held, {}) if told else ({}, held)
        return True

    def _begin_anew(self, tape: Tape) -> None:
        """Begin anew: to views, a jump is as if the robot's computer had started anew."""
        self._jumps += 1
        self._robot.began_ns = tape.first_ns
        self._robot.row_ns = self._robot.stamp_ns = None
        self._said = {}
        station = self.desk.stations[0]
        station.take([Described(_description(tape, self._jumps, self._words, self.parameters.described))])
        station.predictions.take(Serves(station.name, {}, {"": NOT_PREDICTED}))

    def _show_said(self, now_ns: int) -> None:
        """Show the last predictions, unless they are too old."""
        recalled = {
            task: Recalled(one.prediction, (now_ns - one.utc_ns) / 1e9) for task, one in self._said.items()
        }
        shown = {task: one for task, one in recalled.items() if not one.is_stale()}
        self.desk.stations[0].predictions.recalled = shown

    def _feed(self, rows: Rows) -> None:
        newest = self._robot.stamp_ns
        if newest is not None:  # UTC may have fallen a little where two pieces meet; this clock never does
            rows = rows.part(slice(int(np.searchsorted(rows.stamps_ns, newest, "right")), None))
        if not len(rows):
            return
        columns = {name: nullable(column) for name, column in rows.columns.items()}
        batch = Batch(rows.stamps_ns.tolist(), columns, 0, 0, 0, 1, time.monotonic_ns())
        station = self.desk.stations[0]
        station.take([Telemetry(1, batch, None)])
        station.flags.add(*self._flags(rows))
        self._robot.row_ns, self._robot.stamp_ns = int(rows.utc_ns[-1]), int(rows.stamps_ns[-1])
        until_now = [flag for flag in self.happened.flags if flag.at_ns <= self._robot.row_ns]
        self._robot.judge(fault_codes(until_now))

    def _flags(self, rows: Rows) -> Iterator[Flag]:
        """Yield the flags within these rows, or since those before, on their clock."""
        behind_ns, before_ns = int(rows.stamps_ns[-1] - rows.utc_ns[-1]), self._robot.row_ns
        begin_ns = int(rows.utc_ns[0]) if before_ns is None else before_ns + 1  # gaps have no rows
        for flag in self.happened.flags.between(begin_ns, int(rows.utc_ns[-1]) + 1):
            if flag.kind not in (FlagKind.FAULT, FlagKind.STOP):  # these the rows tell themselves
                yield replace(flag, at_ns=flag.at_ns + behind_ns)

    # --- what is read

    def _place(self, tape: Tape, instant_ns: int) -> int:
        return (instant_ns - tape.first_ns) // PIECE_NS

    def _fetch(self, tape: Tape, place: int | None) -> None:
        if place is None or self._reading is not None:
            return
        self._reading, recall = place, self._recall
        begin_ns = tape.first_ns + place * PIECE_NS
        end_ns = begin_ns + PIECE_NS
        when_done(
            self._read(lambda: Piece(drawable(tape.read(begin_ns, end_ns)), recall(begin_ns, end_ns))),
            self._deliver,
            lambda piece: self._fetched(tape, place, piece),
            lambda error: self._failed(tape, error),
        )

    def _fetched(self, tape: Tape, place: int, piece: Piece) -> None:
        if tape is not self.tape:
            return
        self._reading = None
        self._pieces[place] = piece
        here = self._place(tape, self.position_ns)
        while len(self._pieces) > PIECES:
            del self._pieces[max(self._pieces, key=lambda known: abs(known - here))]

    def _failed(self, tape: Tape, error: Exception) -> None:
        if tape is self.tape:
            self._reading, self.playing, self.problem = None, False, str(error)


def _rate(tape: Tape) -> float:
    """Return rows a second, as far as the store knows."""
    seconds = tape.session.length.total_seconds()
    return tape.session.rows / seconds if seconds else 0.0


def _words(tape: Tape, told: Mapping[str, dict[str, str]]) -> dict[str, dict[str, str]]:
    """Return those that are told, and those of drives."""
    joints = [name.rpartition(".")[0] for name in tape.units if name.endswith(".position")]
    usual = {f"{joint}.state": DRIVE_STATES for joint in joints if f"{joint}.state" in tape.units}
    return usual | dict(told)


def _description(
    tape: Tape, jumps: int, words: Mapping[str, dict[str, str]], parameters: Sequence[ParameterInfo] = ()
) -> Description:
    """Return the robot's description, as far as its channels show it."""
    channels = []
    for name, unit in tape.units.items():
        component, _, quantity = name.rpartition(".")
        channels.append(ChannelInfo(name, unit, component, quantity, words.get(name, UNSET)))
    components: dict[str, str] = {}
    for quantity, kind in KINDS.items():
        for channel in channels:
            if channel.quantity == quantity:
                components.setdefault(channel.component, kind)
    return Description(
        robot=tape.session.robot,
        boot_id=f"jump {jumps}",
        role="recording",
        components=[ComponentInfo(name, kind, "ok") for name, kind in components.items()],
        channels=channels,
        parameters=[*parameters],
        modules={},
        clock=Clock(0, 0, f"jump {jumps}"),
        stop=StopInfo(held=False, reason=None, since_ns=None, stopped_again={}, drives={}),
        guard=GuardInfo(),
    )
