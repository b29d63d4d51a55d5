"""Ground reaction of one foot over its stance: vertical force, shear, path of the centre of pressure.

Modelled, not measured: two humps with a valley between, which grow with speed, a quick first part where the
heel strikes, and rockers that roll from heel to toe. The humps' ratios and times follow the measured curves
of Pataky et al. 2008 (J. Biomech. 41, 1987) between 1.1 and 1.9 m/s; slower walking flattens out.
"""

import math
from typing import NamedTuple

_STRIKE_END, _FIRST_AT, _VALLEY_AT, _SECOND_AT = 0.05, 0.21, 0.47, 0.78  # shares of stance


def _way(now: float, start: float, end: float) -> float:
    """0 at `start` to 1 at `end`, level at both."""
    share = min(max((now - start) / (end - start), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


class Humps(NamedTuple):
    """First peak, valley and second peak of the vertical force; only their ratios count.

    `strike` is the share of the first peak that the heel's strike brings at once.
    """

    first: float
    valley: float
    second: float
    strike: float

    @property
    def mean(self) -> float:
        """Mean over stance: every way between two values is symmetric."""
        first, down, up, last = self.parts()
        return first + down + up + last

    def parts(self) -> tuple[float, float, float, float]:
        """Return the contribution of each part to the mean: all are symmetric."""
        return (
            self.first * (_FIRST_AT - (self.strike * _STRIKE_END + (1 - self.strike) * _FIRST_AT) / 2),
            (self.first + self.valley) / 2 * (_VALLEY_AT - _FIRST_AT),
            (self.valley + self.second) / 2 * (_SECOND_AT - _VALLEY_AT),
            self.second / 2 * (1 - _SECOND_AT),
        )

    def at(self, stance: float) -> float:
        """Force at a share of stance (0 … 1)."""
        if stance < _FIRST_AT:
            struck = self.strike * _way(stance, 0.0, _STRIKE_END)
            return self.first * (struck + (1 - self.strike) * _way(stance, 0.0, _FIRST_AT))
        if stance < _VALLEY_AT:
            return self.first + (self.valley - self.first) * _way(stance, _FIRST_AT, _VALLEY_AT)
        if stance < _SECOND_AT:
            return self.valley + (self.second - self.valley) * _way(stance, _VALLEY_AT, _SECOND_AT)
        return self.second * (1.0 - _way(stance, _SECOND_AT, 1.0))


class Transfer(NamedTuple):
    """Shares of stance in which the weight comes to this foot and leaves it again: both are down then."""

    coming: float
    leaving: float

    def force(self, stance: float, humps: Humps) -> float:
        """Force of `humps` at a share of stance (0 … 1): their flanks are as long as the transfer."""
        if stance < self.coming:
            return humps.at(stance / self.coming * _FIRST_AT)
        if stance > 1.0 - self.leaving:
            return humps.at(1.0 - (1.0 - stance) / self.leaving * (1.0 - _SECOND_AT))
        alone = 1.0 - self.coming - self.leaving
        return humps.at(_FIRST_AT + (stance - self.coming) / alone * (_SECOND_AT - _FIRST_AT))

    def mean(self, humps: Humps) -> float:
        """Return the mean of `force` over stance."""
        first, down, up, last = humps.parts()
        alone = (1.0 - self.coming - self.leaving) / (_SECOND_AT - _FIRST_AT)
        return first * self.coming / _FIRST_AT + (down + up) * alone + last * self.leaving / (1 - _SECOND_AT)


def level_humps(speed: float) -> Humps:
    """Return the humps of level walking at `speed` (m/s): a pendulum, whose valley deepens with v²."""
    return Humps(
        first=1.0,
        valley=1.0 - min(0.19 * speed * speed, 0.67),
        second=1.0 + 0.12 * min(speed / 1.1, 1.0) - 0.29 * max(speed - 1.1, 0.0),
        strike=min(0.35 * speed, 0.6),
    )


def vertical_grf(stance: float, humps: Humps, stance_share: float) -> float:
    """Force of one foot in body weights at a share of its stance (0 … 1).

    Two feet that are each on the ground for `stance_share` of the stride carry one body weight on average.
    """
    return humps.at(stance) / (2.0 * stance_share * humps.mean) if stance < 1.0 else 0.0


def shear(stance: float, speed: float) -> float:
    """Fore-aft force of one foot in body weights: it brakes, then it pushes, the same in all."""
    return -0.12 * speed * math.sin(math.tau * stance) if stance < 1.0 else 0.0


class Path(NamedTuple):
    """Way of the centre of pressure: from, to (m before the heel), and its forward bow half-way."""

    start: float
    end: float
    bow: float = 0.0

    def at(self, stance: float) -> float:
        return self.start + (self.end - self.start) * stance + self.bow * 4.0 * stance * (1.0 - stance)


def outward(stance: float) -> float:
    """Return how far off the midline the pressure's centre lies (m): out in mid-stance, in at the toes."""
    return 0.002 + 0.08 * stance * stance * (0.9 - stance)
