"""The bus's view: a full bus is an alarm, what is not known is said so, and the last line names the worst."""

import time
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from gateway.wire.bus import BusInfo, NodeInfo, TalkInfo
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.finding import FindingInfo
from server_gui.core.follow.events import BusesSeen, Described, Looked
from server_gui.core.processing.bus_health import TAKEN
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.frame.status_bar import StatusBar
from server_gui.views.refresh_rate import SLOW
from server_gui.views.resources.bus_health import NOT_NOW, TOO_OLD, BusHealthView
from server_gui.views.theme import Theme
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


def test_load_counters_and_who_talks_stand_there(view: BusHealthView, bench: Bench) -> None:
    show(view, bench, BUS)
    assert view.cards[0].load.text() == "41 % of 1 Mbit/s"
    assert view.cards[0]._counters.accessibleDescription().startswith("1010 frames/s, 4 error frames")
    assert row(view, 0) == ["2", "left knee", "90 %", "900", "TPDO 900/s", "0.4 / 12.0 ms", "3", "0.0 %"]
    assert row(view, 1)[:4] == ["no known node", "", "10 %", "100"]
    assert not view.said.isVisible()


@pytest.mark.parametrize(("opened", "words"), [(1, "opened once"), (3, "opened 3 times")])
def test_how_often_it_was_opened_is_in_words(
    view: BusHealthView, bench: Bench, opened: int, words: str
) -> None:
    show(view, bench, replace(BUS, opened=opened))
    assert words in view.cards[0]._counters.accessibleDescription()


def test_a_full_bus_is_an_alarm(view: BusHealthView, bench: Bench) -> None:
    show(view, bench, replace(BUS, load_percent=100.0))
    assert view.said.text() == "ALARM: bus main: it is full: 100 % of its time is taken"
    assert view.checks.text().startswith("→ find what sends so much")
    assert view.checks.isVisible()
    assert view.said.property("tone") == "bad"
    assert view.cards[0]._icon.accessibleName() == "ALARM"
    show(view, bench, BUS)
    assert not view.said.isVisible()
    assert not view.checks.isVisible()
    assert view.cards[0]._icon.accessibleName() == "not known", "nothing new comes from the robot"
    bench.station.take([walking(1)])
    show(view, bench, BUS)
    assert view.cards[0]._icon.accessibleName() == "ok"


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
    assert bar.computer.text() == "CPU – · memory –"
    bench.station.take([BusesSeen((replace(BUS, load_percent=100.0),), time.monotonic_ns())])
    bar.refresh()
    assert bar.bus.text() == "CAN main 100 %, 4 errors: it is full · most: left knee 90 %"
    assert bar._bus_icon.accessibleName() == "ALARM"


def test_no_bus_is_good_on_the_last_line_where_nothing_new_comes(bar: StatusBar, bench: Bench) -> None:
    good = replace(BUS, load_percent=13.0, findings=(), nodes=())
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
    first, *others = view.said.text().splitlines()
    assert first.startswith("ALARM: lost: left knee")
    assert others == [
        "warning: bus main: 32 error frames in the last 10 s",
        "warning: bus main: left knee: 4 % of its PDOs are missing",
    ]
    assert row(view, 0)[-1] == "4.4 %", "the table says of a node what the line above says of it"
    assert view.cards[0]._bar._colour == "accent", "the load is as good as ever"
    bar.refresh()
    assert bar._bus_icon.accessibleName() == "ALARM"
    assert bar.bus.text() == "CAN main 41 %: lost left knee"
