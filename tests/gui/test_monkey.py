"""Whatever somebody clicks and types while telemetry runs: nothing is raised, and STOP stays in reach.

For seconds of the window's time, as many as `GWRMS_MONKEY_S` says if it says so; `GWRMS_MONKEY_SEED` makes it
another monkey.
"""

import os
import random
import sys
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.client import ConnectionState, NotConnected
from gateway.wire.control import Lease
from gateway.wire.parameter import Confirmed, Reverted, Stored, Written
from gateway.wire.resource import ProcessUse
from gateway.wire.stop import Reset, Stopped
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench
from tests.gui.monkey import Monkey
from tests.support.desk import HELD, JOINTS, FakeCommands, described, looked, resources, walking

SECONDS = [float(os.environ["GWRMS_MONKEY_S"])] if "GWRMS_MONKEY_S" in os.environ else [1.0, 60.0]
SEED = int(os.environ.get("GWRMS_MONKEY_SEED", "7"))
FRAMES_PER_S = 30
ROWS = 4  # a frame, at about 100 Hz


def _nothing(*_arguments: Any) -> None:
    """The answer to what tells nothing."""


class Robot(FakeCommands):
    """Answers at once: now and then refuses, or does not answer at all."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._random = random.Random(seed)
        self._held = dict(HELD)
        self._writes = 0

    def _ask(self, name: str, *arguments: Any) -> "Future[Any]":
        future = super()._ask(name, *arguments)
        self.asked, self.futures = self.asked[-100:], self.futures[-100:]
        chance = self._random.random()
        if chance < 0.15:
            future.set_exception(NotConnected("no link"))
        elif chance < 0.95:
            answer: Callable[..., Any] = self._answers().get(name, _nothing)
            future.set_result(answer(*arguments))
        return future

    def _answers(self) -> dict[str, Callable[..., Any]]:
        return {
            "stop": lambda _reason: Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True),
            "take_control": lambda: Lease("lease", 300.0),
            "write": self._write,
            "confirm": lambda write: Confirmed(write, {}),
            "revert": lambda write: Reverted(write, {}),
            "store": lambda component: Stored(component, "stored"),
            "reset": lambda: Reset({}, {}, held=False),
        }

    def _write(self, changes: dict[str, float], trial_s: float | None) -> Written:
        before = {name: self._held.get(name, 0.0) for name in changes}
        self._held |= changes
        self._writes += 1
        return Written(self._writes, before, dict(changes), trial_s)


class Day:
    """What happens to two robots while the monkey plays: frames of telemetry, and every kind of change."""

    def __init__(self, bench: Bench, seed: int) -> None:
        self._bench = bench
        self._random = random.Random(seed)

    def frame(self, number: int) -> None:
        for station in self._bench.desk.stations:
            if not station.is_linked:
                if self._random.random() < 0.1:
                    station.take([LinkChanged(ConnectionState.CONNECTED, None, 0), described()])
                continue
            station.take([walking(ROWS, rate_hz=100.0)])
            if number % FRAMES_PER_S == 0:
                station.take([looked(), resources([ProcessUse(7, "python3", 3.0, 1 << 20)])])
            if self._random.random() < 0.005:
                station.take([LinkChanged(ConnectionState.WAITING, "timed out", 0)])
            if self._random.random() < 0.005:
                station.take([described(cells=self._random.choice((0, 7, 16))), walking(ROWS, cells=7)])


@pytest.mark.timeout(300 + 12 * max(SECONDS))
@pytest.mark.parametrize("seconds", SECONDS)
def test_a_monkey_at_the_window_breaks_nothing_and_stop_stays_in_reach(
    qt: QApplication,
    window: MainWindow,
    bench: Bench,
    theme: Theme,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    seconds: float,
) -> None:
    monkeypatch.chdir(tmp_path)  # what a file dialog is told to write goes there
    bench.add("exo-02", 7421).take([described("exo-02")])
    for station in bench.desk.stations:
        station._commands = Robot(SEED)
    window.setUpdatesEnabled(True)  # it is painted here, too
    monkey, day = Monkey(SEED, window), Day(bench, SEED)
    raised: list[str] = []
    monkeypatch.setattr(
        sys, "excepthook", lambda _kind, error, _trace: raised.append(f"{monkey.last}: {error!r}")
    )
    left = round(seconds * FRAMES_PER_S)

    def step() -> None:
        nonlocal left
        if left <= 0 or raised:
            return
        # Each by a timer of its own, made before the monkey acts: a menu that is open has an event loop of
        # its own, which goes on doing this, but never calls a timer again that waits for the menu.
        QTimer.singleShot(1, step)
        left -= 1
        day.frame(left)
        window.refresh()
        if (modal := QApplication.activeModalWidget()) is not None:
            raised.append(f"{monkey.last}: a modal dialog is in the way of STOP")
            modal.close()
        if left > 0 and not raised:
            monkey.act()

    step()
    while left > 0 and not raised:
        QTest.qWait(1)
        assert window.header.stop.isVisible(), monkey.last
    while (popup := QApplication.activePopupWidget()) is not None:
        popup.close()
    for other in QApplication.topLevelWidgets():
        if other is not window and other.isWindow():
            other.close()
    theme.set(scale=1.0)
    assert raised == []
    bench.draw(window)
    assert window.header.stop.isEnabled()
