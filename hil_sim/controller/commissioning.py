"""Sets a drive of another make up over SDO, as the file of a machine's builder would: PDOs, cycle, limits."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from hil_sim.bus.can_bus import Frame
from hil_sim.clock import MILLISECOND_NS, Clock, Event

SDO_REQUEST, SDO_RESPONSE = 0x600, 0x580

_TIMEOUT_NS = 100 * MILLISECOND_NS
_NOT_VALID = 1 << 31
_NOT_ON_REQUEST = 1 << 30
_EVERY_SYNC = 1


@dataclass(frozen=True, slots=True)
class Write:
    """An expedited SDO download."""

    index: int
    subindex: int
    value: int
    size: int

    @property
    def multiplexer(self) -> bytes:
        return self.index.to_bytes(2, "little") + bytes([self.subindex])

    @property
    def request(self) -> bytes:
        data = (self.value & (1 << 8 * self.size) - 1).to_bytes(4, "little")
        return bytes([0x23 | (4 - self.size) << 2]) + self.multiplexer + data


def needed(node_id: int, cycle_ms: int) -> Iterator[Write]:
    """Yield the controller's settings of a drive for one of our joints: counts of 1/409 600 revolution."""
    yield from _pdo(0x1800, 0x1A00, _NOT_ON_REQUEST | 0x180 + node_id, (0x6041_0010, 0x6064_0020))
    yield from _pdo(0x1400, 0x1600, 0x200 + node_id, (0x6040_0010, 0x6060_0008, 0x607A_0020))
    yield Write(0x60C2, 2, -3, 1)
    yield Write(0x60C2, 1, cycle_ms, 1)
    yield from _JOINT


# The motor, encoder and gear behind the drive, and how it is to move and stop them.
_JOINT = (
    Write(0x608F, 1, 4096, 4),  # increments a motor revolution
    Write(0x608F, 2, 1, 4),
    Write(0x6091, 1, 100, 4),  # gear
    Write(0x6091, 2, 1, 4),
    Write(0x6075, 0, 5000, 4),  # rated current (mA) and torque (mN·m)
    Write(0x6076, 0, 400, 4),
    Write(0x6065, 0, 22_755, 4),  # following error window, and its time (ms)
    Write(0x6066, 0, 500, 2),
    Write(0x6085, 0, 1_300_000, 4),  # quick stop deceleration
    Write(0x605A, 0, 2, 2),
    Write(0x6073, 0, 3000, 2),  # the most current (per mille of the rated)
    Write(0x1017, 0, 100, 2),  # heartbeat (ms)
)


def _pdo(communication: int, mapping: int, cob_id: int, mapped: tuple[int, ...]) -> Iterator[Write]:
    """Yield a synchronous PDO by the sequence of CiA 301 §7.5.2.36."""
    yield Write(communication, 1, _NOT_VALID | cob_id, 4)
    yield Write(mapping, 0, 0, 1)
    for number, value in enumerate(mapped, 1):
        yield Write(mapping, number, value, 4)
    yield Write(mapping, 0, len(mapped), 1)
    yield Write(communication, 2, _EVERY_SYNC, 1)
    yield Write(communication, 1, cob_id, 4)


class Commissioning:
    """Writes one object of a drive after the other, then calls `done`; what it refuses stays as it is.

    A drive that does not answer is left alone until `begin` is called again.
    """

    def __init__(
        self, clock: Clock, send: Callable[[int, bytes], None], node_id: int, done: Callable[[], None]
    ) -> None:
        self.node_id = node_id
        self._clock = clock
        self._send = send
        self._done = done
        self._left: Iterator[Write] = iter(())
        self._asked: Write | None = None
        self._timeout: Event | None = None

    def begin(self, cycle_ms: int) -> None:
        self._left = needed(self.node_id, cycle_ms)
        self._next()

    def answered(self, frame: Frame) -> None:
        """Take a frame of the drive's SDO server, which other clients may use as well."""
        if self._asked is not None and frame.data[1:4] == self._asked.multiplexer:
            self._next()

    def _next(self) -> None:
        if self._timeout is not None:
            self._timeout.cancel()
        self._asked = next(self._left, None)
        if self._asked is None:
            self._timeout = None
            self._done()
            return
        self._send(SDO_REQUEST + self.node_id, self._asked.request)
        self._timeout = self._clock.after(_TIMEOUT_NS, self._give_up)

    def _give_up(self) -> None:
        self._asked = self._timeout = None
