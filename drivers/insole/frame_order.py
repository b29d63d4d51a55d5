"""Late frames of formats whose description says what counts: a sequence, else the device's time."""

from drivers.insole.foot import Foot
from drivers.parsing import Counters, Sequence

TIME_MODULUS = 1 << 64  # µs: never
LARGEST = 1 << 62  # number or µs that a device can mean; a damaged one says anything
LONGEST_TIME_S = LARGEST / 1e6


class Order:
    """Tells late frames from others, for each foot or for all together."""

    def __init__(self, counters: Counters, modulus: int, each_foot: bool) -> None:
        self._counters = counters
        self._modulus = modulus
        self._each_foot = each_foot
        self._sequences: dict[Foot | None, Sequence] = {}
        self._times: dict[Foot | None, Sequence] = {}

    def restart(self) -> None:
        """Begin another stream."""
        self._sequences.clear()
        self._times.clear()

    def is_late(self, foot: Foot | None, sequence: int | None, ticks: int | None) -> bool:
        """Return whether the frame is a repetition, or older than one before; counts what it shows."""
        if sequence is not None:
            key = foot if self._each_foot else None
            if key not in self._sequences:
                self._sequences[key] = Sequence(self._counters, self._modulus)
            return self._sequences[key].is_late(sequence)
        if ticks is None:
            return False
        if foot not in self._times:
            self._times[foot] = Sequence(self._counters, TIME_MODULUS, gaps=False)
        return self._times[foot].is_late(ticks)
