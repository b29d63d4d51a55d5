"""Where the overview has no room for everything, its sections are on pages, each of them whole."""

import dataclasses

import msgspec
import pytest
from PySide6.QtWidgets import QScrollArea

from gateway.wire.component import QualityInfo
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.overview.page import Overview
from server_gui.views.overview.sections import (
    ALL,
    JOINTS,
    PLOTS,
    REPLAYED,
    WEARER,
    Page,
    Section,
    arranged,
    name_of,
)
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Bench
from tests.support.desk import looked, walking

NEEDS = {Section.JOINTS: 190, Section.WEARER: 150, Section.PLOTS: 140}
LEAST_CURVES = 70  # pixels high, at text of 100 %


def scrolled(page: Overview) -> int:
    """How far it can be scrolled, down and across."""
    seen = page.parentWidget()
    area = None if seen is None else seen.parentWidget()
    assert isinstance(area, QScrollArea)
    return area.verticalScrollBar().maximum() + area.horizontalScrollBar().maximum()


def settle(window: MainWindow, bench: Bench) -> None:
    """Let docks and pages find their places."""
    for _ in range(3):
        bench.draw(window)
        rules.settle()


@pytest.mark.parametrize(
    ("room", "pages"),
    [
        (500, ALL),
        (380, (JOINTS | WEARER, JOINTS | PLOTS)),
        (340, (JOINTS, WEARER | PLOTS)),
        (240, (JOINTS, WEARER, PLOTS)),
        (0, (JOINTS, WEARER, PLOTS)),
    ],
)
def test_sections_that_have_room_together_are_on_one_page(room: int, pages: tuple[Page, ...]) -> None:
    assert arranged(NEEDS, room, bar=22, between=5) == pages
    assert frozenset.union(*pages) == ALL[0], "each is on some page"
    names = [name_of(page) for page in pages]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("room", "pages"), [(500, ALL), (380, (JOINTS, WEARER | PLOTS)), (240, (JOINTS, WEARER, PLOTS))]
)
def test_a_replay_has_its_joints_on_a_page_of_their_own(room: int, pages: tuple[Page, ...]) -> None:
    assert arranged(NEEDS, room, bar=22, between=5, offered=REPLAYED) == pages


def test_a_small_laptop_shows_all_of_the_overview_with_curves_that_can_be_read(
    window: MainWindow, bench: Bench
) -> None:
    window.resize(1366, 768)
    bench.station.take([walking(300), looked()])
    settle(window, bench)
    page = window.tabs.overview
    assert page.sections.isHidden()
    assert scrolled(page) == 0
    assert min(plot.plot._lines.height() for plot in page._plots) >= LEAST_CURVES


@pytest.mark.parametrize(
    ("width", "height", "names"),
    [
        (1366, 768, ["Joints and wearer", "Joints and plots"]),
        (1024, 700, ["■ Joints: left knee", "Wearer and plots"]),
    ],
)
def test_with_large_text_each_page_is_whole_and_a_joint_in_trouble_is_named_on_all_of_them(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, names: list[str]
) -> None:
    theme.set(scale=1.5)
    window.resize(width, height)
    bench.station.take([walking(300), looked(state="fault", problem="overcurrent, 0x2310")])
    page = window.tabs.overview
    settle(window, bench)
    for button, page_shown in zip(page.sections.buttons, page._pages, strict=False):
        button.click()
        bench.draw(window)
        rules.settle()
        assert page._page == page_shown
        assert scrolled(page) == 0
        assert page._joints.isVisible() is (Section.JOINTS in page_shown)
        assert [one.text() for one in page.sections.buttons if not one.isHidden()] == names
    said = page._wrong.text() if page._joints.isVisible() else page.sections.buttons[0].text()
    assert "left knee" in said


def test_the_chosen_page_stays_as_alarms_come_and_go_and_shows_what_is_so_now(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    bench.station.take([walking(300), looked()])
    page = window.tabs.overview
    settle(window, bench)
    assert page.sections.buttons[0].text() == "Joints"
    page.sections.buttons[1].click()
    assert page._page == WEARER | PLOTS
    assert page._plots[0].legend.text()
    bench.look_again([looked(state="fault", problem="overcurrent, 0x2310")])
    bench.draw(window)
    assert page._page == WEARER | PLOTS
    assert page._plots[0].isVisible()
    assert not page._joints.isVisible()


def test_an_insole_in_trouble_is_named_on_the_button_of_the_wearer(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    now = looked()
    lost: QualityInfo = {"state": "lost", "age_ms": 4000.0, "problem": "the port is gone"}
    quality = {**now.quality.quality, "left_insole": lost}
    wrong = dataclasses.replace(now, quality=msgspec.structs.replace(now.quality, quality=quality))
    bench.station.take([walking(300), wrong])
    page = window.tabs.overview
    settle(window, bench)
    assert page.sections.buttons[0].text() == "Joints"
    button = page.sections.buttons[1]
    assert button.text() == "✕ Wearer and plots: left insole"
    assert button.property("tone") == "bad"


@pytest.mark.parametrize("scale", [1.5, 2.0])
@pytest.mark.parametrize(("width", "height"), [(1024, 700), (1366, 768), (1920, 1080)])
def test_no_page_leaves_room_empty_and_joints_alone_have_higher_rows(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    window.resize(width, height)
    window.docks[0].hide()
    bench.station.take([walking(300), looked()])
    settle(window, bench)
    page = window.tabs.overview
    table = page._table
    for shown in page._pages:
        page._choose(shown)
        settle(window, bench)
        cards = [card for section in shown for card in page._cards[section]]
        last = max(card.geometry().bottom() + 1 for card in cards)
        assert last + page._grid.contentsMargins().bottom() == page.height(), "nothing is left below"
        if Section.JOINTS not in shown:
            continue
        rows = [table.rowHeight(row) for row in range(table.model().rowCount())]
        assert len(set(rows)) == 1, "none looks more important"
        is_fuller = rows[0] == theme.px(44) or table.viewport().height() - sum(rows) < 2 * len(rows)
        assert theme.px(19) <= rows[0] <= theme.px(44)
        assert is_fuller if shown == JOINTS else rows[0] == theme.px(19)
        assert scrolled(page) == 0


def test_few_joints_alone_have_rows_no_higher_than_the_eye_follows(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    theme.set(scale=1.5)
    window.resize(1024, 700)
    bench.station.take([walking(300), looked()])
    settle(window, bench)
    page = window.tabs.overview
    assert page._page == JOINTS
    model = page._model
    model.beginResetModel()
    model._joints, model._cells = model._joints[:2], model._cells[:2]
    model.endResetModel()
    rules.settle()
    assert [page._table.rowHeight(row) for row in range(2)] == [theme.px(44)] * 2
    assert page._table.geometry().top() < theme.px(60), "the rest is below"


def test_a_state_that_the_window_does_not_know_breaks_no_page(
    window: MainWindow, bench: Bench, theme: Theme
) -> None:
    """A gateway newer than the window may tell one."""
    theme.set(scale=1.5)
    window.resize(1024, 700)
    now = looked()
    new: QualityInfo = {"state": "hibernating", "age_ms": 4.0, "problem": "asleep"}
    quality = {**now.quality.quality, "trunk": new, "left_knee": new}
    wrong = dataclasses.replace(now, quality=msgspec.structs.replace(now.quality, quality=quality))
    bench.station.take([walking(300), wrong])
    settle(window, bench)
    assert window.tabs.overview.sections.isVisible()
