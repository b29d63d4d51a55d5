"""A sensor on a serial line: what it measures becomes its format's bytes, numbered and timed by itself."""

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

from hil_sim.clock import SECOND_NS
from hil_sim.sensors.faults import LineFaults
from hil_sim.sensors.line import SerialLine

M = TypeVar("M", contravariant=True)

_CLOCK_ERROR = 40e-6  # an ordinary crystal: this share too fast
_SOON_FRAMES, _SOON_NS = 200, 2 * SECOND_NS


class Tick(NamedTuple):
    """Time of a frame by the sensor's own counters; below zero if a counter is about to wrap to 0."""

    number: int
    time_ns: int


@dataclass(frozen=True, slots=True)
class SerialFormat(Generic[M]):
    """A sensor's language, from its manual. `encode` cuts the tick to the size of its counters.

    `keys` are more lines of its table in the robot's file, `beside` the files that they name, with contents.
    """

    encode: Callable[[M, Tick], bytes]
    baudrate: int
    banner: bytes = b""  # said once when it starts
    keys: str = ""
    beside: Mapping[str, str] = field(default_factory=dict)


class SerialSensor(Generic[M]):
    """Tells what it is given; starts anew when it was unplugged."""

    def __init__(self, language: SerialFormat[M], faults: LineFaults, random_source: random.Random) -> None:
        self.line = SerialLine(language.baudrate, faults, random_source)
        self._language = language
        self._faults = faults
        self._running = False
        self._started_ns = 0
        self._number = 0

    def tell(self, measured: M, now_ns: int) -> None:
        """One measurement, made at `now_ns`."""
        started = not self._faults.unplugged and not self._running
        self._running = not self._faults.unplugged
        if started:
            soon = self._faults.wraps_soon
            self._number, self._started_ns = (-_SOON_FRAMES, now_ns + _SOON_NS) if soon else (0, now_ns)
        self._number += 1
        if self.line.port is None:
            return  # nobody hears it
        since_ns = now_ns - self._started_ns
        tick = Tick(self._number, since_ns + round(_CLOCK_ERROR * since_ns))
        self.line.send((self._language.banner if started else b"") + self._language.encode(measured, tick))
