"""Text and colours are of the size and the look that are chosen, wherever and whenever they are shown."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLabel, QWidget

from server_gui.views.frame.application import kept_theme
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import PALETTES, Look, Theme
from tests.gui.fakes import Bench, destroy, make_every_page

CHOSEN = ((Look.DARK, 1.5), (Look.LIGHT, 1.5), (Look.DARK, 1.0))


@pytest.fixture
def kept(tmp_path: Path) -> QSettings:
    return QSettings(str(tmp_path / "kept.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def hidden(qt: QApplication, theme: Theme, bench: Bench, kept: QSettings) -> Iterator[MainWindow]:
    made = MainWindow(bench.desk, theme, kept)
    yield made
    destroy(made)


def test_a_window_takes_what_is_chosen_before_it_is_shown(hidden: MainWindow, theme: Theme) -> None:
    make_every_page(hidden)
    before = _points(hidden)
    theme.set(Look.LIGHT, 1.5)
    hidden.show()
    assert _wrong(hidden, theme, before) == []


def test_a_window_takes_what_is_chosen_while_it_is_shown(window: MainWindow, theme: Theme) -> None:
    make_every_page(window)
    before = _points(window)
    for look, scale in CHOSEN:
        theme.set(look, scale)
        QApplication.processEvents()
        assert _wrong(window, theme, before) == [], (look, scale)


def test_what_waited_in_a_shown_window_takes_what_was_chosen_meanwhile(theme: Theme) -> None:
    """A page that is made later and hidden, of which Qt has measured a part."""
    shown, later, measured, title = QWidget(), QWidget(), QLabel("measured"), QLabel("of the page")
    title.setObjectName("title")
    shown.show()
    later.setParent(shown)
    row = QHBoxLayout(later)
    for label in (measured, title):
        row.addWidget(label)
    measured.sizeHint()
    before = _points(shown)
    theme.set(Look.LIGHT, 1.5)
    later.show()
    assert _wrong(shown, theme, before) == []
    destroy(shown)


def test_what_is_asked_for_goes_before_what_is_kept(qt: QApplication, theme: Theme, kept: QSettings) -> None:
    kept.setValue("look", "light")
    kept.setValue("scale", 125)
    try:
        chosen = [kept_theme(qt, kept, *asked) for asked in ((), (None, 1.5), (Look.DARK, None))]
        assert [(one.look, one.scale) for one in chosen] == [
            (Look.LIGHT, 1.25),
            (Look.LIGHT, 1.5),
            (Look.DARK, 1.25),
        ]
    finally:
        theme.set(Look.DARK, 1.0)  # the application's again


def _points(window: QWidget) -> dict[QWidget, float]:
    """How high text is in each part, but for Qt's own inner ones, which hold none."""
    parts = (window, *window.findChildren(QWidget))
    return {part: part.font().pointSizeF() for part in parts if not part.objectName().startswith("qt_")}


def _wrong(window: QWidget, theme: Theme, before: dict[QWidget, float]) -> list[str]:
    """What has not the size that it had at 100 %, times the scale, or a colour of the other look."""
    now = _points(window)
    sizes = {part: (now[part], points * theme.scale) for part, points in before.items()}
    found = [
        f"{part}: {one} pt for {other}" for part, (one, other) in sizes.items() if abs(one - other) > 0.01
    ]
    (other,) = set(Look) - {theme.look}
    strange = {PALETTES[other].text, PALETTES[other].dim}
    return found + [
        f"{part}: colour" for part in now if part.palette().windowText().color().name() in strange
    ]
