"""A robot is paired without a terminal; what one may not do is grey, and says why."""

import dataclasses
import itertools
import shutil
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton

from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.access.pairing import Candidate, Pairing
from gateway.client import Address, ConnectionState
from gateway.client.keys import keys_folder, pin_of
from gateway.connections.listeners import listen
from gateway.wire.pairing import Reply, link
from gateway.wire.robot import Hello
from gateway.wire.role import Role
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.robots.pairing import PairingDialog
from server_gui.views.robots.reset import ask_reset
from server_gui.views.theme import Theme
from tests.gui.fakes import Around, Bench, destroy
from tests.support.desk import described
from tests.support.waiting import until
from tests.unit.gateway import keyed as keys

CODE = "0123-4567-89AB-CDEF"
WRONG = "ZZZZ-ZZZZ-ZZZZ-ZZZZ"


class Shown:
    """A robot that shows `CODE`; somebody there confirms once the test says so."""

    def __init__(self, folder: Path) -> None:
        self.folder = AccessFolder(keys.keyed(folder, {}), {})
        self.listener = listen("127.0.0.1", 0)
        self.where = f"127.0.0.1:{self.listener.getsockname()[1]}"
        self._now_s = itertools.repeat(0.0)
        own = keys.pin(keys.ROBOT)
        self.pairing = Pairing(self.folder, self.listener, CODE, own, clock=lambda: next(self._now_s))
        self._pool = ThreadPoolExecutor(1)
        self.proved: Future[Candidate] = self._pool.submit(self.pairing.wait)

    def confirm(self) -> None:
        candidate = self.proved.result()
        changes.add(self.folder, "anna", candidate.der, Role.OPERATOR)
        candidate.answer(Reply(self.pairing.proof(candidate), "exo-07", 7499, "anna", "operator"))

    def close(self) -> None:
        self._now_s = itertools.repeat(1e9)
        self._pool.shutdown()
        self.listener.close()


@pytest.fixture
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shown]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    keys_folder().mkdir(parents=True)
    keys_folder().chmod(0o700)
    for file, name in zip(keys.pair("desk"), ("desk.key", "desk.crt"), strict=True):
        shutil.copy(file, keys_folder() / name)
    made = Shown(tmp_path)
    yield made
    made.close()


def turning(condition: Callable[[], bool]) -> Callable[[], bool]:
    def turned() -> bool:
        QApplication.processEvents()
        return condition()

    return turned


def ended(dialog: PairingDialog) -> None:
    until(turning(lambda: dialog.attempt is None), "it is known what came of it")


def test_a_robot_is_paired_by_address_and_code_and_followed(
    around: Around, bench: Bench, shown: Shown
) -> None:
    added: list[str] = []
    around.robots.added.connect(added.append)
    around.robots.address.setText(shown.where)
    around.robots.pair.click()
    (dialog,) = around.findChildren(PairingDialog)
    assert not dialog.isModal()
    assert dialog.address.text() == shown.where
    dialog.code.setText(CODE.lower())
    dialog.act.click()
    assert not dialog.act.isEnabled()
    assert "Waiting for confirmation on the robot" in dialog.said.text()
    around.header.stop.click()  # nothing of the window waits for it
    shown.confirm()
    ended(dialog)
    assert dialog.said.text() == "Paired with exo-07: it calls this desk anna, as operator."
    assert added == ["127.0.0.1:7499"]
    assert pin_of(Address("127.0.0.1", 7499)) == keys.pin(keys.ROBOT)


def test_a_link_that_is_pasted_as_an_address_opens_it(around: Around, shown: Shown) -> None:
    around.robots.address.setText(link(shown.where, CODE))
    QTest.keyClick(around.robots.address, Qt.Key.Key_Return)
    (dialog,) = around.findChildren(PairingDialog)
    dialog.act.click()
    shown.confirm()
    ended(dialog)
    assert dialog.said.property("tone") == "good"


@pytest.mark.parametrize(
    ("where", "code", "said"),
    [
        ("192.0.2.7", "12", "16 letters and digits"),
        ("gwrms://192.0.2.7", "", "HOST:PORT/CODE"),
    ],
)
def test_what_was_mistyped_is_named_and_nothing_sent(theme: Theme, where: str, code: str, said: str) -> None:
    window = PairingDialog(where=where)
    window.code.setText(code)
    window.act.click()
    assert said in window.said.text()
    assert window.attempt is None
    destroy(window)


def test_a_wrong_code_is_named_and_another_one_can_be_typed(around: Around, shown: Shown) -> None:
    dialog = around.robots.begin_pairing(shown.where)
    dialog.code.setText(WRONG)
    dialog.act.click()
    ended(dialog)
    assert "that is not the code which the robot shows" in dialog.said.text()
    assert dialog.act.isEnabled()
    dialog.code.setText(CODE)
    dialog.act.click()
    shown.confirm()
    ended(dialog)
    assert "Paired with exo-07" in dialog.said.text()


def test_who_cancels_waits_for_nothing_and_nothing_is_pinned(around: Around, shown: Shown) -> None:
    dialog = around.robots.begin_pairing(link(shown.where, CODE))
    dialog.act.click()
    candidate = shown.proved.result()
    attempt = dialog.attempt
    assert attempt is not None
    dialog.cancel.click()
    assert not dialog.isVisible()
    assert attempt.join(10.0)
    candidate.answer(Reply(shown.pairing.proof(candidate), "exo-07", 7499, "anna", "operator"))
    assert pin_of(Address("127.0.0.1", 7499)) is None


def test_a_window_that_closes_ends_its_pairing(window: MainWindow, shown: Shown) -> None:
    dialog = window.robots.begin_pairing(link(shown.where, CODE))
    dialog.act.click()
    candidate, attempt = shown.proved.result(), dialog.attempt
    assert attempt is not None
    window.close()
    assert attempt.join(10.0)
    candidate.answer(Reply(problem="too late"))


# What one may not


def greeted(bench: Bench, **more: Any) -> None:
    hello = Hello(1, "exo-01", "viewer", "boot-1", identity="anna", **more)
    bench.station.take([dataclasses.replace(described(), hello=hello)])


def test_what_one_may_not_is_grey_and_says_why_and_nothing_is_for_who_may_all_nor_stop(
    window: MainWindow, bench: Bench
) -> None:
    greeted(bench)
    window.parameters.stage("gait.step_length", 0.45)
    bench.draw(window)
    assert window.robots.cards[0].toolTip() == "You are anna, as viewer here."
    assert window.parameters.review_button.isEnabled()
    assert window.parameters.store_button.isEnabled()
    why = "anna is a viewer on this robot, and this is for an operator; ask one"
    methods = ("control.acquire", "parameter.write", "parameter.store", "robot.reset")
    greeted(bench, refused=dict.fromkeys(methods, why))
    bench.station.stopping.described(held=True, reason="test")
    bench.draw(window)
    parameters = window.parameters
    for button in (
        parameters.control._take,
        parameters.review_button,
        parameters.store_button,
        window.header.reset_button,
    ):
        assert not button.isEnabled()
        assert button.toolTip() == why
    assert parameters.control.words.text() == why
    question = ask_reset(window, bench.station)
    assert not question.act.isEnabled()
    assert question.words.text().startswith(why)
    assert window.header.stop.isEnabled()


def test_another_robot_s_key_is_said_loudly(around: Around, bench: Bench) -> None:
    why = "ANOTHER ROBOT ANSWERS AT 127.0.0.1:7420, or somebody in between: its key is 12, and that …"
    bench.look_again([LinkChanged(ConnectionState.WAITING, why, time.monotonic_ns(), is_another=True)])
    bench.draw(around)
    worst = bench.station.alarms.worst
    assert worst is not None
    assert worst.kind is Kind.ANOTHER
    assert around.robots.cards[0].texts[1].startswith("ANOTHER ROBOT ANSWERS")


def test_pairing_is_offered_once_there_is_something_to_pair_with(qt: QApplication) -> None:
    dialog = PairingDialog()
    assert not dialog.act.isEnabled()
    dialog.address.setText("127.0.0.1:7420")
    assert not dialog.act.isEnabled()
    dialog.code.setText(CODE)
    assert dialog.act.isEnabled()
    dialog.code.clear()
    dialog.address.setText(link("127.0.0.1:7420", CODE))
    assert dialog.act.isEnabled(), "the code is in the link"
    destroy(dialog)


def test_the_command_for_the_robot_is_copied_with_one_click(qt: QApplication) -> None:
    dialog = PairingDialog()
    copy = next(one for one in dialog.findChildren(QPushButton) if one.text() == "Copy")
    copy.click()
    assert QApplication.clipboard().text() == "sudo gwrms keys pair"
    destroy(dialog)
