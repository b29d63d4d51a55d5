"""Help: every view has its section of the manual, by F1 and by a button, in the manual's own words."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDockWidget

from server_gui.core.desk import manual
from server_gui.views.frame.main_window import MainWindow

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "window.md"


def test_the_sections_are_the_documents_own_without_pictures_and_links() -> None:
    sections, document = manual.sections(), DOCS.read_text(encoding="utf-8")
    assert [f"## {title}" for title in sections] == [
        line for line in document.splitlines() if line.startswith("## ") and line != "## How it is made"
    ]
    assert "quick stop on every drive of the robot shown" in sections["Always visible"]
    assert all("](" not in text for text in sections.values())


def test_every_tab_and_panel_has_its_section_by_f1_and_by_a_button(window: MainWindow) -> None:
    titles = {window.tabs.tabText(place).replace("&", "") for place in range(window.tabs.count())}
    assert titles | {"Parameters", "Recordings", "Cloud"} <= manual.sections().keys()
    assert not window.help.isVisible()
    window.tabs.setCurrentIndex(1)
    window.help_button.click()
    QApplication.processEvents()
    assert window.help.choice.currentText() == "Signals"
    assert window.header.stop.isVisible()
    assert QApplication.activeModalWidget() is None
    window.reset_layout()
    assert not window.help.isVisible()
    assert all(dock.isVisible() for dock in window.findChildren(QDockWidget) if dock.windowTitle() != "Help")
    for place in range(window.tabs.count()):
        window.tabs.setCurrentIndex(place)
        window.tabs.setFocus()
        QTest.keyClick(window.tabs, Qt.Key.Key_F1)
        assert window.help.isVisible()
        assert window.help.choice.currentText() == window.tabs.tabText(place).replace("&", "")
    window.parameters.filters.words.setFocus()
    QTest.keyClick(window.parameters.filters.words, Qt.Key.Key_F1)
    assert window.help.choice.currentText() == "Parameters"
    assert "the robot column shows four" in " ".join(window.help.text.toPlainText().split())
