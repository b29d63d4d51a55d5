"""The control module: who may write, what is written, and the stop."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from gateway.access.folder import AccessFolder
from gateway.handlers import Handlers, on
from gateway.modules.control.access_journal import AccessJournal
from gateway.modules.control.lease import RENEWED, TAKEN, Leases
from gateway.modules.control.storage import RESTORING, STORING
from gateway.modules.control.tuning import Tuning
from gateway.modules.stop.authority import Authority
from gateway.modules.stop.drive import Drive
from gateway.modules.stop.stop_control import StopControl
from gateway.process.futures import then
from gateway.records.journal import Journal, Share
from gateway.records.records import Records
from gateway.records.signing import HeadSigner
from gateway.wire.bus import BusInfo
from gateway.wire.component import ChannelInfo, ComponentInfo
from gateway.wire.control import (
    CONTROL_ACQUIRE,
    CONTROL_RELEASE,
    JOURNAL_HEAD,
    JOURNAL_TAIL,
    AcquireParams,
    JournalEntries,
    JournalProof,
    Lease,
    RecordsInfo,
    ReleaseParams,
    TailParams,
)
from gateway.wire.dictionary import (
    OBJECT_LIST,
    OBJECT_READ,
    ObjectList,
    ObjectListParams,
    ObjectReadParams,
    ObjectValues,
)
from gateway.wire.method import Done, Params
from gateway.wire.parameter import (
    PARAMETER_CONFIRM,
    PARAMETER_LIST,
    PARAMETER_READ,
    PARAMETER_RESTORE,
    PARAMETER_REVERT,
    PARAMETER_STORE,
    PARAMETER_WRITE,
    ComponentParams,
    Confirmed,
    ParameterInfo,
    ParameterParams,
    ParameterValues,
    ParameterWriteParams,
    Reverted,
    Stored,
    TrialInfo,
    WriteNumberParams,
    Written,
)
from gateway.wire.stop import (
    ROBOT_ENABLE,
    ROBOT_RESET,
    ROBOT_STOP,
    Enabled,
    EnableParams,
    Reset,
    StopInfo,
    StopParams,
    Stopped,
)

LOOK_S = 1.0  # between looks who is let in

if TYPE_CHECKING:
    from gateway.access.known_clients import KnownClients
    from gateway.connections.session import Session
    from gateway.modules.component.module import ComponentModule
    from gateway.registry import Context


@dataclass(frozen=True, slots=True)
class Described:
    """The part of `robot.describe` that comes from the component and control modules."""

    components: list[ComponentInfo]
    channels: list[ChannelInfo]
    parameters: list[ParameterInfo]
    stop: StopInfo
    trials: list[TrialInfo]
    records: RecordsInfo
    buses: list[BusInfo]


class ControlModule:
    """Everything that changes something on the robot."""

    def __init__(self, context: "Context") -> None:
        self._context = context
        self._component = cast("ComponentModule", context.needs["component"])
        self._leases = Leases(context.loop, self._lease_changed)
        self._watching = False
        self._awake: set[str] = set()  # why the bus is kept, clients or not
        self._signer = HeadSigner(AccessFolder(context.config.access), context.config.robot.name)
        self.armed: Callable[[str], bool] = lambda _name: False  # the guard's, where there is one
        self.handlers = Handlers(
            on(CONTROL_ACQUIRE, self._acquire),
            on(CONTROL_RELEASE, self._release),
            on(JOURNAL_TAIL, self._tail),
            on(JOURNAL_HEAD, self._head),
            on(PARAMETER_LIST, self._list),
            on(PARAMETER_READ, self._read),
            on(PARAMETER_WRITE, self._write),
            on(PARAMETER_CONFIRM, self._confirm),
            on(PARAMETER_REVERT, self._revert),
            on(PARAMETER_STORE, self._store),
            on(PARAMETER_RESTORE, self._restore),
            on(OBJECT_LIST, self._objects),
            on(OBJECT_READ, self._read_objects),
            on(ROBOT_STOP, self._stop_asked),
            on(ROBOT_RESET, self._reset),
            on(ROBOT_ENABLE, self._enable),
            require=self._leases.require,
        )

    def start(self) -> None:
        config, loop = self._context.config, self._context.loop
        with ExitStack() as opened:  # what was opened before something failed
            self._records = Records(config.records)
            opened.callback(self._records.close)
            self._stop = StopControl(config, self._component, loop, self._records, self._hold_changed)
            self._tuning = Tuning(
                config, self._component, loop, self._records, self._stop.authority, self._trials_changed
            )
            opened.callback(self._tuning.close)
            self._admissions = AccessJournal(self._records, AccessFolder(config.access))
            self._admissions.look()
            self._stop.claim = self._tuning.claim
            left = self._tuning.load()
            self._stop.start()
            opened.pop_all()
        self._watching = True
        loop.post(self._look_who_is_known)
        loop.post(lambda: self._tuning.resume(left))
        self._context.stops_by(self.stop_robot)
        loop.post(self._hold_changed)  # a stop that is held keeps the module from its first moment on

    def stop(self) -> None:
        self._watching = False
        self._context.stops_by(None)
        self._stop.close()
        self._tuning.close()
        self._records.close()

    def describe(self) -> "Future[Described]":
        """Describe the robot after a cold start is over."""
        ready = self._component.when_ready(self._component.robot.components)
        return then(ready, lambda _none: self._described())

    def _described(self) -> Described:
        return Described(
            components=self._component.components(),
            channels=self._component.channels(),
            parameters=self._tuning.infos(),
            stop=self._stop.info(self.armed),
            trials=self._tuning.trials.infos(),
            records=self._records.info,
            buses=self._component.buses(),
        )

    def keep_awake(self, why: str, on: bool) -> None:
        """Keep the bus, clients or not, as long as there is a reason. In the loop's thread."""
        (self._awake.add if on else self._awake.discard)(why)
        self._context.keep(bool(self._awake))

    def revert_trials(self, why: str) -> None:
        """Take back everything that is on trial. In the loop's thread."""
        self._tuning.trials.revert_all(why)

    def who_is_known(self, known: "KnownClients") -> None:
        """Take the known clients after a change. In the loop's thread."""
        self._admissions.tell(known)

    def _look_who_is_known(self) -> None:
        """Look who is let in, even if nobody is there: who is new, or is no more, is told at once."""
        if self._watching:
            self._admissions.look()
            self._context.loop.call_later(LOOK_S, self._look_who_is_known)

    def _hold_changed(self) -> None:
        self.keep_awake("stop", self._stop.held)

    def _trials_changed(self) -> None:
        self.keep_awake("trials", self._tuning.trials.pending)

    def _lease_changed(self, session: "Session", what: str) -> None:
        if what == RENEWED:
            return
        self._records.journal.append(session.who, what, Share.ASKED)
        if what != TAKEN:
            self._tuning.trials.revert_of(session, what)

    # What clients ask for

    def _acquire(self, session: "Session", params: AcquireParams) -> Lease:
        return self._leases.acquire(session, params.ttl_s, take_over=params.take_over)

    def _release(self, session: "Session", params: ReleaseParams) -> Done:
        self._leases.release(session, params.lease)
        return Done()

    def _tail(self, _session: "Session", params: TailParams) -> "Future[JournalEntries]":
        return then(self._records.journal.tail(params.n), lambda tail: JournalEntries(*tail))

    def _head(self, _session: "Session", _params: Params) -> "Future[JournalProof]":
        return self._records.journal.with_head(self._signer.proof)

    def _list(self, _session: "Session", params: ParameterParams) -> ParameterValues:
        return self._tuning.listed(params.names)

    def _read(self, session: "Session", params: ParameterParams) -> "Future[ParameterValues]":
        return self._tuning.read(params.names, session)

    def _write(self, session: "Session", params: ParameterWriteParams) -> "Future[Written]":
        return self._tuning.write(params.changes, session, params.trial_s)

    def _confirm(self, _session: "Session", params: WriteNumberParams) -> "Future[Confirmed]":
        return self._tuning.trials.confirm(params.write)

    def _revert(self, _session: "Session", params: WriteNumberParams) -> "Future[Reverted]":
        return self._tuning.trials.revert(params.write)

    def _store(self, session: "Session", params: ComponentParams) -> "Future[Stored]":
        return self._tuning.store(STORING, session, params.component)

    def _restore(self, session: "Session", params: ComponentParams) -> "Future[Stored]":
        return self._tuning.store(RESTORING, session, params.component)

    def _objects(self, _session: "Session", params: ObjectListParams) -> ObjectList:
        return self._tuning.objects.listed(params)

    def _read_objects(self, session: "Session", params: ObjectReadParams) -> "Future[ObjectValues]":
        return self._tuning.objects.read(params, session)

    def _stop_asked(self, session: "Session", params: StopParams) -> "Future[Stopped]":
        return self.stop_robot(session.who, str(params.reason))

    def _reset(self, session: "Session", _params: Params) -> "Future[Reset]":
        return self._stop.reset(session.who, session.asked_ns)

    def _enable(self, session: "Session", params: EnableParams) -> "Future[Enabled]":
        return self._stop.enable(
            session.who,
            session.asked_ns,
            params.joints,
            lambda: self._lost_lease(session),
            self._tuning.enabling_objection,
        )

    def _lost_lease(self, session: "Session") -> str | None:
        return None if self._leases.held_by(session) else "the lease of who asked for it has ended"

    # For the guard

    @property
    def drives(self) -> Mapping[str, Drive]:
        """Every joint that is there."""
        return self._stop.drives

    @property
    def journal(self) -> Journal:
        return self._records.journal

    @property
    def authority(self) -> Authority:
        """The authority over motion."""
        return self._stop.authority

    def stop_robot(self, who: str, reason: str) -> "Future[Stopped]":
        """Quick stop on every drive, held until it is reset. From any thread."""
        return self._stop.stop(who, reason)

    def trip(self, who: str, reason: str) -> None:
        """Stop for the guard, which leaves an already held stop as it is. From any thread."""
        self._stop.trip(who, reason)
