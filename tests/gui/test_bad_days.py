"""Bad days: each has a calm message that says what is so and what to do, and nothing stops being updated."""

import errno
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox, QWidget

from gateway.client import ConnectionState
from gateway.wire.component import LayoutInfo
from server_gui.app import App
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.news import NewsKind
from server_gui.core.settings.server_file import ServerSettings, add_robots
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.overview.page import Overview
from server_gui.views.refresh_rate import SLOW
from server_gui.views.theme import Theme
from server_gui.views.widgets.files import ask_open, ask_save
from server_gui.views.workspace.page import Signals
from tests.fake_robot import FakeRobot
from tests.gui.fakes import Around, Bench, destroy
from tests.gui.running import running, wait
from tests.support.desk import HELD, described, looked, telemetry, walking

HOUR_S = 3600.0


def texts(window: MainWindow) -> dict[str, str]:
    """What each chip of the header says."""
    return {name: chip.toolTip() for name, chip in window.header._chips.items()}


def said(bench: Bench, kind: NewsKind) -> list[str]:
    return [item.text for item in bench.desk.news.items if item.kind is kind]


def shown(window: MainWindow, so: Callable[[], bool], what: str) -> None:
    """Draw until it is shown: what people read changes five times a second."""

    def drawn() -> bool:
        window.refresh()
        return so()

    wait(drawn, what)


def test_a_robot_that_was_gone_for_an_hour_says_so_and_is_live_again(
    window: MainWindow, bench: Bench
) -> None:
    station = bench.station
    bench.look_again([walking(300, age_s=HOUR_S)])
    bench.look_again([LinkChanged(ConnectionState.WAITING, "no route to 192.0.2.7", time.monotonic_ns())])
    bench.draw(window)
    assert texts(window)["link"].startswith("No link · 60 min old")
    assert "no route to 192.0.2.7" in texts(window)["link"]
    assert texts(window)["status"].startswith("Activity not known")
    shown(window, lambda: window.tabs.overview.notes[4] == "STALE, 60 min old", "said how old the curves are")
    assert len(said(bench, NewsKind.LINK)) == 1, "an hour of attempts is told once"
    bench.look_again([LinkChanged(ConnectionState.CONNECTED, None, time.monotonic_ns()), described()])
    bench.look_again([walking(300, age_s=-HOUR_S)])
    shown(window, lambda: "Hz" in texts(window)["link"], "said that it is live")
    shown(window, lambda: "STALE" not in window.tabs.overview.notes[4], "showed the curves as live")
    assert np.isnan(station.rings.values("left_hip.position", 301)[0]), "a line is drawn over the hour"


def test_two_robots_with_one_name_are_told_apart_wherever_they_are_named(
    around: Around, bench: Bench
) -> None:
    other = bench.add("second", 7421)
    other.take([described("exo-01")])
    bench.draw(around)
    assert [card.texts[0] for card in around.robots.cards] == [
        "exo-01 at 127.0.0.1:7420",
        "exo-01 at 127.0.0.1:7421",
    ]
    assert around.header.stop.text() == "STOP  exo-01 at 127.0.0.1:7420"
    newest = around.events.lines[len(around.events.pinned)]
    assert newest.robot == "exo-01 at 127.0.0.1:7421"
    assert "give one another [robot] name" in bench.desk.news.items[0].text
    around.header.stop.pressed.emit()
    other.take([described("exo-02")])
    bench.draw(around)
    assert around.header.stop.text() == "STOP  exo-01"


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as made:
        yield made


@pytest.fixture
def old(qt: QApplication, robot: FakeRobot, tmp_path: Path) -> Iterator[App]:
    """A window on one robot whose gateway speaks an older protocol, and on one that is well."""
    robot.protocol = 0
    with FakeRobot() as well:
        settings = add_robots(ServerSettings(), {"old": robot.address, "well": well.address})
        kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
        with running(qt, settings, kept) as app:
            yield app


def test_a_gateway_of_an_older_protocol_is_named_and_disturbs_no_other(old: App, robot: FakeRobot) -> None:
    ancient, well = old.desk.stations
    wait(lambda: ancient.robot.link.problem is not None, "was refused")
    wait(lambda: not well.robot.is_stale(), "showed the other")
    for _ in range(7):
        old.tick()
    problem = f"{robot.address} speaks protocol 0, this program speaks 1; update the older of the two"
    assert old.window.robots.cards[0].texts[1] == f"never reached: {problem}"
    assert old.window.header.isVisible()
    robot.protocol = 1
    wait(lambda: not ancient.robot.is_stale(), "showed it once it was updated")


def test_a_gateway_whose_description_cannot_be_read_says_why_and_is_asked_again(
    qt: QApplication, robot: FakeRobot, tmp_path: Path
) -> None:
    robot.overrides["robot.describe"] = lambda _params: {"robot": "exo-old", "parts": []}
    settings = add_robots(ServerSettings(), {"old": robot.address})
    with running(qt, settings, QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)) as app:
        station = app.desk.stations[0]
        wait(lambda: station.robot.last_failure is not None, "told the failure")
        wait(lambda: any("robot.describe" in item.text for item in app.desk.news.items), "said it")
        del robot.overrides["robot.describe"]
        wait(lambda: not station.robot.is_stale(), "followed it all the same")


def test_parameters_that_a_new_firmware_no_longer_has_go_with_what_was_to_be_written(
    window: MainWindow, bench: Bench
) -> None:
    station = bench.station
    bench.look_again([looked()])
    window.parameters.stage_text("gait.trunk_angle", "5")
    window.parameters.stage_text("gait.step_length", "430")
    window.parameters.begin_review()
    fewer = {name: value for name, value in HELD.items() if name != "gait.trunk_angle"}
    bench.look_again([described(parameters=fewer), looked(fewer)])
    bench.draw(window)
    assert [change.name for change in window.parameters.review.changes] == ["gait.step_length"]
    assert any("no longer has gait.trunk_angle" in text for text in said(bench, NewsKind.WARNING))
    station.writing.undo.append({"gait.trunk_angle": 0.05, "gait.step_length": 0.41})
    station.stage_undo()
    assert list(station.edits.staged) == ["gait.step_length"]
    assert any("gait.trunk_angle is not undone" in text for text in said(bench, NewsKind.WARNING))


def test_an_insole_that_nobody_describes_is_said_to_be_drawn_in_order(theme: Theme, bench: Bench) -> None:
    bench.station.take([described(cells=7), walking(20, -HOUR_S, cells=7)])  # not stale within this test
    overview = Overview(bench.desk, theme)
    overview.resize(1000, 800)
    overview.show()

    def note() -> str:
        overview.read_now()
        overview.refresh()
        return overview.notes[2]

    order = "7 cells in their order: the robot does not say where they are"
    wait(lambda: note().startswith(order), "said that nobody describes it")
    bench.station.take(
        [described(cells=7, layout=LayoutInfo("seven", [(0.03 * n, 0.0, 1e-3) for n in range(7)]))]
    )
    wait(lambda: note() == "7 cells, seven", "took the layout")
    destroy(overview)


def test_what_is_asked_about_files_stands_in_nobody_s_way(qt: QApplication, tmp_path: Path) -> None:
    window = QWidget()
    window.show()
    path, chosen = tmp_path / "walk.csv", list[Path]()
    path.write_text("before", encoding="utf-8")
    dialogs = [
        ask_save(window, "Export", "csv", chosen.append, "walk"),
        ask_open(window, "Open", ("csv",), chosen.append),
    ]
    assert not any(dialog.isModal() for dialog in dialogs)
    assert all(dialog.testOption(QFileDialog.Option.ReadOnly) for dialog in dialogs), "Qt would ask, and wait"
    dialogs[0].fileSelected.emit(str(path))
    box = window.findChild(QMessageBox)
    assert isinstance(box, QMessageBox)
    assert box.isVisible()
    assert QApplication.activeModalWidget() is None
    assert chosen == []
    box.buttons()[0].click()
    assert chosen == [path]
    for dialog in dialogs:
        dialog.close()
    destroy(window)


@pytest.mark.parametrize("kind", ["csv", "png"])
def test_a_full_disk_keeps_the_export_that_was_there_and_says_so(
    theme: Theme, bench: Bench, tmp_path: Path, kind: str
) -> None:
    bench.station.take([walking(50)])
    signals, path = Signals(bench.desk, theme), tmp_path / f"walk.{kind}"
    signals.resize(900, 600)
    signals.show()
    signals.refresh()
    signals.export(signals.save_csv if kind == "csv" else signals.save_png, path)
    before = path.read_bytes()

    def full(part: Path) -> None:
        part.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    signals.export(full, path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.glob("walk*")] == [path.name]
    bench.station.take([telemetry([time.monotonic_ns()], {"left_hip.position": [0.1]})])
    for _ in range(SLOW + 1):
        signals.refresh()
    assert f"NOT SAVED as {path.name}: No space left on device" in signals.said.text()
    assert "rows/s" in signals.said.text()
    destroy(signals)
