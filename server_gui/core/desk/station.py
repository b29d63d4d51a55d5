"""One robot at the desk: its state, its past, and what is asked of it. For the window's thread."""

import dataclasses
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from typing import Final

from msgspec.structs import replace

from gateway.client import ConnectionState
from gateway.units import Units
from gateway.wire.control import Lease
from gateway.wire.cost import GatewayCost
from gateway.wire.method import AnyMethod
from gateway.wire.parameter import ParameterInfo, Written
from gateway.wire.resource import ProcessUse, ResourceSnapshot
from gateway.wire.robot import Description
from gateway.wire.stop import Stopped
from ml.danger.levels import Level
from server_gui.core.alarms.alarm import Alarm, Alarms
from server_gui.core.alarms.drive_states import off_of_late
from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.robot_alarms import Facts
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.watch import AlarmWatch
from server_gui.core.alarms.worst_state import worst
from server_gui.core.audit.journal import Audit
from server_gui.core.desk.alarm_news import AlarmNews
from server_gui.core.desk.flag_watch import FlagWatch, of_stop
from server_gui.core.desk.flags import Flag, FlagKind, Flags
from server_gui.core.desk.resetting import Resetting
from server_gui.core.desk.rings import Rings
from server_gui.core.desk.writes_of_others import WritesOfOthers
from server_gui.core.evidence.edit_list import EditList
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.experiments.plan import ExperimentPlan
from server_gui.core.experiments.run import Run, begun
from server_gui.core.follow.events import (
    Costs,
    Described,
    Event,
    Journalled,
    LinkChanged,
    Looked,
    Resources,
    Telemetry,
)
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.follow.robot import Robot
from server_gui.core.follow.robot_news import RobotNews
from server_gui.core.objects.objects import Objects
from server_gui.core.prediction.newest_predictions import StationPredictions
from server_gui.core.prediction.news import Endangered, PredictionNews, Ruled, turn
from server_gui.core.processing.robot_processing import RobotProcessing
from server_gui.core.threads.answers import Deliver, Result, when_done
from server_gui.core.tuning.commands import Commands
from server_gui.core.tuning.comparison import Comparison
from server_gui.core.tuning.edits import Edits, ReviewedEdit
from server_gui.core.tuning.flash import Flash
from server_gui.core.tuning.lease import LeaseState
from server_gui.core.tuning.link import LEASE_S
from server_gui.core.tuning.reverted_trials import RevertedTrials
from server_gui.core.tuning.stop import Sent, StopProgress, StopState
from server_gui.core.tuning.storing import Storing
from server_gui.core.tuning.trial_ends import TrialEnds
from server_gui.core.tuning.writing import WriteProgress, written_line

WATCH_NS: Final = 200_000_000  # between looks for news


class Station:
    """`take` brings what has come, the others ask; `deliver` brings answers into the window's thread."""

    def __init__(
        self,
        name: str,
        address: str,
        commands: Commands,
        deliver: Deliver,
        news: News,
        *,
        is_named: bool = False,
    ) -> None:
        self.name = name
        self.is_named = is_named  # by the user, who is to find that name everywhere
        self.address = address
        self.is_overloaded: Callable[[], bool] = lambda: False  # this computer
        self.is_full: Callable[[], bool] = lambda: False  # this computer, for seconds, or its window is slow
        self.neighbours: Sequence[Station] = ()  # the robots of the desk, this one among them
        self.robot = Robot()
        self.rings = Rings()
        self.flags = Flags()  # on the robot's clock, as the rows of `rings`
        self.processing = RobotProcessing()
        self.processes: ResourceSnapshot | None = None  # the newest look with a process table
        self.processes_at_ns: int | None = None
        self.most: tuple[ProcessUse, int] | None = None  # who used most CPU, and when that was seen
        self.cost: GatewayCost | None = None  # what monitoring costs the robot, as long as it is looked at
        self.predictions = StationPredictions()
        self.experiment: Run | None = None  # an A/B trial or a sweep, the newest
        self.judged = EditList()
        self.stopping = StopProgress()
        self.control = LeaseState()
        self.edits = Edits()
        self.writing = WriteProgress()
        self.file: Comparison | None = None  # what its parameters are compared with
        self.audit = Audit()
        self.flash = Flash(self.audit)
        self.objects = Objects(commands, deliver)
        self._commands = commands
        self._deliver = deliver
        self.news = news
        self._alarms = AlarmWatch(self._facts, lambda: self.rings.newest_ns)
        self._news = RobotNews(self.tell)
        self._watched_ns = 0
        self._happened = FlagWatch()
        self._alarm_news = AlarmNews(self.tell)
        self.reverted = RevertedTrials(self.robot, self.writing, self.tell)
        self._trial_ends = TrialEnds(commands, deliver, self.writing, self.reverted, self.tell)
        self._others = WritesOfOthers(self.robot, self.tell)
        self._resetting = Resetting(commands, deliver, self.robot, self.stopping, self.tell)
        self._storing = Storing(commands, deliver, self.writing, self.control, self.tell)

    @property
    def called(self) -> str:
        """What the robot calls itself, or what we call it while it has not spoken."""
        return self.robot.description.robot if self.robot.description is not None else self.name

    @property
    def has_twin(self) -> bool:
        """Whether another robot of the desk calls itself so too."""
        others = (other for other in self.neighbours if other is not self)
        return any(self.called == (other.name if other.is_named else other.called) for other in others)

    @property
    def title(self) -> str:
        """The user's name for it; else what it calls itself, and where it is, where another is called so."""
        if self.is_named:
            return self.name
        return f"{self.called} at {self.address}" if self.has_twin else self.called

    @property
    def known(self) -> dict[str, ParameterInfo]:
        """The parameters that can be changed, in the robot's order."""
        found = self.robot.description.parameters if self.robot.description is not None else []
        return {info.name: info for info in found if info.read_only is None}

    @property
    def who(self) -> str:
        """Who we are there, and as what; empty where the robot has no keys, or has not said."""
        hello = self.robot.hello
        return "" if hello is None or hello.identity is None else hello.who

    def refused(self, method: AnyMethod) -> str:
        """Return why we may not ask for this, in the robot's words; empty if we may, as far as is known."""
        return "" if self.robot.hello is None else self.robot.hello.refused.get(method.name, "")

    @property
    def is_linked(self) -> bool:
        """Whether there is a link now."""
        return self.robot.is_linked

    @property
    def is_live(self) -> bool:
        """Whether what is known of the robot is how it is now."""
        return self.is_linked and not self.robot.is_stale()

    @property
    def alarms(self) -> Alarms:
        """What is wrong with it, as of now: a dozen views ask in each frame."""
        return self._alarms.look()

    def acknowledge(self, alarm: Alarm) -> None:
        """Note that somebody has read it; how to go on after a reset is known then."""
        self.alarms.acknowledge(alarm.key)
        if alarm.kind is Kind.RESET:
            self.stopping.was_ended = False

    def _facts(self) -> Facts:
        known = (self.robot, self.stopping, self.address, self.audit.entries)
        return Facts(*known, danger=self.predictions.danger, is_overloaded=self.is_overloaded())

    @property
    def mark(self) -> Mark:
        """How it is, in one mark and word: the same wherever it is shown."""
        return worst(self.robot, self.alarms, self.stopping)

    def tell(self, kind: NewsKind, text: str, about: str = "", ago_s: float = 0.0) -> None:
        """Note something about this robot, or about a component of it, which was so long ago."""
        title = "" if self.robot.description is None else self.title
        self.news.add(kind, self.name, text, about, title, ago_s)

    def flag(self, text: str, ago_s: float = 0.0) -> None:
        """Flag this instant, or the one `ago_s` before it, which somebody has marked."""
        if self.rings.newest_ns is not None:
            before_ns = max(round((ago_s - (self.robot.age_s() or 0.0)) * 1e9), 0) if ago_s else 0
            self.flags.add(Flag(self.rings.newest_ns - before_ns, text or "mark", FlagKind.MARK))

    # --- what has come

    def take(self, events: Iterable[Event]) -> None:
        """Apply what has come, and look for what is new."""
        self._alarms.again()
        for event in events:
            if self.experiment is not None:
                self.experiment.take(event)
            if isinstance(event, Resources) and isinstance(event.snapshot.processes, list):
                self._processes(event)
                continue
            if isinstance(event, Resources) and event.most is not None:
                self.most = event.most, event.at_ns
            before = self.robot.description
            self.robot.apply(event)
            self.processing.apply(event)
            match event:
                case Telemetry():
                    self._look_for_stalls(event)
                    self.rings.take(event.batch.stamps_ns, event.batch.columns)
                    self.flash.clock = event.clock
                    self._show_stop(event)
                case Looked():
                    self.flash.look(event.quality.quality, event.at_ns)
                    self.reverted.look()
                case Journalled():
                    self.audit.take(event.journal.entries)
                    self._others.take(event.journal.entries, time.monotonic_ns())
                    self.stopping.read(event.journal.entries, self.robot.boot_id)
                case Described():
                    self.stopping.calendar_ns = event.calendar_ns
                    self._described(event.description, before)
                case Costs():
                    self.cost = event.cost
                case LinkChanged(state=state):
                    if state is ConnectionState.CONNECTED:
                        self._commands.dial()  # its own link may still wait: nobody is to
                    self.cost = None  # it was of the link that there was
                    self.predictions.clear()
                    self.flash.forget()
                    self._alarms.stalls.forget()
            self.flags.add(*self._happened.take(event, self.robot, self.rings.newest_ns))
        now_ns = time.monotonic_ns()
        if now_ns - self._watched_ns >= WATCH_NS:
            self._watched_ns = now_ns
            self._news.look(self.robot)
            self._alarm_news.look(self.alarms.active)  # looked for now, so that it is known since when
            self.reverted.look_if_over(now_ns)
            self._others.own(*(() if self.experiment is None else self.experiment.writes))
            self._others.look(now_ns)

    def _look_for_stalls(self, event: Telemetry) -> None:
        batch = event.batch
        if self.robot.is_recording:
            return
        received_s = self.robot.now_s() - (time.monotonic_ns() - batch.received_ns) / 1e9
        stall = self._alarms.stalls.take(event.stream, batch.stamps_ns, batch.received_ns, received_s)
        if stall is not None and self._alarms.stalls.is_news(stall):
            self.tell(NewsKind.WARNING, f"the robot's computer stood still for {stall.lasted_s:.1f} s")

    def _described(self, description: Description, before: Description | None) -> None:
        is_another = before is not None and before.boot_id != description.boot_id
        self.objects.described(is_another=is_another)
        if is_another:
            self.rings.clear()
            self.flags.clear()
            self.predictions.forget_danger()
            self._alarms.found.forget_places()
            self._happened, self.flash.clock = FlagWatch(), None
            self.tell(NewsKind.STATE, "the robot's computer has started anew")
        stop = description.stop
        self.stopping.described(stop.held, stop.reason, stop.problem)
        if self.has_twin and not self.is_named and (before is None or before.robot != description.robot):
            self.tell(
                NewsKind.WARNING, "another robot is called so too: give one another [robot] name in its file"
            )
        gone = self.edits.vanished(self.known)
        if gone:
            self.tell(NewsKind.WARNING, f"staged edits dropped, the robot no longer has {', '.join(gone)}")

    def _processes(self, event: Resources) -> None:
        """Take a look at the process table; CPU and memory come from other looks."""
        self.processes, self.processes_at_ns = event.snapshot, event.at_ns
        known = max(event.snapshot.processes or [], key=lambda one: one.cpu_percent or 0.0, default=None)
        self.most = None if known is None else (known, event.at_ns)
        seen = self.robot.resources
        if seen is not None:
            snapshot = replace(event.snapshot, cpu=seen.cpu, gateway=seen.gateway)
            self.processing.apply(dataclasses.replace(event, snapshot=snapshot))

    def take_prediction(self, news: PredictionNews) -> None:
        """Apply what models say of this robot."""
        self._alarms.again()
        before = self.predictions.danger
        self.predictions.take(news)
        if isinstance(news, Ruled):
            self.tell(NewsKind.WARNING, news.text)
            self.flags.add(Flag(news.cause.prediction.stamp_ns, news.text, FlagKind.RULE))
        if isinstance(news, Endangered):
            # What was so before a lost link, since when nobody has said it, is told again.
            level = Level.NONE if before is None or not before.came_ns else before.said.verdict.level
            if (happened := turn(level, news.verdict)) is not None:
                self.tell(NewsKind.WARNING, happened)
                self.flags.add(Flag(news.verdict.stamp_ns, happened, FlagKind.DANGER))

    @property
    def trial_evidence(self) -> EditEvidence | None:
        """What is known of what is on trial."""
        trial = self.writing.trial
        return None if trial is None else self.judged.on_trial(trial.write)

    def begin(self, plan: ExperimentPlan) -> Run:
        """Begin an experiment; raises `BadPlan` where one goes on, or something is on trial."""
        self.experiment = begun(plan, self.experiment, self.robot, self._commands, self._deliver)
        return self.experiment

    # --- STOP and reset

    def stop(self, reason: str) -> None:
        """Quick stop on every drive."""
        self.note_stop(self.send_stop(reason))

    def send_stop(self, reason: str) -> Sent:
        """Send a quick stop from any thread, at once; its answer is for `note_stop`."""
        at_ns, future = time.monotonic_ns(), self._commands.stop(reason)
        return Sent(at_ns, future, off_of_late(self.robot))

    def note_stop(self, sent: Sent) -> None:
        """Follow what becomes of a STOP that was sent."""
        number = self.stopping.sent(sent.off, sent.at_ns, self.flash.clock, self.robot.boot_id)
        when_done(
            sent.future,
            self._deliver,
            lambda stopped: self._stopped(number, stopped, sent.answered_ns),
            lambda error: self._stop_failed(number, error),
        )

    def _stopped(self, number: int, stopped: Stopped, at_ns: int | None) -> None:
        self.stopping.answered(number, stopped, at_ns)
        self._tell_stop()

    def _stop_failed(self, number: int, error: Exception) -> None:
        self.stopping.failed(number, str(error))
        self._tell_stop()

    def _tell_stop(self) -> None:
        self.tell(NewsKind.NOT_STOPPED if self.stopping.is_unproven else NewsKind.STOP, self.stopping.news)
        self.flags.add(*of_stop(self.stopping, self.rings.newest_ns, self.robot.age_s()))

    def _show_stop(self, event: Telemetry) -> None:
        """Update a running STOP from the drives' states."""
        if self.stopping.at_ns is None or self.stopping.state is StopState.IDLE:
            return
        stamps_ns, columns = event.batch.stamps_ns, event.batch.columns
        words = {
            joint: [self.robot.word_of(channel, value) for value in columns[channel]]
            for joint in self.robot.names("joint")
            if joint not in self.stopping.proofs and (channel := f"{joint}.state") in columns
        }
        if event.clock is not None:
            self.stopping.show(stamps_ns, words, event.clock.offset_ns)

    def reset(self, failed: Callable[[str], None] = lambda _: None) -> None:
        """End a held stop, clear faults; enables nothing. `failed` is told what is still in fault."""
        self._resetting.begin(failed)

    # --- the lease

    def take_control(self) -> None:
        """Become the one writer."""
        self.control.asked()
        when_done(self._commands.take_control(), self._deliver, self._control_taken, self._control_refused)

    def release_control(self) -> None:
        """Let others write; a trial goes back with it."""
        self._ask(self._commands.release_control(), lambda _: self._control_gone(), "release")

    def lost_control(self) -> None:
        """Note that the link with the lease has dropped."""
        if self.control.until_ns is not None:
            self.tell(NewsKind.CONTROL, "control lost with the link")
        self._control_gone()

    def _control_taken(self, lease: Lease) -> None:
        self.control.taken(lease)
        self.tell(NewsKind.CONTROL, "this window has control")

    def _control_refused(self, error: Exception) -> None:
        self.control.refused(str(error))
        self.tell(NewsKind.CONTROL, str(error))

    def _control_gone(self) -> None:
        self.control.gone()
        if self.writing.trial is not None:
            self.writing.reverted("the trial went back with control")

    # --- parameters

    def difference(self, units: Units) -> tuple[ReviewedEdit, ...]:
        """Return what would be written."""
        return self.edits.difference(self.robot.parameters, self.known, units)

    def write(self, changes: tuple[ReviewedEdit, ...], trial_s: float | None = None) -> None:
        """Write exactly these changes in one transaction."""
        self.writing.began(changes)
        future = self._commands.write({change.name: change.new for change in changes}, trial_s)
        when_done(
            future,
            self._deliver,
            lambda written: self._written(changes, written),
            lambda error: self._write_failed(changes, error),
        )

    def _written(self, changes: tuple[ReviewedEdit, ...], written: Written) -> None:
        self.control.renewed(LEASE_S)
        self._others.own(written.write)
        self.writing.done(written)
        self.robot.hold(written.after)
        self.reverted.forget()
        self.edits.drop(*(change.name for change in changes))
        self.tell(NewsKind.PARAMETER, ", ".join(written_line(change, written) for change in changes))

    def _write_failed(self, changes: tuple[ReviewedEdit, ...], error: Exception) -> None:
        self.writing.failed(changes, error)
        self.tell(NewsKind.PARAMETER, f"{self.writing.state.value}: {error}")

    def keep_trial(self) -> None:
        """Make what is on trial stay."""
        self._trial_ends.keep()

    def end_trial(self) -> None:
        """Take back what is on trial, now."""
        self._trial_ends.take_back()

    def stage_undo(self) -> None:
        """Stage the inverse of the latest write, to be reviewed and written like any edit."""
        if self.writing.undo:
            for name, value in self.writing.undo.pop().items():
                self.edits.stage(name, value, self.robot.parameters.get(name))
            for name in self.edits.vanished(self.known):
                self.tell(NewsKind.WARNING, f"{name} is not undone: the robot no longer lets it be written")

    def store(self, *components: str) -> None:
        """Make devices keep their parameters over a reset, one after another."""
        self._storing.begin(components)

    def is_stored(self, name: str) -> bool:
        """Return whether the present value is in flash, as far as the journal shows it; else nobody knows."""
        description, held = self.robot.description, self.robot.parameters.get(name)
        if description is None or held is None or held.value is None:
            return False
        return self.flash.holds(name, held.value, description)

    # --- the rest

    def show_processes(self, wanted: bool) -> None:
        """Ask for the process table from now on, or no more."""
        self._commands.show_processes(wanted)

    def _ask(self, future: "Future[Result]", done: Callable[[Result], None], what: str) -> None:
        when_done(future, self._deliver, done, lambda error: self.tell(NewsKind.WARNING, f"{what}: {error}"))
