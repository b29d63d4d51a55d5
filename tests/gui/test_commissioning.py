"""The page that commissions a robot: every state at every size, by keyboard, and nobody answers twice."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QLineEdit, QPushButton, QWidget

from gateway.commission import controller, joints
from server_gui.core.commissioning import messages
from server_gui.core.commissioning.request import SUFFIX
from server_gui.core.commissioning.stages import Stage
from server_gui.views.commissioning.bar import APART
from server_gui.views.commissioning.form import Form
from server_gui.views.commissioning.page import CommissionPage
from server_gui.views.confirmation import Question
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Look, Theme
from tests.gui import rules
from tests.gui.fakes import destroy
from tests.support import commissioning as playing
from tests.support.commissioning import BEND, EVERY, FILE, KNEE, WISH, Played, asks, lives

# What the page has of windows of 1024x700 and 1480x900.
SIZES = (
    (480, 470, 1.5, Look.LIGHT),
    (560, 420, 2.0, Look.DARK),
    (560, 520, 1.0, Look.DARK),
    (800, 600, 1.0, Look.LIGHT),
)
GOOD = {playing.was_written, playing.stop_confirmed}


@pytest.fixture
def page(qt: QApplication, theme: Theme, played: Played) -> Iterator[CommissionPage]:
    made = CommissionPage(played.model, theme)
    made.resize(900, 800)
    made.show()
    made.activateWindow()
    yield made
    destroy(made)


def draw(page: CommissionPage) -> None:
    for _ in range(3):
        page.refresh()
        QApplication.processEvents()


def click(page: CommissionPage, words: str) -> None:
    found = next(one for one in page.question.buttons if one.text() == words)
    QTest.mouseClick(found, Qt.MouseButton.LeftButton)


@pytest.mark.parametrize(("width", "height", "scale", "look"), SIZES)
def test_every_state_keeps_the_rules(
    qt: QApplication, theme: Theme, width: int, height: int, scale: float, look: Look
) -> None:
    theme.set(look, scale)
    broken = [
        f"{state.__name__}: {one}" for state in EVERY for one in shown_wrong(theme, state, width, height)
    ]
    assert not broken, "\n".join(sorted(set(broken)))


def shown_wrong(theme: Theme, state: Callable[[Played], None], width: int, height: int) -> Iterator[str]:
    """What of the rules one state does not keep."""
    played = Played()
    state(played)
    page = CommissionPage(played.model, theme)
    page.resize(width, height)
    page.show()
    draw(page)
    rules.settle()
    if state not in GOOD:
        yield from (f"green: {one}" for one in rules.green(page.bar, theme))
    yield from (f"half a number: {one}" for one in rules.halved_numbers(page))
    yield from (f"out of reach: {one}" for one in rules.out_of_reach(page))
    yield from (f"nameless: {one}" for one in rules.nameless(page))
    yield from (f"cut: {one}" for one in cut(page))
    stop = page.bar.stop
    if (page.width(), page.height()) != (width, height):
        yield f"the page wants {page.width()} x {page.height()}"
    if not page.rect().contains(stop.mapTo(page, stop.rect().bottomRight())) or "STOP" not in stop.text():
        yield "STOP is not whole"
    destroy(page)


def cut(page: QWidget) -> Iterator[str]:
    """Words of buttons and hints of fields that have no room."""
    for widget in rules.seen(page):
        if isinstance(widget, QAbstractButton):
            words = widget.text()
        elif isinstance(widget, QLineEdit):
            words = widget.text() or widget.placeholderText()
        else:
            continue
        if widget.fontMetrics().horizontalAdvance(words) > widget.width():
            yield words


def test_a_double_click_answers_one_question(page: CommissionPage, played: Played) -> None:
    played.start()
    played.hear(asks("Stand upright and still.", 1, press=True))
    draw(page)
    click(page, "Done")
    played.talker.says(asks("Lean forward.", 2, press=True))
    played.model.look()
    draw(page)
    click(page, "Done")  # grey, at the same place
    assert played.talker.told == ['{"answer":"","number":1}']
    played.now_s += 1.0
    draw(page)
    click(page, "Done")
    assert played.talker.told[1:] == ['{"answer":"","number":2}']


def test_all_of_it_goes_by_keyboard(page: CommissionPage, played: Played, tmp_path: Path) -> None:
    page.form.file.setFocus()
    QTest.keyClicks(page.form.file, str(tmp_path / "exo-01.toml"))
    bus = page.form.bus.lineEdit()
    assert bus is not None
    bus.setFocus()
    QTest.keyClicks(bus, "can0")
    QTest.keyClick(bus, Qt.Key.Key_Return)
    assert played.model.stage is Stage.STARTING
    assert played.talker.arguments[-2:] == [str(tmp_path / "exo-01.toml"), "can0"]
    draw(page)
    played.hear(KNEE)
    draw(page)
    assert QApplication.focusWidget() is page.question.field
    QTest.keyClicks(page.question.field, "12.5")
    QTest.keyClick(page.question.field, Qt.Key.Key_Return)
    played.hear(BEND)
    draw(page)
    assert QApplication.focusWidget() is page.question.buttons[0]
    QTest.keyClick(page.question.buttons[0], Qt.Key.Key_Return)
    assert played.talker.answers == ["12.5", "moved"]


def test_a_refusal_and_the_unit_stand_beside_the_field(page: CommissionPage, played: Played) -> None:
    playing.typing(played)
    draw(page)
    assert page.question.refused.isVisible()
    assert page.question.refused.text() == KNEE["refused"]
    assert page.question.news.text().startswith("left knee is node 7"), "and not the refusal again"
    assert KNEE["refused"] not in page.question.news.text()
    assert (page.question.unit.text(), page.question.range.text()) == ("°", "−180 to 360 °")
    assert page.question.live.texts == [("node 7", "−30500 counts · no power")]


def test_what_is_typed_stays_while_live_values_come(page: CommissionPage, played: Played) -> None:
    playing.typing(played)
    draw(page)
    QTest.keyClicks(page.question.field, "12")
    played.hear(lives(14, ("node 7", -30_400, "counts")))
    draw(page)
    assert page.question.field.text() == "12"


def test_what_is_typed_before_it_may_be_sent_stays_when_it_may(page: CommissionPage, played: Played) -> None:
    """It was selected at that moment, and the next key was instead of it: *exo-01* became *-01*."""
    played.start()
    played.talker.says(KNEE)
    played.model.look()
    draw(page)
    assert not page.question.send.isEnabled()
    page.question.field.setFocus()
    QTest.keyClicks(page.question.field, "12")
    played.now_s += 1.0
    draw(page)
    assert page.question.send.isEnabled()
    QTest.keyClicks(page.question.field, ".5")
    assert page.question.field.text() == "12.5"


def test_stop_is_sent_when_it_is_pressed_whatever_else_is_so(page: CommissionPage, played: Played) -> None:
    playing.working(played)
    draw(page)
    QTest.mousePress(page.bar.stop, Qt.MouseButton.LeftButton)
    assert played.talker.told == ['{"stop": true}']
    played.model.look()
    draw(page)
    assert page.bar.stage.text() == "STOP sent"


def test_return_is_a_stop_while_a_joint_is_under_power(page: CommissionPage, played: Played) -> None:
    playing.working(played)
    draw(page)
    QTest.keyClick(page, Qt.Key.Key_Return)
    assert played.talker.told == []
    played.hear({"moving": "The left knee is under power. STOP: Enter."})
    draw(page)
    QTest.keyClick(page, Qt.Key.Key_Return)
    assert played.talker.told == ['{"stop": true}']


def test_what_was_said_can_be_copied_and_who_reads_is_left_alone(
    page: CommissionPage, played: Played
) -> None:
    played.start()
    played.hear(*({"say": f"line {number}"} for number in range(200)))
    draw(page)
    bar = page.log.text.verticalScrollBar()
    assert bar.value() == bar.maximum()
    page.resize(page.width(), page.height() - 60)  # less room, and the newest is seen still
    draw(page)
    assert bar.value() == bar.maximum()
    bar.setValue(3)
    played.hear({"say": "one more"})
    draw(page)
    assert bar.value() == 3
    page.log.copy.click()
    assert QApplication.clipboard().text().endswith("one more")


def test_the_file_is_shown_with_the_check_and_a_way_on(page: CommissionPage, played: Played) -> None:
    playing.was_written(played)
    draw(page)
    asked: list[str] = []
    page.connect_to.connect(asked.append)
    assert page.result.text.toPlainText() == FILE
    page.result.connect_button.click()
    assert asked == [WISH.file]
    assert "found no problem" in page.result.checked.text()


def test_a_file_that_cannot_be_used_is_not_connected_to(page: CommissionPage, played: Played) -> None:
    playing.not_usable(played)
    draw(page)
    assert not page.result.connect_button.isVisible()
    assert "drive.eds is not there" in page.result.checked.text()


def test_what_was_left_is_gone_on_with(page: CommissionPage, tmp_path: Path) -> None:
    file = tmp_path / "exo-01.toml"
    page.form.file.setText(str(file))
    draw(page)
    assert page.form.start.text() == "Start"
    file.with_name(file.name + SUFFIX).write_text("{}")
    draw(page)
    assert page.form.start.text() == "Go on"


def test_closing_the_window_asks_first_and_ends_the_command(full_window: MainWindow, played: Played) -> None:
    playing.hand(played)
    full_window.close()
    assert full_window.isVisible()
    question = full_window.findChild(Question)
    assert question is not None
    question.act.click()
    assert played.talker.asked_to_end
    full_window.refresh()
    assert full_window.isVisible(), "it waits for the end"
    played.end(143)
    full_window.refresh()
    assert not full_window.isVisible()


def test_a_window_stays_where_a_drive_has_not_confirmed_that_it_is_stopped(
    full_window: MainWindow, played: Played
) -> None:
    playing.moving(played)
    full_window.close()
    question = full_window.findChild(Question)
    assert question is not None
    question.act.click()
    played.end(-9)
    played.hear(playing.stopped(confirmed=False))
    played.end(1)
    full_window.refresh()
    assert full_window.isVisible()
    full_window.close()
    assert not full_window.isVisible()


def test_a_stop_is_proved_drive_by_drive_with_its_time_until_the_next_one(
    page: CommissionPage, played: Played
) -> None:
    playing.stopping(played)
    assert page.stopped.isHidden()
    told = playing.stopped(confirmed=False)
    told["stopped"] |= {
        "drives": {"node 5": "confirmed", "node 6": "unconfirmed", "node 7": "unreachable"},
        "states": {"node 5": "switch on disabled", "node 6": "operation enabled"},
        "after_ms": {"node 5": 34.2},
    }
    played.hear(told)
    draw(page)
    assert page.stopped.texts == [
        ("node 5", "switch on disabled", "after 34\u00a0ms"),
        ("node 6", "operation enabled", "NOT CONFIRMED: unconfirmed"),
        ("node 7", "not known", "NOT CONFIRMED: unreachable"),
    ]
    assert page.stopped.note == "1 of 3 confirmed"
    played.model.stop()
    draw(page)
    assert page.stopped.isHidden(), "what was confirmed before is of before"
    played.hear({"stopped": {"confirmed": True, "words": "…", "drives": {"node 5": "confirmed"}}})
    draw(page)
    assert page.stopped.texts == [("node 5", "not known", "confirmed")], "an older command tells no time"


def test_a_window_that_is_ended_asks_nobody(full_window: MainWindow, played: Played) -> None:
    playing.hand(played)
    full_window.end()
    full_window.close()
    assert not full_window.isVisible()


def test_a_window_without_a_robot_leads_to_it(full_window: MainWindow) -> None:
    button = full_window.empty.findChild(QPushButton, "commission")
    assert button is not None
    button.click()
    assert full_window.tabs.view is full_window.tabs.commission


def test_the_form_knows_who_sits_at_the_window() -> None:
    form = Form("Ada")
    assert form.wish.who == "Ada"
    destroy(form)


def test_a_stop_that_reaches_the_drives_only_is_said_beneath_the_stop_as_long_as_it_is_so(
    page: CommissionPage, played: Played
) -> None:
    played.start()
    draw(page)
    assert page.bar.drives_only.isHidden()
    played.hear({"say": controller.DRIVES_ONLY}, asks("How are the joints called?", 2))
    draw(page)
    assert page.bar.drives_only.text().startswith("▲ A STOP will reach the drives only")
    played.hear({"say": "left knee is node 7."}, playing.stopped())
    draw(page)
    assert page.bar.drives_only.isVisible()
    assert controller.DRIVES_ONLY.startswith(messages.DRIVES_ONLY)


def test_a_drive_that_had_no_power_a_moment_before_has_only_answered(
    page: CommissionPage, played: Played
) -> None:
    played.start()
    played.hear(BEND)
    played.talker.says(lives(BEND["number"], ("node 7", "no power", "")))
    played.model.look()
    played.model.stop()
    played.hear(playing.stopped())
    draw(page)
    assert page.stopped.texts == [("node 7", "switch on disabled", "was off · answered after 34\u00a0ms")]
    played.now_s += 60
    played.model.stop()
    played.hear(playing.stopped())
    draw(page)
    assert page.stopped.texts == [("node 7", "switch on disabled", "after 34\u00a0ms")], (
        "that was long before"
    )


def test_what_leads_on_is_no_louder_than_stop_and_keeps_away_from_it(
    page: CommissionPage, played: Played
) -> None:
    draw(page)
    assert page.form.start.objectName() == "primary"
    playing.stop_confirmed(played)
    draw(page)
    assert page.form.start.objectName() != "primary"
    space = page.bar.stop.geometry().left() - page.form.start.geometry().right()
    assert space >= APART


def test_it_says_how_many_steps_are_done_instead_of_what_it_waits_for_again(
    page: CommissionPage, played: Played
) -> None:
    played.start()
    played.hear(playing.steps(), BEND)
    draw(page)
    assert re.fullmatch(r"\d+ of \d+ steps done", page.bar.words.text())


def test_the_drive_that_has_moved_enough_is_bold_and_ticked(page: CommissionPage, played: Played) -> None:
    played.start()
    played.hear(BEND)
    for far, other, bold in ((40, 0, False), (-900, 200, False), (-900, 3, True), (0, 0, False)):
        moved = ("node 7", far, "counts moved"), ("node 9", other, "counts moved")
        played.talker.says(lives(BEND["number"], *moved))
        played.model.look()
        draw(page)
        (first, value), (_, unmoved) = page.question.live._rows
        assert ("✓" in value.text(), value.font().bold(), first.font().bold()) == (bold, bold, bold)
        assert not unmoved.font().bold()
    assert (messages.LEAST_MOVE, messages.CLEARLY) == (joints.LEAST_MOVE, joints.CLEARLY)


def test_while_a_robot_is_commissioned_an_alarm_of_another_names_its_robot(
    full_window: MainWindow, played: Played
) -> None:
    full_window._desk.stations[1:] = []
    assert not full_window.alarms.named
    playing.hand(played)
    assert full_window.alarms.named
