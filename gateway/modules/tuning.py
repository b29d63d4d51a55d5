"""Parameters as clients see them: listed, read from the device, and written all or nothing.

Writes run one after another in a thread of their own, and so does what takes them back. A stop does not wait
for them: it interrupts them.
"""

import itertools
import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

from drivers.bus.settings import DeviceSettings
from drivers.bus.values import unsigned
from drivers.errors import DriverError
from drivers.joint.cia402 import ENERGISED, STATE_WORDS, DriveState, drive_state
from drivers.joint.commands import STATUSWORD
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.settings import JointSettings
from drivers.samples import State
from gateway.coding import too_far
from gateway.config import RobotConfig
from gateway.futures import back, done, failed, gather, then
from gateway.loop import Loop
from gateway.messages import ParameterInfo, ParameterValue, ParameterValues, Written
from gateway.modules.catalogue import resolve
from gateway.modules.component import ComponentModule
from gateway.modules.ledger import Keeping, WriteLedger
from gateway.modules.parameters import Parameter
from gateway.modules.storage import Storage
from gateway.modules.taking_back import OutOfReach
from gateway.modules.transaction import ANSWER_S, Change, Node, Outcome, Transaction, device_error
from gateway.modules.trials import Trials
from gateway.records.records import Records
from gateway.records.undo import Undo, UndoChange, UndoFile
from gateway.wire import Kind, RpcError, refuse

if TYPE_CHECKING:
    from gateway.session import Session

log = logging.getLogger(__name__)

Changed = Callable[[], None]


class Tuning:
    """Every parameter of the robot. It belongs to the loop's thread, but for `_check`."""

    def __init__(
        self, config: RobotConfig, component: ComponentModule, loop: Loop, records: Records, changed: Changed
    ) -> None:
        self._component = component
        self._loop = loop
        self._config = config
        self._devices: dict[str, JointSettings | DeviceSettings] = {**config.joint, **config.device}
        self._parameters = resolve(config, component.robot.descriptions, component.absent)
        self._infos = [one.info for one in self._parameters.values()]
        self._known: dict[str, tuple[int, float]] = {}  # parameter → when, what the device held
        self._numbers = itertools.count(time.time_ns() // 1_000_000)  # unique also after a restart
        self._interrupted = threading.Event()
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="write")
        undo = UndoFile(records.folder.undo)
        self._keeping = Keeping(undo, records.journal, self._place, records.unusable)
        self.trials = Trials(loop, self._writer.submit, self._keeping, self._reach, changed)
        self.storage = Storage(
            config, component, self._parameters, self._keeping, self._state, self._writer.submit
        )

    def close(self) -> None:
        """Take back what is being written, and end the writer's thread."""
        self.interrupt()
        self.trials.close()
        self._writer.shutdown(wait=True)

    def load(self) -> list[Undo]:
        """What the last gateway left to be taken back. Before anything is written."""
        if self._keeping.unusable is not None:
            return []
        undos, problem = self._keeping.undo.load()
        if problem is not None:
            log.critical("%s", problem)
            self._keeping.journal.append("gateway", "undo file damaged", result=problem)
        return undos

    def resume(self, undos: list[Undo]) -> None:
        """Take that back, the newest first, as soon as its devices are there."""
        ready = self._component.when_ready({one.component for undo in undos for one in undo.changes})
        for undo in reversed(undos):
            self.trials.take_up(undo, "the gateway ended before this write did", ready)

    def interrupt(self) -> None:
        """End every write that was asked for until now; what it had changed is taken back."""
        self._interrupted.set()
        self._interrupted = threading.Event()

    def infos(self) -> list[ParameterInfo]:
        return self._infos

    def listed(self, names: list[str] | None) -> ParameterValues:
        """What is known without asking: the last value read, as long as its device is there."""
        chosen = self._parameters.chosen(names)
        absent = self._absent(chosen)
        return ParameterValues({one.name: self._last(one, absent) for one in chosen})

    def read(self, names: list[str] | None) -> "Future[ParameterValues]":
        """What the devices hold now; where one does not tell, `problem` says why."""
        chosen = self._parameters.chosen(names)
        ready = self._component.when_ready({one.component for one in chosen})
        return then(then(ready, lambda _none: self._uploads(chosen)), self._values)

    def write(
        self, values: Mapping[str, float], session: "Session", trial_s: float | None
    ) -> "Future[Written]":
        """All of them or none; on trial for `trial_s` where that is given.

        Raises:
            RpcError: at once, or as the future's error: why not, and what became of each.

        """
        changes = [self._change(name, value) for name, value in values.items()]
        if len({change.parameter.name for change in changes}) != len(changes):
            raise refuse(Kind.BAD_PARAMS, "a parameter is written twice, by its name and by its address")
        ready = self._component.when_ready({one.parameter.component for one in changes})
        interrupted = self._interrupted
        return then(ready, lambda _none: self._begin(changes, interrupted, session, trial_s))

    # Reading

    def _absent(self, parameters: Iterable[Parameter]) -> dict[str, str]:
        """Why a device cannot be asked at all; of each that has one of these parameters."""
        now_ns, absent = time.monotonic_ns(), {}
        for name in {one.component for one in parameters if one.problem is None}:
            quality = self._component.quality(name, now_ns)
            if quality["state"] == State.LOST:
                absent[name] = f"{name} is not there: {quality['problem'] or 'it is silent'}"
        return absent

    def _last(self, parameter: Parameter, absent: Mapping[str, str]) -> ParameterValue:
        problem = parameter.problem or absent.get(parameter.component)
        stamp_ns, value = self._known.get(parameter.name, (None, None)) if problem is None else (None, None)
        return _value(parameter, value, stamp_ns, problem)

    def _uploads(self, parameters: list[Parameter]) -> "Future[dict[str, bytes | Exception]]":
        absent = self._absent(parameters)
        return gather({one.name: self._upload(one, absent) for one in parameters})

    def _upload(self, parameter: Parameter, absent: Mapping[str, str]) -> "Future[bytes]":
        problem = parameter.problem or absent.get(parameter.component)
        if problem is not None:
            return failed(parameter.refusal(Kind.UNAVAILABLE, problem))
        try:
            parameter.check_readable()
            return self._node(parameter).upload(parameter.index, parameter.subindex)
        except RpcError as error:
            return failed(error)

    def _values(self, found: Mapping[str, bytes | Exception]) -> ParameterValues:
        return ParameterValues(
            {name: self._found(self._parameters[name], one) for name, one in found.items()}
        )

    def _found(self, parameter: Parameter, found: bytes | Exception) -> ParameterValue:
        stamp_ns = time.monotonic_ns()
        try:
            if isinstance(found, Exception):
                raise found
            value = parameter.decode(found)
        except (DriverError, TimeoutError) as error:
            return _value(parameter, None, None, str(device_error(parameter, "reading", error)))
        except RpcError as error:
            return _value(parameter, None, None, str(error))
        self._known[parameter.name] = (stamp_ns, value)
        return _value(parameter, value, stamp_ns)

    def _node(self, parameter: Parameter) -> Node:
        component: Any = self._component.robot.components.get(parameter.component)
        if component is None:
            raise parameter.refusal(Kind.UNAVAILABLE, parameter.problem or "its device is not there")
        node: Node = component.node
        return node

    # Writing

    def _change(self, name: str, value: float) -> Change:
        parameter = self._parameters.get(name)
        if parameter is None:
            raise refuse(Kind.UNKNOWN_NAME, f"there is no parameter {name!r}; parameter.list has them all")
        return Change(parameter, self._node(parameter), parameter.encode(value))

    def _begin(
        self,
        changes: list[Change],
        interrupted: threading.Event,
        session: "Session",
        trial_s: float | None,
    ) -> "Future[Written]":
        ledger = WriteLedger(self._keeping, next(self._numbers), session.who, changes, trial_s)
        transaction = Transaction(changes, self._check, interrupted, ledger)
        for change in changes:
            self._known.pop(change.parameter.name, None)
        ended = back(self._loop, self._writer.submit(transaction.run))
        ended.add_done_callback(lambda _ended: self._follow(ledger, session, trial_s))
        return then(ended, lambda outcome: self._written(outcome, ledger))

    def _follow(self, ledger: WriteLedger, session: "Session", trial_s: float | None) -> None:
        """What stays of a write: its trial, or what could not be rolled back."""
        if ledger.kept is None:
            return
        if ledger.kept.trial and trial_s is not None:
            self.trials.begin(ledger.kept, trial_s, session, ledger.replaced)
        else:
            self.trials.take_up(ledger.kept, "its roll-back failed", done(None), ledger.problem)

    def _written(self, outcome: Outcome, ledger: WriteLedger) -> Written:
        now_ns = time.monotonic_ns()
        self._known.update({name: (now_ns, value) for name, value in outcome.after.items()})
        if ledger.kept is None:
            return Written(ledger.number, outcome.before, outcome.after)
        return Written(ledger.number, ledger.kept.before(), ledger.kept.values(), ledger.trial_s)

    def _check(self, change: Change, current: float) -> None:
        """In the writer's thread: the step, and the states of the drives that the parameter may move."""
        parameter = change.parameter
        new, most = parameter.decode(change.data), parameter.settings.max_step
        if most is not None and too_far(current, new, most):
            unit, step = parameter.settings.unit, abs(new - current)
            text = f"from {current:g} {unit} it may change by {most:g} {unit} at once, not by {step:g}"
            raise parameter.refusal(Kind.OUT_OF_LIMIT, text, most)
        allowed = allowed_states(parameter)
        if allowed is not None:
            for drive in self._config.drives_of(parameter.component):
                self._check_state(parameter, drive, allowed)

    def _check_state(self, parameter: Parameter, drive: str, allowed: frozenset[DriveState]) -> None:
        state, why = self._state(drive)
        if state in allowed:
            return
        said = f"unknown: {why}" if state is None else STATE_WORDS[state]
        wanted = ", ".join(sorted(STATE_WORDS[one] for one in allowed))
        text = f"the state of {drive} is {said}; this parameter may be written in: {wanted}"
        raise parameter.refusal(Kind.WRONG_STATE, text)

    def _state(self, drive: str) -> tuple[DriveState | None, str]:
        """The drive's state as it says now; or why that is not known."""
        component: Any = self._component.robot.components.get(drive)
        if component is None:
            return None, self._component.absent.get(drive, "it is not there")
        index = STATUSWORD + AXIS_OFFSET * self._config.joint[drive].axis
        try:
            statusword = unsigned(component.node.upload(index, 0).result(ANSWER_S))
        except (DriverError, TimeoutError) as error:
            return None, str(error)
        return drive_state(statusword), f"its statusword is 0x{statusword:04X}"

    def _place(self, component: str) -> tuple[str, int]:
        device = self._devices[component]
        return device.bus, device.node_id

    def _reach(self, change: UndoChange) -> Node:
        """The device that a change was written to, as long as it is the same one."""
        device = self._devices.get(change.component)
        if device is None or (device.bus, device.node_id) != (change.bus, change.node_id):
            where = f"node {change.node_id} on bus {change.bus!r}"
            raise OutOfReach(
                f"the robot's file no longer says that {where} is {change.component}", final=True
            )
        component: Any = self._component.robot.components.get(change.component)
        if component is None:
            raise OutOfReach(self._component.absent.get(change.component, "it is not there"), final=False)
        quality = self._component.quality(change.component, time.monotonic_ns())
        if quality["state"] == State.LOST:
            raise OutOfReach(str(quality["problem"] or "it is silent"), final=False)
        node: Node = component.node
        return node


def allowed_states(parameter: Parameter) -> frozenset[DriveState] | None:
    """The drive states in which a parameter may be written; `None` where the state does not matter."""
    settings = parameter.settings
    if settings.states is None:
        return None if settings.live else frozenset(DriveState) - ENERGISED
    named = frozenset(state for state in DriveState if STATE_WORDS[state] in settings.states)
    return named if settings.live else named - ENERGISED


def _value(
    parameter: Parameter, value: float | None, stamp_ns: int | None, problem: str | None = None
) -> ParameterValue:
    return ParameterValue(value, parameter.settings.unit, parameter.min, parameter.max, stamp_ns, problem)
