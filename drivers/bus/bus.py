"""One supervised CAN bus: opens, hands out frames, names what is wrong, and comes back.

Everything is received in one thread of the bus, which calls each frame's handlers directly; everything is
sent through its `Sender`. The bus is open while somebody holds it: its owner between `start` and `stop`, and
every node that is attached.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from functools import partial

from drivers.bus.frames import ERROR, FrameHandler, Transport
from drivers.bus.health import BusHealth
from drivers.bus.interfaces.controller_state import BusState
from drivers.bus.interfaces.opening import open_transport
from drivers.bus.master import NMT_COMMAND, NMT_START, NMT_STOP, MasterCycles
from drivers.bus.sender import Sender, always
from drivers.bus.settings import CanSettings, Role
from drivers.bus.thread_switching import FastSwitching
from drivers.bus.traffic import Traffic
from drivers.errors import Unavailable
from drivers.findings import active_findings
from drivers.reader_stalls import ReaderStalls
from drivers.realtime_priority import make_realtime
from drivers.samples import Finding

TICK_S = 0.05  # how long the thread waits for a frame before it looks at the clock
FIRST_RETRY_S = 0.1
LAST_RETRY_S = 2.0
MAX_UNCLAIMED = 2048  # as many as there are 11-bit identifiers


class BusUser:
    """Listener to a bus coming and going, and to time passing: in the bus's thread, never for long."""

    @property
    def ready(self) -> bool:
        """Whether it knows which frames it needs."""
        return True

    def bus_opened(self) -> None:
        """Frames can come from now on. In the caller's thread where the bus was open already."""

    def bus_closed(self) -> None:
        """No frame comes any more; the bus's `problem` says why."""

    def tick(self, now_ns: int) -> None:
        """About every `TICK_S`, frames or not."""


class CanBus:
    """A bus by its name in the robot's file.

    An `urgent` one receives with real-time priority: it wakes for each frame, which costs twice as much.
    """

    def __init__(
        self, name: str, settings: CanSettings, role: Role = Role.OBSERVER, *, urgent: bool = False
    ) -> None:
        self.name = name
        self.settings = settings
        self.role = role
        self._urgent = urgent
        self.problem: str | None = None  # why it is not open, in words
        self.health = BusHealth(settings.bitrate)
        self.traffic = Traffic()
        self.standstill = ReaderStalls()
        self.frames = 0  # that came; error frames are none of them
        self.opened = 0  # times
        self.failed_handlers = 0  # those of users' ticks are among them
        self.unclaimed: set[int] = set()  # identifiers that came and nobody asked for
        self.nodes: dict[int, BusUser] = {}  # one object a node id, whoever uses it
        self._received_bytes = 0
        self._handlers: dict[int, FrameHandler] = {}
        self._subscribers: dict[int, tuple[FrameHandler, ...]] = {}
        self._users: tuple[BusUser, ...] = ()
        self._owner = BusUser()
        self._sender = Sender(name, self._why_closed)
        self._cycles = MasterCycles(name, settings, self.send)
        self._life = threading.Lock()  # the thread's start and end; the thread itself never takes it
        self._lock = threading.Lock()  # users, subscribers and transport
        self._stopping = threading.Event()
        self._transport: Transport | None = None
        self._thread: threading.Thread | None = None

    @property
    def trouble(self) -> str | None:
        """Why it is not open, or what its controller says about the wire; `None` when nothing is wrong."""
        transport = self._transport
        warning = None if transport is None else transport.warning
        return self.problem or self.health.state_text or warning

    @property
    def state(self) -> BusState:
        """As the controller's error frames say, where the interface has them."""
        return self.health.state

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Problems of the bus, or of its reader."""
        return (*self.health.findings, *active_findings((self.standstill,)))

    @property
    def is_open(self) -> bool:
        return self._transport is not None

    @property
    def dropped(self) -> int:
        """Frames that came and were lost since the bus opened, as far as the interface tells."""
        transport = self._transport
        return 0 if transport is None else transport.dropped

    @property
    def sent(self) -> int:
        """Frames that left since it was made."""
        return self._sender.sent

    @property
    def sent_bytes(self) -> int:
        """Bytes of those frames."""
        return self._sender.sent_bytes

    def start(self) -> None:
        """Keep the bus open, nodes or not; idempotent, returns at once."""
        self.hold(self._owner)

    def stop(self) -> None:
        """Let go what `start` held; idempotent."""
        self.release(self._owner)

    def hold(self, user: BusUser) -> None:
        """Open the bus for `user`, who is told of everything until `release`; idempotent."""
        with self._life:
            with self._lock:
                if user in self._users:
                    return
                self._users = (*self._users, user)
                is_open = self._transport is not None
            if is_open:
                user.bus_opened()
            elif self._thread is None:
                self._stopping.clear()
                self._thread = threading.Thread(target=self._run, name=f"can {self.name}", daemon=True)
                self._thread.start()

    def release(self, user: BusUser) -> None:
        """Let go; the last one to do so closes the bus and joins its thread. Not for the bus's own thread."""
        with self._life:
            with self._lock:
                self._users = tuple(known for known in self._users if known is not user)
            if not self._users and self._thread is not None:
                self._stopping.set()
                self._thread.join()
                self._thread = None

    def subscribe(self, can_id: int, handler: FrameHandler) -> None:
        """Call `handler` with every frame of this identifier."""
        with self._lock:
            self._set_handlers(can_id, (*self._subscribers.get(can_id, ()), handler))

    def unsubscribe(self, can_id: int, handler: FrameHandler) -> None:
        """End it; a handler that is not subscribed does no harm."""
        with self._lock:
            kept = tuple(known for known in self._subscribers.get(can_id, ()) if known != handler)
            self._set_handlers(can_id, kept)

    def send(self, can_id: int, data: bytes) -> None:
        """Put a frame on the bus; raises `Unavailable`. See `Sender.send`."""
        self._sender.send(can_id, data)

    def offer(self, can_id: int, data: bytes, wanted: Callable[[], bool] = always) -> Callable[[], bool]:
        """Put a frame on the bus, or into its queue, without waiting; see `Sender.offer`."""
        return self._sender.offer(can_id, data, wanted)

    def send_urgent(self, can_id: int, data: bytes) -> bool:
        """Put a frame on the bus ahead of all that waits, without ever blocking. See `Sender.send_urgent`."""
        return self._sender.send_urgent(can_id, data)

    def start_node(self, node_id: int) -> None:
        """Let a node that came up send its PDOs (NMT start): a master's part, an observer does nothing.

        Starting a node does not enable its drive: that is the controlword's part.
        """
        if self.role is Role.MASTER:
            self.send(NMT_COMMAND, bytes([NMT_START, node_id]))

    def stop_node(self, node_id: int) -> None:
        """Stop a node (NMT), in either role: only ever to stop a drive. It answers no SDO then.

        It goes ahead of all that waits, and nobody waits for it.
        """
        self.send_urgent(NMT_COMMAND, bytes([NMT_STOP, node_id]))

    def _set_handlers(self, can_id: int, handlers: tuple[FrameHandler, ...]) -> None:
        self._subscribers[can_id] = handlers
        if not handlers:
            self._handlers.pop(can_id, None)
        else:
            self._handlers[can_id] = handlers[0] if len(handlers) == 1 else _all(handlers)

    def _why_closed(self) -> str:
        return f"bus {self.name} is not open: {self.problem or 'nobody holds it'}"

    def _run(self) -> None:
        if self._urgent:
            make_realtime()
        retry_s = FIRST_RETRY_S
        while not self._stopping.is_set():
            began = time.monotonic()
            try:
                transport = open_transport(self.settings)
                began = time.monotonic()
                self._serve(transport)
            except Exception as error:  # noqa: BLE001 - whatever a transport raises, the bus is to come back
                self.problem = _words(error)
            if time.monotonic() - began > LAST_RETRY_S:
                retry_s = FIRST_RETRY_S  # it was well for a while
            self._stopping.wait(retry_s)
            retry_s = min(2 * retry_s, LAST_RETRY_S)

    def _serve(self, transport: Transport) -> None:
        """Hand out frames until told to stop; raises what ended it, `Unavailable` when the interface goes."""
        problem = "it was closed"
        FastSwitching.begin()
        try:
            self._sender.start(transport)  # whoever sees it open may send
            with self._lock:
                self._transport, self.problem = transport, None
                self.health.opened()
                self.traffic.opened()
                self.opened += 1
                users = self._users
            if self.role is Role.MASTER:
                self._cycles.start()
            for user in users:
                user.bus_opened()
            self._receive(transport)
        except Exception as error:
            problem = _words(error)
            raise
        finally:
            self._shut(transport, problem)

    def _shut(self, transport: Transport, problem: str) -> None:
        """Let go of it in this order; what fails keeps nothing of the rest from being done."""
        self.problem = problem
        self._transport = None
        self.standstill.closed()
        self._sender.stop()
        with contextlib.ExitStack() as last_to_first:
            for user in reversed(self._users):
                last_to_first.callback(user.bus_closed)
            last_to_first.callback(FastSwitching.end)
            last_to_first.callback(self._sender.join)
            last_to_first.callback(transport.close)
            last_to_first.callback(self._cycles.stop)

    def _receive(self, transport: Transport) -> None:
        tick_ns = round(TICK_S * 1e9)
        handler_of = self._handlers.get
        next_tick_ns = time.monotonic_ns()
        accepted: frozenset[int] | None = None
        self.standstill.passed(next_tick_ns)
        while not self._stopping.is_set():
            frames = transport.receive(TICK_S)
            self.frames += len(frames)
            if frames:
                self.traffic.take(frames)
            for stamp_ns, can_id, data in frames:
                self._received_bytes += len(data)
                handler = handler_of(can_id)
                if handler is None:
                    self._unhandled(stamp_ns, can_id, data)
                    continue
                try:
                    handler(stamp_ns, data)
                except Exception as error:  # noqa: BLE001 - one wrong handler must not silence every joint
                    self._failed(f"at frame 0x{can_id:X}", error)
            now_ns = time.monotonic_ns()
            self.standstill.passed(now_ns)
            if now_ns >= next_tick_ns:
                next_tick_ns = now_ns + tick_ns
                accepted = self._accept(transport, accepted)
                self.health.look(now_ns, partial(self._counts, transport))
                self.traffic.look(now_ns)
                self._tick(now_ns)

    def _counts(self, transport: Transport) -> tuple[int, int, int]:
        """Return frames and data bytes on the bus, and frames that were lost; as far as we know of them."""
        carried = transport.carried()
        if carried is None:
            carried = self.frames + self.sent, self._received_bytes + self.sent_bytes
        return (*carried, transport.dropped)

    def _tick(self, now_ns: int) -> None:
        for user in self._users:
            try:
                user.tick(now_ns)
            except Exception as error:  # noqa: BLE001 - nor one wrong user
                self._failed("at a tick", error)

    def _failed(self, where: str, error: Exception) -> None:
        self.failed_handlers += 1
        self.problem = f"internal error {where}: {type(error).__name__}: {error}"

    def _accept(self, transport: Transport, before: frozenset[int] | None) -> frozenset[int] | None:
        """Once all is ready only what is subscribed matters; before, any frame helps to say what is wrong."""
        wanted = frozenset(self._handlers) if all(user.ready for user in self._users) else None
        if wanted != before:
            transport.accept(wanted)
        return wanted

    def _unhandled(self, stamp_ns: int, can_id: int, data: bytes) -> None:
        if can_id & ERROR:
            self.frames -= 1
            self.health.take_error(stamp_ns, can_id, data)
        elif len(self.unclaimed) < MAX_UNCLAIMED:
            self.unclaimed.add(can_id)


def _words(error: Exception) -> str:
    return (
        str(error) if isinstance(error, Unavailable) else f"internal error: {type(error).__name__}: {error}"
    )


def _all(handlers: tuple[FrameHandler, ...]) -> FrameHandler:
    def call_all(stamp_ns: int, data: bytes) -> None:
        for handler in handlers:
            handler(stamp_ns, data)

    return call_all
