"""What was learned from the wearer is offered with what it is worth, and one click takes it back."""

import dataclasses
from collections.abc import Iterator

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from server_gui.core.desk.station import Station
from server_gui.core.prediction.adaptation import NEXT, AdaptationState, Adapting, Happening, Tried
from server_gui.views.confirmation import Question
from server_gui.views.frame.recording_chip import ask_name
from server_gui.views.overview.learned_offer import wordings
from server_gui.views.overview.page import Overview
from server_gui.views.predictions import LEARNED, lines
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.gui.foreseen import predicted
from tests.support.desk import looked, walking

HOUR_S = 3600.0
OFFERED = Adapting("exo-01", 7, AdaptationState.OFFERED, "P01", tried=Tried(3.4, 2.1, 34, (0.031, 0.002)))
STRIDE = predicted("stride", {"stride": 0.97}, "gait_phase", values={"left": 0.2, "right": 0.7})


@pytest.fixture
def station(bench: Bench) -> Station:
    """A robot that walks, whose data are not stale within a test."""
    bench.station.take([walking(300, -HOUR_S), looked()])
    return bench.station


@pytest.fixture
def overview(theme: Theme, bench: Bench) -> Iterator[Overview]:
    made = Overview(bench.desk, theme)
    made.show()
    yield made
    destroy(made)


def show(overview: Overview, station: Station, adapting: Adapting) -> list[str]:
    """Which buttons there are."""
    station.take_prediction(adapting)
    overview.read_now()
    overview.refresh()
    return [button.text() for button in overview.learned.buttons.values() if not button.isHidden()]


def test_an_offer_is_accepted_and_taken_back_with_a_click_each(
    overview: Overview, station: Station, bench: Bench
) -> None:
    said: list[tuple[str, int, Happening]] = []
    bench.desk.adapt = lambda *what: said.append(what)
    offer = overview.learned
    assert offer.isHidden()
    assert show(overview, station, OFFERED) == ["Use it", "No"]
    assert not offer.isHidden()
    assert "3.4 → 2.1 %" in offer.words.text()
    assert offer.accessibleDescription().startswith("learned from P01: 3.4 → 2.1 %")
    QTest.mouseClick(offer.buttons[Happening.ACCEPT], Qt.MouseButton.LeftButton)
    assert show(overview, station, dataclasses.replace(OFFERED, state=AdaptationState.SERVING)) == [
        "Take back"
    ]
    QTest.mouseClick(offer.buttons[Happening.TAKE_BACK], Qt.MouseButton.LeftButton)
    name = station.name
    assert said == [(name, 7, Happening.ACCEPT), (name, 7, Happening.TAKE_BACK)]
    assert show(overview, station, dataclasses.replace(OFFERED, state=AdaptationState.TAKEN_BACK)) == [
        "Learn again"
    ]
    show(overview, station, dataclasses.replace(OFFERED, state=AdaptationState.COLLECTING))
    assert offer.isHidden(), "there is nothing to decide"


def test_the_tip_says_how_often_each_was_wrong() -> None:
    wrong = "off by more than a tenth of the stride: 3.1 → 0.2 % of the time"
    assert OFFERED.tip == f"{OFFERED.text}\n{wrong}"
    unknown = Adapting("exo-01", 7, AdaptationState.OFFERED, "P01", tried=Tried(3.4, 2.1, 34))
    assert unknown.tip == unknown.text


def test_meanwhile_a_line_says_how_it_goes(station: Station) -> None:
    station.take_prediction(Adapting("exo-01", 1, AdaptationState.COLLECTING, "P01", 35.2))
    line = list(lines(station))[-1]
    assert (line.text, line.detail) == ("Learning 35 of 60 s", "from the steps of P01")
    station.take_prediction(Adapting("exo-01", 1, AdaptationState.UNNAMED))
    assert "name the wearer" in list(lines(station))[-1].detail
    station.take_prediction(Adapting("exo-01", 1, AdaptationState.OFF))
    assert not any("earn" in line.text for line in lines(station))
    assert LEARNED.keys() == set(AdaptationState) == NEXT.keys()


def test_the_model_that_has_learned_from_the_wearer_is_called_so(station: Station) -> None:
    station.take_prediction(dataclasses.replace(STRIDE, learned_from="P01"))
    line = next(line for line in lines(station) if line.text.startswith("Stride"))
    assert "learned from P01" in line.detail
    assert ", learned from P01, gait_phase-3fa2c1" in line.tip


def test_a_recording_is_begun_of_who_is_named(qt: QApplication) -> None:
    window = QWidget()
    window.show()
    begun: list[tuple[str, str]] = []
    ask_name(window, lambda *what: begun.append(what), "P01")
    ask_name(window, lambda *what: begun.append(what), "P01")  # it is asked once
    (question,) = window.findChildren(Question)
    name, wearer = question.findChildren(QLineEdit)
    assert (name.accessibleName(), wearer.text()) == ("Name of the recording", "P01")
    name.setText("stairs")
    wearer.setText(" P02 ")
    question.act.click()
    assert begun == [("stairs", "P02")]
    destroy(window)


@pytest.mark.parametrize(
    ("state", "word"),
    [
        (AdaptationState.NO_BETTER, "No better"),
        (AdaptationState.SERVING, "erve"),
        (AdaptationState.TAKEN_BACK, "aken back"),
    ],
)
def test_however_little_room_there_is_figures_are_not_taken_for_better(
    state: AdaptationState, word: str
) -> None:
    one = dataclasses.replace(OFFERED, state=state, wearer="Participant-0017")
    assert all(word in text or word.lower() in text for text in wordings(one)), wordings(one)
    assert len(wordings(one)[-1]) < 12
