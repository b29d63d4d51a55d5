"""Blame: a late frame of the control loop, and who ran instead, over recorded counters."""

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from gateway.cli.blame import line, summary
from gateway.modules.resource import blame as module
from gateway.modules.resource.blame import BlameModule
from gateway.modules.resource.overruns import Deadline, Judge, Late, Reason
from gateway.modules.resource.tasks import Spent, Tasks
from gateway.wire.messages import Overrun, Overruns, RanInstead
from tests.unit.gateway.harness import HEAD, Bench, Client, config, serving
from tests.unit.gateway.recorded import Process, Recorded, Thread, single

MS = 1_000_000
PERIOD, TOLERANCE = 10 * MS, 2 * MS
LOOP = '[control_loop]\nprocesses = ["exo_control"]\nbus = "main"\nperiod_ms = 10\nlate_ms = 2\n'
SYNC = 0x080


# When


def test_a_frame_is_late_after_its_tolerance_and_the_next_is_due_a_period_after_it() -> None:
    deadline = Deadline(PERIOD, TOLERANCE)
    stamps = [0, 10, 22, 34.001, 44, 50, 90]
    late = [deadline.met(round(stamp * MS)) for stamp in stamps]
    assert late == [None, None, None, Late(34_001_000, 2_001_000), None, None, Late(90 * MS, 30 * MS)]
    assert (deadline.cycles, deadline.missed) == (6, 2)


# Why


CONTROL = (40, 40)
LATE = Late(0, 8 * MS)


def judged(own: tuple[float, float], *, usual_ms: float = 3.0, cycles: int = 1) -> Reason:
    judge = Judge()
    for _ in range(5):
        judge.in_time(2, {CONTROL: Spent(0, 0)}, {CONTROL: Spent(round(2 * usual_ms * MS), 0)}, [40])
    spent = Spent(round(own[0] * MS), round(own[1] * MS))
    return judge.late(LATE, cycles, {CONTROL: Spent(0, 0)}, {CONTROL: spent}, [40]).reason


def test_where_it_waited_for_a_core_others_ran() -> None:
    assert judged((3, 7)) is Reason.OTHERS
    assert judged((11, 4)) is Reason.OTHERS


def test_where_it_ran_longer_than_it_usually_does_it_is_its_own_work() -> None:
    assert judged((11, 0.1)) is Reason.OWN_WORK
    assert judged((7, 0)) is Reason.OWN_WORK
    assert judged((6.9, 0)) is Reason.ASLEEP
    assert judged((11, 0), usual_ms=10) is Reason.ASLEEP
    assert judged((11, 0), cycles=3) is Reason.ASLEEP  # as much as usual, in more than one cycle


def test_where_it_did_neither_it_slept() -> None:
    assert judged((1, 0.5)) is Reason.ASLEEP


def test_the_processes_come_with_the_time_of_all_their_threads_the_longest_first() -> None:
    before = {CONTROL: Spent(0, 0), (1, 1): Spent(100, 0), (2, 2): Spent(5, 0), (3, 3): Spent(9, 0)}
    after = {CONTROL: Spent(50, 0), (1, 1): Spent(103, 0), (2, 2): Spent(7, 0), (2, 21): Spent(4, 0)}
    blame = Judge().late(LATE, 1, before, after | {(3, 3): Spent(9, 0)}, [40])
    assert blame.others == [(2, 21, 6), (1, 1, 3)]


# Who


class Turn:
    """A blame module over a recorded procfs; its loop is turned by hand."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.recorded = Recorded(folder / "proc")
        self.control = Process([Thread(40, "python3")], "/opt/exo_control", cores="0")
        self.hog = single(50, "hog")
        self.elsewhere = single(51, "elsewhere", core=1)
        self.recorded.processes = [self.control, self.hog, self.elsewhere]
        self.recorded.write()
        self.posted: list[Callable[[], object]] = []
        self.bus = CanBus("main", CanSettings(interface="virtual", channel="unused"))
        monkeypatch.setattr(module, "Tasks", lambda: Tasks(str(self.recorded.root)))
        monkeypatch.setattr(module, "LOOK_S", 0.0)
        monkeypatch.setattr(module, "LATE_MEET_S", 0.0)
        component = SimpleNamespace(robot=SimpleNamespace(buses={"main": self.bus}))
        context: Any = SimpleNamespace(
            config=config(folder, HEAD + LOOP),
            loop=SimpleNamespace(post=self.posted.append),
            needs={"component": component},
        )
        self.module = BlameModule(context)
        self.module.start()
        self.stamp_ns = 0
        self.frame(0)

    def frame(self, after_ms: float) -> None:
        """The next SYNC, and the loop's turn."""
        self.stamp_ns += round(after_ms * MS)
        self.recorded.write()
        self.bus._handlers[SYNC](self.stamp_ns, b"")
        self.turn()

    def turn(self) -> None:
        posted, self.posted[:] = list(self.posted), []
        for callback in posted:
            callback()

    def ask(self, session: Any) -> Any:
        return self.module.handlers["resource.overruns"](session, None)

    def end(self) -> None:
        self.module.stop()
        self.turn()
        assert SYNC not in self.bus._handlers


class FakeSession:
    """A connection that stays."""

    closed = False

    def on_close(self, farewell: Callable[[], None]) -> None:
        """It never comes to that."""


@pytest.fixture
def turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Turn]:
    turn = Turn(tmp_path, monkeypatch)
    yield turn
    turn.end()


def had(process: Process, ran_ms: float, waited_ms: float = 0.0) -> None:
    process.threads[0].ran_ns += round(ran_ms * MS)
    process.threads[0].waited_ns += round(waited_ms * MS)


def test_the_hog_is_named_with_what_it_ran(turn: Turn) -> None:
    asker = FakeSession()
    for _ in range(5):
        had(turn.control, 3)
        had(turn.hog, 1)
        turn.frame(10)
    had(turn.control, 3, 20)
    had(turn.hog, 21)
    had(turn.elsewhere, 30)  # on another core than the control loop may use
    turn.frame(30)
    answer = turn.ask(asker)
    assert (answer.cycles, answer.missed, answer.control) == (6, 1, {"40": "python3"})
    (overrun,) = answer.overruns
    assert (overrun.late_ms, overrun.reason) == (20, "others_ran")
    assert (overrun.ran_ms, overrun.waited_ms) == (3, 20)
    (hog,) = overrun.instead
    assert (hog.pid, hog.name, hog.ran_ms, hog.core, hog.policy) == (50, "hog", 21, 0, "other")
    assert turn.ask(asker).overruns == []  # told once
    assert len(turn.ask(FakeSession()).overruns) == 1  # to each


def test_what_a_real_time_loop_runs_ahead_of_is_named_after_what_it_waits_for(turn: Turn) -> None:
    own, urgent = turn.control.threads[0], turn.hog.threads[0]
    own.policy, own.rt_priority, urgent.policy, urgent.rt_priority = 1, 50, 2, 80
    less = single(52, "less urgent", policy=1, rt_priority=49)
    turn.recorded.processes += [less, single(53, "usual"), single(54, "deadline", policy=6)]
    turn.module._met_ns = 0  # it looks for new ones with the next frame
    turn.frame(10)
    for process, ran_ms in zip(turn.recorded.processes, (3, 15, 0, 30, 40, 5), strict=True):
        had(process, ran_ms, 20 if process is turn.control else 0)
    turn.frame(30)
    (overrun,) = turn.ask(FakeSession()).overruns
    assert [one.name for one in overrun.instead] == ["hog", "deadline", "usual", "less urgent"]


def test_a_hog_that_has_only_just_begun_is_named_too_and_an_older_one_is_not(turn: Turn) -> None:
    turn.frame(10)
    since_boot_s = float(Path("/proc/uptime").read_text().split()[0])
    had(turn.control, 3, 20)
    turn.recorded.processes += [
        single(60, "just begun", ran_ns=20 * MS, started_s=since_boot_s + 1),
        single(61, "unseen for long", ran_ns=900 * MS, started_s=since_boot_s - 100),
    ]
    turn.frame(30)
    (overrun,) = turn.ask(FakeSession()).overruns
    assert [one.name for one in overrun.instead] == ["just begun"]


def test_only_the_worst_of_several_frames_that_came_together_is_told(turn: Turn) -> None:
    turn.recorded.write()
    for after_ms in (10, 30, 10, 50):
        turn.stamp_ns += round(after_ms * MS)
        turn.bus._handlers[SYNC](turn.stamp_ns, b"")
    turn.turn()
    answer = turn.ask(FakeSession())
    assert (answer.cycles, answer.missed) == (4, 2)
    assert [one.late_ms for one in answer.overruns] == [40]


def test_who_does_not_fetch_them_is_given_the_newest(turn: Turn) -> None:
    turn.module._overruns = deque(maxlen=8)
    for n in range(18):
        turn.frame(20 + n)
    overruns = turn.ask(FakeSession()).overruns
    assert len(overruns) == 8
    assert overruns[-1].late_ms == 10 + 17


def test_nobody_is_watched_who_does_not_ask(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, HEAD + LOOP)) as address, Client(address) as client:
        client.call("resource.snapshot")
        assert client.call("gateway.cost")["modules"]["blame"] == "off"


def test_without_a_bus_to_watch_it_is_said_what_is_missing(client: Client) -> None:
    refusal = client.refused("resource.overruns")
    assert (refusal.kind, "[control_loop] bus" in str(refusal)) == ("unavailable", True)


# As people read it


def test_the_summary_says_who_was_first_how_often() -> None:
    hog, other = (
        RanInstead(50, "hog", "hog", 21.4, 0, "other", 0),
        RanInstead(51, "b", "b", 3.0, 0, "other", 0),
    )
    seen = [
        Overrun(1, 20.0, "others_ran", 3.0, 20.5, [hog, other]),
        Overrun(2, 15.0, "others_ran", 3.0, 15.5, [hog]),
        Overrun(3, 9.0, "own_work", 12.0, 0.1, [other]),
    ]
    assert line(seen[0]) == (
        "20.0 ms late: others ran (ran 3.0 ms, waited 20.5 ms); ran instead: hog (50) 21.4 ms, b (51) 3.0 ms"
    )
    assert summary(Overruns(0, {"40": "python3"}, 100, 3, []), seen) == (
        "\ncontrol loop: python3 (40); 3 of 100 cycles late\n"
        "TO BLAME        TIMES    RAN\n"
        "hog                 2  42 ms\n"
        "(its own work)      1      –\n"
    )
    assert summary(Overruns(0, {}, 0, 0, []), []) == "\ncontrol loop: none is there; 0 of 0 cycles late\n"
