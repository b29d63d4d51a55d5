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

from drivers.bus.boot_diagnosis import why_silent
from drivers.bus.booting import Booting
from drivers.bus.bus import BusUser, CanBus
from drivers.bus.frame_losses import FrameLosses
from drivers.bus.liveness import NodeLife
from drivers.bus.nmt import HEARTBEAT, NmtState
from drivers.bus.node_polling import Asking
from drivers.bus.objects import identity_problem, read, read_optional, read_rest
from drivers.bus.outlet import Requests
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.protocol import confirmed_write
from drivers.bus.sdo.worker import SdoWorker
from drivers.bus.settings import NodeTimes, Role
from drivers.errors import DeviceTimeout, DriverError, SettingsError
from drivers.findings import active_findings
from drivers.samples import Finding
from eds import Description

T = TypeVar("T")

_REMAPPED = "its PDOs are being mapped otherwise: nothing is made of them until that has rested"
_PLAYED = "; where its bus is simulated: does the simulator keep real time? It says where not"
_NOT_ASKED = "it has not come up, so nobody knows what it is: nothing is written to it"
EMCY = 0x080
PDO_PARAMETERS = range(0x1400, 0x1C00)  # communication and mapping, of both directions (CiA 301 §7.5.2)
REMAPPED_S = 0.3  # after the last of them was written: who writes one mostly writes more


class NodeUser(Protocol):
    """A driver that lives on a node."""

    def boot(self, sdo: SdoChannel) -> None:
        """Read from the device what is needed, in the worker's thread. A `DriverError` is tried again."""

    def forget(self) -> None:
        """Forget all values: the node rebooted or its bus is gone."""


class Node(BusUser):
    """A node id on a bus. Alive while at least one user is attached."""

    def __init__(self, bus: CanBus, node_id: int, description: Description, times: NodeTimes) -> None:
        self.bus = bus
        self.node_id = node_id
        self.description = description
        self.life = NodeLife(times.heartbeat_timeout_s, bus.standstill)
        self.arrivals: tuple[FrameLosses, ...] = ()  # of the PDOs that its users follow
        self._findings: tuple[str, ...] = ()
        self._stranger: str | None = _NOT_ASKED  # why it may not be the device that it should be
        self._times = times
        self._users: tuple[tuple[NodeUser, str], ...] = ()  # with their names
        self._lock = threading.RLock()
        self._request_id, response_id = times.sdo_ids(node_id)
        self.channel = SdoChannel(
            f"node {node_id} on {bus.name}",
            Requests(bus, self._request_id),
            times.sdo_timeout_s,
            lambda: self.distrust,
        )
        self.channel.also_silent = _PLAYED if bus.settings.is_program else ""
        self.worker = SdoWorker(self.channel)
        self._booting = Booting(self.worker, self._lock, self._come_up, self._explain)
        guard_s = times.guard_time_s if bus.role is Role.MASTER else None
        self._asking = Asking(bus, node_id, self.life, self.worker, guard_s)
        self._settled_ns = 0  # when nobody has written a PDO's parameters for so long that they can be read
        self._emcy_id = EMCY + node_id
        self._handlers = {HEARTBEAT + node_id: self._on_heartbeat, response_id: self._on_response}

    @property
    def ready(self) -> bool:
        """Whether its users have read what they need, and nothing has made that worthless since."""
        return self._booting.ready

    @property
    def comes_up(self) -> bool:
        """Whether it is being read now, and no attempt has failed since its bus was opened."""
        return self._booting.comes_up

    @property
    def boots_begun(self) -> int:
        """Attempts to read what is needed of it."""
        return self._booting.begun

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
        """Notes for the integrator, in words."""
        distrust = self.distrust
        return self._findings if distrust in (None, _NOT_ASKED) else (*self._findings, distrust)

    @property
    def trouble(self) -> tuple[Finding, ...]:
        """Problems of its answers and PDOs, with their start, and what to check."""
        if not self.ready:
            return ()
        return (*self.channel.round_trips.findings, *active_findings(self.arrivals))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the components on it."""
        return tuple(name for _, name in self._users)

    # What users ask.

    def probe(self) -> None:
        """Ask it now and then where it says nothing: for a user who gets no PDOs of it."""
        self._asking.probes = True

    def silence(self, now_ns: int) -> str | None:
        """Return in words that a probed node without a heartbeat stopped answering."""
        return self._asking.silence(now_ns) if self.ready else None

    def follow(self, arrivals: FrameLosses) -> Callable[[], None]:
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
                self._booting.overtake()  # a boot that is under way does not know the new user
        if first:
            self._reset()
            self._subscribe()
            self.worker.start()
            self.bus.hold(self)
        else:
            self._booting.start()

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
        return self.worker.submit(lambda sdo: read(sdo, self.description, index, subindex))

    def upload_all(self, objects: Sequence[tuple[int, int]]) -> Future[list[bytes | DriverError]]:
        """Read several objects in a row, nothing in between; an error stands in its object's place.

        After one that was not answered the others are not asked for: the list ends there. What was read
        before an urgent job interrupts is not read again.
        """
        done: list[bytes | DriverError] = []
        return self.worker.submit(lambda sdo: read_rest(sdo, self.description, objects, done))

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
        """Return the node's present problem, in words with what to check; `None` if there is none."""
        if not self.ready:
            return self.bus.trouble or (_REMAPPED if now_ns < self._settled_ns else self._booting.step)
        return self.life.problem(now_ns) or self._asking.guard_problem or self.bus.trouble

    def counters(self) -> dict[str, int]:
        """Return the counters since the node's object was made."""
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

    def remapped(self) -> None:
        """Its PDOs are not what was read: nothing is made of them until that was read anew."""
        self._settled_ns = time.monotonic_ns() + round(REMAPPED_S * 1e9)
        self._begin_anew()

    def bus_opened(self) -> None:
        self._reset()
        self._booting.start()

    def bus_closed(self) -> None:
        self._reset()

    def tick(self, now_ns: int) -> None:
        if now_ns >= self._settled_ns:
            self._booting.retry(now_ns)
        if self.ready:
            self._asking.tick(now_ns)
        standstill = self.bus.standstill
        settled, gap = standstill.is_settled(now_ns), standstill.gap
        for arrivals in self.arrivals:
            if gap is not None and not standstill.is_even(now_ns):
                arrivals.excuse(*gap)
            arrivals.look(now_ns) if settled else arrivals.skip()

    def _on_heartbeat(self, stamp_ns: int, data: bytes) -> None:
        first = self.life.heard_ns is None
        state = self.life.on_heartbeat(stamp_ns, data)
        if state is NmtState.BOOT_UP:
            self.channel.rebooted()
            self._begin_anew()
            self._booting.start()
        elif state is not None and first:
            self._booting.hurry()

    def _on_response(self, stamp_ns: int, data: bytes) -> None:
        self.life.heard_ns = stamp_ns
        written = confirmed_write(data)
        if (
            written is not None
            and written[0] in PDO_PARAMETERS
            and (self.ready or not self.channel.is_unsure(*written))  # while it comes up, we may write them
        ):
            self.remapped()
        self.channel.on_response(stamp_ns, data)

    # Coming up.

    def _reset(self) -> None:
        self.life.reset()
        self._begin_anew()

    def _begin_anew(self) -> None:
        with self._lock:
            self._booting.begin_anew()
            self._stranger = _NOT_ASKED
        self.channel.forget_written()
        self._forget()

    def _forget(self) -> None:
        for user, _ in self._users:
            user.forget()

    def _come_up(self, sdo: SdoChannel) -> None:
        timeout_s = min(self._booting.retry_s, self._times.sdo_timeout_s)
        sdo.upload(0x1000, 0, attempts=1, timeout_s=timeout_s)
        stranger = identity_problem(sdo, self.description)
        with self._lock:
            if self._booting.is_current():
                self._stranger = stranger
        self._findings = self._settings_findings()
        period_ms = read_optional(sdo, self.description, 0x1017, 0)
        self.life.expect_every(period_ms / 1000 if period_ms else self._asking.guard_s)
        self._follow_emcy(sdo)
        for user, _ in self._users:
            user.boot(sdo)
        if not self._booting.is_current():  # overtaken after its last answer: nobody goes by what was read
            self._forget()
            return
        self.bus.start_node(self.node_id)

    def _explain(self, error: DriverError) -> str:
        bus = self.bus
        silent = isinstance(error, DeviceTimeout)
        words = silent and why_silent(
            self.life,
            self.node_id,
            self._request_id,
            bus.name,
            bus.frames,
            bus.unclaimed,
            bus.health.load_percent,
        )
        return words or str(error)

    def _settings_findings(self) -> tuple[str, ...]:
        unused = self._times.guard_time_s is not None and self._asking.guard_s is None
        return ("guard_time_s is not used: node guarding is the master's",) if unused else ()

    def _follow_emcy(self, sdo: SdoChannel) -> None:
        cob_id = read_optional(sdo, self.description, 0x1014, 0)
        if cob_id is not None and not cob_id & 0x8000_0000 and cob_id & 0x7FF:
            self.bus.unsubscribe(self._emcy_id, self.life.on_emcy)
            self._emcy_id = cob_id & 0x7FF
            self.bus.subscribe(self._emcy_id, self.life.on_emcy)

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
    """Return the one node object of this id: two axes of a drive, or a joint and its parameters, share it.

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
