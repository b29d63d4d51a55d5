"""Six unknown drives become a robot in the window: as the scenario does by lines, and then it is followed."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from gateway.commission.dialogue import Ask
from server_gui.app import App
from server_gui.core.commissioning.stages import Stage
from server_gui.core.settings.prediction import PredictionSettings
from server_gui.core.settings.server_file import ServerSettings
from server_gui.processes.children import Child
from server_gui.views.commissioning.page import CommissionPage
from tests.gui.running import running, wait
from tests.scenario.processes import gwrms, nothing
from tests.scenario.test_commissioned_robot import PORTS, ready, unknown_robot
from tests.support.waiting import WAIT_S, until
from tests.unit.commission.person import Person, emergency_stop

pytestmark = pytest.mark.nightly  # it listens and watches for a minute

WITHIN_S = 600.0


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    made = tmp_path / "unknown"
    made.mkdir()
    with Child("simulator", unknown_robot(made)) as simulator:
        simulator.wait_ready(ready, WAIT_S, nothing)
        yield made


@pytest.fixture
def app(qt: QApplication, tmp_path: Path) -> Iterator[App]:
    kept = QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)
    settings = ServerSettings(prediction=PredictionSettings(enabled=False))
    with running(qt, settings, kept) as made:
        made.window.tabs.look_at_commissioning()
        yield made


def test_six_drives_are_commissioned_by_the_page_and_walk(app: App, folder: Path, tmp_path: Path) -> None:
    page, file = app.window.tabs.commission, tmp_path / "exo-01.toml"
    page.form.file.setText(str(file))
    page.form.bus.setEditText(str(folder / "robot.toml"))
    page.form.serial.setText(" ".join(str(folder / port) for port in PORTS))
    with emergency_stop(folder):
        QTest.mouseClick(page.form.start, Qt.MouseButton.LeftButton)
        answer_all(page, Person(folder))
    assert page.commissioning.stage is Stage.WRITTEN, list(page.commissioning.log)[-20:]
    assert gwrms("check", str(file)).returncode == 0
    assert {step.state for step in page.commissioning.steps} <= {"done", "passed"}
    QTest.mouseClick(page.result.connect_button, Qt.MouseButton.LeftButton)
    wait(lambda: app.desk.selected is not None and app.desk.selected.is_live, "it is followed")


def answer_all(page: CommissionPage, person: Person) -> None:
    """Read, move the joints by hand, click and type, until it has ended."""
    answered: list[int] = []

    def step() -> bool:
        question = page.commissioning.question
        if question is None or question.number in answered or not _can_be_clicked(page):
            return not page.commissioning.runs
        answered.append(question.number)
        typed = person.ask(Ask(question.ask or "", question.choices, question.default, question.unit))
        _answer(page, typed or question.default or "")
        return False

    until(step, lambda: list(page.commissioning.log)[-20:], WITHIN_S, lambda: QTest.qWait(50))


def _can_be_clicked(page: CommissionPage) -> bool:
    return page.question.isVisible() and page.question.send.isEnabled()


def _answer(page: CommissionPage, typed: str) -> None:
    question = page.commissioning.question
    assert question is not None
    if question.press or question.choices:
        choices = question.choices or ("",)
        place = choices.index(typed)
        QTest.mouseClick(page.question.buttons[place], Qt.MouseButton.LeftButton)
    else:
        page.question.field.setText(typed)
        QTest.keyClick(page.question.field, Qt.Key.Key_Return)
