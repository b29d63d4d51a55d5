"""Reading what unknown nodes are: first all 127 ids at once, then each that answers (CiA 301, CiA 402)."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from drivers.bus.bus import CanBus
from drivers.bus.outlet import Requests
from drivers.bus.pdo import USUAL_TPDOS, Tpdo, read_tpdo
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.protocol import multiplexer, upload
from drivers.bus.settings import SDO_REQUEST, SDO_RESPONSE
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError
from drivers.joint.quantities import AXIS_OFFSET

SWEEP_S = 0.5  # for the answers to the first question
GAP_S = 0.002  # between two questions of the sweep: it takes less than a tenth of a 125 kbit/s bus
TIMEOUT_S = 0.3
MAX_AXES = 8
_DRIVE = 402
_RATIOS = (0x608F, 0x6091)  # CiA 402-2: encoder counts, and gear, a revolution


@dataclass(frozen=True, slots=True)
class Axis:
    """One drive in a device: which motor it says it drives (6402h), which modes it has (6502h)."""

    number: int
    motor_type: int | None
    modes: int | None


@dataclass(frozen=True, slots=True)
class NodeAnswers:
    """A node's answers; `None`, or empty, for those it does not have."""

    device_type: int
    error_register: int | None
    name: str | None
    hardware: str | None
    software: str | None
    vendor_id: int | None
    product_code: int | None
    revision: int | None
    serial_number: int | None
    heartbeat_ms: int | None
    axes: tuple[Axis, ...]
    tpdos: tuple[Tpdo, ...]
    ratios: tuple[tuple[int, int, int], ...] = ()  # index, sub-index, value of 608Fh and 6091h
    problem: str | None = None  # why the rest could not be read


def sweep(bus: CanBus, nodes: Iterable[int], wait: Callable[[float], object]) -> frozenset[int]:
    """Ask each of `nodes` for its device type, in one go; returns those that answered, or refused.

    Raises:
        Unavailable: the bus is not open.

    """
    question = next(upload(0x1000, 0))
    answered: set[int] = set()
    handlers = {node: _noting(answered, node) for node in nodes}
    for node, handler in handlers.items():
        bus.subscribe(SDO_RESPONSE + node, handler)
    try:
        for node in handlers:
            bus.send(SDO_REQUEST + node, question)
            wait(GAP_S)
        wait(SWEEP_S)
    finally:
        for node, handler in handlers.items():
            bus.unsubscribe(SDO_RESPONSE + node, handler)
    return frozenset(answered)


def _noting(answered: set[int], node: int) -> Callable[[int, bytes], None]:
    def note(_stamp_ns: int, data: bytes) -> None:
        if len(data) == 8 and data[1:4] == multiplexer(0x1000, 0):
            answered.add(node)

    return note


def ask(bus: CanBus, node: int) -> NodeAnswers:
    """Read the identity and abilities of a node.

    Raises:
        DriverError: it does not say of what type it is.

    """
    channel = SdoChannel(f"node {node} on {bus.name}", Requests(bus, SDO_REQUEST + node), TIMEOUT_S)
    bus.subscribe(SDO_RESPONSE + node, channel.on_response)
    try:
        return _Reader(channel).told()
    finally:
        bus.unsubscribe(SDO_RESPONSE + node, channel.on_response)


class _Reader:
    def __init__(self, channel: SdoChannel) -> None:
        self._channel = channel
        self._problem: str | None = None

    def told(self) -> NodeAnswers:
        device_type = unsigned(self._channel.upload(0x1000, 0))
        axes = self._axes() if device_type & 0xFFFF == _DRIVE else ()
        return NodeAnswers(
            device_type=device_type,
            error_register=self._number(0x1001, 0),
            name=self._text(0x1008),
            hardware=self._text(0x1009),
            software=self._text(0x100A),
            vendor_id=self._number(0x1018, 1),
            product_code=self._number(0x1018, 2),
            revision=self._number(0x1018, 3),
            serial_number=self._number(0x1018, 4),
            heartbeat_ms=self._number(0x1017, 0),
            axes=axes,
            tpdos=self._tpdos(),
            ratios=tuple(self._ratios(axes)),
            problem=self._problem,
        )

    def _upload(self, index: int, subindex: int) -> bytes | None:
        """Return an object's bytes; after one that was not answered nothing more is asked."""
        if self._problem is not None:
            return None
        try:
            return self._channel.upload(index, subindex)
        except DeviceAbort:
            return None
        except DriverError as error:
            self._problem = str(error)
            return None

    def _number(self, index: int, subindex: int) -> int | None:
        data = self._upload(index, subindex)
        return None if data is None else unsigned(data)

    def _text(self, index: int) -> str | None:
        data = self._upload(index, 0)
        return None if data is None else data.rstrip(b"\x00 ").decode("latin-1")

    def _axes(self) -> tuple[Axis, ...]:
        axes = []
        for number in range(MAX_AXES):
            offset = number * AXIS_OFFSET
            if self._number(0x6041 + offset, 0) is None:
                break
            motor_type, modes = self._number(0x6402 + offset, 0), self._number(0x6502 + offset, 0)
            axes.append(Axis(number, motor_type, modes))
        return tuple(axes)

    def _ratios(self, axes: Iterable[Axis]) -> Iterator[tuple[int, int, int]]:
        for axis in axes:
            for index in _RATIOS:
                for subindex in (1, 2):
                    place = index + axis.number * AXIS_OFFSET
                    if (value := self._number(place, subindex)) is not None:
                        yield place, subindex, value

    def _tpdos(self) -> tuple[Tpdo, ...]:
        tpdos: list[Tpdo] = []
        for number in range(USUAL_TPDOS):
            if self._problem is not None:
                break
            try:
                found = read_tpdo(self._channel, None, number)
            except DeviceAbort:
                continue
            except DriverError as error:
                self._problem = str(error)
                break
            if found is not None:
                tpdos.append(found)
        return tuple(tpdos)
