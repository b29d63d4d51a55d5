"""Parameters as clients see them: listed, read from the device, and written all or nothing.

Writes run one after another in a thread of their own, and so does what takes them back. A stop does not wait
for them: what is not written by then is not written any more.
"""

import itertools
import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from msgspec import UNSET

from drivers.errors import DeviceTimeout, DriverError
from gateway.config.robot import RobotConfig
from gateway.connections.fair_queue import Client
from gateway.modules.component.module import ComponentModule
from gateway.modules.control.catalogue import resolve
from gateway.modules.control.dictionary import Objects, Wanted
from gateway.modules.control.ledger import WriteLedger
from gateway.modules.control.objects import Node, ObjectWrite, device_error
from gateway.modules.control.parameters import Parameter
from gateway.modules.control.reads import Reads
from gateway.modules.control.rules import Rules
from gateway.modules.control.storage import Command, Storage
from gateway.modules.control.transaction import ENDING, Leave, Transaction, TransactionResult
from gateway.modules.control.trial_jobs import TrialJobs
from gateway.modules.control.trials import Coming, Trials
from gateway.modules.control.unanswered import Unanswered
from gateway.modules.control.writer import Turn, Writer
from gateway.modules.stop.authority import Authority, Permit
from gateway.modules.stop.machine import Phase
from gateway.process.futures import back, done, gather, then
from gateway.process.loop import Loop
from gateway.records.records import Records
from gateway.records.undo import Undo
from gateway.wire.framing import ErrorKind, RpcError, refuse
from gateway.wire.parameter import ParameterInfo, ParameterValue, ParameterValues, Stored, Written

if TYPE_CHECKING:
    from gateway.connections.session import Session

log = logging.getLogger(__name__)

Changed = Callable[[], None]


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """One write, and what it may do."""

    changes: list[ObjectWrite]
    who: str
    trial_s: float | None
    coming: Coming
    permit: Permit

    @property
    def over(self) -> str | None:
        """Why a trial is pointless by now."""
        if self.trial_s is None or self.coming.over is None:
            return None
        return f"its trial is over already: {self.coming.over}"


class Tuning:
    """Every parameter of the robot. It belongs to the loop's thread, but for `claim` and `close`."""

    def __init__(
        self,
        config: RobotConfig,
        component: ComponentModule,
        loop: Loop,
        records: Records,
        authority: Authority,
        changed: Changed,
    ) -> None:
        self._component = component
        self._loop = loop
        self._records = records
        self._authority = authority
        self._parameters = resolve(config, component.robot.descriptions, component.absent)
        self._infos = [one.info for one in self._parameters.values()]
        self._joints = tuple(config.joint)
        self._rules = Rules(config, component, self._parameters)
        self._reads: Reads[Parameter | Wanted, Any] = Reads(loop, self._rules.device, self._read_any)
        self._unanswered = Unanswered()
        silence, ask = self._rules.silence, self._reads.ask
        self.objects = Objects(config, component, loop, self._parameters, silence, self._unanswered, ask)
        self._known: dict[str, tuple[int, float | str]] = {}  # parameter → when, what the device held
        self._asked: set[_Asked] = set()  # writes that have not been answered
        self._ending: str | None = None
        self._writer = Writer()
        jobs = TrialJobs(self._rules, authority, records, self._writer)
        self.trials = Trials(loop, self._writer, jobs, records.undo, changed, self._forget)
        self._storage = Storage(config, component, self._parameters, records, self._rules, self._writer)

    def close(self) -> None:
        """Take back what is being written, and end the writer's thread."""
        self._ending = ENDING
        self.trials.close()
        self._writer.close()

    def load(self) -> list[Undo]:
        """Return the writes that the last gateway left to be reverted; to be called before any write."""
        undos, problem = self._records.undo.load()
        if problem is not None:
            log.critical("%s", problem)
            self._records.journal.append("gateway", "undo file damaged", result=problem)
        newest = max((undo.write for undo in undos), default=0)
        now = time.time_ns() // 1_000_000  # unique also after a restart, and where the clock was set back
        self._numbers = itertools.count(max(now, newest + 1))
        return undos

    def resume(self, undos: Iterable[Undo]) -> None:
        """Revert those writes, newest first, once their devices are there; not values claimed by a stop."""
        left = [undo for one in undos if (undo := self._records.undo.get(one.write)) is not None]
        ready = self._component.when_ready({one.component for undo in left for one in undo.changes})
        for undo in reversed(left):
            how = "while it was on trial" if undo.trial else "before it had answered it, or taken it back"
            self.trials.take_up(undo, f"the gateway ended {how}", ready)

    def claim(self) -> "Future[None]":
        """Keep the values that stop controllers as a stop has set them: they are never reverted.

        From any thread.
        """
        return self.trials.claim()

    def enabling_objection(self, joints: Iterable[str]) -> str | None:
        """Return why these drives must not be enabled now: a value on trial could not be taken back then."""
        names = {one.name: "is being written" for asked in self._asked for one in asked.changes}
        for trial in self.trials.infos():
            how = f"is on trial (write {trial.write} of {trial.who}); confirm or revert that first"
            names |= dict.fromkeys(trial.values, how)
        chosen = tuple(joints)
        barred = (name for name in names if self._rules.bars(name, chosen))
        name = next(barred, None)
        return None if name is None else f"{name}, which enabled drives do not allow, {names[name]}"

    def infos(self) -> list[ParameterInfo]:
        return self._infos

    def listed(self, names: list[str] | None) -> ParameterValues:
        """Return the last known values, without asking; only of devices that are there."""
        chosen = self._parameters.chosen(names)
        lost = self._lost(chosen)
        return ParameterValues({one.name: self._last(one, lost) for one in chosen})

    def read(self, names: list[str] | None, client: Client) -> "Future[ParameterValues]":
        """Return the devices' present values; `problem` says why one is missing."""
        chosen = self._parameters.chosen(names)
        ready = self._component.when_ready({one.component for one in chosen})
        values = then(ready, lambda _none: self._reads.ask(client, chosen))
        return then(values, ParameterValues)

    def write(
        self, values: Mapping[str, float], session: "Session", trial_s: float | None
    ) -> "Future[Written]":
        """All of them or none; on trial for `trial_s` where that is given.

        Raises:
            RpcError: at once, or as the future's error: why not, and what became of each.

        """
        changes = [self._change(name, value) for name, value in values.items()]
        if len({change.parameter.name for change in changes}) != len(changes):
            raise refuse(ErrorKind.BAD_PARAMS, "a parameter is written twice, by its name and by its address")
        ready = self._component.when_ready({one.parameter.component for one in changes})
        asked = _Asked(
            changes,
            session.who,
            trial_s,
            self.trials.expect(session),
            self._authority.permit(session.asked_ns),
        )
        self._asked.add(asked)
        answer = then(ready, lambda _none: self._begin(asked))
        answer.add_done_callback(lambda _answer: self._end(asked))
        return answer

    def store(self, command: Command, session: "Session", component: str) -> "Future[Stored]":
        """Let a device keep its values, or forget them; see `Storage.run`."""
        leave = Leave(self._authority.permit(session.asked_ns), lambda: self._ending)
        return self._storage.run(command, session.who, component, leave)

    # Reading

    def _forget(self, names: Iterable[str]) -> None:
        """Forget the values of these."""
        for name in names:
            self._known.pop(name, None)

    def _lost(self, parameters: Iterable[Parameter]) -> dict[str, str]:
        """Return why the last readings may hold no longer, by device that has one of these parameters."""
        names = {one.component for one in parameters if one.problem is None}
        absent = ((name, self._rules.absence(name)) for name in names)
        return {name: f"{name} is not there: {why}" for name, why in absent if why is not None}

    def _last(self, parameter: Parameter, lost: Mapping[str, str]) -> ParameterValue:
        problem = parameter.problem or lost.get(parameter.component)
        stamp_ns, value = self._known.get(parameter.name, (None, None)) if problem is None else (None, None)
        return _value(parameter, value, stamp_ns, problem)

    def _read_any(self, chosen: "Sequence[Parameter | Wanted]") -> "Future[list[Any]]":
        """Read these for `Reads`: they are of one request, which is for parameters or for objects."""
        parameters = [one for one in chosen if isinstance(one, Parameter)]
        objects = [one for one in chosen if isinstance(one, Wanted)]
        return self._read_all(parameters) if parameters else self.objects.read_all(objects)

    def _read_all(self, parameters: Sequence[Parameter]) -> "Future[list[ParameterValue]]":
        """Read parameters of one device; an unreadable one says why."""
        why = {name: self._why_unasked(name) for name in {one.component for one in parameters}}
        refusals = ((one.name, self._refusal(one, why[one.component])) for one in parameters)
        refused = {name: refusal for name, refusal in refusals if refusal is not None}
        asked = [one for one in parameters if one.name not in refused]
        if not asked:
            return done([self._found(one, refused[one.name]) for one in parameters])
        node = self._rules.node(asked[0])
        uploads = gather({"all": node.upload_all([(one.index, one.subindex) for one in asked])})

        def told(found: Mapping[str, Any]) -> list[ParameterValue]:
            each = self._each(asked, node, found["all"])
            return [self._found(one, refused.get(one.name) or next(each)) for one in parameters]

        return then(back(self._loop, uploads), told)

    def _each(
        self, asked: Sequence[Parameter], node: Node, told: "Sequence[bytes | DriverError] | Exception"
    ) -> Iterator[bytes | Exception]:
        """Return each parameter's answer; after a missing answer, the same error for all the rest."""
        found: list[bytes | Exception] = [told] if isinstance(told, Exception) else [*told]
        last = found[-1]
        if isinstance(last, DeviceTimeout):
            self._unanswered.note({one.component for one in asked}, node, str(last))
        return itertools.islice(itertools.chain(found, itertools.repeat(last)), len(asked))

    def _why_unasked(self, component: str) -> str | None:
        """Return why it cannot be asked, or is not asked again so soon."""
        silence = self._rules.silence(component)
        return self._unanswered.why(component) if silence is None else f"{component} is not there: {silence}"

    def _refusal(self, parameter: Parameter, unasked: str | None) -> RpcError | None:
        """Return why it is not asked for."""
        problem = parameter.problem or unasked
        if problem is not None:
            return parameter.refusal(ErrorKind.UNAVAILABLE, problem)
        try:
            parameter.check_readable()
        except RpcError as error:
            return error
        return None

    def _found(self, parameter: Parameter, found: bytes | Exception) -> ParameterValue:
        stamp_ns = time.monotonic_ns()
        try:
            if isinstance(found, Exception):
                raise found
            value = parameter.told(found)
        except (DriverError, TimeoutError) as error:
            return _value(parameter, None, None, str(device_error(parameter, "reading", error)))
        except RpcError as error:
            return _value(parameter, None, None, str(error))
        self._known[parameter.name] = (stamp_ns, value)
        return _value(parameter, value, stamp_ns)

    # Writing

    def _change(self, name: str, value: float) -> ObjectWrite:
        parameter = self._parameters.get(name)
        if parameter is None:
            raise refuse(
                ErrorKind.UNKNOWN_NAME, f"there is no parameter {name!r}; parameter.list has them all"
            )
        return ObjectWrite(parameter, self._rules.node(parameter), parameter.encode(value))

    def _begin(self, asked: "_Asked") -> "Future[Written]":
        self._check_enabling(asked.changes)
        ledger = WriteLedger(
            self._records, self._rules.address, next(self._numbers), asked.who, asked.trial_s
        )
        leave = Leave(asked.permit, lambda: self._ending or asked.over)
        let_pass = partial(self._writer.let_pass, Turn.WRITE)
        transaction = Transaction(list(asked.changes), self._rules, leave, ledger, let_pass)
        self._forget(change.name for change in asked.changes)
        ended = back(self._loop, self._writer.submit(transaction.run, Turn.WRITE))
        ended.add_done_callback(lambda ended: self._follow(asked, ledger, ended))
        return then(ended, lambda outcome: self._written(outcome, ledger))

    def _end(self, asked: "_Asked") -> None:
        self._asked.discard(asked)
        self.trials.dismiss(asked.coming)

    def _check_enabling(self, changes: Iterable[ObjectWrite]) -> None:
        """Refuse a change that bars an enabling under way, as `enabling_objection` does the reverse."""
        if self._authority.state.phase is not Phase.ENABLING:
            return
        for change in changes:
            if self._rules.bars(change.name, self._joints):
                text = "an enabling is under way; wait for its answer"
                raise change.parameter.refusal(ErrorKind.WRONG_STATE, text)

    def _follow(self, asked: "_Asked", ledger: WriteLedger, ended: "Future[TransactionResult]") -> None:
        """Keep a write's trial, or the values that could not be rolled back."""
        kept = ledger.kept
        if kept is None:
            return
        if ended.exception() is None and asked.trial_s is not None:
            self.trials.begin(kept, asked.trial_s, asked.coming, ledger.taken_over)
        else:
            self.trials.take_up(kept, "its roll-back failed", done(None), ledger.problem)

    def _written(self, outcome: TransactionResult, ledger: WriteLedger) -> Written:
        now_ns = time.monotonic_ns()
        self._known.update({name: (now_ns, value) for name, value in outcome.after.items()})
        kept = ledger.kept
        if kept is None:
            return Written(ledger.number, outcome.before, outcome.after)
        return Written(ledger.number, kept.before(), kept.values(), ledger.trial_s)


def _value(
    parameter: Parameter, value: float | str | None, stamp_ns: int | None, problem: str | None = None
) -> ParameterValue:
    number, text = (None, value) if isinstance(value, str) else (value, UNSET)
    unit = parameter.settings.unit
    return ParameterValue(number, unit, parameter.min, parameter.max, stamp_ns, problem, text)
