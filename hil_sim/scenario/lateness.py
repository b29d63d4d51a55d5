"""Check of the computer's spare time: without it, a failed expectation proves nothing.

Measured a tenth of a second at a time: by how much the simulator's events came late, and how long the gateway
was ready to run and waited for a processor. Only what is worth noticing counts, so that a lively computer's
everyday milliseconds never add up to a doubt.
"""

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock
from hil_sim.scenario.expectation import Timing, When

_PERIOD_NS = 100 * MILLISECOND_NS
_PERIOD_S = _PERIOD_NS / SECOND_NS
_WORTH_S = 0.05  # of one look
_LEAST_MARGIN_S = 0.2  # up to which the simulator catches up, and nothing is left out
_SHARE = 0.1  # of a window that may be lost


@dataclass(frozen=True, slots=True)
class Loss:
    """Time lost before `time_s` (simulated), since the last check."""

    time_s: float
    simulator_s: float
    gateway_s: float


class Lateness:
    """Looks as long as `clock` runs; `late_s` and `waited_s` tell what came since their last call."""

    def __init__(self, clock: Clock, late_s: Callable[[], float], waited_s: Callable[[], float]) -> None:
        self._clock = clock
        self._late_s = late_s
        self._waited_s = waited_s
        self._losses: list[Loss] = []
        clock.every(_PERIOD_NS, self._look)

    def doubt(self, timing: Timing, since_s: float, end_s: float) -> str:
        """Return why time may have been too short between these, in words; "" if there was enough."""
        lost = [one for one in self._losses if since_s < one.time_s <= end_s + _PERIOD_S]
        simulator_s = sum(one.simulator_s for one in lost)
        gateway_s = sum(one.gateway_s for one in lost)
        margin_s = margin(timing)
        if simulator_s + gateway_s <= margin_s:
            return ""
        return (
            f"this computer was too slow between {since_s:g} and {end_s:g} s: the simulator came "
            f"{simulator_s:.2f} s late and the gateway waited {gateway_s:.2f} s for a processor; "
            f"up to {margin_s:.2f} s would not matter"
        )

    def _look(self) -> None:
        late_s, waited_s = (
            seconds if seconds >= _WORTH_S else 0.0 for seconds in (self._late_s(), self._waited_s())
        )
        if late_s or waited_s:
            self._losses.append(Loss(self._clock.now_s, late_s, waited_s))


def margin(timing: Timing) -> float:
    """Return the time that may be lost before a verdict of this timing is in doubt (s)."""
    if timing.when is When.WITHIN:
        return max(_LEAST_MARGIN_S, _SHARE * (timing.end_s - timing.begin_s))
    return _LEAST_MARGIN_S
