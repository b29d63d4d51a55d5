"""Every colour of the theme's tables against every ground that it is drawn on: WCAG 2.2, level AA."""

import itertools
import re
from dataclasses import fields

import pytest
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QLineEdit, QPlainTextEdit

from server_gui.views.theme import PALETTES, STYLE, Colours, Look, Theme
from server_gui.views.workspace.unit_plot import RECORDINGS
from tests.gui.test_window import contrast

TEXT, GRAPHIC = 4.5, 3.0  # WCAG 2.2: 1.4.3 and 1.4.11
GROUNDS = ("window", "panel", "card", "field")
TEXTS = ("text", "dim", "old", "accent", "left", "right", "good", "warn", "bad")
CURVES = ("green", "pink", "vermilion", "yellow", "violet", "lime")
NOT_READ = {"border"}  # parts what would be understood without it
PAIRS = (
    *itertools.product(TEXTS, GROUNDS),
    *itertools.product(CURVES, ("card",)),  # their names stand in legends
    *itertools.product(("text", "warn", "bad"), ("staged",)),
    ("on_accent", "accent"),
)
EDGES = (*itertools.product(("edge", "accent"), GROUNDS), ("stop_border", "stop"))


@pytest.mark.parametrize("look", Look)
@pytest.mark.parametrize(("pairs", "least"), [(PAIRS, TEXT), (EDGES, GRAPHIC)])
def test_what_is_read_and_what_is_found_stands_out(
    look: Look, pairs: tuple[tuple[str, str], ...], least: float
) -> None:
    colours = PALETTES[look]
    found = {pair: contrast(*(getattr(colours, name) for name in pair)) for pair in pairs}
    assert {pair: round(ratio, 2) for pair, ratio in found.items() if ratio < least} == {}


@pytest.mark.parametrize("look", Look)
def test_a_chosen_row_can_be_read(look: Look) -> None:
    colours = PALETTES[look]
    share = 70 / 255
    mixed = QColor(
        *(
            round(
                share * int(colours.accent[at : at + 2], 16)
                + (1 - share) * int(colours.card[at : at + 2], 16)
            )
            for at in (1, 3, 5)
        )
    )
    assert contrast(mixed.name(), colours.text) >= TEXT
    assert contrast("#ffffff", colours.stop) >= TEXT


def test_every_colour_is_looked_at() -> None:
    looked_at = set(itertools.chain(*PAIRS, *EDGES)) | NOT_READ
    assert {field.name for field in fields(Colours)} <= looked_at


def test_fields_and_buttons_have_an_edge_that_is_seen() -> None:
    for kind in ("QLineEdit, QAbstractSpinBox, QComboBox", "QPushButton, QToolButton {"):
        rule = STYLE[STYLE.index(kind) :].partition("}}")[0]
        assert re.search(r"border: 1px solid \{edge\}", rule), kind


@pytest.mark.parametrize("look", Look)
@pytest.mark.parametrize("kind", [QLineEdit, QPlainTextEdit])
def test_what_an_empty_field_asks_for_can_be_read(
    theme: Theme, look: Look, kind: type[QLineEdit | QPlainTextEdit]
) -> None:
    theme.set(look)
    field = kind()
    field.setPlaceholderText("Filter events")
    field.ensurePolished()
    hint = field.palette().color(QPalette.ColorRole.PlaceholderText)
    assert hint.alpha() == 255
    assert contrast(hint.name(), theme.colours.field) >= TEXT
    field.deleteLater()


@pytest.mark.parametrize("look", Look)
def test_curves_and_names_of_two_recordings_are_seen_and_read(theme: Theme, look: Look) -> None:
    theme.set(look)
    for name in RECORDINGS:
        colour = theme.colour(name).name()
        assert contrast(colour, theme.colours.card) >= GRAPHIC, name
        assert contrast(colour, theme.colours.window) >= TEXT, name


@pytest.mark.parametrize("look", [Look.DARK, Look.LIGHT])
def test_words_are_read_on_the_tint_of_what_endangers_somebody(theme: Theme, look: Look) -> None:
    theme.set(look)
    tint = theme.urgent.name()
    assert tint != theme.colours.card
    for name in ("text", "dim"):
        assert contrast(getattr(theme.colours, name), tint) >= TEXT, name
    assert contrast(theme.colours.bad, tint) >= GRAPHIC
