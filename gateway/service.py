"""The gateway's service: check a request's parameters, start its module, and answer."""

import logging
import time
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING, Protocol, cast

from gateway import __version__
from gateway.access import roles
from gateway.always_on import Standing
from gateway.config.robot import RobotConfig
from gateway.connections.session import Answer, Session
from gateway.handlers import Handlers, on
from gateway.modules.resource.module import RESOURCE_CHANNELS
from gateway.modules.stop.first_stop import FirstStop
from gateway.process.boot import boot_id
from gateway.process.futures import gather, then
from gateway.process.loop import Loop
from gateway.records.folder import RecordsFolder
from gateway.registry import MODULES, Module, Registry, Spec
from gateway.streaming.budget import Budget
from gateway.streaming.sources import Selection, channel_info, check_globs, merge, narrow
from gateway.streaming.streams import Streams
from gateway.wire import framing
from gateway.wire.cost import GATEWAY_COST, GatewayCost
from gateway.wire.method import Done, Params
from gateway.wire.methods import METHODS
from gateway.wire.robot import (
    CLOCK_READ,
    HELLO,
    ROBOT_DESCRIBE,
    Clock,
    Description,
    GuardInfo,
    Hello,
    HelloParams,
)
from gateway.wire.stop import ROBOT_STOP
from gateway.wire.stream import STREAM_START, STREAM_STOP, StreamStarted, StreamStartParams, StreamStopParams

if TYPE_CHECKING:
    from gateway.access.known_clients import KnownClients
    from gateway.cost import Costs
    from gateway.guard.module import GuardModule
    from gateway.modules.component.module import ComponentModule
    from gateway.modules.control.module import ControlModule, Described
    from gateway.modules.resource.module import ResourceModule

log = logging.getLogger(__name__)

MAY_MOVE = ("component", "status")  # who looks at these may have to stop the robot


class Streamed(Protocol):
    """A module whose channels can be streamed."""

    @property
    def absent(self) -> Mapping[str, str]:
        """Components that are not there, and why."""

    def selections(self) -> list[Selection]:
        """Return all its channels, by their sources."""


class Service:
    """The methods of one robot's gateway."""

    def __init__(self, config: RobotConfig, loop: Loop, specs: Mapping[str, Spec] = MODULES) -> None:
        self.registry = Registry(config, loop, specs)
        self._budget = Budget(loop, config.gateway.max_cpu_percent)
        self.streams = Streams(loop, config.gateway.buffer_kb * 1024, self._budget)
        self._sessions: dict[Session, Costs | None] = {}  # that are open; how each sees the costs
        self._config = config
        self._loop = loop
        self._boot_id = boot_id()
        self.listens: str | None = None  # HOST:PORT
        self._first_stop = FirstStop(config)
        self._guard_problem = "it has not started yet"
        self.handlers = Handlers(
            on(HELLO, self._hello),
            on(CLOCK_READ, self._read_clock),
            on(ROBOT_DESCRIBE, self._describe),
            on(GATEWAY_COST, self._cost),
            on(STREAM_START, self._stream_start),
            on(STREAM_STOP, self._stream_stop),
        )

    def resume(self) -> None:
        """Begin what needs no client: a configured guard, and what the last gateway left unfinished."""
        if self._config.guard is not None:
            self._stand("guard", "guard", self._guard_failed)
        if RecordsFolder(self._config.records).unfinished:
            # It keeps itself as long as a stop is held, or a write is to be taken back.
            self._stand("control", None, _control_failed)

    def _stand(self, name: str, user: str | None, failed: Callable[[str], object]) -> None:
        Standing(self.registry, self._loop, name, user, failed).begin()

    def _guard_failed(self, why: str) -> None:
        self._guard_problem = why
        log.critical("the guard does not run: %s", why)

    def close(self) -> None:
        """Join the first stop, once the loop has ended."""
        self._first_stop.join()

    def objection(self) -> str | None:
        """Return why the gateway must not end now, in words; `None` if it may."""
        guard = self._running_guard()
        return None if guard is None else guard.objection()

    @property
    def needed(self) -> bool:
        """Whether something runs, or has to without any client."""
        if self._config.guard is not None or not self.registry.off:
            return True
        return RecordsFolder(self._config.records).unfinished

    def who_is_known(self, known: "KnownClients") -> None:
        """Take the known clients and their permissions after a change."""
        control = cast("ControlModule | None", self.registry.running("control"))
        if control is not None:  # else it looks itself when it starts
            control.who_is_known(known)

    def opened(self, session: Session) -> None:
        """Take a new client."""
        self._sessions[session] = None
        session.on_close(lambda: self._closed(session))

    def _closed(self, session: Session) -> None:
        del self._sessions[session]
        self.registry.leave(session)

    def handle(self, session: Session, request: framing.Request) -> Answer:
        """Return the answer to one request, now or later.

        Raises:
            RpcError: the method or its parameters cannot be served.

        """
        method = METHODS.get(request.method)
        if method is None:
            raise framing.unknown_method(request.method)
        roles.check(session.identity, method)
        params = framing.decode_params(request.params, method.params)
        roles.check_params(session.identity, method, params)
        if method.module is None:
            return self.handlers.answer(method, session, params)
        if method is ROBOT_STOP and self.registry.running(method.module) is None:
            self._first_stop.begin()
        module, asked_ns = self._use(method.module, session), session.asked_ns

        def answer(running: Module) -> Answer:
            session.asked_ns = asked_ns  # others may have been asked for while the module was starting
            return running.handlers.answer(method, session, params)

        return then(module, answer)

    def use_resource(self, user: Hashable) -> "Future[ResourceModule]":
        """Return the running resource module, kept for `user` until it leaves the registry."""
        return cast("Future[ResourceModule]", self.registry.use("resource", user))

    def _use(self, name: str, session: Session) -> "Future[Module]":
        # What a client asked for just before it vanished is still done (a stop above all).
        user = None if session.closed else session
        if name in MAY_MOVE:
            self.registry.use("control", user)  # so that a stop does not wait for its module
        return self.registry.use(name, user)

    def _hello(self, session: Session, params: HelloParams) -> Hello:
        if params.protocol != framing.PROTOCOL:
            raise framing.refuse(
                framing.ErrorKind.BAD_PARAMS,
                f"this gateway speaks protocol {framing.PROTOCOL}, not {params.protocol}",
            )
        if not params.client.isprintable():
            raise framing.refuse(framing.ErrorKind.BAD_PARAMS, "a client's name is of printable characters")
        if session.named not in (None, params.client):
            raise framing.refuse(
                framing.ErrorKind.BAD_PARAMS,
                f"this connection has called itself {session.named!r} already; keep to it",
            )
        session.named = params.client
        who, robot = session.identity, self._config.robot.name
        session.who = who.called(session.peer, params.client)
        return Hello(
            framing.PROTOCOL,
            robot,
            who.role,
            self._boot_id,
            __version__,
            who.name,
            roles.refused(who),
            self.listens,
        )

    def _read_clock(self, _session: Session, _params: Params) -> Clock:
        return self._clock()

    def _clock(self) -> Clock:
        return Clock(time.monotonic_ns(), time.time_ns(), self._boot_id)

    def _describe(self, session: Session, _params: Params) -> "Future[Description]":
        control = cast("Future[ControlModule]", self._use("control", session))
        described = then(control, lambda running: running.describe())
        return then(described, self._description)

    def _description(self, robot: "Described") -> Description:
        return Description(
            robot=self._config.robot.name,
            boot_id=self._boot_id,
            role=self._config.gateway.role.value,
            components=robot.components,
            channels=[*robot.channels, *map(channel_info, RESOURCE_CHANNELS)],
            parameters=robot.parameters,
            modules=self.registry.phases,
            clock=self._clock(),
            stop=robot.stop,
            guard=self._guard_info(),
            trials=robot.trials,
            records=robot.records,
            budget=self._budget.info,
            version=__version__,
            buses=robot.buses,
            file=self._config.digest,
        )

    def _guard_info(self) -> GuardInfo:
        if self._config.guard is None:
            return GuardInfo()
        guard = self._running_guard()
        return GuardInfo(configured=True, problem=self._guard_problem) if guard is None else guard.info()

    def _running_guard(self) -> "GuardModule | None":
        running = self.registry.running("guard") if self._config.guard is not None else None
        return cast("GuardModule | None", running)

    def _cost(self, session: Session, _params: Params) -> "Future[GatewayCost]":
        resource = self.use_resource(None if session.closed else session)
        return then(resource, lambda running: self._look_at_costs(session, running))

    def _look_at_costs(self, session: Session, resource: "ResourceModule") -> GatewayCost:
        from gateway.cost import Costs  # for who asks

        costs = self._sessions.get(session) or Costs()
        if not session.closed:
            self._sessions[session] = costs
        component = cast("ComponentModule | None", self.registry.running("component"))
        buses = {} if component is None else component.robot.buses
        phases = self.registry.phases
        return costs.look(
            resource.own_rss_bytes(), phases, buses, self._sessions, self.streams, self._budget.info
        )

    def _stream_start(self, session: Session, params: StreamStartParams) -> "Future[StreamStarted]":
        modules: dict[str, Future[Streamed]] = {
            name: cast("Future[Streamed]", self._use(name, session)) for name in params.modules
        }

        def start(found: "dict[str, Streamed | Exception]") -> StreamStarted:
            running: list[Streamed] = []
            for module in found.values():
                if isinstance(module, Exception):
                    raise module
                running.append(module)
            everything = merge(one for module in running for one in module.selections())
            absent = {name: why for module in running for name, why in module.absent.items()}
            names = [name for one in everything for name in one.names]
            check_globs("channel", names, params.channels, absent)
            chosen = narrow(everything, params.channels)
            if session.closed:
                raise framing.refuse(framing.ErrorKind.UNAVAILABLE, "the connection has ended")
            if not chosen:
                raise framing.refuse(
                    framing.ErrorKind.UNAVAILABLE, "there is no channel to stream; see robot.describe"
                )
            return StreamStarted(self.streams.start(session, chosen, params.rate_hz))

        return then(gather(modules), start)

    def _stream_stop(self, session: Session, params: StreamStopParams) -> Done:
        if not self.streams.stop(session, params.stream):
            raise framing.refuse(
                framing.ErrorKind.UNKNOWN_NAME,
                f"this connection has no stream {params.stream}; it may have ended before",
            )
        return Done()


def _control_failed(why: str) -> None:
    log.critical("what the last gateway left, a held stop or a write on trial, waits: %s", why)
