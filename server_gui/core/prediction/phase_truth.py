"""True gait phases of both legs, in hindsight, from heel strike to heel strike."""

import collections
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from gateway.client import Batch
from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import Stride

STRIDE_S: Final = (0.5, 2.5)  # shorter and longer ones are none, or a strike between them was missed
STANCE: Final = (0.3, 0.9)  # of a stride
USUAL: Final = (0.7, 1.4)  # times this leg's usual stride: else a strike was missed, or is none
NEWEST: Final = 9  # strides that are usual
FEWEST: Final = 3  # strides before which nobody knows what is usual
LATEST_NS: Final = 4_000_000_000  # after this nothing of an instant will be known


@dataclass(frozen=True, slots=True)
class Instant:
    """The phases of both legs, 0 (heel strike) to 1, and when the left leg's stride began."""

    left: float
    right: float
    stride_ns: int


class PhaseTruth:
    """True phases of one robot; implausible strides are ignored."""

    def __init__(self) -> None:
        self._processing = ComponentProcessing()
        self._strides: dict[Leg, collections.deque[Stride]] = {
            leg: collections.deque(maxlen=8) for leg in Leg
        }
        self._usual_s: dict[Leg, collections.deque[float]] = {
            leg: collections.deque(maxlen=NEWEST) for leg in Leg
        }

    def take(self, batch: Batch) -> bool:
        """Take rows in the order of time; whether more is known of strides now."""
        found = self._processing.take(batch.stamps_ns, batch.columns).strides
        return sum(map(self._is_new, found)) > 0  # of all of them

    def at(self, stamp_ns: int) -> Instant | None:
        """Return the truth about an instant, as far as it is known by now."""
        left, right = (self._stride(leg, stamp_ns) for leg in (Leg.LEFT, Leg.RIGHT))
        if left is None or right is None:
            return None
        return Instant(_phase(left, stamp_ns), _phase(right, stamp_ns), left.began_ns)

    def _is_new(self, stride: Stride) -> bool:
        usual_s = self._usual_s[stride.leg]
        possible = STRIDE_S[0] <= stride.time_s <= STRIDE_S[1] and STANCE[0] <= stride.stance <= STANCE[1]
        if not possible or stride.step_s is None:  # the other foot did not strike in it
            return False
        is_usual = len(usual_s) >= FEWEST and _is_like(stride.time_s, usual_s)
        usual_s.append(stride.time_s)
        if is_usual:
            self._strides[stride.leg].append(stride)
        return is_usual

    def _stride(self, leg: Leg, stamp_ns: int) -> Stride | None:
        strides = (one for one in self._strides[leg] if one.began_ns <= stamp_ns < one.ended_ns)
        return next(strides, None)


def _is_like(time_s: float, usual_s: Sequence[float]) -> bool:
    least, most = (share * statistics.median(usual_s) for share in USUAL)
    return least <= time_s <= most


def _phase(stride: Stride, stamp_ns: int) -> float:
    return (stamp_ns - stride.began_ns) / (stride.ended_ns - stride.began_ns)
