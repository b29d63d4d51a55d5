"""Differences in words: in percent only where a percentage says something."""

import pytest

from server_gui.core.evidence.comparison import FEWEST, Evidence, Measured, Word
from server_gui.core.evidence.wording import interval, share, strides

TAKES = "it takes 8 of each leg, with and without it"


@pytest.mark.parametrize(
    ("before", "difference", "half", "unit", "said"),
    [
        (0.01, 0.002, 0.001, "rad", ("+20.0 %", "+10.0 to +30.0 %")),
        (-0.01, 0.002, 0.001, "s", ("+20.0 %", "+10.0 to +30.0 %")),
        (1e-6, 5e-6, 1e-3, "s", ("+5e-06", "-0.000995 to +0.00101 s")),  # not -99500 to +100500 %
        (1e-300, 0.0, 1e-3, "s", ("+0", "-0.001 to +0.001 s")),
        (0.0, 0.1, 0.05, "", ("+0.1", "+0.05 to +0.15")),
        (10.0, 5.0, 2.0, "%", ("+5 points", "+3 to +7 points")),  # not +50 %
    ],
)
def test_percent_is_of_what_was_before(
    before: float, difference: float, half: float, unit: str, said: tuple[str, str]
) -> None:
    low, high = difference - half, difference + half
    one = Measured("a.b", "b", unit, Word.SAME, 9, 9, before, before + difference, difference, low, high)
    assert (share(one), interval(one)) == said


@pytest.mark.parametrize(
    ("before", "after", "back", "said"),
    [
        (
            13,
            3,
            4,
            f"3 gait cycles with it, 9 before it, 4 since it was taken back; {TAKES}",
        ),
        (40, 1, 0, f"1 gait cycle with it, 40 before it; {TAKES}"),
        (5, 40, 0, f"40 gait cycles with it, 5 before it; {TAKES}"),
    ],
)
def test_of_cycles_that_are_not_enough_it_is_said_how_many_it_takes(
    before: int, after: int, back: int, said: str
) -> None:
    found = Evidence(Word.FEW, "", (), before, after, cycles_back=back)
    assert FEWEST == 8
    assert strides(found) == said
