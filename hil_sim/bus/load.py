"""Says when the simulated bus is asked for more than its bit rate carries, and when that is over."""

from collections.abc import Callable

from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import SECOND_NS

_FULL = 0.99  # of the time; frames still wait then


class LoadWatch:
    """Looks at `bus` once a simulated second, and tells `say`."""

    def __init__(self, bus: CanBus, say: Callable[[str], object]) -> None:
        self._bus = bus
        self._say = say
        self._busy_ns = bus.busy_ns
        self._lost = bus.frames_lost
        self._overloaded = False
        bus.clock.every(SECOND_NS, self._look)

    def _look(self) -> None:
        bus = self._bus
        busy_ns, self._busy_ns = bus.busy_ns - self._busy_ns, bus.busy_ns
        lost, self._lost = bus.frames_lost - self._lost, bus.frames_lost
        overloaded = bus.pending > 0 and busy_ns >= _FULL * SECOND_NS
        if overloaded is not self._overloaded:
            self._overloaded = overloaded
            self._say(self._overload(lost) if overloaded else "the bus is no longer overloaded")

    def _overload(self, lost: int) -> str:
        bus = self._bus
        return (
            f"the bus is overloaded at {bus.bitrate / 1e6:g} Mbit/s: {bus.pending} frames wait and {lost} "
            "were lost in the last second; send fewer PDOs, or SYNC less often"
        )
