"""Layouts: those that ship, an integrator's own, mirrored for the other foot, and wrong ones."""

from pathlib import Path

import pytest

from drivers.errors import SettingsError
from drivers.insole import layout as layouts


def test_default_layout_is_a_whole_sole_in_the_foot_frame() -> None:
    layout = layouts.load("insole-16")
    assert len(layout.cells) == 16
    assert 0.012 < sum(layout.areas) < 0.018
    assert all(0.0 < x < 0.265 and abs(y) < 0.05 for x, y, _ in layout.cells)


@pytest.mark.parametrize("name", layouts.shipped())
def test_shipped_layout_lies_on_a_foot(name: str) -> None:
    layout = layouts.load(name)
    assert layout.name == name
    assert all(0.0 <= x <= 0.30 and abs(y) <= 0.06 for x, y, _ in layout.cells)
    assert len({(x, y) for x, y, _ in layout.cells}) == len(layout.cells)
    assert 0.004 < sum(layout.areas) < 0.025


def test_right_foot_is_the_mirror_image() -> None:
    left = layouts.load("insole-16")
    right = left.for_foot("right")
    assert [(x, -y, area) for x, y, area in left.cells] == list(right.cells)
    assert right.for_foot("left") == left
    assert right.for_foot("right") is right


def test_own_layout_is_found_beside_the_robots_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "mine"\ncells = [[0.02, 0.0, 0.004], [0.18, 0.01, 0.005]]\n')
    assert layouts.load("mine.toml", tmp_path).areas == (0.004, 0.005)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "x"\ncells = []', "`cells` is empty"),
        ('name = "x"\ncells = [[20.0, 0.0, 0.004]]', "positions are in metres"),
        ('name = "x"\ncells = [[0.02, 0.0, 0.0]]', "area > 0"),
        ('name = "x"\ncells = [[0.02, 0.0]]', "cells"),
        ('name = "x"', "cells"),
        ('name = "x"\ncolour = 1\ncells = [[0.02, 0.0, 0.004]]', "colour"),
        ("name = ", "insole layout"),
    ],
)
def test_wrong_layout_is_named(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(SettingsError, match=words) as caught:
        layouts.load("mine.toml", tmp_path)
    assert str(tmp_path / "mine.toml") in str(caught.value)


def test_unknown_name_lists_what_ships() -> None:
    with pytest.raises(SettingsError, match=r"no insole layout 'insole-17'.*insole-16"):
        layouts.load("insole-17")


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"mine\.toml"):
        layouts.load("mine.toml", tmp_path)
