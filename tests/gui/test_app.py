"""The whole window on a gateway over TCP: it follows, writes, stops, and lets go of everything at its end."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NoReturn

import msgspec
import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.wire.dictionary import ObjectList
from server_gui.app import App
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.desk.station import Station
from server_gui.core.settings.server_file import ServerSettings, add_robots
from server_gui.core.tuning.stop import StopState
from server_gui.core.tuning.writing import WriteState
from tests.fake_robot import FakeRobot
from tests.gui.running import running, wait
from tests.support.dictionaries import HOLDS, OBJECTS


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as made:
        yield made


@pytest.fixture
def app(qt: QApplication, robot: FakeRobot, tmp_path: Path) -> Iterator[App]:
    settings = add_robots(ServerSettings(), {"exo-01": robot.address})
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    with running(qt, settings, kept) as made:
        wait(lambda: bool(made.desk.stations[0].robot.parameters), "read the parameters")
        yield made


def test_a_value_goes_from_the_table_to_the_robot_on_trial_and_back_and_a_wrong_one_is_refused(
    app: App, robot: FakeRobot
) -> None:
    station = app.desk.stations[0]
    wait(lambda: not station.robot.is_stale(), "saw live data")
    app.window.parameters.stage_text("gait.step_length", "430")
    app.window.parameters.begin_review()
    wait(app.window.parameters.review.try_it.isEnabled, "let it be tried")
    QTest.mouseClick(app.window.parameters.review.try_it, Qt.MouseButton.LeftButton)
    wait(lambda: station.writing.trial is not None, "was on trial")
    assert robot.called("parameter.write") == [{"changes": {"gait.step_length": 0.43}, "trial_s": 30.0}]
    wait(lambda: station.robot.parameters["gait.step_length"].value == 0.43, "saw the new value")
    station.end_trial()
    wait(lambda: station.writing.trial is None, "went back")
    assert robot.parameters["gait.step_length"] == 0.4
    station.edits.stage("gait.step_length", 9.0, station.robot.parameters["gait.step_length"])
    station.write(station.difference(app.desk.shown.units))
    wait(lambda: station.writing.state is WriteState.FAILED, "was refused")
    assert "above 0.6" in station.writing.text
    assert robot.parameters["gait.step_length"] == 0.4


def test_stop_is_confirmed_by_the_robot_and_not_confirmed_without_one(app: App, robot: FakeRobot) -> None:
    station = app.desk.stations[0]
    QTest.mousePress(app.window.header.stop, Qt.MouseButton.LeftButton)
    wait(lambda: station.stopping.state is StopState.CONFIRMED, "confirmed the stop")
    robot.refuse()
    wait(lambda: not station.is_linked, "lost the link")
    app.stop("test")
    wait(lambda: station.stopping.state is StopState.NOT_CONFIRMED, "said that it was not confirmed")


@pytest.mark.parametrize("stop", [App.stop, App.stop_all])
def test_an_error_at_one_that_is_stopped_keeps_the_stop_from_no_other(
    app: App, robot: FakeRobot, monkeypatch: pytest.MonkeyPatch, stop: Callable[[App, str], None]
) -> None:
    """The robot that is commissioned came first, and its error was all that happened."""
    asked: list[str] = []

    def fail(*_: object) -> NoReturn:
        asked.append("commissioned")
        raise OSError("the pipe is closed")

    monkeypatch.setattr(Commissioning, "runs", True)
    monkeypatch.setattr(app.commissioning, "stop", fail)
    with pytest.raises(OSError, match="the pipe is closed"):
        stop(app, "test")
    station = app.desk.stations[0]
    wait(lambda: station.stopping.state is StopState.CONFIRMED, "confirmed the stop")
    assert len(robot.called("robot.stop")) == 1
    monkeypatch.setattr(Station, "send_stop", fail)
    monkeypatch.setattr(app.commissioning, "stop", lambda: asked.append("stopped"))
    with contextlib.suppress(OSError):
        stop(app, "test")
    assert asked[-1] == "stopped"


def test_a_robot_that_comes_back_is_followed_again_and_control_was_lost(app: App, robot: FakeRobot) -> None:
    station = app.desk.stations[0]
    station.take_control()
    wait(lambda: station.control.left_s() is not None, "had control")
    robot.refuse()
    wait(lambda: not station.is_linked and station.robot.is_stale(), "was stale")
    assert station.control.left_s() is None
    robot.listen()
    wait(lambda: station.is_linked and not station.robot.is_stale(), "was live again")


def test_processes_and_objects_are_asked_for_only_while_they_are_looked_at(
    app: App, robot: FakeRobot
) -> None:
    """But for the process that uses most, which costs a hundredth of the table's bytes."""
    wait(lambda: bool(robot.called("resource.snapshot")), "looked at the computer")
    asked = [params for params in robot.called("resource.snapshot") if params.get("processes", True)]
    assert [params for params in asked if params.get("limit") != 1 or params["include"]] == []
    app.window.tabs.setCurrentIndex(2)
    wait(lambda: app.window.tabs.resources.table.processes.rowCount() == 12, "showed the processes")
    told = msgspec.to_builtins(ObjectList("left_knee", list(OBJECTS)))
    robot.overrides["object.list"] = lambda _params: told
    robot.overrides["object.read"] = lambda params: {
        "component": params["component"],
        "values": {address: msgspec.to_builtins(HOLDS[address]) for address in params["objects"]},
    }
    wait(lambda: not app.desk.stations[0].robot.is_stale(), "saw live data")
    assert not robot.called("object.list")
    page = app.window.tabs.objects
    app.window.tabs.look_at(page)
    reading = app.desk.stations[0].objects.reading
    wait(lambda: len(reading.held) == len(OBJECTS), "read what is in sight")
    wait(lambda: page.count.text() == f"{len(OBJECTS)} objects, {len(OBJECTS)} read", "said so")
    app.window.tabs.setCurrentIndex(0)
    app.window.refresh()
    reads = len(robot.called("object.read"))
    rows = app.desk.stations[0].rings.newest_ns
    wait(
        lambda: (app.desk.stations[0].rings.newest_ns or 0) > (rows or 0) + 1_500_000_000,
        "went on for a while",
    )
    assert len(robot.called("object.read")) <= reads + 1, "what was under way"


def test_robots_are_added_and_left_while_the_window_runs_and_come_back_by_the_names_that_the_user_gave(
    app: App, robot: FakeRobot
) -> None:
    """Also when one is removed, and added again by its address alone."""
    with FakeRobot() as other:
        app.window.added.emit(f"second={other.address}")
        wait(lambda: app.desk.stations[1].is_linked, "followed the other")
        assert app.desk.selected is app.desk.stations[0]
        for station in app.desk.stations[:]:
            title, address = station.title, station.address
            app.window.removed.emit(station)
            wait(lambda: len(app.window.robots.cards) == 1, "left it")
            assert other.called("robot.stop") == robot.called("robot.stop") == []
            app.window.added.emit(address)
            wait(lambda: app.desk.stations[-1].is_linked, "followed it again")
            assert app.desk.stations[-1].title == title
        assert len({station.called for station in app.desk}) == 1
        assert "second" in [station.title for station in app.desk]
        (second,) = (station for station in app.desk if station.title == "second")
        other.refuse()
        wait(lambda: not second.is_linked, "lost the other")
    assert all(station.is_linked for station in app.desk if station is not second)


def test_the_simulator_that_is_offered_at_first_walks_in_the_window(qt: QApplication, tmp_path: Path) -> None:
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    with running(qt, ServerSettings(), kept) as app:
        wait(app.window.empty.isVisible, "offered it")
        app.window.empty.start.click()
        wait(lambda: app.desk.selected is not None, "started it")
        station = app.desk.stations[0]
        wait(lambda: station.title == "simulated-exo" and not station.robot.is_stale(), "was live")
        wait(lambda: station.processing.derived().gait.walking is True, "walked")
        assert app.demo is not None
        demo = app.demo
        app.stop("test")
        wait(
            lambda: station.stopping.held and not demo.walk.isEnabled(),
            "held the stop, and did not offer to walk",
        )
        station.reset()
        wait(lambda: not station.stopping.held and demo.walk.isEnabled(), "was reset, and offered to walk")
        assert set(_states(station)) == {"switch on disabled"}
        demo.walk.click()
        wait(lambda: set(_states(station)) == {"operation enabled"}, "was started by its own controller")


def _states(station: Station) -> list[str | None]:
    return [station.robot.word(f"{joint}.state") for joint in station.robot.names("joint")]
