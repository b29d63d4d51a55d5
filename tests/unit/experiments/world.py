"""A robot's gateway as far as an experiment meets it, and what may come between; nothing comes by itself."""

import collections
import contextlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from gateway.client import LinkLost, NotConnected, RemoteError
from gateway.wire.control import JournalEntries
from gateway.wire.parameter import ParameterInfo, Reverted, Written
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import Kind
from server_gui.core.evidence.cycles import Cycle
from server_gui.core.experiments.machine import ExperimentState
from server_gui.core.experiments.plan import Dwell, ExperimentPlan, sweep
from server_gui.core.experiments.run import Run
from server_gui.core.follow.events import Event, Journalled, Telemetry
from server_gui.core.processing.gait_events import Leg
from server_gui.core.tuning.commands import ReadBack
from tests.support.desk import FakeCommands, described, looked, telemetry

NAME, ORIGINAL = "gait.step_length", 0.4
SECOND = 1_000_000_000
INFO = ParameterInfo(NAME, "m", 0.2, 0.6, 0.1, True, None, "gait", "0x2001:0", "rw", True)
Asked = tuple[str, Callable[[], object], "Future[Any]"]


class Walk:
    """Gait cycles that come when the test says so."""

    def __init__(self) -> None:
        self.cycles: collections.deque[Cycle] = collections.deque()
        self.joints: tuple[str, ...] = ("left_knee",)
        self.cut = self.newest_ns = 0

    def take(self, event: Event) -> None:
        """Everything else is left out."""


class World(FakeCommands):
    """The gateway's half: it holds the value, and takes back what is on trial with the lease or the link."""

    def __init__(self, plan: ExperimentPlan | None = None) -> None:
        super().__init__()
        self.now_ns = 100 * SECOND
        self.value, self.ends_ns = ORIGINAL, 0
        self.trial: int | None = None
        self.is_linked = self.is_walking = self.is_told = self.is_watched = True
        self.is_taken = False  # the lease, by another desk
        self.foreign = False
        self.waiting: list[Asked] = []
        self.wrote: list[float] = []
        self.number = 0
        self.alarms: list[Alarm] = []
        self.walk = Walk()
        plan = plan or sweep_of()
        self.run = Run(plan, "exo-01", self, lambda call: call(), described(), lambda: self.now_ns)
        vars(self.run)["_walk"] = self.walk

    # --- what is asked

    def _later(self, name: str, do: Callable[[], object]) -> "Future[Any]":
        future: Future[Any] = Future()
        if self.is_linked:
            self.waiting.append((name, do, future))
        else:
            future.set_exception(NotConnected("no link"))
        return future

    def write(self, changes: Mapping[str, float], trial_s: float | None) -> "Future[Any]":
        assert trial_s is not None
        assert not self.run.why, f"written after {self.run.why}"
        (value,) = changes.values()
        self.wrote.append(value)
        return self._later("write", lambda: self._written(value, trial_s))

    def revert(self, write: int) -> "Future[Any]":
        return self._later("revert", lambda: self._reverted(write))

    def release_control(self) -> "Future[Any]":
        return self._later("release", self.take_back)

    def read_back(self, name: str) -> "Future[Any]":
        return self._later("read", lambda: ReadBack(self.value, None, self.trial is not None))

    # --- what the gateway does

    def _written(self, value: float, trial_s: float) -> Written:
        if self.is_taken:
            raise RemoteError(-1, "another desk has control", {"kind": "no_lease"})
        self.number += 1
        self.trial, self.ends_ns = self.number, self.now_ns + round(trial_s * SECOND)
        self.value = value
        return Written(self.number, {NAME: ORIGINAL}, {NAME: value}, trial_s)

    def _reverted(self, write: int) -> Reverted:
        if self.trial != write:
            raise RemoteError(-1, "it is not on trial", {"kind": "unknown_name"})
        self.take_back()
        return Reverted(write, {NAME: "left alone" if self.foreign else "taken back"})

    def take_back(self) -> None:
        """As a gateway does: what another master has written is left alone."""
        if self.trial is not None and not self.foreign:
            self.value = ORIGINAL
        self.trial = None

    # --- what happens

    def carry_out(self) -> None:
        """The oldest request is carried out and answered."""
        if self.waiting:
            _, do, future = self.waiting.pop(0)
            try:
                answer = do()
            except RemoteError as error:
                future.set_exception(error)
                return
            future.set_result(answer)

    def drop(self) -> None:
        """The link dies; requests that were on their way are not carried out, trials go back."""
        self.is_linked = False
        lost, self.waiting = self.waiting, []
        self.take_back()
        for _, _, future in lost:
            future.set_exception(LinkLost("the link dropped"))

    def drop_late(self) -> None:
        """The link dies when the oldest request was carried out, and before its answer."""
        if self.waiting:
            _, do, future = self.waiting.pop(0)
            self.waiting.insert(0, ("", lambda: None, future))
            with contextlib.suppress(RemoteError):
                do()
        self.drop()

    def link(self) -> None:
        """There is a link again."""
        self.is_linked = True

    def sleep(self, seconds: float) -> None:
        """Time passes, and telemetry and steps come as long as there are any."""
        for _ in range(round(seconds / 0.5)):
            self.now_ns += SECOND // 2
            if self.trial is not None and self.now_ns >= self.ends_ns:
                self.take_back()
            if self.is_told:
                self._tell()
            if self.is_watched:
                self.run.beat()
            self.run.tick(self.alarms)

    def _tell(self) -> None:
        self.walk.newest_ns = self.now_ns
        if self.is_walking:
            self.walk.cut += 1
            self.walk.cycles.append(Cycle(Leg.LEFT, self.now_ns - SECOND // 2, self.now_ns))
        row: Telemetry = telemetry([self.now_ns], {"left_knee.following_error": [0.01]})
        self.run.take(row)
        self.run.take(looked({NAME: self.value}, at_ns=self.now_ns))

    def steal(self) -> None:
        """Another master writes the object, past the gateway."""
        self.value, self.foreign = 0.55, True

    def alarm(self) -> None:
        """The guard warns."""
        self.alarms = [Alarm(Kind.GUARD, "guard.tilt", "too far")]

    def stop(self, reason: str = "") -> "Future[Any]":
        entry = {"n": 1000, "who": "anna", "what": "stop"}
        self.run.take(Journalled(JournalEntries([entry])))
        return Future()

    def restart(self) -> None:
        """The robot's computer starts anew: it takes back what it finds on trial."""
        self.drop()
        event = described()
        vars_of = type(event.description)
        fields = {name: getattr(event.description, name) for name in vars_of.__struct_fields__}
        self.run.take(type(event)(vars_of(**{**fields, "boot_id": "boot-2"})))

    def settle(self) -> None:
        """Everything that is asked is answered from now on, for long enough."""
        self.is_linked = True
        for _ in range(400):
            if self.run.is_over and not self.waiting:
                return
            self.carry_out()
            self.sleep(0.5)
        raise AssertionError(f"it never ends: {self.run.state} {self.run.why}")

    def until(self, state: ExperimentState) -> None:
        """Let all go well until it stands there."""
        for _ in range(400):
            if self.run.state is state:
                return
            if state is not ExperimentState.WRITING or self.run.state is not ExperimentState.WRITING:
                self.carry_out()
            if self.run.state is not state:
                self.sleep(0.5)
        raise AssertionError(f"{self.run.state}, not {state}: {self.run.why}")


def sweep_of() -> ExperimentPlan:
    """Three values."""
    from gateway.units import Units
    from server_gui.core.tuning.edits import unit_of

    return sweep(INFO, ORIGINAL, (0.4, 0.44, 0.02), unit_of(NAME, "m", Units()), dwell=Dwell(3, 1))
