"""Newcomers' walks: a short one each time, and at night all of them on every screen, in both looks."""

import shutil
from pathlib import Path

import pytest

from tests.gui.walks.__main__ import walk
from tests.gui.walks.walk import Screen
from tests.gui.walks.walks import SHORT, WALKS

SIZES = ((1024, 700), (1366, 768), (1920, 1080))
SCREENS = [Screen(*size, scale, look) for size in SIZES for scale in (100, 150) for look in ("dark", "light")]

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, ("Xvfb", "xdotool"))), reason="needs apt-get install xvfb xauth xdotool"
)


def test_a_newcomer_sees_it_walk_and_stops_it(tmp_path: Path) -> None:
    assert walk(SHORT, Screen(1366, 768), tmp_path) == []


@pytest.mark.parametrize("screen", SCREENS, ids=lambda screen: screen.name)
@pytest.mark.parametrize("name", WALKS)
def test_a_newcomer_finds_what_there_is_to_find(name: str, screen: Screen, tmp_path: Path) -> None:
    assert walk(WALKS[name], screen, tmp_path) == []
