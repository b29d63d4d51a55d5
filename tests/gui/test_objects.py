"""The page of a device's objects: asked only while it is shown and in sight, and nothing is written there."""

import csv
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from gateway.client import ConnectionState, RemoteError
from gateway.wire.dictionary import ObjectValue
from gateway.wire.parameter import PARAMETER_WRITE
from gateway.wire.robot import Hello
from server_gui.core.follow.events import Described, LinkChanged
from server_gui.core.objects.rows import RowKind
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.objects.choice_bar import READ_NO_MORE
from server_gui.views.objects.objects_model import AGE, HOLDS, NAME, OTHER, PARAMETER
from server_gui.views.objects.panel import ObjectsPage
from server_gui.views.parameters.filter import NAME_ROLE
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Bench, destroy, stop_is_whole
from tests.support.desk import described, looked
from tests.support.dictionaries import HOLDS as HELD
from tests.support.dictionaries import OBJECTS, RELEASE, answer_lists, answer_reads, one

KNEE = "left_knee"


@pytest.fixture
def page(theme: Theme, bench: Bench) -> Iterator[ObjectsPage]:
    """The knee's objects, of which those in sight were read."""
    bench.station.take([looked()])
    made = ObjectsPage(bench.desk, theme)
    made.resize(1200, 900)
    made.show()
    made.look()
    made.bar.device.setCurrentIndex(made.bar.device.findData(KNEE))
    made.bar.device.activated.emit(made.bar.device.currentIndex())
    _answer(made, bench)
    yield made
    destroy(made)


def _answer(page: ObjectsPage, bench: Bench) -> None:
    answer_lists(bench.first)
    _read_again(page, bench)


def _read_again(page: ObjectsPage, bench: Bench) -> None:
    answer_reads(bench.first)  # of another device, which was shown before
    reading = bench.station.objects.reading
    reading._next_ns = 0
    reading._asked.clear()
    page.look()
    answer_reads(bench.first)
    page.look()


def _cell(page: ObjectsPage, address: str, column: int) -> str:
    model = page.table.model()
    row = next(row for row, info in enumerate(page.table.rows) if info.object == address)
    return str(model.index(row, column).data())


def _ink(page: ObjectsPage, theme: Theme, address: str, column: int) -> str:
    row = next(row for row, info in enumerate(page.table.rows) if info.object == address)
    ink = page.table.model().index(row, column).data(Qt.ItemDataRole.ForegroundRole)
    return next(name for name in ("text", "dim", "warn", "old", "good") if theme.colour(name) == ink)


def test_what_is_in_sight_is_shown_with_what_it_holds(page: ObjectsPage, theme: Theme) -> None:
    assert _cell(page, "0x6041:0", HOLDS) == "0x0237 (operation enabled)"
    assert _cell(page, "0x6041:0", AGE) == "0 s"
    assert _cell(page, "0x2001:0", HOLDS) == str(2**63 + 1)
    assert _cell(page, "0x6065:0", OTHER) == "≠ 5000"
    assert _cell(page, "0x6072:0", PARAMETER) == "left_knee.max_torque"
    assert _cell(page, "0x6065:0", PARAMETER) == "not released"
    assert _ink(page, theme, "0x6041:0", HOLDS) == "text"


def test_of_thousands_only_those_in_sight_are_asked_for(theme: Theme, bench: Bench) -> None:
    many = [one(f"0x{index:04X}:0", f"Thing {index}") for index in range(0x2000, 0x3000)]
    page = ObjectsPage(bench.desk, theme)
    page.resize(900, 700)
    page.show()
    page.look()
    answer_lists(bench.first, many)
    for _ in range(4):
        page.look()
        answer_reads(bench.first)
        bench.station.objects.reading._next_ns = 0
    assert len(page.table.rows) == len(many)
    assert len(bench.station.objects.reading.held) <= len(page.table.in_sight) < 60
    page.table.scrollToBottom()
    page.look()
    assert bench.first.named("read_objects")[-1][1][-1] > "0x2F00:0"
    destroy(page)


def test_words_and_kinds_choose(page: ObjectsPage) -> None:
    page.bar.words.setText("0x60*")
    assert [info.object[:4] for info in page.table.rows] == ["0x60"] * 4
    page.bar.words.setText("")
    page.bar.kinds[RowKind.DIFFERENT].click()
    assert [info.object for info in page.table.rows] == ["0x6040:0", "0x6065:0", "0x6072:0"]
    page.bar.kinds[RowKind.PARAMETERS].click()
    assert [info.object for info in page.table.rows] == ["0x6072:0"]
    assert page.bar.kinds[RowKind.ALL].text() == f"All {len(OBJECTS)}"


def test_the_chosen_one_stays_chosen_when_it_is_found_again(page: ObjectsPage) -> None:
    page.table.choose("0x6041:0")
    page.bar.words.setText("torque")
    page.bar.words.setText("")
    current = page.table.current
    assert current is not None
    assert current.object == "0x6041:0"


def test_the_facts_are_of_the_chosen_object_also_while_text_of_another_is_marked(page: ObjectsPage) -> None:
    page.table.choose("0x6041:0")
    page.facts.text.selectAll()
    page.table.choose("0x6065:0")
    assert "operation enabled" not in page.facts.text.toPlainText()
    assert "to release in [joint.left_knee]" in page.facts.text.toPlainText()
    said = page.facts.text.toPlainText()
    page.facts.text.selectAll()
    page.look()
    assert page.facts.text.toPlainText() == said
    assert page.facts.text.textCursor().hasSelection(), "what is marked to be copied stays marked"


def test_its_facts_have_bits_by_name_and_why_it_is_locked(page: ObjectsPage) -> None:
    page.table.choose("0x6041:0")
    assert "2 operation enabled" in page.facts.text.toPlainText()
    assert not page.facts.edit.isEnabled()
    page.table.choose("0x6065:0")
    assert "to release in [joint.left_knee]" in page.facts.text.toPlainText()
    page.facts.lines.click()
    assert QGuiApplication.clipboard().text() == RELEASE
    page.facts.address.click()
    assert QGuiApplication.clipboard().text() == "0x6065:0"
    page.facts.channel.click()
    assert '[channel."left_knee.following_error_window"]' in QGuiApplication.clipboard().text()


def test_nothing_is_asked_while_another_page_is_shown_and_a_parameter_staged_where_those_are(
    window: MainWindow, bench: Bench
) -> None:
    bench.draw(window)
    assert not bench.first.named("objects")
    assert not bench.first.named("read_objects")
    bench.station.take([looked()])
    window.tabs.look_at(window.tabs.objects)
    bench.draw(window)
    page = window.tabs.objects
    page.bar.device.setCurrentIndex(page.bar.device.findData(KNEE))
    page.bar.device.activated.emit(page.bar.device.currentIndex())
    _answer(page, bench)
    window.parameters.filters.words.setText("nothing has this")
    page.table.choose("0x6072:0")
    at = page.table.visualRect(page.table.currentIndex()).center()
    for do in (QTest.mouseClick, QTest.mouseDClick):
        do(page.table.viewport(), Qt.MouseButton.LeftButton, pos=at)
    tree = window.parameters.tree
    assert tree.currentIndex().siblingAtColumn(0).data(NAME_ROLE) == "left_knee.max_torque"
    assert tree.state() is tree.State.EditingState
    assert not bench.station.edits.staged
    window.parameters.stage_text("left_knee.max_torque", "60")
    page.look()
    assert _cell(page, "0x6072:0", PARAMETER) == "● left_knee.max_torque"
    assert not bench.first.named("write")


@pytest.mark.parametrize("address", ["0x6040:0", "0x6041:0", "0x6065:0", "0x2000:1"])
def test_what_is_no_released_parameter_is_never_edited(page: ObjectsPage, address: str) -> None:
    asked: list[str] = []
    page.edited.connect(asked.append)
    page.table.choose(address)
    QTest.keyClick(page.table, Qt.Key.Key_F2)
    page.table.wanted.emit()
    assert asked == []
    assert not page.facts.edit.isEnabled()


def test_who_may_not_write_is_told_so(page: ObjectsPage, bench: Bench) -> None:
    refused = {PARAMETER_WRITE.name: "a viewer may not write parameters"}
    hello = Hello(1, "exo-01", "viewer", "boot-1", refused=refused)
    bench.station.take([replace_hello(hello), looked()])
    page.table.choose("0x6072:0")
    page.look()
    assert not page.facts.edit.isEnabled()
    assert "a viewer may not write" in page.facts.edit.toolTip()
    assert "a viewer may not write" in page.facts.text.toPlainText()


def replace_hello(hello: Hello) -> Described:
    return Described(described().description, hello=hello)


def test_when_the_link_goes_values_are_grey_with_their_age_and_nothing_is_asked(
    page: ObjectsPage, bench: Bench, theme: Theme
) -> None:
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", 0)])
    asked = len(bench.first.asked)
    bench.station.objects.reading._next_ns = 0
    page.look()
    assert _cell(page, "0x6041:0", HOLDS) == "0x0237 (operation enabled)"
    assert _ink(page, theme, "0x6041:0", HOLDS) == "old"
    assert "each value has its age" in page.said.text()
    assert len(bench.first.asked) == asked
    assert not page.bar.all.isEnabled()


def test_a_node_that_is_silent_says_so_in_its_rows(page: ObjectsPage, bench: Bench, theme: Theme) -> None:
    silent = ObjectValue(None, "", None, "left_knee is not there: no answer for 2.0 s")
    reading = bench.station.objects.reading
    reading._next_ns = 0
    reading._asked.clear()
    page.look()
    answer_reads(bench.first, dict.fromkeys(HELD, silent))
    page.look()
    assert _cell(page, "0x6041:0", HOLDS) == silent.problem
    assert _ink(page, theme, "0x6041:0", HOLDS) == "warn"


def test_a_device_without_eds_says_why_and_how(theme: Theme, bench: Bench) -> None:
    page = ObjectsPage(bench.desk, theme)
    page.show()
    page.look()
    bench.first.fail(RemoteError(-32010, "left_hip: drive.eds is not there"))
    page.look()
    assert "drive.eds is not there" in page.said.text()
    assert 'eds = "FILE"' in page.said.text()
    destroy(page)


def test_two_devices_stand_beside_each_other(page: ObjectsPage, bench: Bench) -> None:
    page.bar.other.setCurrentIndex(page.bar.other.findData("right_knee"))
    page.bar.other.activated.emit(page.bar.other.currentIndex())
    answer_lists(bench.first)
    _read_again(page, bench)
    reading = bench.station.objects.reading
    reading._next_ns = 0
    page.look()
    answer_reads(bench.first, {**HELD, "0x6065:0": ObjectValue(7, "7", 1)})
    page.look()
    assert _cell(page, "0x6065:0", OTHER) == "≠ 7"
    assert page.table.model().headerData(OTHER, Qt.Orientation.Horizontal) == "right knee"


def test_everything_is_read_once_and_saved(page: ObjectsPage, bench: Bench, tmp_path: Path) -> None:
    page.bar.all.click()
    assert page.bar.all.text() == READ_NO_MORE
    _read_again(page, bench)
    assert not bench.station.objects.reading.left
    path = tmp_path / "knee.csv"
    page.save_csv(path)
    with path.open(newline="", encoding="utf-8") as file:
        lines = {line["object"]: line for line in csv.DictReader(file)}
    assert len(lines) == len(OBJECTS)
    assert lines["0x2001:0"]["value"] == str(2**63 + 1)


def test_an_object_is_pinned_for_its_robot(page: ObjectsPage, bench: Bench) -> None:
    page.table.choose("0x6041:0")
    page.facts.pin.click()
    assert bench.desk.pins.of("exo-01") == {"left_knee.0x6041:0"}
    assert _cell(page, "0x6041:0", NAME) == "★ Statusword"
    page.bar.kinds[RowKind.PINNED].click()
    assert [info.object for info in page.table.rows] == ["0x6041:0"]


@pytest.mark.parametrize(("width", "height", "scale"), [(1366, 768, 1.0), (1024, 700, 2.0)])
def test_the_page_keeps_the_rules_at_every_size(
    window: MainWindow, bench: Bench, theme: Theme, width: int, height: int, scale: float
) -> None:
    """Full of values, also when the link has gone: then nothing is green."""
    window.tabs.look_at(window.tabs.objects)
    page = window.tabs.objects
    bench.station.take([LinkChanged(ConnectionState.CONNECTED, None, 0), described(), looked()])
    theme.set(scale=scale)
    window.resize(width, height)
    bench.draw(window)
    _answer(page, bench)
    page.table.choose("0x6065:0")
    bench.draw(window)
    rules.settle()
    broken = [*rules.halved_numbers(window), *rules.out_of_reach(window), *rules.nameless(window)]
    bench.station.take([LinkChanged(ConnectionState.WAITING, "no gateway", 0)])
    bench.draw(window)
    rules.settle()
    broken += [*rules.halved_numbers(page), *rules.green(page, theme), *rules.out_of_reach(window)]
    assert page.table.rows
    assert stop_is_whole(window)
    assert not broken, "\n".join(sorted(set(broken)))


def test_names_that_command_something_are_shown_as_what_they_are(theme: Theme, bench: Bench) -> None:
    page = ObjectsPage(bench.desk, theme)
    page.show()
    page.look()
    answer_lists(bench.first, [replace(OBJECTS[0], name="<b>Type\x1b[31m</b>")])
    page.look()
    page.table.choose("0x1000:0")
    assert _cell(page, "0x1000:0", NAME) == "<b>Type\\x1b[31m</b>"
    assert "\x1b" not in page.facts.text.toPlainText()
    destroy(page)
