"""Decimal places of a value follow what is in sight of its axis, and do not flicker."""

import math

import pytest

from server_gui.core.workspace.decimals import places


@pytest.mark.parametrize(
    ("span", "shown"),
    [(120.0, 1), (20.0, 1), (5.0, 2), (0.8, 3), (1e-6, 3), (0.0, 1), (math.nan, 1), (math.inf, 1)],
)
def test_a_narrow_axis_is_read_more_finely(span: float, shown: int) -> None:
    assert places(1, span, 1) == shown


def test_an_axis_that_changes_a_little_changes_no_text() -> None:
    shown = 1
    for span in (11.0, 9.5, 10.4, 9.9):
        shown = places(1, span, shown)
        assert shown == 1
    assert places(1, 6.0, shown) == 2
    assert places(1, 10.4, 2) == 2
    assert places(1, 14.0, 2) == 1
