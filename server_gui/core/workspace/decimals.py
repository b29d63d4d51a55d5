"""The decimal places of a curve's value, by the span of its axis in sight."""

import math
from typing import Final

PARTS: Final = 2  # decimal places below the largest digit of what is in sight: a hundredth of it is read
MORE: Final = 2  # than a unit is read with, at most
STEADY: Final = 1.3  # an axis that changes by less changes no text


def places(least: int, span: float, before: int) -> int:
    """Return the number of decimals for an axis of this span in its unit; `before` is shown now.

    `least` is what the unit is read with: 1 of °. A following error of half a degree is read in thousandths.
    """
    if not (math.isfinite(span) and span > 0.0):
        return least
    found = [_of(least, span * by) for by in (1.0, STEADY, 1.0 / STEADY)]
    return before if before in found else found[0]


def _of(least: int, span: float) -> int:
    return min(max(least, PARTS - math.floor(math.log10(span))), least + MORE)
