"""The scan: a bus is opened, listened to and, on request, asked. It writes nothing and starts nothing."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from drivers.bus.bus import CanBus
from drivers.bus.frames import STANDARD_IDS
from drivers.bus.interfaces.controller_state import BusState
from drivers.bus.settings import CanSettings
from drivers.errors import DriverError, Unavailable
from drivers.scan.identification import NodeAnswers, ask, sweep
from drivers.scan.traffic import Traffic

OPEN_S = 5.0
NODES = range(1, 128)


@dataclass(frozen=True, slots=True)
class ScanResult:
    """Result of a scan. `told` has each node's answers, or the reason why it could not be read."""

    seconds: float
    traffic: Traffic
    frames_per_s: float
    load_percent: float | None  # None: the bit rate is not known, or there was too little time
    error_frames: int
    state: BusState
    trouble: str | None
    told: dict[int, NodeAnswers | str]
    not_asked: frozenset[int]  # because somebody else asks them

    @property
    def nodes(self) -> tuple[int, ...]:
        """Ids of those that were heard, or answered."""
        return tuple(sorted(self.traffic.nodes() | self.told.keys()))


def scan(
    settings: CanSettings, seconds: float, wait: Callable[[float], object], *, active: bool
) -> ScanResult:
    """Listen for `seconds`, then ask where `active`: only nodes that nobody else is asking by SDO.

    Raises:
        Unavailable: the interface cannot be opened; the message says what to do.

    """
    bus, traffic = CanBus(str(settings.channel), settings), Traffic()
    for can_id in range(STANDARD_IDS + 1):
        bus.subscribe(can_id, _taking(traffic, can_id))
    bus.start()
    try:
        await_open(bus, wait)
        began = time.monotonic()
        wait(seconds)
        told: dict[int, NodeAnswers | str] = {}
        frames_per_s = bus.frames / max(time.monotonic() - began, 1e-3)
        load = bus.health.load_percent
        asked = traffic.asked() if active else frozenset()
        if active:
            for node in sorted(sweep(bus, set(NODES) - asked, wait)):
                if node not in traffic.asked():  # who has begun to ask it meanwhile goes first
                    told[node] = _ask(bus, node)
            asked = traffic.asked()
        return ScanResult(
            seconds, traffic, frames_per_s, load, bus.health.error_frames, bus.state, bus.trouble, told, asked
        )
    finally:
        bus.stop()


def _taking(traffic: Traffic, can_id: int) -> Callable[[int, bytes], None]:
    return lambda stamp_ns, data: traffic.take(stamp_ns, can_id, data)


def await_open(bus: CanBus, wait: Callable[[float], object]) -> None:
    """Wait until a bus that was started is open; raises `Unavailable`."""
    until = time.monotonic() + OPEN_S
    while not bus.is_open:
        if bus.problem is not None or time.monotonic() > until:
            raise Unavailable(bus.problem or f"{bus.name} did not open within {OPEN_S:g} s")
        wait(0.01)


def _ask(bus: CanBus, node: int) -> NodeAnswers | str:
    try:
        return ask(bus, node)
    except DriverError as error:
        return str(error)
