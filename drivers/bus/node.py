"""One CANopen node: it comes up, is asked by one worker, and starts anew when it reboots or its bus goes.

A node is up when it answers SDO: then its users read what they need (`boot`), and it is ready. Where it is
stuck, `problem` says at which step, in words. It is written to only where it is known to be the device that
it should be, and the only one; else `distrust` says why not.
"""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Protocol, TypeVar, cast

from drivers.bus.arrivals import Arrivals
from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frames import REMOTE
from drivers.bus.life import NodeLife
from drivers.bus.nmt import HEARTBEAT, NmtState
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import Interrupted, SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.bus.settings import NodeTimes, Role
from drivers.bus.stuck import why_silent
from drivers.bus.values import size_of, unsigned
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError, SettingsError, Unavailable
from drivers.noted import found
from drivers.samples import Finding
from eds import Description

T = TypeVar("T")

FIRST_RETRY_S = 0.1  # also how long the first attempt waits: a cold start must not hang on one lost frame
LAST_RETRY_S = 2.0
DOUBT_S = 0.1  # how often a node is asked that answers twice, to see when it does so no more
_COMING_UP = "it was not read yet: look again in a moment"
_NOT_ASKED = "it has not come up, so nobody knows what it is: nothing is written to it"
PROBE_S = 1.0  # how often a node is asked that has no heartbeat and says nothing
SILENT_S = 3.0  # without a word, though it was asked
EMCY = 0x080


class NodeUser(Protocol):
    """A driver that lives on a node."""

    def boot(self, sdo: SdoChannel) -> None:
        """Read from the device what is needed, in the worker's thread. A `DriverError` is tried again."""

    def forget(self) -> None:
        """What was read and received is no longer true: the node rebooted or its bus is gone."""


def _ask_type(sdo: SdoChannel) -> None:
    sdo.upload(0x1000, 0, attempts=1)


class Node(BusUser):
    """A node id on a bus. Alive while at least one user is attached."""

    def __init__(self, bus: CanBus, node_id: int, description: Description, times: NodeTimes) -> None:
        self.bus = bus
        self.node_id = node_id
        self.description = description
        self.life = NodeLife(times.heartbeat_timeout_s, bus.standstill)
        self.ready = False
        self.arrivals: tuple[Arrivals, ...] = ()  # of the PDOs that its users follow
        self.boots_begun = 0  # attempts to read what is needed of it
        self._findings: tuple[str, ...] = ()
        self._stranger: str | None = _NOT_ASKED  # why it may not be the device that it should be
        self._times = times
        self._users: tuple[tuple[NodeUser, str], ...] = ()  # with their names
        self._lock = threading.RLock()
        self._step = _COMING_UP
        self._guard_s = times.guard_time_s if bus.role is Role.MASTER else None
        self._guard_ns = 0
        self._guard_problem: str | None = None
        self._doubt_ns = 0
        self.probes = False  # whether it is asked where it says nothing: a user who gets no PDOs wants that
        self._probe_ns = 0
        self._generation = 0  # counts what makes an earlier boot worthless
        self._booted_generation = 0  # of the boot that is under way, or was the last
        self._booting: Future[None] | None = None
        self._retry_s = FIRST_RETRY_S
        self._retry_ns = 0
        self._request_id, response_id = times.sdo_ids(node_id)
        self.channel = SdoChannel(
            f"node {node_id} on {bus.name}",
            Requests(bus, self._request_id),
            times.sdo_timeout_s,
            lambda: self.distrust,
        )
        self.worker = SdoWorker(self.channel)
        self._emcy_id = EMCY + node_id
        self._handlers = {HEARTBEAT + node_id: self._on_heartbeat, response_id: self._on_response}

    @property
    def distrust(self) -> str | None:
        """Why nothing is written to it, in words; it is read and stopped all the same."""
        if self._stranger is not None:
            return self._stranger
        if self.channel.doubled:
            return (
                f"two devices answer as node {self.node_id}: nothing is written to it; "
                "give one of them another node id"
            )
        if self.channel.out_of_sync:
            return (
                f"nobody can say to which request node {self.node_id} answers: nothing is written to it; "
                "is another SDO client using this channel?"
            )
        return None

    @property
    def answered_ns(self) -> int:
        """When it last did, or refused, what it was asked by SDO (monotonic); 0 before the first time."""
        return self.channel.answered_ns

    @property
    def findings(self) -> tuple[str, ...]:
        """What an integrator should know about it, in words."""
        distrust = self.distrust
        return self._findings if distrust in (None, _NOT_ASKED) else (*self._findings, distrust)

    @property
    def trouble(self) -> tuple[Finding, ...]:
        """What is wrong with its answers and its PDOs, each since when, and what to check."""
        if not self.ready:
            return ()
        return (*self.channel.round_trips.findings, *found(self.arrivals))

    @property
    def names(self) -> tuple[str, ...]:
        """Of those who live on it."""
        return tuple(name for _, name in self._users)

    # What users ask.

    def follow(self, arrivals: Arrivals) -> Callable[[], None]:
        """Watch whether frames are missing; returns how to end it."""
        arrivals.restart()
        self.arrivals = (*self.arrivals, arrivals)

        def end() -> None:
            self.arrivals = tuple(known for known in self.arrivals if known is not arrivals)
            arrivals.restart()

        return end

    def attach(self, user: NodeUser, name: str) -> None:
        """Let `user` live here: the first one opens the bus."""
        with self._lock:
            if any(known is user for known, _ in self._users):
                return
            first = not self._users
            self._set_users((*self._users, (user, name)))
            if not first:
                self._generation += 1  # a boot that is under way does not know the new user
                self.ready = False
        if first:
            self._reset()
            self._subscribe()
            self.worker.start()
            self.bus.hold(self)
        else:
            self._start_boot()

    def detach(self, user: NodeUser) -> None:
        """Let it go: the last one closes the bus."""
        with self._lock:
            before = len(self._users)
            self._set_users(tuple(known for known in self._users if known[0] is not user))
            last = before > 0 and not self._users
        if last:
            self.worker.stop()
            self.bus.release(self)
            self._unsubscribe()
            self._reset()

    def upload(self, index: int, subindex: int) -> Future[bytes]:
        """Read an object's bytes, no more than its type has."""
        return self.worker.submit(lambda sdo: self._trim(index, subindex, sdo.upload(index, subindex)))

    def upload_all(self, objects: Sequence[tuple[int, int]]) -> Future[list[bytes | DriverError]]:
        """Read several objects in a row, nothing in between; an error stands in its object's place.

        After one that was not answered the others are not asked for: the list ends there. What was read
        before an urgent job interrupts is not read again.
        """
        found: list[bytes | DriverError] = []
        return self.worker.submit(lambda sdo: self._upload_rest(sdo, objects, found))

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        timeout_s: float | None = None,
        permitted: Callable[[], str | None] | None = None,
    ) -> Future[None]:
        """Write an object, once: `DeviceTimeout` means that nobody knows whether the device took it.

        Fails with `NotPermitted` where `distrust`, or `permitted` at the last moment, says why it must not be
        written; see `SdoChannel.download`.
        """
        return self.worker.submit(lambda sdo: sdo.download(index, subindex, data, timeout_s, permitted))

    def run(
        self,
        job: Callable[[SdoChannel], T],
        *,
        urgent: bool = False,
        ahead: bytes | None = None,
        wake: bool = True,
    ) -> Future[T]:
        """Do several transfers in a row, nothing in between; see `SdoWorker.submit`."""
        return self.worker.submit(job, urgent=urgent, ahead=ahead, wake=wake)

    def wake(self) -> None:
        """Follow what was asked for with `wake=False`."""
        self.worker.wake()

    def problem(self, now_ns: int) -> str | None:
        """What is wrong with the node now, in words with what to check; `None` when nothing is."""
        if not self.ready:
            return self.bus.trouble or self._step
        return self.life.problem(now_ns) or self._guard_problem or self.bus.trouble

    def counters(self) -> dict[str, int]:
        """What happened since the node's object was made."""
        sdo = self.channel.counters
        return {
            "boots": self.life.boots,
            "heartbeats": self.life.heartbeats,
            "emcys": self.life.emcys,
            "sdo_transfers": sdo.transfers,
            "sdo_timeouts": sdo.timeouts,
            "sdo_aborts": sdo.aborts,
            "sdo_stale": sdo.stale,
            "sdo_doubled": sdo.doubled,
            "sdo_resyncs": sdo.resyncs,
            "sdo_dropped": sdo.dropped,
            "sdo_late": self.channel.round_trips.late,
            "bus_opened": self.bus.opened,
            "bus_dropped": self.bus.dropped,
        }

    # What the bus tells.

    def bus_opened(self) -> None:
        self._reset()
        self._start_boot()

    def bus_closed(self) -> None:
        self._reset()

    def tick(self, now_ns: int) -> None:
        if not self.ready and now_ns >= self._retry_ns:
            self._start_boot()
        if self._guard_s is not None and self.ready and now_ns >= self._guard_ns:
            self._guard_ns = now_ns + round(self._guard_s * 1e9)
            self._ask_life(now_ns)
        if self.ready and self.channel.doubled and now_ns >= self._doubt_ns:
            self._doubt_ns = now_ns + round(DOUBT_S * 1e9)
            self.worker.submit(_ask_type)
        if self.probes and self.ready and now_ns >= self._probe_ns and self._unheard_s(now_ns) > PROBE_S:
            self._probe_ns = now_ns + round(PROBE_S * 1e9)
            self.worker.submit(_ask_type)
        settled = self.bus.standstill.is_settled(now_ns)
        for arrivals in self.arrivals:
            arrivals.look(now_ns) if settled else arrivals.skip()

    def _unheard_s(self, now_ns: int) -> float:
        """For how long a node that is probed has said nothing but PDOs; 0 for those with a heartbeat."""
        if self.life.timeout_s is not None or not self.probes:
            return 0.0
        return (self.life.silent_ms(now_ns) or 0.0) / 1000

    def silence(self, now_ns: int) -> str | None:
        """That a node without a heartbeat answers no more, in words; `None` while it does."""
        silent_s = self._unheard_s(now_ns)
        if not self.ready or silent_s <= SILENT_S:
            return None
        return f"it has answered nothing for {silent_s:.1f} s: check the node's power and cable"

    def _ask_life(self, now_ns: int) -> None:
        """Node guarding: the answer is the node's state and counts as a heartbeat (CiA 301 §7.2.8)."""
        if self.life.heartbeat_ns is None:
            self.life.heartbeat_ns = now_ns  # from now on silence counts
        try:
            self.bus.send((HEARTBEAT + self.node_id) | REMOTE, b"")
            self._guard_problem = None
        except Unavailable as error:
            self._guard_problem = str(error)

    def _on_heartbeat(self, stamp_ns: int, data: bytes) -> None:
        first = self.life.heard_ns is None
        state = self.life.on_heartbeat(stamp_ns, data)
        if state is NmtState.BOOT_UP:
            self.channel.rebooted()
            self._begin_anew()
            self._start_boot()
        elif state is not None and first and not self.ready:
            self._retry_ns = 0  # it is there: ask it at the next tick

    def _on_response(self, stamp_ns: int, data: bytes) -> None:
        self.life.heard_ns = stamp_ns
        self.channel.on_response(stamp_ns, data)

    # Coming up.

    def _reset(self) -> None:
        self.life.reset()
        self._begin_anew()

    def _begin_anew(self) -> None:
        with self._lock:
            self._generation += 1
            self.ready = False
            self._stranger = _NOT_ASKED
            self._step = _COMING_UP
            self._retry_s, self._retry_ns = FIRST_RETRY_S, 0
            users = self._users
        self.channel.forget_written()
        for user, _ in users:
            user.forget()

    def _start_boot(self) -> None:
        with self._lock:
            if self._booting is None or self._booting.done():
                self._retry_ns = time.monotonic_ns() + round(self._retry_s * 1e9)
                self._booting = self.worker.submit(self._boot, current=self._boot_is_current)

    def _boot_is_current(self) -> bool:
        return self._booted_generation == self._generation

    def _boot(self, sdo: SdoChannel) -> None:
        self.boots_begun += 1
        self._booted_generation = self._generation
        try:
            self._come_up(sdo)
        except DriverError as error:
            self._try_later(self._explain(error))
        except Interrupted:
            raise
        except Exception as error:  # noqa: BLE001 - it must be told, and not be tried without a pause
            self._try_later(f"internal error: {type(error).__name__}: {error}")
        else:
            with self._lock:
                self.ready = self._boot_is_current()
                self._retry_s, self._retry_ns = FIRST_RETRY_S, 0

    def _try_later(self, step: str) -> None:
        with self._lock:
            if not self._boot_is_current():
                self._retry_ns = 0
                return
            self._step = step
            self._retry_ns = time.monotonic_ns() + round(self._retry_s * 1e9)
            self._retry_s = min(2 * self._retry_s, LAST_RETRY_S)

    def _come_up(self, sdo: SdoChannel) -> None:
        sdo.upload(0x1000, 0, attempts=1, timeout_s=min(self._retry_s, self._times.sdo_timeout_s))
        stranger = self._identity_problem(sdo)
        with self._lock:
            if self._boot_is_current():
                self._stranger = stranger
        self._findings = self._settings_findings()
        period_ms = self._optional(sdo, 0x1017, 0)
        self.life.expect_every(period_ms / 1000 if period_ms else self._guard_s)
        self._follow_emcy(sdo)
        for user, _ in self._users:
            user.boot(sdo)
        self.bus.start_node(self.node_id)

    def _explain(self, error: DriverError) -> str:
        bus = self.bus
        silent = isinstance(error, DeviceTimeout)
        words = silent and why_silent(
            self.life, self.node_id, self._request_id, bus.name, bus.frames, bus.unclaimed
        )
        return words or str(error)

    def _settings_findings(self) -> tuple[str, ...]:
        unused = self._times.guard_time_s is not None and self._guard_s is None
        return ("guard_time_s is not used: node guarding is the master's",) if unused else ()

    def _identity_problem(self, sdo: SdoChannel) -> str | None:
        """Why it may be another device than its EDS is for."""
        expected = (self.description.vendor_id, self.description.product_code)
        problems = []
        for subindex, name, should in zip((1, 2), ("vendor id", "product code"), expected, strict=True):
            if not should or not self.description.has(0x1018, subindex):
                continue
            found = self._optional(sdo, 0x1018, subindex)
            if found != should:
                is_ = "cannot be read" if found is None else f"is 0x{found:X}"
                file = self.description.path.name
                problems.append(f"1018h {name} {is_}, the EDS {file} is for 0x{should:X}")
        if not problems:
            return None
        return f"{'; '.join(problems)}: nothing is written to it; correct its eds or its node_id"

    def _follow_emcy(self, sdo: SdoChannel) -> None:
        cob_id = self._optional(sdo, 0x1014, 0)
        if cob_id is not None and not cob_id & 0x8000_0000 and cob_id & 0x7FF:
            self.bus.unsubscribe(self._emcy_id, self.life.on_emcy)
            self._emcy_id = cob_id & 0x7FF
            self.bus.subscribe(self._emcy_id, self.life.on_emcy)

    def _optional(self, sdo: SdoChannel, index: int, subindex: int) -> int | None:
        """A number that not every device has."""
        if not self.description.has(index, subindex):
            return None
        try:
            return unsigned(self._trim(index, subindex, sdo.upload(index, subindex)))
        except DeviceAbort:
            return None

    def _upload_rest(
        self, sdo: SdoChannel, objects: Sequence[tuple[int, int]], found: list[bytes | DriverError]
    ) -> list[bytes | DriverError]:
        for index, subindex in objects[len(found) :]:
            try:
                found.append(self._trim(index, subindex, sdo.upload(index, subindex)))
            except DriverError as error:
                found.append(error)
                if not isinstance(error, DeviceAbort):
                    break
        return found

    def _trim(self, index: int, subindex: int, data: bytes) -> bytes:
        """Some devices answer with four bytes whatever the object's size."""
        variable = self.description.variable(index, subindex)
        size = None if variable is None else size_of(variable.data_type or 0)
        return data if size is None else data[:size]

    def _set_users(self, users: tuple[tuple[NodeUser, str], ...]) -> None:
        self._users = users
        names = "+".join(name for _, name in users) or "unused"
        self.channel.label = f"{names} (node {self.node_id} on {self.bus.name})"

    def _subscribe(self) -> None:
        for can_id, handler in self._handlers.items():
            self.bus.subscribe(can_id, handler)
        self.bus.subscribe(self._emcy_id, self.life.on_emcy)

    def _unsubscribe(self) -> None:
        for can_id, handler in self._handlers.items():
            self.bus.unsubscribe(can_id, handler)
        self.bus.unsubscribe(self._emcy_id, self.life.on_emcy)


def shared_node(bus: CanBus, node_id: int, description: Description, times: NodeTimes) -> Node:
    """The one node object of this id: two axes of a drive, or a joint and its parameters, share it.

    Raises `SettingsError` where two tables describe the same node with different files.
    """
    # Nobody else puts one there.
    node = cast("Node", bus.nodes.setdefault(node_id, Node(bus, node_id, description, times)))
    if node.description.path != description.path:
        raise SettingsError(
            f"node {node_id} on bus {bus.name} is described by {node.description.path.name} and by "
            f"{description.path.name}: give all its tables the same eds, or correct a node_id"
        )
    return node
