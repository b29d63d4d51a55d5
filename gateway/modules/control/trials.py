"""Writes on trial: each ends by itself, confirmed or taken back, whatever becomes of client and gateway.

What is true about a trial is decided in the writer's thread (`TrialJobs`). Here is only who waits for what.
"""

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from typing import TYPE_CHECKING

import msgspec

from gateway.modules.control.reverting import TakenBack
from gateway.modules.control.trial_jobs import TrialJobs
from gateway.modules.control.writer import Turn, Writer
from gateway.process.futures import back, done, outcome, then
from gateway.process.loop import Loop, Timer
from gateway.records.undo import Undo, UndoFile
from gateway.wire.framing import ErrorKind, RpcError, refuse
from gateway.wire.parameter import Confirmed, Reverted, TrialInfo

if TYPE_CHECKING:
    from gateway.connections.session import Session

log = logging.getLogger(__name__)

FIRST_RETRY_S, LAST_RETRY_S = 0.5, 5.0  # between attempts to take back what could not be
_REMEMBERED = 100  # ended trials whose end is still told


class _Trial:
    """A write on trial (`why` is `None`) or being taken back."""

    def __init__(self, undo: Undo, session: "Session | None") -> None:
        self.undo = undo
        self.session = session
        self.ends_ns: int | None = None
        self.timer: Timer | None = None
        self.why: str | None = None
        self.trying = False  # an attempt to take it back is under way
        self.problem: str | None = None
        self.outcome: dict[str, str] = {}
        self.retry_s = FIRST_RETRY_S
        self.waiting: list[Future[Reverted]] = []

    @property
    def info(self) -> TrialInfo:
        left_s = None if self.ends_ns is None else max(0, self.ends_ns - time.monotonic_ns()) / 1e9
        undo = self.undo
        return TrialInfo(undo.write, undo.who, undo.values(), undo.before(), left_s, self.problem)

    def set_timer(self, timer: Timer | None) -> None:
        if self.timer is not None:
            self.timer.cancel()
        self.timer = timer


class Coming:
    """A trial that was asked for: who ends all trials, or those of its client, ends it before it begins."""

    def __init__(self, session: "Session") -> None:
        self.session = session
        self.over: str | None = None  # why


class Trials:
    """All trials of a robot. It belongs to the loop's thread, but for `claim` and `close`."""

    def __init__(
        self,
        loop: Loop,
        writer: Writer,
        jobs: TrialJobs,
        undos: UndoFile,
        changed: Callable[[], None],
        wrote: Callable[[Iterable[str]], None],
    ) -> None:
        """Set the callbacks: `changed` when `pending` may differ, `wrote` with parameters that may."""
        self._loop = loop
        self._writer = writer
        self._jobs = jobs
        self._undos = undos
        self._changed = changed
        self._wrote = wrote
        self._closed = False
        self._coming: set[Coming] = set()
        self._trials: dict[int, _Trial] = {}
        self._ended: OrderedDict[int, str] = OrderedDict()

    @property
    def pending(self) -> bool:
        """Whether anything is on trial or still to be taken back."""
        return bool(self._trials)

    def infos(self) -> list[TrialInfo]:
        return [trial.info for trial in self._trials.values()]

    def expect(self, session: "Session") -> Coming:
        """Expect a requested trial; it is `dismissed` in any case."""
        coming = Coming(session)
        self._coming.add(coming)
        return coming

    def dismiss(self, coming: Coming) -> None:
        self._coming.discard(coming)

    def begin(self, undo: Undo, trial_s: float, coming: Coming, taken_over: Iterable[int]) -> None:
        """Take over a write that has succeeded on trial."""
        for other in taken_over:
            self._forget(other, f"it was taken over by write {undo.write}")
        trial = self._trials[undo.write] = _Trial(undo, coming.session)
        trial.ends_ns = time.monotonic_ns() + round(trial_s * 1e9)
        trial.set_timer(self._loop.call_later(trial_s, lambda: self._take_back(trial, "time ran out")))
        self._changed()
        if coming.over is not None:
            self._take_back(trial, coming.over)

    def take_up(self, undo: Undo, why: str, ready: "Future[None]", problem: str | None = None) -> None:
        """Take back what a failed roll-back or an ended gateway has left, once its devices are `ready`."""
        trial = self._trials[undo.write] = _Trial(undo, None)
        trial.why, trial.problem = why, problem
        ready.add_done_callback(lambda _ready: self._loop.call(lambda: self._take_back(trial, why)))
        self._changed()

    def confirm(self, write: int) -> "Future[Confirmed]":
        """Keep the values on trial, if the devices still hold them.

        Raises:
            RpcError: at once, or as the future's error. unknown_name: it has ended, and how; mismatch,
                device_timeout, …: it stays on trial.

        """
        trial = self._trials.get(write)
        if trial is None or trial.why is not None:
            raise self._not_on_trial(write)
        confirmed = self._writer.submit(lambda: self._jobs.confirm(write), Turn.TRIAL)
        return then(back(self._loop, confirmed), lambda values: self._confirmed(write, values))

    def revert(self, write: int) -> "Future[Reverted]":
        """Take it back now; raises `RpcError` (unknown_name) where it has ended, and says how."""
        trial = self._trials.get(write)
        if trial is None:
            raise self._not_on_trial(write)
        future: Future[Reverted] = Future()
        trial.waiting.append(future)
        self._take_back(trial, "asked for")
        return future

    def revert_of(self, session: "Session", why: str) -> None:
        """Take back every trial of one client."""
        self._revert(lambda one: one.session is session, why)

    def revert_all(self, why: str) -> None:
        """Take back everything that is on trial."""
        self._revert(lambda _one: True, why)

    def claim(self) -> "Future[None]":
        """Release the objects set by a stop: they are never reverted. From any thread."""
        if not self._jobs.concerned():
            return done(None)
        claimed = self._writer.submit(self._jobs.claim, Turn.CLAIM)
        return then(claimed, lambda writes: self._loop.post(lambda: self._claimed(writes)))

    def close(self) -> None:
        """No more attempts; what is still to be taken back stays in the undo file. From any thread."""
        self._closed = True
        self._loop.post(self._end)

    # In the loop's thread.

    def _revert(self, chosen: "Callable[[_Trial | Coming], bool]", why: str) -> None:
        for coming in filter(chosen, self._coming):
            coming.over = coming.over or why
        for trial in tuple(filter(chosen, self._trials.values())):
            self._take_back(trial, why)

    def _end(self) -> None:
        for trial in self._trials.values():
            trial.set_timer(None)
            self._fail(trial, _ending())

    def _take_back(self, trial: _Trial, why: str) -> None:
        write = trial.undo.write
        if self._closed:
            self._fail(trial, _ending())
        if self._closed or self._trials.get(write) is not trial:
            return
        if trial.trying:
            return
        trial.trying = True
        trial.why = said = trial.why or why
        trial.ends_ns = None
        trial.set_timer(None)
        known = trial.problem
        attempt = self._writer.submit(lambda: self._jobs.take_back(write, said, known), Turn.TRIAL)
        attempt.add_done_callback(lambda ended: self._loop.post(lambda: self._attempted(trial, ended)))

    def _attempted(self, trial: _Trial, ended: "Future[TakenBack | None]") -> None:
        write, found = trial.undo.write, outcome(ended)
        trial.trying = False
        if found is None:  # it was confirmed, taken over or claimed before its turn came
            self._forget(write, "nothing of it was left to be taken back")
            self._changed()
        elif isinstance(found, TakenBack):
            trial.outcome |= found.outcome
            self._wrote(found.outcome)
            self._follow(trial, found)
        else:
            log.error("taking back write %d failed", write, exc_info=found)
            trial.problem = str(found)
            self._try_again(trial)

    def _follow(self, trial: _Trial, found: TakenBack) -> None:
        write, waiting = trial.undo.write, trial.waiting
        trial.problem = found.problem
        if found.problem is not None:
            trial.undo = msgspec.structs.replace(trial.undo, changes=found.left)
            self._try_again(trial)
            return
        trial.waiting = []
        self._forget(write, f"it was taken back: {trial.why}")
        self._changed()
        for future in waiting:
            future.set_result(Reverted(write, dict(trial.outcome)))

    def _try_again(self, trial: _Trial) -> None:
        text = (
            f"write {trial.undo.write} could not be taken back yet: {trial.problem}; the gateway keeps trying"
        )
        self._fail(trial, refuse(ErrorKind.ROLLBACK_FAILED, text, outcome=dict(trial.outcome)))
        if not self._closed:
            trial.set_timer(self._loop.call_later(trial.retry_s, lambda: self._take_back(trial, "")))
            trial.retry_s = min(2 * trial.retry_s, LAST_RETRY_S)

    def _claimed(self, writes: Iterable[int]) -> None:
        for trial in [self._trials[write] for write in writes if write in self._trials]:
            undo = self._undos.get(trial.undo.write)
            if undo is None:
                self._forget(trial.undo.write, "it was claimed by a stop")
            else:
                trial.undo = undo
        self._changed()

    def _confirmed(self, write: int, values: dict[str, float] | None) -> Confirmed:
        if values is None:
            raise self._not_on_trial(write)
        self._forget(write, "it was confirmed")
        self._changed()
        return Confirmed(write, values)

    def _forget(self, write: int, how: str) -> None:
        trial = self._trials.pop(write, None)
        self._ended.setdefault(write, how)
        if len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)
        if trial is not None:
            trial.set_timer(None)
            self._fail(trial, self._not_on_trial(write))

    @staticmethod
    def _fail(trial: _Trial, error: RpcError) -> None:
        waiting, trial.waiting = trial.waiting, []
        for future in waiting:
            future.set_exception(error)

    def _not_on_trial(self, write: int) -> RpcError:
        why = self._ended.get(write)
        if why is None and write in self._trials:
            why = f"it is being taken back: {self._trials[write].why}"
        said = why or "there is no such write, or it was not on trial"
        return refuse(ErrorKind.UNKNOWN_NAME, f"write {write} is not on trial: {said}")


def _ending() -> RpcError:
    return refuse(ErrorKind.UNAVAILABLE, "the gateway is ending")
