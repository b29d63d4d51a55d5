"""A robot's card: whose its STOP is, how it is and what it does, in the words of the header."""

import time

import pytest
from PySide6.QtCore import Qt

from gateway.client import ConnectionState, NotConnected
from gateway.wire.stop import Stopped
from server_gui.core.follow.events import LinkChanged
from server_gui.views.confirmation import Question
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from server_gui.views.widgets.visibility import is_all_seen
from tests.gui import rules
from tests.gui.fakes import Around, Bench
from tests.gui.faulty import fault, settle
from tests.support.desk import JOINTS, described, looked, telemetry, walking


def test_each_stop_names_its_robot_and_all_says_all(around: Around, bench: Bench) -> None:
    other = bench.add("a-robot-with-quite-a-long-name-of-its-own", 7421)
    other.is_named = True
    other.take([described()])
    settle(around, bench)
    first, second = around.robots.cards
    assert first.stop.text() == "STOP  exo-01"
    assert second.stop.text().startswith("STOP  a-robot")
    assert second.stop.accessibleName() == "STOP a-robot-with-quite-a-long-name-of-its-own"
    assert around.robots.all_stop.text() == "STOP  ALL"


def test_a_card_says_what_its_robot_does_also_beside_an_alarm_and_nothing_of_the_past(
    around: Around, bench: Bench
) -> None:
    other = bench.add("exo-02", 7421)
    other.take([described(), walking(300), looked()])
    fault(bench)
    settle(around, bench)
    first, second = around.robots.cards
    assert first.texts[3].endswith("0 of 6 enabled")
    assert second.texts[3].endswith("6 of 6 enabled")
    assert second._doing.is_whole
    first.resize(200, first.height())
    assert "·" in first._doing.shown, (
        "what the wearer does is left out where there is room for it in few words"
    )
    other.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    settle(around, bench)
    assert second.texts[3] == "its activity is not known"


def test_a_card_has_the_same_word_as_the_header_where_it_is_narrow(window: MainWindow, bench: Bench) -> None:
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    settle(window, bench)
    assert window.width() >= 1300
    card = window.robots.cards[0]
    assert "STOP NOT CONFIRMED" in card._state.shown
    assert card._state.is_whole


def test_a_card_is_never_wider_than_its_list(window: MainWindow, bench: Bench) -> None:
    rows = walking(300)
    rows.batch.columns[f"{JOINTS[0]}.state"] = [None] * len(rows.batch.stamps_ns)
    bench.look_again([rows, looked()])
    window.resize(1366, 768)
    settle(window, bench)
    assert "not known" in window.robots.cards[0].texts[3]
    assert not list(rules.out_of_reach(window.robots))
    assert window.robots.cards[0]._doing.is_whole


def test_the_worst_state_is_never_cut_on_card_and_header(window: MainWindow, bench: Bench) -> None:
    bench.station.stop("test")
    bench.first.fail(NotConnected("there is no link"))
    for width in (1024, 1366, 1920):
        window.resize(width, 768)
        settle(window, bench)
        assert not list(rules.cut_states(rules.seen(window))), width


def test_an_empty_list_says_what_to_do(around: Around, bench: Bench) -> None:
    assert around.robots.none.isHidden()
    bench.desk.stations = []
    around.robots.refresh()
    assert not around.robots.none.isHidden()


def test_a_narrow_card_of_a_stopped_robot_says_by_how_many_drives_and_how_soon(
    around: Around, bench: Bench
) -> None:
    states: dict[str, list[float | None]] = {f"{joint}.state": [6.0] for joint in JOINTS}
    now_ns = time.monotonic_ns()
    bench.station.take([walking(10), looked(), telemetry([now_ns], states, now_ns)])
    stopping = bench.station.stopping
    stopping.answered(
        stopping.sent(at_ns=0), Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True), 14_000_000
    )
    settle(around, bench)
    (card,) = around.robots.cards
    assert "confirmed by all 6 drives in 14 ms" in card._state._wordings[0]
    assert "STOPPED 6/6 in 14 ms" in card._state._wordings


def test_a_long_name_is_whole_on_its_card_in_as_many_lines_as_it_needs(
    window: MainWindow, bench: Bench
) -> None:
    name = "exo-rehab-center-right-02"
    other = bench.add(name, 7421)
    other.is_named = True
    other.take([described(name)])
    window.resize(1366, 768)
    settle(window, bench)
    label = window.robots.cards[1]._name
    assert label.text().replace("\n", "") == name
    assert "\n" in label.text()
    assert label.accessibleName() == name
    widest = max(label.fontMetrics().horizontalAdvance(line) for line in label.text().split("\n"))
    assert widest <= label.width()
    assert label.height() >= label.fontMetrics().lineSpacing() * len(label.text().split("\n"))


def test_names_on_the_stops_of_two_cards_have_one_weight(window: MainWindow, bench: Bench) -> None:
    other = bench.add("simulated-exoskeleton", 7421)
    other.is_named = True
    window.resize(1366, 768)
    settle(window, bench)
    bench.draw(window)  # once they have their widths
    fonts = [card.stop._lines[1].bold() for card in window.robots.cards]
    assert fonts == [False, False], "the long one has no room in bold"
    other.name = "exo-2"
    settle(window, bench)
    bench.draw(window)
    assert all(card.stop._lines[1].bold() for card in window.robots.cards)


def test_stop_all_is_in_sight_beside_the_pages_where_the_list_of_robots_is_not(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    settle(window, bench)
    window.docks[0].hide()
    settle(window, bench)
    assert not window.stop_everyone.isVisible(), "there is one robot"
    bench.add("exo-02", 7421)
    settle(window, bench)
    assert window.stop_everyone.isVisible()
    for scale in (1.0, 1.5, 2.0):
        theme.set(scale=scale)
        bench.draw(window)
        assert window.stop_everyone.lines == ["ALL"], "STOP alone would be that of one robot"
        assert window.stop_everyone.is_whole
    asked: list[bool] = []
    window.stop_all.connect(lambda: asked.append(True))
    window.stop_everyone.pressed.emit()
    assert asked
    theme.set(scale=1.0)
    settle(window, bench)
    window.docks[0].show()
    for _ in range(2):  # the panel has its width in the frame after that in which it is shown
        settle(window, bench)
    assert not window.stop_everyone.isVisible()


def test_stop_all_is_whole_beside_the_pages_where_the_list_of_robots_is_narrow(
    window: MainWindow, bench: Bench
) -> None:
    window.resize(1366, 768)
    for place in range(2, 5):
        bench.add(f"exo-0{place}", 7420 + place).take([described(f"exo-0{place}"), walking(20), looked()])
    for _ in range(3):
        settle(window, bench)  # with each width of the window panels have their sizes again
    for wide, is_cut in ((60, True), (250, False)):
        window.resizeDocks(window.docks[:1], [wide], Qt.Orientation.Horizontal)
        for _ in range(3):
            settle(window, bench)
        assert is_all_seen(window.robots.all_stop) is not is_cut
        assert window.stop_everyone.isVisible() is is_cut


def test_a_robot_that_is_enabled_is_not_removed_without_saying_so(around: Around, bench: Bench) -> None:
    bench.station.take([walking(300), looked()])
    settle(around, bench)
    around.robots.cards[0].remove.click()
    (asked,) = around.findChildren(Question)
    assert asked.words.text().startswith("exo-01 walks: its STOP leaves this window.")
    asked.reject()
    bench.desk.remove(bench.station)
    newest = bench.desk.news.items[0]
    assert "removed while its drives were enabled; this window cannot stop it any more" in newest.text


@pytest.mark.parametrize("ends", ["acknowledged", "it is added again"])
def test_one_that_was_removed_while_enabled_stays_named_until_somebody_has_seen_to_it(
    around: Around, bench: Bench, ends: str
) -> None:
    bench.station.take([walking(300), looked()])
    bench.desk.remove(bench.station)
    settle(around, bench)
    strip = around.alarms
    assert (
        strip.headline.text()
        == "removed: exo-01: while its drives were enabled; this window cannot stop it any more"
    )
    assert "use the hardware stop" in strip.details.text()
    assert strip.property("tone") == "warn"
    other = bench.add("exo-02", 7421)
    other.take([walking(300), looked()])
    other.stop("test")
    bench.commands[-1].answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))
    settle(around, bench)
    assert any("removed: exo-01" in text for text in strip.texts), "an alarm of another one does not hide it"
    if ends == "acknowledged":
        strip.acknowledge(next(told for told in strip.told if told[1].alarm.where == "exo-01"))
    else:
        bench.add("exo-01", 7420).take([described("exo-01"), walking(300), looked()])
    settle(around, bench)
    assert not any("removed: exo-01" in text for text in strip.texts)
