"""Unknown is never shown as good, nor as zero."""

import time
from collections.abc import Callable

import pytest
from PySide6.QtGui import QImage

from gateway.client import ConnectionState
from server_gui.core.desk.soles import cells_of
from server_gui.core.follow.events import LinkChanged
from server_gui.views.alarms.words import BUSY, quiet
from server_gui.views.frame.header import _WORDS
from server_gui.views.predictions import lines
from server_gui.views.theme import Theme
from server_gui.views.widgets.pressure_map import (
    BEHIND_M,
    COLUMNS,
    LENGTH_M,
    ROWS,
    STEPS,
    WIDTH_M,
    PressureMap,
)
from tests.gui.fakes import Bench, destroy
from tests.gui.foreseen import predicted
from tests.support.desk import described, looked, walking


def _never_reached(bench: Bench) -> None:
    lost = LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())
    bench.add("exo-02", 7421).take([lost])
    bench.desk.select(bench.desk.stations[-1])


def _nothing_came(bench: Bench) -> None:
    bench.station.take([described()])


def _link_lost(bench: Bench) -> None:
    bench.station.take([described(), walking(100), looked()])
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())])


def test_no_alarm_on_a_full_computer_is_not_called_all_ok(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.station.take([described(), walking(100), looked()])
    bench.station.predictions.foresees = False
    assert quiet(bench.station)[0].colour == "dim", "how many rows come is not known yet"
    monkeypatch.setattr(type(bench.station.robot), "has_rate", lambda *_: True)
    monkeypatch.setattr(type(bench.station.robot), "is_slow", lambda *_: False)
    assert quiet(bench.station)[2] == "all ok"
    bench.station.take_prediction(predicted("abnormal", {"walk": 0.41}, novelty=11.1))
    assert quiet(bench.station)[0].colour == "warn", "somebody who falls is like nothing that it knows"
    assert "look at the wearer" in quiet(bench.station)[2]
    bench.station.predictions.clear()
    bench.station.is_full = lambda: True
    mark, headline, why = quiet(bench.station)
    assert (mark.colour, headline) == ("warn", "This computer is busy")
    assert why == BUSY


@pytest.mark.parametrize("happened", [_never_reached, _nothing_came, _link_lost])
def test_nothing_in_the_header_is_green_where_nothing_is_known(
    bench: Bench, happened: Callable[[Bench], None]
) -> None:
    happened(bench)
    station = bench.desk.selected
    assert station is not None
    shown = {name: words(station) for name, words in _WORDS.items()}
    green = {name: said for name, said in shown.items() if said.mark.colour == "good"}
    assert green.keys() <= ({"link"} if happened is _nothing_came else set())
    assert "all ok" not in str(shown)
    assert shown["drives"].parts[0].startswith("– of ")
    assert quiet(station)[1] != "No alarms"


@pytest.mark.parametrize(("label", "gone"), [("steady", "not known"), ("fall", "Fall 99 %")])
def test_balance_is_not_known_while_nothing_new_comes_but_a_fall_stays(
    bench: Bench, label: str, gone: str
) -> None:
    for age_s, said in ((70.0, gone), (0.0, f"{label.capitalize()} 99 %")):
        bench.station.take([described(), walking(100, age_s), looked()])
        bench.station.take_prediction(predicted("walk", {"walk": 0.99}))
        bench.station.take_prediction(predicted(label, {label: 0.99}, "falling"))
        assert f"Balance: {said}" in [line.text for line in lines(bench.station)]


def test_a_sole_that_is_lost_is_hatched_and_one_without_load_is_not(theme: Theme) -> None:
    foot = PressureMap(theme, "left")
    foot.resize(120, 240)
    foot.set_cells(cells_of(16, right=False))
    pictures: dict[str, QImage] = {}
    given: dict[str, list[float | None]] = {
        "empty": [0.0] * 16,
        "lost": [None] * 16,
        "one": [None, *[0.0] * 15],
    }
    for name, pressures in given.items():
        foot.show_pressures(pressures, None, live=True)
        pictures[name] = foot.grab().toImage()
    assert foot.missing == (0,)
    (x, y), *_ = cells_of(16, right=False) or ()
    assert _drawn(foot, x, y) == STEPS  # which is transparent
    assert _drawn(foot, 0.2, -0.01) < STEPS
    assert pictures["lost"] != pictures["empty"]
    assert pictures["one"] != pictures["empty"]
    foot.show_pressures([None, *[200_000.0] * 15], None, live=True)
    full = foot._image.copy()
    foot.show_pressures([200_000.0] * 16, None, live=True)
    assert _least(full) >= _least(foot._image)  # a cell without a value takes nothing from its neighbours
    destroy(foot)


def test_cells_without_a_place_are_bars_and_a_lost_one_is_none(theme: Theme) -> None:
    foot = PressureMap(theme, "left")
    foot.resize(120, 240)
    foot.set_cells(None)
    given: list[list[float | None]] = [[0.0, 9e4], [None, 9e4], [None, None]]
    pictures = []
    for pressures in given:
        foot.show_pressures(pressures, None, live=True)
        pictures.append(foot.grab().toImage())
    assert pictures[0] != pictures[1] != pictures[2] != pictures[0]
    destroy(foot)


def _drawn(foot: PressureMap, x: float, y: float) -> int:
    """The place in the table of colours at x forward and y to the left, in m."""
    down = (LENGTH_M - BEHIND_M - x) / LENGTH_M * ROWS
    across = (WIDTH_M / 2 - y) / WIDTH_M * COLUMNS
    return foot._image.pixelIndex(int(across), int(down))


def _least(image: QImage) -> int:
    """The lowest place that is drawn above the heel's middle, where there are cells all around."""
    middle = [image.pixelIndex(COLUMNS // 2, row) for row in range(ROWS // 3, ROWS - ROWS // 10)]
    return min(place for place in middle if place < STEPS)


def test_balance_is_not_judged_before_the_activity_is_known_nor_without_the_model_s_sensors(
    bench: Bench,
) -> None:
    """It said Steady 100 % beside Activity not known."""

    def balance() -> str:
        return next(line.text for line in lines(bench.station) if line.text.startswith("Balance"))

    bench.station.take([described(), walking(10), looked()])
    bench.station.take_prediction(predicted("steady", {"steady": 1.0}, "falling"))
    assert balance() == "Balance: not judged"
    bench.station.take_prediction(predicted("walk", {"walk": 0.99}))
    assert balance() == "Balance: Steady 100 %"
    bench.station.take([looked(state="lost", problem="no heartbeat")])
    assert balance() == "Balance: not judged"
    bench.station.take_prediction(predicted("fall", {"fall": 0.97}, "falling"))
    assert balance() == "Balance: Fall 97 %", "a warning of a fall stays"
