"""A frame is of one moment: however slowly it is drawn, no two places of the window judge by other clocks."""

import itertools
import time
from types import SimpleNamespace

import pytest
from PySide6.QtWidgets import QWidget

from gateway.client import ConnectionState
from server_gui.core.follow import frame_time, robot
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.widgets.mark import MarkIcon
from tests.gui.fakes import Bench
from tests.support.desk import described, looked, walking

BUS = 3


def test_all_of_a_frame_is_judged_by_one_moment(
    bench: Bench, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each look at the clock takes so long that what is live becomes stale within a frame or two."""
    bench.station.take([described(), walking(600), looked()])
    bench.draw(window)
    ticks = itertools.count(time.monotonic_ns(), robot.STALE_NS // 20)
    monkeypatch.setattr(frame_time, "time", SimpleNamespace(monotonic_ns=lambda: next(ticks)))
    said = list[str]()
    for _ in range(40):
        window.refresh()
        chip, fact = window.header._chips["drives"], window.tabs.overview.now.drives
        colours = {icon._mark.colour for one in (chip, fact) for icon in one.findChildren(MarkIcon)}
        assert len(colours) == 1, said
        said.append(colours.pop())
        if said[-1] == "old":
            break
    assert {said[0], said[-1]} == {"good", "old"}


def test_what_is_read_is_shown_anew_in_the_same_frames(bench: Bench, window: MainWindow) -> None:
    """Header and overview: a drive that goes off is off in both."""
    bench.station.take([described(), walking(600), looked()])
    bench.draw(window)
    shown = set[str]()
    for _ in range(20):
        bench.station.robot.values["left_knee.state"] = float(len(shown) % 2)
        window.refresh()
        header = window.header._chips["drives"].main_text
        shown.add(header)
        assert window.tabs.overview.now.drives.main.text() == header


def test_header_and_alarms_go_on_where_a_page_cannot_be_made(
    bench: Bench, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails() -> QWidget:
        raise ValueError("a mistake of ours")

    bench.station.take([described(), walking(600), looked()])
    bench.draw(window)
    monkeypatch.setattr(window.tabs._buses, "_make", fails)
    monkeypatch.setattr(window.tabs._buses, "setVisible", lambda _visible: None)  # which Qt only prints
    monkeypatch.setattr(window.tabs._buses, "showEvent", lambda _event: None)
    window.tabs.setCurrentIndex(BUS)
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no answer", time.monotonic_ns())])
    with pytest.raises(ValueError, match="a mistake of ours"):
        window.refresh()
    assert any("no answer" in text for text in window.alarms.texts)
    assert "no link" in window.robots.cards[0].texts[1]


def test_within_one_moment_the_clock_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = itertools.count()
    monkeypatch.setattr(frame_time, "time", SimpleNamespace(monotonic_ns=lambda: next(ticks)))
    with frame_time.one_moment():
        first = frame_time.now_ns()
        with frame_time.one_moment():
            assert frame_time.now_ns() == first
        assert frame_time.now_ns() == first
    assert frame_time.now_ns() > first
