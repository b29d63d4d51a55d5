"""Writes on trial: each ends by itself, confirmed or taken back, whatever becomes of client and gateway.

What is true about a trial is decided in the writer's thread, one job after another, by the undo file: who
comes first, the confirmation or the end of its time, wins. Here is only who waits for what.
"""

import logging
import time
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any

import msgspec

from drivers.errors import DriverError
from gateway.futures import back, outcome, then
from gateway.loop import Loop, Timer
from gateway.messages import Confirmed, Reverted, TrialInfo
from gateway.modules.ledger import Keeping
from gateway.modules.taking_back import TAKEN_BACK, UNCHANGED, OutOfReach, Reach, TakenBack, take_back
from gateway.modules.transaction import ANSWER_S
from gateway.records.undo import Undo
from gateway.wire import Kind, RpcError, refuse

if TYPE_CHECKING:
    from gateway.session import Session

log = logging.getLogger(__name__)

FIRST_RETRY_S, LAST_RETRY_S = 0.5, 5.0  # between attempts to take back what could not be
_REMEMBERED = 100  # ended trials whose end is still told

Submit = Callable[[Callable[[], Any]], "Future[Any]"]  # a job for the writer's thread


class _Trial:
    """A write on trial (`why` is `None`) or being taken back."""

    def __init__(self, undo: Undo, session: "Session | None") -> None:
        self.undo = undo
        self.session = session
        self.ends_ns: int | None = None
        self.timer: Timer | None = None
        self.why: str | None = None
        self.problem: str | None = None
        self.outcome: dict[str, str] = {}
        self.retry_s = FIRST_RETRY_S
        self.waiting: list[Future[Reverted]] = []

    def set_timer(self, timer: Timer | None) -> None:
        if self.timer is not None:
            self.timer.cancel()
        self.timer = timer


class Trials:
    """All trials of a robot. It belongs to the loop's thread, but for the jobs it submits."""

    def __init__(
        self, loop: Loop, submit: Submit, keeping: Keeping, reach: Reach, changed: Callable[[], None]
    ) -> None:
        self._loop = loop
        self._submit = submit
        self._keeping = keeping
        self._reach = reach
        self._changed = changed  # told whenever `pending` may be another
        self._trials: dict[int, _Trial] = {}
        self._ended: OrderedDict[int, str] = OrderedDict()

    @property
    def pending(self) -> bool:
        """Whether anything is on trial or still to be taken back."""
        return bool(self._trials)

    def infos(self) -> list[TrialInfo]:
        now_ns = time.monotonic_ns()
        return [
            TrialInfo(
                trial.undo.write,
                trial.undo.who,
                trial.undo.values(),
                trial.undo.before(),
                None if trial.ends_ns is None else max(0, trial.ends_ns - now_ns) / 1e9,
                trial.problem,
            )
            for trial in self._trials.values()
        ]

    def under_trial(self, component: str) -> bool:
        """Whether one of the component's parameters is on trial or still to be taken back."""
        changes = (change for trial in self._trials.values() for change in trial.undo.changes)
        return any(change.component == component for change in changes)

    def begin(self, undo: Undo, trial_s: float, session: "Session", replaced: tuple[Undo, ...]) -> None:
        """A write has succeeded on trial; it takes over the trials that it `replaced`."""
        for other in replaced:
            self._forget(other.write, f"it was taken over by write {undo.write}")
        trial = self._trials[undo.write] = _Trial(undo, session)
        trial.ends_ns = time.monotonic_ns() + round(trial_s * 1e9)
        trial.set_timer(self._loop.call_later(trial_s, lambda: self._take_back(trial, "its time was over")))
        self._changed()

    def take_up(self, undo: Undo, why: str, ready: "Future[None]", problem: str | None = None) -> None:
        """Take back what a failed roll-back or an ended gateway has left, once its devices are `ready`."""
        trial = self._trials[undo.write] = _Trial(undo, None)
        trial.problem = problem
        ready.add_done_callback(lambda _ready: self._loop.call(lambda: self._take_back(trial, why)))
        self._changed()

    def confirm(self, write: int) -> "Future[Confirmed]":
        """Keep what is on trial, if the devices still hold it.

        Raises:
            RpcError: as the future's error. unknown_name: it has ended, and how; mismatch, device_timeout, …:
                it stays on trial.

        """
        confirmed = self._submit(lambda: self._confirm_job(write))
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
        for trial in tuple(self._trials.values()):
            if trial.session is session:
                self._take_back(trial, why)

    def revert_all(self, why: str) -> None:
        """Take back everything that is on trial."""
        for trial in tuple(self._trials.values()):
            self._take_back(trial, why)

    def close(self) -> None:
        """No more attempts; what is still to be taken back stays in the undo file for the next start."""
        for trial in self._trials.values():
            trial.set_timer(None)
            for future in trial.waiting:
                future.set_exception(refuse(Kind.UNAVAILABLE, "the gateway is ending"))

    # In the loop's thread.

    def _take_back(self, trial: _Trial, why: str) -> None:
        if trial.why is not None and trial.timer is None:
            return  # an attempt is under way
        trial.why = trial.why or why
        trial.ends_ns = None
        trial.set_timer(None)
        attempt = self._submit(lambda: self._take_back_job(trial.undo.write, trial.why or why, trial.problem))
        attempt.add_done_callback(lambda done: self._loop.post(lambda: self._attempted(trial, outcome(done))))

    def _attempted(self, trial: _Trial, found: "TakenBack | Exception | None") -> None:
        if isinstance(found, TakenBack):
            for name, what in found.outcome.items():
                if what != UNCHANGED or trial.outcome.get(name) != TAKEN_BACK:
                    trial.outcome[name] = what
            trial.problem = found.problem
        elif found is not None:
            log.error("taking back write %d failed", trial.undo.write, exc_info=found)
            trial.problem = str(found)
        answer = self._answer(trial)
        waiting, trial.waiting = trial.waiting, []
        if trial.problem is None:
            self._forget(trial.undo.write, f"it was taken back: {trial.why}")
            self._changed()
        elif trial.undo.write in self._trials:
            again = self._loop.call_later(trial.retry_s, lambda: self._take_back(trial, ""))
            trial.set_timer(again)
            trial.retry_s = min(2 * trial.retry_s, LAST_RETRY_S)
        for future in waiting:
            answer(future)

    @staticmethod
    def _answer(trial: _Trial) -> "Callable[[Future[Reverted]], None]":
        write, said, problem = trial.undo.write, dict(trial.outcome), trial.problem
        if problem is None:
            return lambda future: future.set_result(Reverted(write, said))
        error = refuse(
            Kind.ROLLBACK_FAILED,
            f"write {write} could not be taken back yet: {problem}; the gateway keeps trying",
            outcome=said,
        )
        return lambda future: future.set_exception(error)

    def _confirmed(self, write: int, values: dict[str, float] | None) -> Confirmed:
        if values is None:
            raise self._not_on_trial(write)
        self._forget(write, "it was confirmed")
        self._changed()
        return Confirmed(write, values)

    def _forget(self, write: int, how: str) -> None:
        trial = self._trials.pop(write, None)
        if trial is not None:
            trial.set_timer(None)
        self._ended[write] = how
        if len(self._ended) > _REMEMBERED:
            self._ended.popitem(last=False)

    def _not_on_trial(self, write: int) -> RpcError:
        why = self._ended.get(write)
        if why is None and write in self._trials:
            why = f"it is being taken back: {self._trials[write].why}"
        said = why or "there is no such write, or it was not on trial"
        return refuse(Kind.UNKNOWN_NAME, f"write {write} is not on trial: {said}")

    # In the writer's thread.

    def _confirm_job(self, write: int) -> dict[str, float] | None:
        undo = self._keeping.undo.get(write)
        if undo is None or not undo.trial:
            return None
        for change in undo.changes:
            try:
                held = self._reach(change).upload(change.index, change.subindex).result(ANSWER_S)
            except (OutOfReach, DriverError, TimeoutError) as error:
                raise refuse(
                    Kind.UNAVAILABLE,
                    f"{change.parameter}: {error}; it stays on trial",
                    component=change.component,
                ) from error
            if held != bytes.fromhex(change.written):
                raise refuse(
                    Kind.MISMATCH,
                    f"{change.parameter} holds {held.hex(' ')} and not what was written; it stays on trial",
                    component=change.component,
                )
        try:
            self._keeping.journal.append(undo.who, "trial confirmed", write=write).result()
            self._keeping.undo.change(drop=[write])
        except OSError as error:
            text = f"the confirmation could not be recorded, it stays on trial: {error.strerror or error}"
            raise refuse(Kind.UNAVAILABLE, text) from error
        return undo.values()

    def _take_back_job(self, write: int, why: str, known: str | None) -> TakenBack | None:
        """One attempt; `None` where there is nothing to take back any more."""
        undo = self._keeping.undo.get(write)
        if undo is None:
            return None
        found = take_back(undo, self._reach)
        if found.problem is None or found.problem != known:
            what = "taken back" if found.problem is None else "NOT TAKEN BACK yet"
            log.warning("write %d of %s %s (%s): %s", write, undo.who, what, why, found.outcome)
            entry = self._keeping.journal.append(
                "gateway", what, write=write, reason=why, outcome=found.outcome
            )
            outcome(entry)  # a disk that fails was logged, and does not change what was done
        self._keep(undo, found)
        return found

    def _keep(self, undo: Undo, found: TakenBack) -> None:
        """On disk stays what is still to be taken back."""
        try:
            if found.problem is None:
                self._keeping.undo.change(drop=[undo.write])
            elif undo.trial:
                self._keeping.undo.change(put=[msgspec.structs.replace(undo, trial=False)])
        except OSError as error:
            log.error("the undo file cannot be written: %s", error)
