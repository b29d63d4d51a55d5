"""The gateway's modules and their lives: started on first use, stopped after the last client has left.

A module's code is imported only when it starts. Starting and stopping take threads of their own, because
files are read and devices are opened and closed there, and no client waits for another's devices.
"""

import contextlib
import gc
import importlib
import logging
import threading
import time
from collections.abc import Callable, Hashable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from gateway.config.robot import RobotConfig
from gateway.connections.incoming_bytes import StopNow
from gateway.handlers import Handlers
from gateway.process.futures import done, failed
from gateway.process.loop import Loop, Timer
from gateway.wire import framing

log = logging.getLogger(__name__)


class Module(Protocol):
    """A module of the daemon. `start` and `stop` may take their time; all else runs in the loop."""

    @property
    def handlers(self) -> Handlers: ...

    def start(self) -> None: ...

    def stop(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Context:
    """Context of a module. `keep(True)` keeps it running without any client until `keep(False)`.

    Who carries out stops says how: `stops_by(stop_now)`, from any thread. From then until `stops_by(None)`
    every stop of a client is `stop_now(who, reason)`, called in the thread that reads the clients, past the
    loop; what it returns is answered. Where it raises, the handler of `robot.stop` gets it, in the loop.
    """

    config: RobotConfig
    loop: Loop
    needs: Mapping[str, Module]
    keep: Callable[[bool], None]
    stops_by: Callable[[StopNow | None], None] = lambda _stop_now: None


@dataclass(frozen=True, slots=True)
class Spec:
    """Import path of a module, and the modules that it needs."""

    path: str
    needs: tuple[str, ...] = ()

    def preload(self) -> None:
        """Import its code already; what is wrong with it is told when it starts."""
        with contextlib.suppress(Exception):
            importlib.import_module(self.path.partition(":")[0])


# A module stands below those it needs.
MODULES: Mapping[str, Spec] = {
    "resource": Spec("gateway.modules.resource.module:ResourceModule"),
    "component": Spec("gateway.modules.component.module:ComponentModule"),
    "blame": Spec("gateway.modules.resource.blame:BlameModule", needs=("component",)),
    "status": Spec("gateway.modules.status:StatusModule", needs=("component", "resource")),
    "control": Spec("gateway.modules.control.module:ControlModule", needs=("component",)),
    "guard": Spec("gateway.guard.module:GuardModule", needs=("component", "control")),
}


class Phase(StrEnum):
    """Phase of a module's life."""

    OFF = "off"
    STARTING = "starting"
    RUNNING = "running"
    STOPPING = "stopping"


class _Slot:
    """One module's place: its phase, its users, and those who wait for it."""

    def __init__(self, spec: Spec) -> None:
        self.spec = spec
        self.phase = Phase.OFF
        self.module: Module | None = None
        self.users: set[Hashable] = set()
        self.linger_until_ns = 0
        self.waiting: list[Future[Module]] = []
        self.thread: threading.Thread | None = None


class Registry:
    """All modules of one gateway. It belongs to the loop's thread."""

    def __init__(self, config: RobotConfig, loop: Loop, specs: Mapping[str, Spec] = MODULES) -> None:
        self._config = config
        self._loop = loop
        self._slots = {name: _Slot(spec) for name, spec in specs.items()}
        self._linger: Timer | None = None
        self._closing: Callable[[], None] | None = None
        self.when_off: Callable[[], None] = lambda: None  # called when the last module has stopped
        self.stop_now: StopNow | None = None  # how a stop is carried out from any thread, while somebody can

    @property
    def off(self) -> bool:
        """Whether no module runs, or is about to."""
        return all(slot.phase is Phase.OFF and not slot.waiting for slot in self._slots.values())

    @property
    def phases(self) -> dict[str, str]:
        return {name: slot.phase.value for name, slot in self._slots.items()}

    @property
    def ending(self) -> bool:
        """Whether `close` has been called: nothing starts any more."""
        return self._closing is not None

    def running(self, name: str) -> Module | None:
        """Return the module, where it is running now."""
        slot = self._slots[name]
        return slot.module if slot.phase is Phase.RUNNING else None

    def use(self, name: str, user: Hashable | None) -> "Future[Module]":
        """Return the running module; `user` keeps it (and what it needs) until `leave`.

        Without a user it lingers only.
        """
        slot = self._slots[name]
        if self.ending:
            return failed(framing.refuse(framing.ErrorKind.UNAVAILABLE, "the gateway is ending"))
        if user is None:
            slot.linger_until_ns = self._linger_from_now_ns()
        else:
            slot.users.add(user)
        if slot.phase is Phase.RUNNING and slot.module is not None:
            return done(slot.module)
        future: Future[Module] = Future()
        slot.waiting.append(future)
        self._settle()
        return future

    def leave(self, user: Hashable) -> None:
        """Let go of every module that `user` has used."""
        until_ns = self._linger_from_now_ns()
        for slot in self._slots.values():
            if user in slot.users:
                slot.users.remove(user)
                slot.linger_until_ns = until_ns
        self._settle()

    def close(self, closed: Callable[[], None]) -> None:
        """Stop everything now, whoever uses it; calls `closed` in the loop when all is off."""
        self._closing = closed
        for name in self._slots:
            self._give_up(name, framing.refuse(framing.ErrorKind.UNAVAILABLE, "the gateway is ending"))
        self._settle()

    def _stops_by(self, stop_now: StopNow | None) -> None:
        self.stop_now = stop_now

    def _linger_from_now_ns(self) -> int:
        return time.monotonic_ns() + round(self._config.gateway.linger_s * 1e9)

    def _settle(self) -> None:
        """Bring every module to where it is wanted; the one place where phases begin."""
        for name, slot in self._slots.items():
            needed = [self._slots[other] for other in slot.spec.needs]
            wanted = self._is_wanted(name)
            if slot.phase is Phase.OFF and wanted and all(other.module for other in needed):
                self._begin_start(name, slot)
            elif slot.phase is Phase.RUNNING and not wanted and self._is_free(name):
                self._begin_stop(name, slot)
        self._set_linger_timer()
        if self._closing is not None and all(slot.phase is Phase.OFF for slot in self._slots.values()):
            self._loop.post(self._closing)

    def _standing_on(self, name: str) -> list[str]:
        return [other for other, slot in self._slots.items() if name in slot.spec.needs]

    def _is_wanted(self, name: str) -> bool:
        slot = self._slots[name]
        if slot.users or slot.waiting or time.monotonic_ns() < slot.linger_until_ns:
            return True
        return any(self._is_wanted(other) for other in self._standing_on(name))

    def _is_free(self, name: str) -> bool:
        return all(self._slots[other].phase is Phase.OFF for other in self._standing_on(name))

    def _set_linger_timer(self) -> None:
        if self._linger is not None:
            self._linger.cancel()
            self._linger = None
        now_ns = time.monotonic_ns()
        ends = [
            slot.linger_until_ns
            for slot in self._slots.values()
            if slot.phase is Phase.RUNNING and not slot.users and slot.linger_until_ns > now_ns
        ]
        if ends:
            self._linger = self._loop.call_later((min(ends) - now_ns) / 1e9, self._settle)

    def _begin_start(self, name: str, slot: _Slot) -> None:
        slot.phase = Phase.STARTING
        needs = {other: self._slots[other].module for other in slot.spec.needs}

        def keep(on: bool) -> None:
            if on and not self.ending:
                slot.users.add(slot)
            else:
                self.leave(slot)

        there = {k: v for k, v in needs.items() if v is not None}
        context = Context(self._config, self._loop, there, keep, self._stops_by)

        waiting = [self._slots[other].spec for other in self._standing_on(name) if self._is_wanted(other)]

        def work() -> None:
            try:
                for spec in waiting:  # now, because devices that come up would slow it down
                    spec.preload()
                path, _, class_name = slot.spec.path.partition(":")
                module: Module = getattr(importlib.import_module(path), class_name)(context)
                module.start()
            except Exception as error:  # handed to everybody who waits for it
                log.exception("the module %s cannot start", name)
                reason = error
                self._loop.post(lambda: self._failed(name, slot, reason))
            else:
                self._loop.post(lambda: self._started(slot, module))

        self._spawn(slot, f"start-{name}", work)

    def _begin_stop(self, name: str, slot: _Slot) -> None:
        slot.phase = Phase.STOPPING
        module = slot.module
        slot.module = None

        def work() -> None:
            try:
                if module is not None:
                    module.stop()
            except Exception:  # it is off all the same; the next start begins anew
                log.exception("the module %s did not stop cleanly", name)
            self._loop.post(lambda: self._ended(slot))

        self._spawn(slot, f"stop-{name}", work)

    @staticmethod
    def _spawn(slot: _Slot, name: str, work: Callable[[], None]) -> None:
        slot.thread = threading.Thread(target=work, name=name)
        slot.thread.start()

    def _started(self, slot: _Slot, module: Module) -> None:
        self._join(slot)
        slot.phase, slot.module = Phase.RUNNING, module
        gc.freeze()  # a full collection of all that was read and built would hold up a stop for 20 ms
        waiting, slot.waiting = slot.waiting, []
        for future in waiting:
            future.set_result(module)
        self._settle()

    def _ended(self, slot: _Slot) -> None:
        self._join(slot)
        slot.phase = Phase.OFF
        gc.unfreeze()  # what the module leaves may be collected
        self._settle()
        if self.off:
            self.when_off()

    def _failed(self, name: str, slot: _Slot, reason: Exception) -> None:
        self._give_up(
            name, framing.refuse(framing.ErrorKind.UNAVAILABLE, f"the module {name} cannot start: {reason}")
        )
        self._ended(slot)

    def _give_up(self, name: str, error: framing.RpcError) -> None:
        """Tell everybody who waits for it or for what stands on it; the next request tries again."""
        slot = self._slots[name]
        slot.users.clear()
        slot.linger_until_ns = 0
        waiting, slot.waiting = slot.waiting, []
        for future in waiting:
            future.set_exception(error)
        for other in self._standing_on(name):
            self._give_up(other, error)

    @staticmethod
    def _join(slot: _Slot) -> None:
        if slot.thread is not None:
            slot.thread.join()
            slot.thread = None
