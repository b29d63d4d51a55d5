"""Unknown is never shown as good, nor as zero."""

import time
from collections.abc import Callable

import pytest
from PySide6.QtGui import QImage

from gateway.client import ConnectionState
from server_gui.core.desk.soles import cells_of
from server_gui.core.follow.events import LinkChanged
from server_gui.views.header import _WORDS
from server_gui.views.theme import Theme
from server_gui.views.widgets.pressure_map import PressureMap
from tests.gui.fakes import Bench, destroy
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


@pytest.mark.parametrize("happened", [_never_reached, _nothing_came, _link_lost])
def test_nothing_in_the_header_is_green_where_nothing_is_known(
    bench: Bench, happened: Callable[[Bench], None]
) -> None:
    happened(bench)
    station = bench.desk.selected
    assert station is not None
    shown = {name: words(station) for name, words in _WORDS.items()}
    green = {name: said for name, said in shown.items() if said[0].colour == "good"}
    assert green.keys() <= ({"link"} if happened is _nothing_came else set())
    assert "every component is ok" not in str(shown)
    assert shown["drives"][2].startswith("–/")
    assert shown["warnings"][1] == "Warnings not known"


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
    assert not foot.is_missing
    assert foot.missing == (0,)
    assert pictures["lost"] != pictures["empty"]
    assert pictures["one"] != pictures["empty"]
    destroy(foot)
