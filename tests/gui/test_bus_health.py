"""The bus's view: a full bus is an alarm, what is not known is said so, and the last line names the worst."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from PySide6.QtWidgets import QApplication

from gateway.wire.bus import BusInfo, NodeInfo, TalkInfo
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.finding import FindingInfo
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.desk.frame_rate import FrameRate
from server_gui.core.follow.events import BusesSeen, Described, Looked
from server_gui.core.processing.bus_health import TAKEN
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.refresh_rate import SLOW
from server_gui.views.resources.bus_card import SENDER, SPARE, STATE, TITLES, controller_text
from server_gui.views.resources.bus_health import NOT_NOW, TOO_OLD, BusHealthView
from server_gui.views.resources.load_bar import LoadBar
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Bench, destroy
from tests.support.desk import described, looked, walking

NODE = NodeInfo(2, ["left_knee"], 0.44, 12.0, 88, 3, 0, 0.0)
TALKS = [TalkInfo("TPDO", 2, 900.0), TalkInfo("SYNC", None, 100.0)]
BUS = BusInfo("main", "error active", 1_000_000, 41.2, 1010.0, 4, 0, 1, 0, [NODE], None, [], TALKS)


@pytest.fixture
def view(theme: Theme, bench: Bench) -> Iterator[BusHealthView]:
    made = BusHealthView(bench.desk, theme)
    made.resize(900, 500)
    made.show()
    yield made
    destroy(made)


@pytest.fixture
def bar(theme: Theme, bench: Bench) -> Iterator[StatusBar]:
    made = StatusBar(bench.desk, theme)
    made.show()
    yield made
    destroy(made)


def show(view: BusHealthView, bench: Bench, *buses: BusInfo) -> None:
    bench.station.take([BusesSeen(buses, time.monotonic_ns())])
    view._frame = 0
    view.refresh()


def row(view: BusHealthView, place: int) -> list[str]:
    table = view.cards[0].table
    items = [table.item(place, column) for column in range(table.columnCount())]
    return ["" if item is None else item.text() for item in items]


def spaced(text: str) -> str:
    """The text with the spaces that one reads: some keep a number with its unit."""
    return text.replace("\u00a0", " ")


def test_load_counters_and_who_talks_stand_there(view: BusHealthView, bench: Bench) -> None:
    show(view, bench, BUS)
    assert view.cards[0].load.text() == "41 % of 1 Mbit/s"
    assert view.cards[0]._counters.accessibleDescription().startswith("1010 frames/s, 4 error frames")
    knee = ["2", "left knee", "○ not known", "89 %", "900", "TPDO 900/s", "0.4 / 12.0 ms", "3", "0.0 %"]
    assert row(view, 0) == knee, "nothing new comes from the robot"
    assert row(view, 1)[:5] == ["–", "SYNC", "", "10 %", "100"]
    assert row(view, 2)[:5] == ["–", "gateway or filtered", "", "1 %", "10"]
    assert not view.said.isVisible()


@pytest.mark.parametrize(("opened", "words"), [(1, "opened once"), (3, "opened 3 times")])
def test_how_often_it_was_opened_is_in_words(
    view: BusHealthView, bench: Bench, opened: int, words: str
) -> None:
    show(view, bench, replace(BUS, opened=opened))
    assert words in view.cards[0]._controller.accessibleDescription()


def test_a_full_bus_is_an_alarm(view: BusHealthView, bench: Bench) -> None:
    show(view, bench, replace(BUS, load_percent=100.0))
    assert spaced(view.said.text()) == "bus full: main: 100 % of its time is taken"
    assert view.checks.text().startswith("→ 89 % of its frames are from left knee, the most: send fewer PDOs")
    assert view.checks.isVisible()
    assert view.said.property("tone") == "bad"
    assert view.cards[0]._icon.accessibleName() == "bus full"
    show(view, bench, BUS)
    assert not view.said.isVisible()
    assert not view.checks.isVisible()
    assert view.cards[0]._icon.accessibleName() == "not known", "nothing new comes from the robot"
    bench.station.take([walking(1)])
    show(view, bench, BUS)
    assert view.cards[0]._icon.accessibleName() == "ok"


@pytest.mark.parametrize("width", [900, 300])
def test_identifiers_stand_beside_what_is_no_node(view: BusHealthView, bench: Bench, width: int) -> None:
    view.resize(width, 600)
    filled = replace(BUS, talks=[TalkInfo("other", None, 5000.0, [0x7FF]), *BUS.talks], frames_per_s=6010.0)
    show(view, bench, filled)
    assert row(view, 0)[1] == "no known node 0x7FF"


def test_the_load_of_the_last_minutes_is_drawn_with_its_peak(view: BusHealthView, bench: Bench) -> None:
    for second, load in enumerate((20.0, 85.0, None, 30.0)):
        bench.station.take([BusesSeen((replace(BUS, load_percent=load),), second * 1_000_000_000)])
    past = bench.station.processing.bus_loads.recent("main")
    assert past[:, 1][[0, 1, 3]].tolist() == [20.0, 85.0, 30.0]
    assert np.isnan(past[2, 1]), "what was not told is a gap"
    show(view, bench, replace(BUS, load_percent=30.0))
    assert view.cards[0]._past.note == "peak 85 %"


def test_what_is_not_known_is_no_card_and_no_zero(view: BusHealthView, bench: Bench) -> None:
    view.refresh()
    assert view.said.text() == NOT_NOW
    show(view, bench, BUS)
    bench.station.take([BusesSeen(None, time.monotonic_ns())])
    view._frame = 0
    view.refresh()
    assert view.said.text() == TOO_OLD
    assert not view.cards[0].isVisible()


def test_the_last_line_has_the_worst_bus(bar: StatusBar, bench: Bench) -> None:
    bar.refresh()
    assert bar.bus.text() == "bus not known"
    assert bar.computer.text() == "robot CPU – · memory –"
    bench.station.take([BusesSeen((replace(BUS, load_percent=100.0),), time.monotonic_ns())])
    bar.refresh()
    assert bar.bus.text() == "CAN main 100 %, 4 errors: it is full · 89 % of its frames are from left knee"
    assert bar._bus_icon.accessibleName() == "bus full"


def test_no_bus_is_good_on_the_last_line_where_nothing_new_comes(bar: StatusBar, bench: Bench) -> None:
    good = replace(BUS, load_percent=13.0, findings=(), nodes=())
    busy = replace(good, load_percent=85.0)
    bench.station.take([walking(10, 70.0), BusesSeen((busy,), time.monotonic_ns())])
    bar.refresh()
    assert bar.bus.text() == "bus not known", "nor is a warning of before shown as one of now"
    for age_s, said in ((70.0, "bus not known"), (0.0, "CAN main 13 %")):
        bench.station.take([walking(10, age_s), BusesSeen((good,), time.monotonic_ns())])
        bar.refresh()
        assert bar.bus.text().startswith(said), age_s


def test_page_and_alarms_tell_of_a_full_bus_in_the_same_frame(window: MainWindow, bench: Bench) -> None:
    bench.draw(window)
    window.tabs.setCurrentIndex(3)
    for before in range(1, SLOW):
        for load in (41.0, 100.0):
            for _ in range(before):
                window.refresh()
            bench.station.take([BusesSeen((replace(BUS, load_percent=load),), time.monotonic_ns())])
            for _ in range(SLOW):
                window.refresh()
                on_page = (
                    "FULL" in window.tabs.buses.cards[0].load.text() if window.tabs.buses.cards else False
                )
                assert on_page is any(TAKEN in text for text in window.alarms.texts), (before, load)
    assert on_page


def test_page_and_last_line_give_one_fact_one_severity(
    view: BusHealthView, bar: StatusBar, bench: Bench
) -> None:
    known = described().description
    parts = [
        replace(one, device={"node_id": 2, "bus": "main"}) if one.name == "left_knee" else one
        for one in known.components
    ]
    lost: QualityInfo = {"state": "lost", "age_ms": 900.0, "problem": "its heartbeat is missing"}
    whole = looked()
    bench.station.take([Described(replace(known, components=parts)), walking(50)])
    bench.look_again([Looked(Snapshot(0, {}, {}, {"left_knee": lost}), whole.parameters, whole.at_ns)])
    errors = FindingInfo(1, "32 error frames in the last 10 s", "check termination")
    show(view, bench, replace(BUS, nodes=[replace(NODE, pdos_missing_percent=4.4)]))
    show(view, bench, replace(BUS, findings=[errors], nodes=[NODE]))  # none is missing any more
    first, *others = spaced(view.said.text()).splitlines()
    assert first.startswith("lost: left knee")
    assert others == [
        "bus trouble: main: 32 error frames in the last 10 s; left knee: 4 % of its PDOs are missing"
    ]
    assert {first, *others} == {alarm.line for alarm in bench.station.alarms.each}, "words of its own"
    assert row(view, 0)[-1] == "4.4 %", "the table says of a node what the line above says of it"
    assert view.cards[0]._bar._colour == "accent", "the load is as good as ever"
    bar.refresh()
    lost_mark = TEXTS[Kind.LOST].mark
    assert bar._bus_icon.mark == view.cards[0]._icon.mark == lost_mark, "one state has one mark"
    assert row(view, 0)[STATE] == "✕ lost"
    assert bar.bus.text() == "CAN main 41 %: lost left knee"


def test_whose_state_it_is_stands_with_it(view: BusHealthView, bench: Bench) -> None:
    """It is the gateway's own controller that is not bus off; of nodes nobody knows that."""
    bench.station.take([walking(1)])
    show(view, bench, BUS)
    said = "gateway's CAN controller: error active (normal), never bus off, opened once"
    assert view.cards[0]._controller.accessibleDescription() == said
    off = replace(BUS, state="bus off", bus_offs=2, opened=3)
    assert (
        controller_text(off, live=True)
        == "gateway's CAN controller: bus off, 2 times bus off, opened 3 times"
    )
    assert "error active" not in view.cards[0].note


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_columns_go_before_a_name_is_cut(
    view: BusHealthView, bench: Bench, theme: Theme, scale: float
) -> None:
    """In the narrowest page hip and knee are still told apart."""
    theme.set(scale=scale)
    names = ("left_hip", "left_knee", "right_ankle")
    nodes = [
        replace(NODE, node_id=place, components=[name], pdos_missing_percent=3.5)
        for place, name in enumerate(names, 1)
    ]
    talks = [*(TalkInfo("TPDO", node.node_id, 250.0) for node in nodes), TalkInfo("SYNC", None, 100.0)]
    view.resize(470, 700)
    QApplication.processEvents()
    show(view, bench, replace(BUS, nodes=nodes, talks=talks))
    QApplication.processEvents()
    show(view, bench, replace(BUS, nodes=nodes, talks=talks))
    table = view.cards[0].table
    assert table.columnWidth(SENDER) >= table.sizeHintForColumn(SENDER)
    assert table.columnWidth(SENDER) >= table.horizontalHeader().sectionSizeHint(SENDER)
    shown = [column for column in range(table.columnCount()) if not table.isColumnHidden(column)]
    assert {SENDER, STATE} <= set(shown)
    assert row(view, 0)[STATE] == "✕ PDOs missing", "mark and word stay together"
    assert sum(map(table.columnWidth, shown)) <= table.viewport().width()


@pytest.mark.parametrize("width", [200, 600])
def test_the_marks_of_the_load_are_named(theme: Theme, width: int) -> None:
    bar = LoadBar(theme)
    bar.resize(width, bar.sizeHint().height())
    busy, full = bar.marks
    assert "busy" in busy
    assert "80 %" in busy
    assert "full" in full
    assert "95 %" in full
    destroy(bar)


@pytest.mark.parametrize("width", [1024, 1366, 1920])
def test_a_busy_desk_computer_is_told_on_the_last_line_and_nothing_there_is_cut(
    bar: StatusBar, bench: Bench, theme: Theme, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setattr(bench.station, "is_full", lambda: True)
    theme.set(scale=1.5)
    bar.resize(width, bar.height())
    bench.station.take([walking(10), BusesSeen((BUS,), time.monotonic_ns())])
    bar.refresh()
    QApplication.processEvents()
    assert "▲" in bar._window.shown
    assert "fps" in bar._window.shown
    assert rules.halved_numbers(bar) == []
    assert bar._window.is_whole


@pytest.mark.parametrize(
    ("apart_s", "said"),
    [(0.04, ("25 fps",)), (0.5, ("busy", "2 fps")), (3.0, ("busy", "<1 fps")), (9.0, ("busy", "<1 fps"))],
)
def test_few_frames_a_second_are_a_busy_computer_on_the_last_line(
    bar: StatusBar, bench: Bench, apart_s: float, said: tuple[str, ...]
) -> None:
    """It said 0 fps, and nothing of the computer."""
    bench.station.is_full = bench.desk.frames.is_slow
    for place in range(20):
        bench.desk.frames.count(apart_s * place)
    bar.resize(1366, bar.height())
    bar.refresh()
    assert all(word in bar._window._wordings[0] for word in said)
    is_busy = "busy" in said
    assert all("busy" in wording for wording in bar._window._wordings[:2]) is is_busy
    assert all("▲" in wording for wording in bar._window._wordings) is is_busy


def test_frames_are_slow_for_a_while_but_not_as_the_window_opens() -> None:
    rate, now_s = FrameRate(), 0.0

    def draw(every_s: float, frames: int) -> bool:
        nonlocal now_s
        for _ in range(frames):
            now_s += every_s
            rate.count(now_s)
        return rate.is_slow()

    assert not draw(0.3, 10), "the window opens"
    assert not draw(0.033, 60)
    assert draw(0.2, 60)
    assert draw(1 / 9, 60), "it would flicker about its limit"
    assert not draw(0.033, 60)
    assert not draw(1 / 9, 60)


def test_the_page_of_the_window_lists_the_columns_and_the_order_in_which_they_go() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "window.md").read_text(encoding="utf-8")
    table = page.partition("| column | |\n|---|---|\n")[2].partition("\n\n")
    listed = [line.split("|")[1].strip() for line in table[0].splitlines()]
    assert tuple(listed) == TITLES
    order = re.findall(r"\*([^*]+)\*", table[2].partition("in this order: ")[2].partition("\n")[0])
    assert order == [TITLES[column] for column in SPARE]
