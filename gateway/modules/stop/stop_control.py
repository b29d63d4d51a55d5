"""Stop, hold, reset and enabling of one robot: what the machine decides is carried out here.

Whatever happens is told to the `Authority`; what follows is done by `_act`: stops in the stop's own thread,
the record in that of the disk, all else in the loop.
"""

import contextlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, cast

from drivers.bus.settings import Role
from drivers.joint.cia402 import ABORT_CONNECTION_OPTIONS, QUICK_STOP_OPTIONS, option_text
from gateway.config.robot import RobotConfig
from gateway.modules.stop.authority import Address, Authority
from gateway.modules.stop.controllers import Controllers
from gateway.modules.stop.drive import Drive
from gateway.modules.stop.enabling import Enabling
from gateway.modules.stop.hold_record import HeldStop, HoldFile
from gateway.modules.stop.machine import OVERTAKEN, Action, Input, Transition
from gateway.modules.stop.reset import Descent, Lowering
from gateway.modules.stop.stop import StopAnswers
from gateway.modules.stop.stopper import Stopper
from gateway.modules.stop.target import Report, StopTarget, stop_all
from gateway.modules.stop.thread import StopThread, StopThreadEnded
from gateway.modules.stop.watch import LOOK_S, StopWatch
from gateway.process.boot import boot_id
from gateway.process.futures import back, done, gather, outcome, pass_on, then
from gateway.process.loop import Loop
from gateway.records.journal import Share
from gateway.records.records import Records
from gateway.streaming.sources import check_globs, matches
from gateway.wire.framing import ErrorKind, refuse
from gateway.wire.stop import DriveReaction, Enabled, Reset, StopInfo, Stopped

if TYPE_CHECKING:
    from gateway.modules.component.module import ComponentModule

REWRITE_S = 5.0  # how often a record is tried again that could not be written
GATEWAY = "gateway"  # who the journal says it was, where nobody asked


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A stop that waits for the stop's thread."""

    asked: "Asked"
    number: int
    recorded: bool  # whether it is to be written down: one that is held already stays whose it was


@dataclass(frozen=True, slots=True)
class Asked:
    """A requested stop: client and reason, and the way of its answer."""

    who: str
    reason: str
    answer: "Future[Stopped]" = field(default_factory=Future)


def _newest_of_each(stops: Iterable[Asked]) -> list[Asked]:
    """One stop of everybody, so that nobody's is lost among another's; the newest last."""
    newest: dict[str, Asked] = {}
    for asked in stops:
        newest.pop(asked.who, None)
        newest[asked.who] = asked
    return list(newest.values())


class StopControl:
    """For any thread, where not said otherwise. `changed` is called in the loop when a hold began or ended.

    `claim` takes what a stop has set out of the hands of trials and roll-backs; it must not block.
    """

    def __init__(
        self,
        config: RobotConfig,
        component: "ComponentModule",
        loop: Loop,
        records: Records,
        changed: Callable[[], None],
    ) -> None:
        self._config = config
        self._loop = loop
        self._journal = records.journal
        self._changed = changed
        self.claim: Callable[[], Future[None]] = lambda: done(None)
        self._claimed: Future[None] = done(None)
        self._closed = False
        self._waiting: list[_Waiting] = []  # under the machine's lock
        components = component.robot.components
        self.drives = {name: cast("Drive", components[name]) for name in config.joint if name in components}
        self._absent = {name: why for name, why in component.absent.items() if name in config.joint}
        self._controllers = Controllers(config.stop.controller, components, component.robot.descriptions)
        stoppers = {
            name: Stopper(drive, config.stop.fallback, self._tell_fallback)
            for name, drive in self.drives.items()
        }
        self._targets: Mapping[str, StopTarget] = {**stoppers, **self._controllers.targets}
        self.authority = Authority(
            (*self.drives, *self._absent, *self._controllers.names), locked_objects(config)
        )
        self._record = HoldFile(records.folder.hold, records.unusable, self._wrote)
        self._watch = StopWatch(
            self.authority, stoppers, self._controllers.targets, self._happened, self._tell_again
        )
        self._thread = StopThread(self._look, lambda: self.authority.held, LOOK_S)
        self._rewrite_due = 0.0
        self._answers = StopAnswers(
            loop,
            config,
            stoppers,
            self._absent,
            self._controllers,
            lambda name: component.when_ready([name]),
            self._tell_fallback,
        )
        self._lowering = Lowering(loop, self.drives, self._absent, self._controllers)

    @property
    def held(self) -> bool:
        return self.authority.held

    def start(self) -> None:
        """Begin; a stop that the last gateway held is held on."""
        left = self._record.load()
        self._thread.start()
        if left is None:
            return
        details = {"by": left.who, "reason": left.reason, "since_utc_ns": left.utc_ns}
        self._journal.append(GATEWAY, "stop still held", **details)
        self._ask(Input.FOUND, Asked(left.who, left.reason))

    def close(self) -> None:
        """End with the process; a held stop stays on disk."""
        self._closed = True
        self._thread.close()
        self._watch.end()
        self._record.close()

    # Stop

    def stop(self, who: str, reason: str) -> "Future[Stopped]":
        """Quick stop on every drive, controllers too, held until it is reset."""
        return self._ask(Input.STOP, Asked(who, reason))

    def trip(self, who: str, reason: str) -> None:
        """Stop for a tripped rule of the guard; an already held stop keeps its owner."""
        self._ask(Input.TRIP, Asked(who, reason))

    def _happened(self, what: Input, target: str, stamp_ns: int) -> None:
        """Take the observations of the watch."""
        asked = Asked(GATEWAY, f"{target}: {what.value} while the hold was ending")
        with contextlib.suppress(StopThreadEnded):
            self.authority.feed(what, partial(self._act, asked, target), at_ns=stamp_ns, target=target)

    def _ask(self, what: Input, asked: Asked) -> "Future[Stopped]":
        self.authority.feed(what, partial(self._act, asked, ""))
        return asked.answer

    def _act(self, asked: Asked, target: str, step: Transition) -> None:
        """Act under the machine's lock: in the order of events, and without waiting for anything."""
        for action in step.actions:
            if action is Action.STOP_ALL:
                self._wait(_Waiting(asked, step.number, recorded=Action.RECORD in step.actions))
            elif action is Action.STOP_AGAIN and not self._targets[target].running:
                self._thread.put(partial(self._watch.stop_again, target))
            elif action is Action.WATCH:
                self._thread.put(self._hold_on)

    def _wait(self, waiting: "_Waiting") -> None:
        """Those that come before the thread turns to them are one stop."""
        if not self._waiting:
            self._thread.put(self._stop_all)
        self._waiting.append(waiting)

    def _stop_all(self) -> None:
        """In the stop's thread: it acts first, and is written down then."""
        try:
            first = stop_all(self._targets)
        except Exception as error:
            for one in self._take_waiting():  # the next stop begins anew
                one.asked.answer.set_exception(error)
            raise
        stops = self._take_waiting()
        try:
            recorded = _newest_of_each(one.asked for one in stops if one.recorded)
            for asked in recorded:
                self._record.write(asked.who, asked.reason)
            if not recorded:
                newest = stops[-1].asked
                self._journal.append(newest.who, "stopped again", Share.ACT, reason=newest.reason)
            self._watch.begin()
            self._claimed = self.claim()
        finally:
            self._loop.post(partial(self._follow, stops, first))

    def _take_waiting(self) -> "tuple[_Waiting, ...]":
        with self.authority.settled():
            stops, self._waiting = tuple(self._waiting), []
        return stops

    def _hold_on(self) -> None:
        """In the stop's thread: what is seen to be stopped since the last gateway's time is left alone."""
        stop_all(self._controllers.targets)
        self._watch.begin()
        self._watch.look()
        self._claimed = self.claim()

    def _look(self) -> None:
        """In the stop's thread: see what says nothing by itself, and whether the disk has room again."""
        self._watch.look()
        if self._record.problem is not None and time.monotonic() >= self._rewrite_due:
            self._rewrite_due = time.monotonic() + REWRITE_S
            self._record.write_again()

    def _follow(self, stops: "Sequence[_Waiting]", first: "Mapping[str, Future[Report]]") -> None:
        """In the loop."""
        self._changed()
        stopped = self._answers.follow(first, self._record.kept)
        stopped.add_done_callback(lambda found: self._answered(stops, found))

    def _answered(self, stops: "Sequence[_Waiting]", stopped: "Future[Stopped]") -> None:
        for one in stops:
            self.authority.feed(Input.ANSWERED, _nothing, number=one.number)
        found = outcome(stopped)
        newest = next((one.asked for one in reversed(stops) if one.recorded), None)
        if isinstance(found, Stopped) and newest is not None and not self._closed:
            keys = ("controllers", "fallbacks", "problem")
            more = {key: value for key in keys if (value := getattr(found, key))}
            self._journal.append(newest.who, "stop answered", Share.ACT, result=found.drives, **more)
        for one in stops:
            pass_on(stopped, one.asked.answer)

    # Reset; in the loop.

    def reset(self, who: str, asked_ns: int) -> "Future[Reset]":
        """Lead every drive to SWITCH ON DISABLED; a held stop ends where all is shown to rest.

        It came in at `asked_ns`: what is older than the newest stop is not done.

        Raises:
            RpcError: stopped while a rule of the guard is tripped, or where a stop came since; wrong_state
                while another reset or an enabling is under way; unavailable, as the future's error: the
                record cannot be removed.

        """
        number = self._begin(Input.RESET, asked_ns)
        wanted = partial(self.authority.is_newest, number)
        down = then(self._settled(), lambda _settled: self._lowering.run(wanted))
        down.add_done_callback(lambda ended: self._give_up(number, ended))
        return then(down, lambda descent: self._prove(who, number, descent))

    def _settled(self) -> "Future[object]":
        """Return a future, done when every stop asked for until now has acted, and claimed what it set."""
        acted: Future[object] = Future()
        self._thread.put(lambda: gather({"claimed": self._claimed}).add_done_callback(acted.set_result))
        return back(self._loop, acted)

    def _give_up(self, number: int, ended: "Future[Descent]") -> None:
        """Note that a failed reset has proved nothing."""
        if ended.exception() is not None:
            self.authority.feed(Input.UNPROVED, _nothing, number=number)

    def _prove(self, who: str, number: int, descent: Descent) -> "Future[Reset]":
        removed: list[Future[None]] = []

        def act(step: Transition) -> None:
            if Action.REMOVE in step.actions:
                removed.append(self._record.remove())

        for target in self._gone():
            self._happened(Input.LOST, target, time.monotonic_ns())
        descent = descent.with_problems(self.authority.unproved(descent.findings))
        self.authority.feed(Input.PROVED, act, number=number, findings=descent.findings)
        if not removed:
            return self._told(who, descent)
        gone = gather({"hold": back(self._loop, removed[0])})
        return then(gone, lambda found: self._removed(who, number, descent, found["hold"]))

    def _gone(self) -> list[str]:
        """Targets whose nodes have gone, or are booting, since they were read."""
        nodes = {name: drive.node for name, drive in self.drives.items()}
        nodes |= {name: one.node for name, one in self._controllers.targets.items()}
        return [name for name, node in nodes.items() if not node.ready]

    def _removed(self, who: str, number: int, descent: Descent, failure: Exception | None) -> "Future[Reset]":
        what = Input.REMOVED if failure is None else Input.KEPT
        step = self.authority.feed(what, self._release, number=number)
        if Action.RELEASE in step.actions:
            self._changed()
        if failure is not None:
            text = (
                f"every drive is disabled, but the stop stays held: its record cannot be removed: {failure}"
            )
            self._journal.append(GATEWAY, "hold not ended", reason=text)
            raise refuse(ErrorKind.UNAVAILABLE, text)
        return self._told(who, descent)

    def _release(self, step: Transition) -> None:
        if Action.RELEASE in step.actions:
            self._watch.end()
            self._record.forget()
        elif Action.RECORD in step.actions:
            self._record.write_again()

    def _told(self, who: str, descent: Descent) -> "Future[Reset]":
        """Return the answer, once it is written down."""
        reset = Reset(descent.drives, descent.problems, held=self.held)
        problems = {"problems": reset.problems} if reset.problems else {}
        written = self._journal.append(
            who, "reset", Share.ACT, result=reset.drives, held=reset.held, **problems
        )
        return then(back(self._loop, gather({"journal": written})), lambda _written: reset)

    def _begin(self, what: Input, asked_ns: int) -> int:
        step = self.authority.feed(what, _nothing, at_ns=asked_ns)
        if step.refusal is None:
            return step.number
        if what is Input.ENABLE and step.state.held:
            raise refuse(ErrorKind.STOPPED, self._hold_words())
        stopped = step.refusal == OVERTAKEN or self.authority.standing()
        said = f"the stop is not reset: {step.refusal}" if stopped and step.state.held else step.refusal
        raise refuse(ErrorKind.STOPPED if stopped else ErrorKind.WRONG_STATE, said)

    # Enabling; in the loop.

    def enable(
        self,
        who: str,
        asked_ns: int,
        globs: list[str] | None,
        objection: Callable[[], str | None],
        on_trial: Callable[[Sequence[str]], str | None],
    ) -> "Future[Enabled]":
        """Enable the joints that the globs mean, as long as there is no `objection`.

        `on_trial` says why the end of a trial could not be written back to a drive that is enabled.

        Raises:
            RpcError: not_allowed to an observer; trial_pending; stopped while a stop is held; wrong_state
                while a reset or another enabling is under way; unavailable where it cannot be journaled, as
                the future's error.

        """
        if self._config.gateway.role is not Role.MASTER:
            raise refuse(
                ErrorKind.NOT_ALLOWED,
                "only the controller that owns the bus may enable drives: start it there "
                '([gateway] role is "observer")',
            )
        check_globs("joint", self.drives, globs, self._absent)
        chosen = {name: drive for name, drive in self.drives.items() if matches(name, globs)}
        pending = on_trial(list(chosen))
        if pending is not None:
            raise refuse(ErrorKind.TRIAL_PENDING, pending)
        number = self._begin(Input.ENABLE, asked_ns)

        def objects() -> str | None:
            overtaken = None if self.authority.is_newest(number) else self._hold_words()
            return overtaken or objection() or on_trial(list(chosen))

        wanted = partial(self.authority.is_newest, number)
        enabling = Enabling(self._loop, chosen, who, objects, wanted, self._journal)
        answer = self._explained(who, list(chosen), enabling)
        answer.add_done_callback(lambda _answer: self.authority.feed(Input.ENABLED, _nothing, number=number))
        return answer

    def _explained(self, who: str, joints: list[str], enabling: Enabling) -> "Future[Enabled]":
        """Begin what could be journaled: nothing else is begun."""
        entry = gather(
            {"journal": back(self._loop, self._journal.append(who, "enabling", Share.ASKED, joints=joints))}
        )

        def begin(written: Mapping[str, Exception | None]) -> "Future[Enabled]":
            error = written["journal"]
            if error is not None:
                raise refuse(
                    ErrorKind.UNAVAILABLE, f"it cannot be journaled, so nothing was enabled: {error}"
                )
            return enabling.run()

        return then(entry, begin)

    # Words

    def info(self, armed: Callable[[str], bool]) -> StopInfo:
        """Return it as `robot.describe` shows it."""
        held = self._record.held if self.held else None
        return StopInfo(
            held=self.held,
            reason=None if held is None else held.reason,
            since_ns=None if held is None or held.boot_id != boot_id() else held.monotonic_ns,
            stopped_again=self._watch.again,
            drives={name: _reaction(drive, armed(name)) for name, drive in self.drives.items()},
            fallbacks=[fallback.words for fallback in self._config.stop.fallback],
            controllers={
                name: self._controllers.absent.get(name) for name in sorted(self._controllers.names)
            },
            problem=self._record.problem,
        )

    def _hold_words(self) -> str:
        held = self._record.held
        if held is None:
            return "a stop came in between; reset it first"
        return f"the stop of {held.who} is held ({held.reason or 'no reason given'}); reset it first"

    def _wrote(self, held: HeldStop, problem: str | None) -> "Future[None]":
        """In the disk's thread: the record is there, or it is known why not."""
        details = {} if problem is None else {"problem": problem}
        return self._journal.append(held.who, "stop", Share.ACT, reason=held.reason, **details)

    def _tell_again(self, target: str, times: int) -> None:
        self._journal.append(GATEWAY, "stopped again", drive=target, times=times)

    def _tell_fallback(self, drive: str, text: str) -> None:
        self._journal.append(GATEWAY, "stop fallback", drive=drive, result=text)


def locked_objects(config: RobotConfig) -> frozenset[Address]:
    """Return the objects that stop a controller."""
    return frozenset(
        (table.bus, table.node_id, *one.address)
        for one in config.stop.controller
        if (table := config.device.get(one.component)) is not None
    )


def _nothing(_step: Transition) -> None:
    """Leave the next step to the caller."""


def _reaction(drive: Drive, armed: bool) -> DriveReaction:
    """Return a drive's own reaction to a lost master, as read when it came up."""
    options = {} if drive.reading is None else drive.reading.options
    quick_stop, abort_connection = options.get("quick_stop"), options.get("abort_connection")
    return DriveReaction(
        quick_stop_option=quick_stop,
        abort_connection_option=abort_connection,
        armed=armed,
        quick_stop=option_text(QUICK_STOP_OPTIONS, quick_stop),
        abort_connection=option_text(ABORT_CONNECTION_OPTIONS, abort_connection),
    )
