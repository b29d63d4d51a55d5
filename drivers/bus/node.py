"""One CANopen node: its life (boot-up, heartbeat, EMCY), and the one worker that asks it by SDO.

A node comes up when it answers SDO: then its users read what they need (`boot`), and it is ready. A boot-up
message or a bus that went away starts that anew. Where it is stuck, `problem` says at which step, in words.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol, TypeVar

from drivers.bus.bus import BusUser, CanBus
from drivers.bus.emcy import Emcy, parse_emcy
from drivers.bus.nmt import NmtState, parse_heartbeat
from drivers.bus.sdo_channel import SdoChannel
from drivers.bus.sdo_worker import SdoWorker
from drivers.bus.settings import NodeTimes
from drivers.bus.values import size_of, unsigned
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError, SettingsError
from eds import Description

T = TypeVar("T")

EMCY_HISTORY = 64
FIRST_RETRY_S = 0.1  # also how long the first attempt waits: a cold start must not hang on one lost frame
LAST_RETRY_S = 2.0
HEARTBEATS_MISSED = 2.5  # producer times without a heartbeat, where no time is configured

_PDO_BASES = (0x180, 0x280, 0x380, 0x480)


class NodeUser(Protocol):
    """A driver that lives on a node."""

    def boot(self, sdo: SdoChannel) -> None:
        """Read from the device what is needed, in the worker's thread. A `DriverError` is tried again."""

    def forget(self) -> None:
        """What was read and received is no longer true: the node rebooted or its bus is gone."""


class Node(BusUser):
    """A node id on a bus. Alive while at least one user is attached."""

    def __init__(self, bus: CanBus, node_id: int, description: Description, times: NodeTimes) -> None:
        self.bus = bus
        self.node_id = node_id
        self.description = description
        self.emcy_history: deque[Emcy] = deque(maxlen=EMCY_HISTORY)
        self.active_emcy: Emcy | None = None
        self.nmt_state: NmtState | None = None
        self.ready = False
        self.boots = 0
        self.emcys = 0
        self.heartbeats = 0
        self.findings: tuple[str, ...] = ()
        self._times = times
        self._names: tuple[str, ...] = ()
        self._users: tuple[NodeUser, ...] = ()
        self._lock = threading.RLock()
        self._step = "nothing was tried yet"
        self._heard_ns: int | None = None
        self._heartbeat_ns: int | None = None
        self._heartbeat_timeout_s = times.heartbeat_timeout_s
        self._generation = 0  # counts what makes an earlier boot worthless
        self._booting: Future[None] | None = None
        self._retry_s = FIRST_RETRY_S
        self._retry_ns = 0
        self._request_id, response_id = times.sdo_cob_ids or (0x600 + node_id, 0x580 + node_id)
        self.channel = SdoChannel(f"node {node_id} on {bus.name}", self._send_request, times.sdo_timeout_s)
        self.worker = SdoWorker(self.channel)
        self._emcy_id = 0x080 + node_id
        self._handlers = {
            0x700 + node_id: self._on_heartbeat,
            response_id: self._on_response,
        }

    # What users ask.

    def attach(self, user: NodeUser, name: str) -> None:
        """Let `user` live here: the first one opens the bus."""
        with self._lock:
            if user in self._users:
                return
            first = not self._users
            self._users = (*self._users, user)
            self._names = (*self._names, name)
            self.channel.label = f"{'+'.join(self._names)} (node {self.node_id} on {self.bus.name})"
        if first:
            self._reset()
            self._subscribe()
            self.worker.start()
            self.bus.hold(self)
        else:
            with self._lock:
                self._generation += 1  # a boot that is under way does not know the new user
                self.ready = False
            self._start_boot()

    def detach(self, user: NodeUser) -> None:
        """Let it go: the last one closes the bus."""
        with self._lock:
            if user not in self._users:
                return
            at = self._users.index(user)
            self._users = self._users[:at] + self._users[at + 1 :]
            self._names = self._names[:at] + self._names[at + 1 :]
            last = not self._users
        if last:
            self.worker.stop()
            self.bus.release(self)
            self._unsubscribe()
            self._reset()

    def upload(self, index: int, subindex: int) -> Future[bytes]:
        """Read an object's bytes, no more than its type has."""
        return self.worker.submit(lambda sdo: self._trim(index, subindex, sdo.upload(index, subindex)))

    def download(self, index: int, subindex: int, data: bytes) -> Future[None]:
        """Write an object, once: `DeviceTimeout` means that nobody knows whether the device took it."""
        return self.worker.submit(lambda sdo: sdo.download(index, subindex, data))

    def urgent_download(self, index: int, subindex: int, data: bytes) -> Future[None]:
        """Write ahead of everything queued; ends our own transfer in flight."""
        return self.worker.submit(lambda sdo: sdo.download(index, subindex, data), urgent=True)

    def run(self, job: Callable[[SdoChannel], T], *, urgent: bool = False) -> Future[T]:
        """Do several transfers in a row, nothing in between."""
        return self.worker.submit(job, urgent=urgent)

    def problem(self, now_ns: int) -> str | None:
        """What is wrong with the node now, in words with what to check; `None` when nothing is."""
        if not self.ready:
            return self.bus.trouble or self._step
        silent_ms = self.silent_ms(now_ns)
        if silent_ms is not None and self.lost_heartbeat(now_ns):
            return f"its heartbeat is missing for {silent_ms / 1000:.1f} s: check the node's power and cable"
        if self.nmt_state is not None and self.nmt_state is not NmtState.OPERATIONAL:
            return f"it is {self.nmt_state.words} (NMT) and sends no PDOs until its master starts it"
        return self.bus.trouble

    def silent_ms(self, now_ns: int) -> float | None:
        """Since its last heartbeat, or anything else it said itself; `None` before the first."""
        last_ns = self._heard_ns if self._heartbeat_ns is None else self._heartbeat_ns
        return None if last_ns is None else max(0, now_ns - last_ns) / 1e6

    def lost_heartbeat(self, now_ns: int) -> bool:
        """Whether a heartbeat that came regularly stays away."""
        if self._heartbeat_timeout_s is None or self._heartbeat_ns is None:
            return False
        return (now_ns - self._heartbeat_ns) / 1e9 > self._heartbeat_timeout_s

    def counters(self) -> dict[str, int]:
        """What happened since the node's object was made."""
        sdo = self.channel.counters
        return {
            "boots": self.boots,
            "heartbeats": self.heartbeats,
            "emcys": self.emcys,
            "sdo_transfers": sdo.transfers,
            "sdo_timeouts": sdo.timeouts,
            "sdo_aborts": sdo.aborts,
            "sdo_stale": sdo.stale,
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

    def _on_heartbeat(self, stamp_ns: int, data: bytes) -> None:
        state = parse_heartbeat(data)
        if state is None:
            return
        if state is NmtState.BOOT_UP:
            self.boots += 1
            self._reset()
            self._heard_ns = self._heartbeat_ns = stamp_ns
            self.nmt_state = state
            self._start_boot()
            return
        self.heartbeats += 1
        first = self._heard_ns is None
        self._heard_ns = self._heartbeat_ns = stamp_ns
        self.nmt_state = state
        if first and not self.ready:
            self._retry_ns = 0  # it is there: ask it at the next tick

    def _on_response(self, stamp_ns: int, data: bytes) -> None:
        self._heard_ns = stamp_ns
        self.channel.on_response(stamp_ns, data)

    def _on_emcy(self, stamp_ns: int, data: bytes) -> None:
        emcy = parse_emcy(stamp_ns, data)
        if emcy is None:
            return
        self.emcys += 1
        self._heard_ns = stamp_ns
        self.emcy_history.append(emcy)
        self.active_emcy = None if emcy.resets else emcy

    # Coming up.

    def _reset(self) -> None:
        with self._lock:
            self._generation += 1
            self.ready = False
            self._heard_ns = self._heartbeat_ns = self.nmt_state = self.active_emcy = None
            self._heartbeat_timeout_s = self._times.heartbeat_timeout_s
            self._retry_s, self._retry_ns = FIRST_RETRY_S, 0
            users = self._users
        for user in users:
            user.forget()

    def _start_boot(self) -> None:
        with self._lock:
            if self._booting is None or self._booting.done():
                self._retry_ns = time.monotonic_ns() + round(self._retry_s * 1e9)
                self._booting = self.worker.submit(self._boot)

    def _boot(self, sdo: SdoChannel) -> None:
        generation = self._generation
        try:
            self._come_up(sdo)
        except DriverError as error:
            self._step = self._explain(error)
            self._retry_ns = time.monotonic_ns() + round(self._retry_s * 1e9)
            self._retry_s = min(2 * self._retry_s, LAST_RETRY_S)
            return
        with self._lock:
            self.ready = generation == self._generation
            self._retry_s, self._retry_ns = FIRST_RETRY_S, 0

    def _come_up(self, sdo: SdoChannel) -> None:
        sdo.upload(0x1000, 0, attempts=1, timeout_s=min(self._retry_s, self._times.sdo_timeout_s))
        self._check_identity(sdo)
        self._read_heartbeat_time(sdo)
        self._follow_emcy(sdo)
        for user in self._users:
            user.boot(sdo)

    def _explain(self, error: DriverError) -> str:
        """Where the node is stuck, in words."""
        if not isinstance(error, DeviceTimeout):
            return str(error)
        if self.nmt_state is NmtState.STOPPED:
            return "it is stopped (NMT) and answers no SDO until its master starts it"
        if self._heartbeat_ns is not None:
            state = "" if self.nmt_state is None else f" ({self.nmt_state.words})"
            return (
                f"its heartbeat comes{state}, but it answers no SDO on 0x{self._request_id:03X}: "
                "is another SDO client using this channel?"
            )
        if self._heard_ns is not None:
            return str(error)
        if any(base + self.node_id in self.bus.unclaimed for base in _PDO_BASES):
            return (
                f"PDOs of node {self.node_id} come, but it answers no SDO on 0x{self._request_id:03X}: "
                "is another SDO client using this channel?"
            )
        if self.bus.frames == 0:
            return f"no frame at all on bus {self.bus.name}: check bitrate, wiring, termination and power"
        return (
            f"no frame at all from node {self.node_id}, others are heard on bus {self.bus.name}: "
            "check its power, cable and node id"
        )

    def _check_identity(self, sdo: SdoChannel) -> None:
        expected = (self.description.vendor_id, self.description.product_code)
        found = (self._optional(sdo, 0x1018, 1), self._optional(sdo, 0x1018, 2))
        names = ("vendor id", "product code")
        self.findings = tuple(
            f"1018h {name} is 0x{is_:X}, the EDS {self.description.path.name} is for 0x{should:X}"
            for name, should, is_ in zip(names, expected, found, strict=True)
            if should and is_ is not None and is_ != should
        )

    def _read_heartbeat_time(self, sdo: SdoChannel) -> None:
        if self._times.heartbeat_timeout_s is None:
            period_ms = self._optional(sdo, 0x1017, 0)
            self._heartbeat_timeout_s = period_ms / 1000 * HEARTBEATS_MISSED if period_ms else None

    def _follow_emcy(self, sdo: SdoChannel) -> None:
        cob_id = self._optional(sdo, 0x1014, 0)
        if cob_id is not None and not cob_id & 0x8000_0000 and cob_id & 0x7FF:
            self.bus.unsubscribe(self._emcy_id, self._on_emcy)
            self._emcy_id = cob_id & 0x7FF
            self.bus.subscribe(self._emcy_id, self._on_emcy)

    def _optional(self, sdo: SdoChannel, index: int, subindex: int) -> int | None:
        """A number that not every device has."""
        if not self.description.has(index, subindex):
            return None
        try:
            return unsigned(self._trim(index, subindex, sdo.upload(index, subindex)))
        except DeviceAbort:
            return None

    def _trim(self, index: int, subindex: int, data: bytes) -> bytes:
        """Some devices answer with four bytes whatever the object's size."""
        variable = self.description.variable(index, subindex)
        size = None if variable is None else size_of(variable.data_type or 0)
        return data if size is None else data[:size]

    def _send_request(self, data: bytes) -> None:
        self.bus.send(self._request_id, data)

    def _subscribe(self) -> None:
        for can_id, handler in self._handlers.items():
            self.bus.subscribe(can_id, handler)
        self.bus.subscribe(self._emcy_id, self._on_emcy)

    def _unsubscribe(self) -> None:
        for can_id, handler in self._handlers.items():
            self.bus.unsubscribe(can_id, handler)
        self.bus.unsubscribe(self._emcy_id, self._on_emcy)


def shared_node(bus: CanBus, node_id: int, description: Description, times: NodeTimes) -> Node:
    """The one node object of this id: two axes of a drive, or a joint and its parameters, share it.

    Raises `SettingsError` where two tables describe the same node with different files.
    """
    node = bus.nodes.setdefault(node_id, Node(bus, node_id, description, times))
    if node.description.path != description.path:
        raise SettingsError(
            f"node {node_id} on bus {bus.name} is described by {node.description.path.name} and by "
            f"{description.path.name}: give all its tables the same eds, or correct a node_id"
        )
    return node
