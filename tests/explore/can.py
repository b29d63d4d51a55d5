"""A CAN bus in memory: every frame takes its time, everybody hears it, and what can go wrong with it does."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from drivers.errors import Unavailable
from tests.explore.runtime import Runtime
from tests.explore.threads import _Waiters as Waiters

FRAME_NS = 130_000  # at 1 Mbit/s
QUEUE = 10  # frames that an interface takes when nobody acknowledges them
SEND_TIMEOUT_NS = 100_000_000  # how long a full interface keeps a blocking sender
KEPT = 4000  # frames
NEVER_NS = 1 << 62


class Sent(NamedTuple):
    """One frame as it was on the bus."""

    stamp_ns: int
    bus: str
    sender: str
    can_id: int
    data: bytes
    asked_ns: int = 0  # when its sender gave it to its interface


class Listener(Protocol):
    """A device."""

    name: str

    def on_frame(self, can_id: int, data: bytes) -> None: ...


class Wire:
    """One bus. `told` hears each frame in the moment it is on the bus, before anybody acts on it."""

    def __init__(self, runtime: Runtime, name: str, told: Callable[[Sent], None]) -> None:
        self.runtime, self.name, self._told = runtime, name, told
        self.blocked = False  # nobody acknowledges: what is sent waits
        self.gone = False  # the gateway's interface is not there
        self.breaks = False  # its next reception fails as nobody expects
        self.listeners: list[Listener] = []
        self.frames: deque[Sent] = deque(maxlen=KEPT)
        self.transport: Transport | None = None
        self.takes_since_ns = NEVER_NS  # since when it takes the gateway's frames
        self.in_flight = 0  # frames that are on their way
        self._free_ns = 0
        self._waiting: deque[tuple[str, int, bytes, int]] = deque()  # in the gateway's interface

    def send(self, sender: str, can_id: int, data: bytes, asked_ns: int | None = None) -> None:
        """Anybody's frame; it is on the bus a moment later."""
        asked_ns = self.runtime.now_ns if asked_ns is None else asked_ns
        if self.blocked:
            if sender == GATEWAY:
                self._waiting.append((sender, can_id, data, asked_ns))
            return  # what devices could not send is old when the bus is back: they do not keep it
        due_ns = self._free_ns = max(self.runtime.now_ns, self._free_ns) + FRAME_NS
        self.in_flight += 1
        sent = Sent(due_ns, self.name, sender, can_id, data, asked_ns)
        self.runtime.call_at(due_ns, lambda: self._arrive(sent))

    @property
    def hears(self) -> bool:
        """Whether the gateway hears what is sent here."""
        return self.transport is not None and not self.gone

    def full(self) -> bool:
        return self.blocked and len(self._waiting) >= QUEUE

    def block(self, blocked: bool) -> None:
        """A blocked bus sends what waited as soon as it can."""
        self.blocked = blocked
        self._look()
        while not blocked and self._waiting:
            self.send(*self._waiting.popleft())
        if not blocked and self.transport is not None:
            self.transport.wake()

    def lose(self, gone: bool) -> None:
        """Take the gateway's interface away, or bring it back."""
        self.gone = gone
        self._look()
        self._waiting.clear()
        if self.transport is not None:
            self.transport.wake()

    def connect(self) -> "Transport":
        """The gateway opens its interface; raises `Unavailable`."""
        if self.gone:
            raise Unavailable(f"interface {self.name} is not there")
        self.transport = Transport(self)
        self._look()
        return self.transport

    def lose_power(self) -> None:
        """The gateway's computer forgets what it has not sent."""
        self._waiting.clear()

    def disconnect(self) -> None:
        self.transport = None
        self._look()

    def _look(self) -> None:
        takes = self.transport is not None and not self.blocked and not self.gone
        self.takes_since_ns = self.runtime.now_ns if takes else NEVER_NS

    def _arrive(self, sent: Sent) -> None:
        self.in_flight -= 1
        self.frames.append(sent)
        self._told(sent)
        for listener in self.listeners:
            if listener.name != sent.sender:
                listener.on_frame(sent.can_id, sent.data)
        if self.transport is not None and sent.sender != GATEWAY and not self.gone:
            self.transport.take((sent.stamp_ns, sent.can_id, sent.data))


GATEWAY = "gateway"


class Transport:
    """The gateway's end of a wire; see `drivers.bus.frames.Transport`."""

    def __init__(self, wire: Wire) -> None:
        self.dropped = 0
        self.warning: str | None = None
        self.blocks = False
        self.full = f"interface {wire.name} does not send: nobody acknowledges"
        self._wire = wire
        self._inbox: list[tuple[int, int, bytes]] = []
        self._accepted: frozenset[int] | None = None
        self._reader = Waiters()
        self._room = Waiters()
        self._closed = False

    def receive(self, timeout_s: float) -> Sequence[tuple[int, int, bytes]]:
        if not self._inbox and not self._wire.gone:
            self._reader.wait(round(timeout_s * 1e9))
        self._check()
        if self._wire.breaks:
            self._wire.breaks = False
            raise ArithmeticError("what no driver has thought of")
        frames, self._inbox = self._inbox, []
        return frames

    def send(self, can_id: int, data: bytes) -> None:
        self._wire.runtime.point()
        self._check()
        if self._wire.full():
            self._wire.runtime.block(SEND_TIMEOUT_NS)
            if self._wire.full():
                raise Unavailable(f"interface {self._wire.name} does not send: nobody acknowledges")
        self._check()
        self._wire.send(GATEWAY, can_id, data)

    def try_send(self, can_id: int, data: bytes) -> bool:
        self._wire.runtime.point()
        self._check()
        if not self._wire.full():
            self._wire.send(GATEWAY, can_id, data)
            return True
        return False

    def flush(self) -> bool:
        return True

    def await_room(self, timeout_s: float) -> None:
        if self._wire.full() and not self._wire.gone:
            self._room.wait(round(timeout_s * 1e9))

    def carried(self) -> tuple[int, int] | None:
        return None

    def accept(self, can_ids: frozenset[int] | None) -> None:
        self._accepted = can_ids

    def close(self) -> None:
        self._closed = True
        if self._wire.transport is self:
            self._wire.disconnect()

    def take(self, frame: tuple[int, int, bytes]) -> None:
        if self._accepted is None or frame[1] in self._accepted:
            self._inbox.append(frame)
            self._reader.wake()

    def wake(self) -> None:
        self._reader.wake()
        self._room.wake()

    def _check(self) -> None:
        if self._closed or self._wire.gone:
            raise Unavailable(f"interface {self._wire.name} is gone")
