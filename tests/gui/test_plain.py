"""Names that look like HTML are shown as they are, wherever the window shows them."""

import re
from pathlib import Path

from PySide6 import QtGui
from PySide6.QtCore import Qt
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QApplication, QMessageBox, QWidget

import server_gui.views
from gateway.units import Units
from gateway.wire.resource import ProcessUse
from server_gui.views.resources.processes import ProcessModel
from server_gui.views.theme import Theme
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.files import _unless_there
from server_gui.views.widgets.plain import PlainLabel, rich, set_tip, tip, unbroken
from server_gui.views.workspace.unit_plot import Drawn, UnitPlot

BAD = '<img src="x"><b>left</b> [/b] & \x1b\u202e'
SHOWN = '<img src="x"><b>left</b> [/b] & \\x1b\\u202e'


def read(text: str) -> str:
    """What somebody reads where Qt is to find out itself whether it is HTML."""
    document = QTextDocument()
    document.setHtml(text) if QtGui.Qt.mightBeRichText(text) else document.setPlainText(text)
    return document.toPlainText()


def test_a_label_shows_html_as_text(qt: QApplication) -> None:
    for label in (PlainLabel(BAD), PlainLabel(), ElidedLabel()):
        label.setText(BAD)
        assert label.textFormat() is Qt.TextFormat.PlainText
        assert label.text() == SHOWN


def test_no_line_ends_between_a_number_and_its_unit() -> None:
    said = "was off · answered after 27 ms; 32 error frames in the last 10 s, 18.5 % (2 m)."
    kept = said.replace("27 ms", "27\u00a0ms").replace("10 s", "10\u00a0s").replace("5 %", "5\u00a0%")
    assert unbroken(said) == kept.replace("2 m", "2\u00a0m")
    assert unbroken("6 drives of 2 sides in 3 steps") == "6 drives of 2 sides in 3 steps"
    assert PlainLabel(unbroken("27 ms")).text() == "27\u00a0ms"


def test_a_tool_tip_shows_html_as_text(qt: QApplication) -> None:
    widget = QWidget()
    for text in (BAD, f"first\n{BAD}", "plain\nlines", "a < b"):
        set_tip(widget, text)
        assert read(widget.toolTip()).replace("\u2028", "\n") == text.replace("\x1b\u202e", "\\x1b\\u202e")
    assert tip("plain") == "plain"


def test_a_legend_shows_the_name_of_a_channel_as_it_is(theme: Theme) -> None:
    plot = UnitPlot(theme, 0, Units().choices("rad")[0], [Drawn(BAD, BAD)], 10.0)
    plot.show_values([1.0])
    assert SHOWN in read(plot._legend.text()).replace("\xa0", " ")
    assert read(f"<b>{rich(BAD)}</b>") == SHOWN


def test_a_question_shows_the_name_of_a_file_as_it_is(qt: QApplication, tmp_path: Path) -> None:
    file = tmp_path / "<b>x<"
    file.touch()
    parent = QWidget()
    _unless_there(parent, file, lambda path: None)
    (box,) = parent.findChildren(QMessageBox)
    assert box.textFormat() is Qt.TextFormat.PlainText
    box.close()


def test_a_table_shows_a_process_as_it_is(theme: Theme) -> None:
    model = ProcessModel(theme)
    model.rows = [ProcessUse(1, BAD, 1.0, 1)]
    assert model.data(model.index(0, 0), Qt.ItemDataRole.DisplayRole) == SHOWN


def test_no_label_is_left_to_find_out_by_itself() -> None:
    folder = Path(server_gui.views.__file__).parent
    labels = [
        (file.name, line.strip())
        for file in sorted(folder.rglob("*.py"))
        for line in file.read_text().splitlines()
        if re.search(r"(?<!\w)(QLabel|QTextBrowser|QErrorMessage)\(", line) and "class " not in line
    ]
    own = {("store_page.py", "explained = QLabel(EXPLAINED)")}
    assert set(labels) == own | {("help.py", "self.text = QTextBrowser()")}  # the manual's
    tips = [
        (file.name, line.strip())
        for file in sorted(folder.rglob("*.py"))
        for line in file.read_text().splitlines()
        if re.search(r"setToolTip\((?!\"|$|HINT|RULE|_TIPS|button.toolTip)", line) and file.name != "plain.py"
    ]
    assert tips == []
