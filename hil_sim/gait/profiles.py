"""Ways from one value to another in time: minimum jerk, there and back, and the drop of a fall."""

from hil_sim.gait.curves import Leg


def smooth(share: float) -> float:
    """0 … 1 to 0 … 1 with no jump in speed or acceleration (minimum jerk)."""
    return share**3 * (10.0 - 15.0 * share + 6.0 * share * share)


def rise(now: float, start: float, end: float) -> float:
    """0 up to `start`, 1 from `end` on, minimum jerk between."""
    if now <= start:
        return 0.0
    return 1.0 if now >= end else smooth((now - start) / (end - start))


def bump(now: float, start: float, top: float, end: float) -> float:
    """Return a bump, from 0 at `start` to 1 at `top` and back to 0 at `end`."""
    return rise(now, start, top) - rise(now, top, end)


def mix(a: Leg, b: Leg, share: float) -> Leg:
    """Return `a` for `share` 0, `b` for 1, and blends between."""
    return Leg(
        a.hip + share * (b.hip - a.hip),
        a.knee + share * (b.knee - a.knee),
        a.ankle + share * (b.ankle - a.ankle),
    )


class Ramp:
    """A share that goes between 0 and 1 in `seconds` and turns only at its ends: nothing is broken off."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._up = False
        self.share = 0.0

    @property
    def smooth(self) -> float:
        return smooth(self.share)

    @property
    def moving(self) -> bool:
        return 0.0 < self.share < 1.0

    @property
    def rate(self) -> float:
        """How fast the share moves (1/s)."""
        return (1.0 if self._up else -1.0) / self._seconds if self.moving else 0.0

    def step(self, dt: float, up: bool) -> None:
        """Move on by `dt` seconds; `up` counts where no way is under way."""
        if not self.moving:
            self._up = up
        change = dt / self._seconds
        self.share = min(max(self.share + (change if self._up else -change), 0.0), 1.0)
