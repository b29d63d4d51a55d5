"""Every view in every state: no green for the unknown, no half number, controls in reach and named."""

import re
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pyarrow as pa
import pytest
from deltalake import DeltaTable, write_deltalake

from gateway.client import ConnectionState, NotConnected
from gateway.wire.stop import Stopped
from server_gui.core.follow.events import LinkChanged
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.archives import Shown, play, record
from tests.gui.fakes import Bench, stop_is_whole
from tests.gui.test_screens import busy, live
from tests.support.desk import JOINTS, described, looked, walking

STRIDES = 300  # rows: three of them
LOST = "nothing came from 127.0.0.1:7420 for 3.0 s; the link is given up"


def _nothing_came(bench: Bench) -> None:
    bench.station.take([described()])


def _never_reached(bench: Bench) -> None:
    bench.add("exo-02", 7421)
    bench.desk.select(bench.desk.stations[-1])
    bench.desk.stations[-1].take([LinkChanged(ConnectionState.WAITING, "no gateway", time.monotonic_ns())])


def _link_lost(bench: Bench) -> None:
    live(bench, STRIDES)
    bench.look_again([looked(), LinkChanged(ConnectionState.WAITING, LOST, time.monotonic_ns())])


def _stale(bench: Bench) -> None:
    bench.look_again([walking(200, age_s=70.0), looked()])


def _walks(bench: Bench) -> None:
    live(bench, STRIDES)
    bench.look_again([looked()])


def _fault(bench: Bench) -> None:
    live(bench, STRIDES)
    bench.look_again([looked(state="fault", problem="overcurrent, 0x2310")])


def _stopped(bench: Bench) -> None:
    live(bench, STRIDES)
    bench.station.stop("STOP button of the window")
    bench.first.answer(Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True))


def _unconfirmed(bench: Bench) -> None:
    live(bench, STRIDES)
    bench.desk.stop_all("STOP ALL of the window")
    bench.first.fail(NotConnected(LOST))


def _stop_lost(bench: Bench) -> None:
    """STOP NOT CONFIRMED: nothing comes that would say whether it moves still."""
    _unconfirmed(bench)
    bench.look_again([LinkChanged(ConnectionState.WAITING, LOST, time.monotonic_ns())])


def _just_begun(bench: Bench) -> None:
    bench.look_again([walking(10), looked()])


def _two_robots(bench: Bench) -> None:
    busy(bench)
    live(bench, STRIDES)


@pytest.fixture(scope="session", autouse=True)
def _runtime(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What deltalake opens at its first use and keeps is no leak of whoever comes first."""
    table = tmp_path_factory.mktemp("first") / "table"
    write_deltalake(table, pa.table({"n": [1]}))
    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: DeltaTable(table).to_pyarrow_table()).result()
        pool.submit(lambda: DeltaTable.is_deltatable(f"{table}/none")).result()


UNKNOWN = (_nothing_came, _never_reached, _link_lost, _stale)
KNOWN = (_just_begun, _walks, _fault, _stopped, _unconfirmed, _stop_lost, _two_robots)
SIZES = ((1024, 700, 1.0), (1024, 700, 2.0), (1366, 768, 1.5))
# Of what this program does itself it may know that it is well.
OWN = ("link", "control", "Store", "recording")


@pytest.mark.parametrize("state", [*UNKNOWN, *KNOWN])
@pytest.mark.parametrize(("width", "height", "scale"), SIZES)
def test_every_view_in_every_state(
    request: pytest.FixtureRequest,
    bench: Bench,
    theme: Theme,
    state: Callable[[Bench], None],
    width: int,
    height: int,
    scale: float,
) -> None:
    theme.set(scale=scale)
    page: Shown = request.getfixturevalue("whole")
    full = request.getfixturevalue("full_window")
    full.setUpdatesEnabled(True)  # it is painted here, too
    full.resize(width, height)
    broken: list[str] = []
    for place in range(full.tabs.count()):
        state(bench)
        full.tabs.setCurrentIndex(place)
        for dock in full.docks if place == 0 else full.docks[:1]:
            dock.raise_()
            page.draw()
            rules.settle()
            where = f"{full.tabs.tabText(place).replace('&', '')}, {dock.windowTitle()}"
            if state in UNKNOWN:
                found = [f"green: {one}" for one in rules.green(full, theme) if not _is_own(one)]
                broken += [f"{where}: {one}" for one in found]
            broken += [f"{where}: {one}" for one in rules.broken(full)]
            if (full.width(), full.height()) != (width, height) or not stop_is_whole(full):
                broken.append(f"{where}: STOP is not whole")
    assert not broken, "\n".join(sorted(set(broken)))


@pytest.mark.parametrize(("width", "height", "scale"), SIZES)
def test_a_recording_in_its_views(
    request: pytest.FixtureRequest, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    theme.set(scale=scale)
    page: Shown = request.getfixturevalue("whole")
    full = request.getfixturevalue("full_window")
    record(request.getfixturevalue("settings"))
    full.setUpdatesEnabled(True)  # it is painted here, too
    full.resize(width, height)
    play(page, request.getfixturevalue("archive"))
    player = full.tabs.recordings.player
    for place in range(2):
        player._stack.setCurrentIndex(place)
        page.draw()
        rules.settle()
        # Its first row is shown, which says of the drives that they were enabled: that is known.
        broken = [
            *(one for one in rules.green(player, theme) if not re.search(r"joint|\(Drives\)", one, re.I)),
            *rules.broken(full),
        ]
        assert not broken, "\n".join(broken)
        assert stop_is_whole(full)


def _is_own(said: str) -> bool:
    return any(f"({name}" in said or f": {name}" in said for name in OWN)
