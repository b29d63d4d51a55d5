"""One experiment on one robot, from the look at the walk until the original value was read back.

Nothing here waits: facts of the robot's feed come by `take`, answers by futures, time by `tick`. What is done
when is the table of `machine`; each value is a trial, which the robot takes back without us.
"""

import time
from collections.abc import Callable, Iterable, Sequence
from typing import Final

from gateway.client import NotConnected, RemoteError
from gateway.wire.parameter import Reverted, Written
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.texts import UNSTOPPED, Kind
from server_gui.core.evidence.cycles import Cycle
from server_gui.core.evidence.experiment import Period
from server_gui.core.evidence.robot_evidence import RobotEvidence
from server_gui.core.experiments.machine import Action, Event, ExperimentState, after
from server_gui.core.experiments.plan import BadPlan, ExperimentKind, ExperimentPlan
from server_gui.core.experiments.stop_rules import StopRules
from server_gui.core.experiments.verdict import HeldPeriod
from server_gui.core.follow.events import Described, Looked, Telemetry
from server_gui.core.follow.events import Event as Fact
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.gait_events import Leg
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands, ReadBack
from server_gui.core.tuning.writing import UNSURE

SECOND: Final = 1_000_000_000
LOOKS_AT: Final = 3  # cycles of a leg, before anything is written
WATCHED_S: Final = 5.0  # without a sign of who watches a sweep
STALE_S: Final = 2.0  # without telemetry
STANDS_S: Final = 6.0  # without a gait cycle: nobody walks any more
AGAIN_NS: Final = SECOND  # between looks at what is held
LIMITS_S: Final = {
    ExperimentState.LOOKING: 30.0,
    ExperimentState.WRITING: 35.0,
    ExperimentState.TAKING_BACK: 35.0,
    ExperimentState.READING: 60.0,
}
IN_THE_WAY: Final = UNSTOPPED | {Kind.GUARD, Kind.STOPPED}


def begun(
    plan: ExperimentPlan, before: "Run | None", robot: Robot, commands: Commands, deliver: Deliver
) -> "Run":
    """Return a new one; raises `BadPlan` where the one `before` goes on, or the robot is not known."""
    if before is not None and not before.is_over:
        raise BadPlan(f"{before.plan.kind.value} of {before.plan.name} goes on: stop it, or wait for its end")
    if robot.description is None:
        raise BadPlan("the robot has not told yet what it is made of")
    return Run(plan, robot.description.robot, commands, deliver, Described(robot.description))


class Run:
    """Begins by itself once somebody walks. Answers come back by `deliver`, in the thread of `tick`."""

    def __init__(
        self,
        plan: ExperimentPlan,
        robot: str,
        commands: Commands,
        deliver: Deliver,
        described: Described,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self.plan = plan
        self.robot = robot
        self.state = ExperimentState.LOOKING
        self.why = ""  # it ended early
        self.back = ""  # what is known of the original value
        self.utc_ns = time.time_ns()
        self.boot_id = described.description.boot_id
        self.periods: list[tuple[Period, HeldPeriod]] = []
        self.writes: list[int] = []  # its trials, in the robot's journal
        self.transients = 0  # cycles that were left out
        self._commands = commands
        self._deliver = deliver
        self._clock = clock
        self._walk = RobotEvidence(robot)
        self._walk.take(described)
        self.joints = self._walk.joints
        component = plan.name.partition(".")[0]
        self.edited = tuple(joint for joint in self.joints if joint == component)
        self.watch = StopRules(plan.name, self.edited or self.joints, plan.bounds, plan.said)
        self.watch.take(described)
        self.place = 0  # of the step
        self._write: int | None = None  # that is on trial
        self._since_ns = self._beat_ns = self._rows_ns = clock()
        self._began_ns = 0  # of this step, on the robot's clock
        self._cycles: dict[Leg, list[Cycle]] = {leg: [] for leg in Leg}  # that began with this value
        self._legs: set[Leg] = set()  # that were seen to step
        self._cut = 0  # cycles that were taken
        self._walked_ns = 0  # the end of the newest cycle, or the beginning of this step
        self._held: float | None = None  # what the device was seen to hold, before anything
        self._read_ns: int | None = None  # when to read next; None: an answer is awaited

    # --- what is told

    @property
    def is_over(self) -> bool:
        """Whether it has ended, well or not."""
        return self.state.is_end

    @property
    def is_whole(self) -> bool:
        """Whether every value was held as planned."""
        return not self.why and self.state is ExperimentState.OVER

    @property
    def cycles(self) -> int:
        """Number of cycles of this step, by the leg with the fewest, without the transient ones."""
        return max(0, self._least() - self.plan.dwell.transient)

    @property
    def left_s(self) -> float:
        """About how long it goes on, as the last stride lasted."""
        stride_s = self._walk.cycles[-1].seconds if self._walk.cycles else 1.2
        whole_s = self.plan.expected_s(stride_s)
        held_s = (self._clock() - self._since_ns) / SECOND if self.state is ExperimentState.HOLDING else 0.0
        return max(0.0, whole_s * (1.0 - self.place / len(self.plan.steps)) - held_s)

    @property
    def trial_left_s(self) -> float:
        """Until the robot takes this value back by itself, if nobody does anything."""
        return max(0.0, self.plan.dwell.trial_s - (self._clock() - self._since_ns) / SECOND)

    # --- what comes

    def take(self, fact: Fact) -> None:
        """Take an event of the robot's feed."""
        self._walk.take(fact)
        self.watch.take(fact)
        match fact:
            case Telemetry():
                self._rows_ns = self._clock()
                self._take_cycles()
            case Looked() if fact.parameters is not None and self.plan.name in fact.parameters.values:
                held = fact.parameters.values[self.plan.name].value
                self._held = None if held is None else float(held)

    def beat(self) -> None:
        """Note that somebody watches."""
        self._beat_ns = self._clock()

    def halt(self, why: str) -> None:
        """End it, and take back what is on trial; says why once."""
        if not self.is_over and self.state in (
            ExperimentState.LOOKING,
            ExperimentState.WRITING,
            ExperimentState.HOLDING,
        ):
            self.why = self.why or why
        self._do(Event.HALT)

    def tick(self, alarms: Sequence[Alarm]) -> None:
        """Look at the time, and at what was broken; call it some times a second."""
        if self.is_over:
            return
        self.watch.see(alarms, self._clock())
        broken = self._broken()
        if broken is not None and self.state in (
            ExperimentState.LOOKING,
            ExperimentState.WRITING,
            ExperimentState.HOLDING,
        ):
            self.halt(broken)
        elif self.state is ExperimentState.LOOKING:
            self._look(alarms)
        elif self.state is ExperimentState.HOLDING and self._is_enough():
            self._close_period()
            self._do(Event.NEXT if self.place < len(self.plan.steps) else Event.LAST)
        if self._is_late():
            self.why = self.why or self._late()
            self._do(Event.LATE)
        elif (
            self.state is ExperimentState.READING
            and self._read_ns is not None
            and self._clock() >= self._read_ns
        ):
            self._ask_what_is_held()

    # --- stop rules that need the time

    def _broken(self) -> str | None:
        now_ns = self._clock()
        if self.watch.why is not None:
            return self.watch.why
        if now_ns - self._rows_ns > STALE_S * SECOND:
            return f"no telemetry for {STALE_S:.0f} s: the link is lost, or its values are stale"
        if self.plan.kind is ExperimentKind.SWEEP and now_ns - self._beat_ns > WATCHED_S * SECOND:
            return "nobody watches it any more"
        if (
            self.state is ExperimentState.HOLDING
            and self._walk.newest_ns - self._walked_ns > STANDS_S * SECOND
        ):
            return f"no gait cycle for {STANDS_S:.0f} s: the robot does not walk any more"
        return None

    def _is_late(self) -> bool:
        limit_s = (
            self.plan.dwell.limit_s if self.state is ExperimentState.HOLDING else LIMITS_S.get(self.state)
        )
        return limit_s is not None and self._clock() - self._since_ns > limit_s * SECOND

    def _late(self) -> str:
        unread = f"{self.plan.name} could not be read"
        seen = f"{self._least()} of {LOOKS_AT} gait cycles were seen"
        unseen = f"{seen}: nobody walks, or rows are missing, as where this computer is too busy"
        return {
            ExperimentState.LOOKING: unread if self._held is None else unseen,
            ExperimentState.WRITING: "the robot has not answered a write in time",
            ExperimentState.HOLDING: f"too few gait cycles came in {self.plan.dwell.limit_s:.0f} s",
        }.get(self.state, "the robot has not answered in time")

    # --- what is done

    def _look(self, alarms: Iterable[Alarm]) -> None:
        """Begin once it is seen that somebody walks, on a robot that nothing is wrong with."""
        problem, said = next((one.brief for one in alarms if one.kind in IN_THE_WAY), None), self.plan.said
        if problem is not None:
            self.halt(f"it does not begin: {problem}")
        elif self._held is not None and self._held != self.plan.original:
            held, planned = said(self._held), said(self.plan.original)
            self.halt(f"{self.plan.name} is {held}, not {planned} any more: begin anew")
        elif self._held is not None and self._least() >= LOOKS_AT:
            self.watch.begin(alarms, self._walk.newest_ns)
            self._do(Event.READY)

    def _do(self, event: Event) -> None:
        before = self.state
        self.state, action = after(before, event)
        if self.state is not before:
            self._since_ns = self._clock()
        match action:
            case Action.WRITE:
                self._ask_to_write()
            case Action.REVERT if self._write is not None:
                when_done(self._commands.revert(self._write), self._deliver, self._taken, self._not_taken)
            case Action.REVERT | Action.RELEASE:
                when_done(self._commands.release_control(), self._deliver, self._taken, self._not_taken)
            case Action.READ:
                self._read_ns = self._clock() + (AGAIN_NS if before is ExperimentState.READING else 0)
        if self.is_over and before is not self.state:
            self._ended()

    def _ask_to_write(self) -> None:
        value = self.plan.steps[self.place].value
        self.watch.writes()
        future = self._commands.write({self.plan.name: value}, self.plan.dwell.trial_s)
        when_done(future, self._deliver, self._written, self._not_written)

    def _written(self, written: Written) -> None:
        self._write = written.write
        self.writes.append(written.write)
        before = written.before.get(self.plan.name)
        self.watch.holds(float(written.after.get(self.plan.name, 0.0)), self._clock())
        self._began_ns = self._walked_ns = self._walk.newest_ns
        self._cycles = {leg: [] for leg in Leg}
        self._do(Event.WRITTEN)
        if before != self.plan.original or len(written.before) != 1:
            original = self.plan.said(self.plan.original)
            self.halt(f"the trial would go back to {before} (SI), and not to {original} alone")

    def _not_written(self, error: Exception) -> None:
        self.why = self.why or f"not written: {error}"
        refused = isinstance(error, RemoteError) and error.kind not in UNSURE
        self._do(Event.REFUSED if refused or isinstance(error, NotConnected) else Event.UNSURE)

    def _taken(self, answer: Reverted | None) -> None:
        if answer is not None:
            self.back = ", ".join(answer.outcome.values())
        self._do(Event.TAKEN)

    def _not_taken(self, error: Exception) -> None:
        self.back = str(error)
        self._do(Event.NOT_TAKEN)

    def _ask_what_is_held(self) -> None:
        self._read_ns = None
        when_done(self._commands.read_back(self.plan.name), self._deliver, self._read, self._not_read)

    def _read(self, found: ReadBack) -> None:
        held = "not known" if found.value is None else self.plan.said(found.value)
        self.back = f"{self.plan.name} = {held}"
        if found.problem:
            self.back += f", {found.problem}"
        if found.on_trial:
            self.back += ", still on trial"
        is_back = found.value == self.plan.original and not found.on_trial
        self._do(Event.ORIGINAL if is_back else Event.OTHER)

    def _not_read(self, error: Exception) -> None:
        self.back = str(error)
        self._do(Event.UNREAD)

    def _ended(self) -> None:
        """Give the lease back, as nobody needs it any more; the end does not wait for that."""
        if self.state is not ExperimentState.NOTHING_DONE:
            self._commands.release_control()

    # --- gait cycles

    def _take_cycles(self) -> None:
        new = self._walk.cut - self._cut
        if not new:
            return
        self._cut += new
        for cycle in list(self._walk.cycles)[-new:]:
            self._legs.add(cycle.leg)
            self._walked_ns = max(self._walked_ns, cycle.ended_ns)
            if cycle.began_ns >= self._began_ns:
                self._cycles[cycle.leg].append(cycle)

    def _least(self) -> int:
        """Return the number of cycles of the leg with the fewest, among legs that have stepped at all."""
        return min((len(self._cycles[leg]) for leg in self._legs), default=0)

    def _is_enough(self) -> bool:
        dwell = self.plan.dwell
        if not self.plan.steps[self.place].is_measured:
            return self._least() > dwell.transient
        if dwell.seconds is None:
            return self._least() >= dwell.transient + dwell.cycles
        legs = [cycles[: dwell.transient] for cycles in self._cycles.values() if cycles]
        if self._least() < dwell.transient:
            return False
        settled_ns = max((cycles[-1].ended_ns for cycles in legs if cycles), default=self._began_ns)
        return self._walk.newest_ns - settled_ns >= dwell.seconds * SECOND

    def _close_period(self) -> None:
        step = self.plan.steps[self.place]
        kept = [one for cycles in self._cycles.values() for one in cycles[self.plan.dwell.transient :]]
        self.transients += sum(map(len, self._cycles.values())) - len(kept)
        self.place += 1
        if step.is_measured:
            ended_ns = self._walk.newest_ns
            period = Period(step.value, self._write or 0, self._began_ns, ended_ns, len(kept))
            self.periods.append((period, HeldPeriod(step.value, sorted(kept, key=lambda one: one.ended_ns))))
