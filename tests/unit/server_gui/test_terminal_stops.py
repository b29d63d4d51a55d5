"""The terminal shows no robot as stopped, nor a drive in green, that is enabled while a stop is held."""

import time

import pytest

from gateway.wire.stop import Stopped
from server_gui.core.follow.events import Event
from server_gui.terminal.controls import Controls
from server_gui.terminal.keys import Key
from server_gui.terminal.marks import BAD, WARN
from server_gui.terminal.panels import _drive
from tests.support.desk import JOINTS, Bench, telemetry, walking_bench
from tests.support.terminal_robot import screen

ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return walking_bench(monkeypatch)


def seen(number: float) -> Event:
    """Every drive in this state, from now on."""
    at_ns = time.monotonic_ns() + 1_000_000_000
    columns: dict[str, list[float | None]] = {f"{joint}.state": [number] for joint in JOINTS}
    return telemetry([at_ns], columns, at_ns)


def test_drives_that_are_enabled_again_are_said_before_the_stop_that_was_confirmed(bench: Bench) -> None:
    station = bench.station
    controls = Controls(station)
    controls.press(Key.STOP)
    assert "STOP sent" in screen(station, controls).splitlines()[1]
    assert str(_drive(station, "left_knee", stale=False).style) == WARN
    bench.first.answer(ALL)
    station.take([seen(6.0)])
    assert "STOP confirmed by all 6 drives" in screen(station, controls)
    station.take([seen(4.0)])
    said = screen(station, controls)
    assert "ENABLED AGAIN: all 6 drives" in said.splitlines()[-1]
    assert "ENABLED AGAIN" in said.splitlines()[1]
    assert str(_drive(station, "left_knee", stale=False).style) == BAD
    controls.press(Key.DOWN)
    assert "ENABLED AGAIN: all 6 drives" in screen(station, controls).splitlines()[-1]
