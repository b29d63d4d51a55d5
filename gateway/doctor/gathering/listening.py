"""Buses listened to while something else is done: who sends what, how often. Nothing is sent."""

import contextlib
import time
from collections import Counter
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Self

from drivers.bus.bus import CanBus
from drivers.bus.frames import STANDARD_IDS
from drivers.bus.settings import SDO_REQUEST, CanSettings
from drivers.scan.traffic import IdentifierTraffic, Traffic
from gateway.doctor.observations import BusFacts, IdentifierFrames

OPEN_S = 3.0
LEAST_S = 0.1
_BEGINS = (1, 2, 5, 6)  # client command specifiers that begin a transfer (CiA 301 §7.2.4.3)
_BLOCK_BEGINS = 0  # the lowest bit of a block transfer's first frame

Wait = Callable[[float], object]


class Listening:
    """Listens to every bus that can be opened, from `with` until its end."""

    def __init__(self, buses: Mapping[str, CanSettings], wait: Wait) -> None:
        self._wait = wait
        self._ears = {name: _Ear(name, settings) for name, settings in buses.items()}
        self._ending = contextlib.ExitStack()

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as ending:
            for ear in self._ears.values():
                ending.callback(ear.bus.stop)
                ear.bus.start()
            self._await_open()
            self._ending = ending.pop_all()
        for ear in self._ears.values():
            ear.begin()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ending.close()

    def facts(self, asked_by_us: Mapping[str, Mapping[int, int]]) -> dict[str, BusFacts]:
        """Return the facts heard so far; to be called before the end."""
        return {name: ear.facts(asked_by_us.get(name, {})) for name, ear in self._ears.items()}

    def asked(self, bus: str) -> frozenset[int]:
        """Return nodes that somebody asks by SDO."""
        return self._ears[bus].traffic.asked()

    def _await_open(self) -> None:
        until = time.monotonic() + OPEN_S
        waiting = [ear.bus for ear in self._ears.values()]
        while any(not bus.is_open and bus.problem is None for bus in waiting) and time.monotonic() < until:
            self._wait(0.02)


class _Ear:
    def __init__(self, name: str, settings: CanSettings) -> None:
        self.bus = CanBus(name, settings)
        self.traffic = Traffic()
        self._bitrate = settings.bitrate
        self._asks: Counter[int] = Counter()
        self._began_ns = self._errors = self._frames = 0
        for can_id in range(STANDARD_IDS + 1):
            self.bus.subscribe(can_id, self._taking(can_id))

    def begin(self) -> None:
        """Count from now on."""
        self._began_ns = time.monotonic_ns()
        self._errors, self._frames = self.bus.health.error_frames, self.bus.frames

    def facts(self, asked_by_us: Mapping[int, int]) -> BusFacts:
        seconds = max((time.monotonic_ns() - self._began_ns) / 1e9, LEAST_S)
        bus, opened = self.bus, self.bus.is_open
        seen = dict(self.traffic.seen)
        return BusFacts(
            seconds=seconds,
            heard={can_id: self._heard(can_id, one) for can_id, one in seen.items()} if opened else None,
            frames_per_s=(bus.frames - self._frames) / seconds if opened else None,
            load_percent=bus.health.load_percent,
            error_frames_per_s=(bus.health.error_frames - self._errors) / seconds if opened else None,
            state=bus.state,
            trouble=bus.trouble,
            asked_by_us=asked_by_us,
        )

    def _heard(self, can_id: int, seen: IdentifierTraffic) -> IdentifierFrames:
        period_s = seen.period_s
        return IdentifierFrames(seen.count, 1 / period_s if period_s else 0.0, self._asks[can_id])

    def _taking(self, can_id: int) -> Callable[[int, bytes], None]:
        def take(stamp_ns: int, data: bytes) -> None:
            self.traffic.take(stamp_ns, can_id, data)

        def take_request(stamp_ns: int, data: bytes) -> None:
            self.traffic.take(stamp_ns, can_id, data)
            if data and data[0] >> 5 in _BEGINS and (data[0] >> 5 < 5 or data[0] & 1 == _BLOCK_BEGINS):
                self._asks[can_id] += 1

        return take_request if SDO_REQUEST < can_id < SDO_REQUEST + 128 else take
