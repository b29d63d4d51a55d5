"""Colours, dark and light, and the style that everything is drawn in. Left is blue, right is orange."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from PySide6.QtCore import QEvent, QObject, Signal
from PySide6.QtGui import QColor, QFont, QFontDatabase, QPalette
from PySide6.QtWidgets import QApplication, QWidget

SMALLEST_SCALE, LARGEST_SCALE = 0.8, 2.0
LOOSE: Final = 11  # px beside the name of a page, where there is room for that
TIGHT: Final = 5  # else
BASE_POINTS: Final = 9.0
URGENT: Final = 0.16  # of the alarm's colour in the tint of what endangers somebody now


class Look(Enum):
    """Palette."""

    DARK = "dark"
    LIGHT = "light"


@dataclass(frozen=True, slots=True)
class Colours:
    """A palette: Okabe–Ito hues, made darker or lighter until they reach WCAG 2.2 AA on their grounds.

    Every text has 4.5 : 1, what tells a field or a button from its ground (`edge`) 3 : 1. `border` only
    parts what would be understood without it. From `green` on: curves that belong to no side.
    """

    window: str
    panel: str
    card: str
    field: str
    border: str
    edge: str
    text: str
    dim: str
    accent: str
    on_accent: str
    left: str
    right: str
    good: str
    warn: str
    bad: str
    old: str
    staged: str
    green: str
    pink: str
    vermilion: str
    yellow: str
    violet: str
    lime: str
    stop: str = "#c8102e"
    stop_border: str = "#ffd400"


PALETTES: Final = {
    Look.DARK: Colours(
        window="#10141a",
        panel="#161b22",
        card="#1a2028",
        field="#12171e",
        border="#2c3440",
        edge="#6b7687",
        text="#e8ecf1",
        dim="#98a3b3",
        accent="#3d9bea",
        on_accent="#06121f",
        left="#56b4e9",
        right="#e69f00",
        good="#2dbb8c",
        warn="#e8d93a",
        bad="#ff7a45",
        old="#8590a0",
        staged="#332d0e",
        green="#009e73",
        pink="#cc79a7",
        vermilion="#e06a1b",
        yellow="#f0e442",
        violet="#8f8fd6",
        lime="#7fb36b",
    ),
    Look.LIGHT: Colours(
        window="#eef1f4",
        panel="#f5f7f9",
        card="#ffffff",
        field="#ffffff",
        border="#ced6df",
        edge="#7b8794",
        text="#18212c",
        dim="#566273",
        accent="#0a63b0",
        on_accent="#ffffff",
        left="#0072b2",
        right="#9a5200",
        good="#007a58",
        warn="#7d6c00",
        bad="#c23b00",
        old="#626d7c",
        staged="#fff3c4",
        green="#00795a",
        pink="#a8437d",
        vermilion="#b04a00",
        yellow="#7d6c00",
        violet="#5b5bb0",
        lime="#457334",
    ),
}

STYLE: Final = """
* {{ color: {text}; }}
QMainWindow, QWidget#page {{ background: {window}; }}
QMainWindow::separator {{ background: {window}; width: 4px; height: 4px; }}
QMainWindow::separator:hover {{ background: {accent}; }}
QToolTip {{ background: {card}; color: {text}; border: 1px solid {border}; padding: 3px; }}
QWidget#header, QStatusBar, QWidget#dock {{ background: {panel}; }}
QWidget#header {{ border-bottom: 1px solid {border}; }}
QStatusBar {{ border-top: 1px solid {border}; }}
QStatusBar QLabel {{ color: {dim}; padding: 0 6px; }}
QStatusBar::item {{ border: none; }}
QDockWidget {{ font-weight: bold; }}
QWidget#dockTitle {{ background: {card}; border-bottom: 1px solid {border}; }}
QWidget#dockTitle QToolButton {{ border: none; background: transparent; padding: 1px; }}
QWidget#dockTitle QToolButton:hover, QWidget#dockTitle QToolButton:focus {{ background: {field}; }}
QDockWidget::title {{ background: {card}; padding: 6px 8px; border-bottom: 1px solid {border}; }}
QFrame#card {{ background: {card}; border: 1px solid {border}; border-radius: 6px; }}
QFrame#card[selected="true"] {{ border: 1px solid {accent}; border-left: 3px solid {accent}; }}
QFrame#card[selected="false"] {{ padding-left: 2px; }}
QLabel, QCheckBox {{ background: transparent; }}
QLabel#dim, QLabel#note {{ color: {dim}; }}
QLabel#title[tone="old"] {{ color: {old}; }}
QLabel#dim[tone="bad"] {{ color: {bad}; }}
QLabel#dim[tone="warn"] {{ color: {warn}; }}
QLabel#title {{ font-weight: bold; }}
QLabel#brand {{ color: {accent}; padding-right: 8px; }}
QWidget#playback {{ border: 1px solid {warn}; }}
QLabel#banner {{ background: {staged}; border: 1px solid {warn}; border-radius: 4px; padding: 5px 8px; }}
QLabel#banner[tone="plain"] {{ background: {card}; border-color: {border}; }}
QLabel#banner[tone="bad"] {{ border-color: {bad}; }}
QLabel#banner[tone="good"] {{ background: {card}; border-color: {good}; }}
QTabWidget::pane {{ border: none; border-top: 1px solid {border}; }}
QTabBar {{ background: {panel}; qproperty-drawBase: 0; }}
QTabBar::tab {{ background: transparent; color: {dim}; padding: 7px {loose}px; border: none;
    border-bottom: 2px solid transparent; }}
QTabBar::tab:selected {{ color: {text}; border-bottom: 2px solid {accent}; }}
QTabBar QToolButton {{ padding: 0; border-radius: 0; }}
QTabBar::tab:focus, QTabBar::tab:hover {{ color: {text}; }}
QDialog {{ background: {card}; border: 1px solid {edge}; }}
QPushButton, QToolButton {{ background: {card}; border: 1px solid {edge}; border-radius: 4px;
    padding: 5px 10px; }}
QPushButton:hover, QToolButton:hover {{ border-color: {accent}; }}
QPushButton:focus, QToolButton:focus, QComboBox:focus {{ border: 1px solid {accent}; }}
QPushButton:disabled, QToolButton:disabled {{ color: {old}; border-color: {border}; }}
QPushButton:checked, QPushButton#primary {{ background: {accent}; color: {on_accent};
    border-color: {accent}; }}
QPushButton#primary {{ font-weight: bold; }}
QPushButton#primary:disabled {{ background: {card}; color: {old}; border-color: {border}; }}
QPushButton#page_name {{ background: transparent; color: {dim}; padding: 7px 11px; border: none;
    border-bottom: 2px solid transparent; border-radius: 0; }}
QPushButton#page_name[tight="true"] {{ padding: 7px {tight}px; }}
QPushButton#page_name:checked {{ color: {text}; border-bottom: 2px solid {accent}; }}
QPushButton#page_name:focus, QPushButton#page_name:hover {{ color: {text}; background: {card}; }}
QPushButton#section {{ padding: 2px 8px; }}
QPushButton#section[tone="bad"] {{ color: {bad}; border-color: {bad}; }}
QPushButton#section[tone="warn"] {{ color: {warn}; border-color: {warn}; }}
QPushButton#section[tone]:checked {{ color: {on_accent}; }}
QPushButton#stop {{ background: {stop}; color: white; border: 3px solid {stop_border}; border-radius: 6px;
    font-weight: bold; padding: 6px 14px; }}
QPushButton#stop:pressed {{ background: #7d0a1d; }}
QPushButton#stop:disabled {{ background: {card}; color: {old}; border-color: {border}; }}
QPushButton#stop:focus {{ border-color: {text}; }}
QPushButton#robot_stop {{ color: {bad}; border-color: {bad}; padding: 2px 8px; font-weight: bold; }}
QLineEdit, QAbstractSpinBox, QComboBox, QPlainTextEdit {{ background: {field}; border: 1px solid {edge};
    border-radius: 4px; padding: 4px 6px; selection-background-color: {accent};
    selection-color: {on_accent}; placeholder-text-color: {old}; }}
QLineEdit:focus, QAbstractSpinBox:focus {{ border-color: {accent}; }}
QAbstractSpinBox {{ padding: 3px 16px 3px 4px; }}
QAbstractSpinBox::up-button, QAbstractSpinBox::down-button {{ background: transparent; border: none;
    width: 16px; }}
QAbstractSpinBox::up-arrow, QAbstractSpinBox::down-arrow {{ image: none; width: 0; height: 0; }}
QAbstractSpinBox QLineEdit {{ border: none; padding: 0; background: transparent; }}
QComboBox QAbstractItemView, QMenu {{ background: {card}; border: 1px solid {border};
    selection-background-color: {accent}; selection-color: {on_accent}; }}
QComboBox::drop-down {{ border: none; width: 16px; }}
QComboBox::down-arrow {{ width: 0; height: 0; border-left: 4px solid {field}; border-right: 4px solid {field};
    border-top: 5px solid {text}; }}
QComboBox::down-arrow:disabled {{ border-top-color: {old}; }}
QMenu::item {{ padding: 5px 22px 5px 12px; }}
QMenu::icon {{ left: 8px; }}
QMenu::item:selected {{ background: {accent}; color: {on_accent}; }}
QMenu::item:disabled {{ color: {old}; }}
QAbstractItemView {{ background: {card}; alternate-background-color: {panel}; border: none;
    selection-background-color: {selection}; selection-color: {text}; outline: 0; }}
QAbstractItemView#framed {{ border: 1px solid {border}; }}
QAbstractItemView#framed:focus, QTextBrowser:focus {{ border-color: {accent}; }}
QTreeView::item {{ padding: 3px 0; }}
QTreeView::indicator {{ width: 10px; height: 10px; background: {field}; border: 1px solid {edge};
    border-radius: 2px; }}
QTreeView::indicator:checked {{ background: {accent}; border-color: {accent}; }}
QHeaderView {{ background: {panel}; }}
QHeaderView::up-arrow, QHeaderView::down-arrow {{ image: none; width: 0; height: 0; }}
QHeaderView::section {{ background: {panel}; color: {dim}; border: none; border-right: 1px solid {border};
    border-bottom: 1px solid {border}; padding: 4px 6px; }}
QScrollArea, QScrollArea > QWidget > QWidget#page {{ background: transparent; border: none; }}
QScrollBar:vertical {{ background: transparent; width: 9px; }}
QScrollBar:horizontal {{ background: transparent; height: 9px; }}
QScrollBar::handle {{ background: {edge}; border-radius: 4px; min-height: 24px; min-width: 24px; }}
QScrollBar::handle:hover {{ background: {old}; }}
QScrollBar::add-line, QScrollBar::sub-line {{ width: 0; height: 0; }}
QSlider::groove:horizontal {{ background: {edge}; height: 4px; border-radius: 2px; }}
QSlider::sub-page:horizontal {{ background: {accent}; border-radius: 2px; }}
QSlider::handle:horizontal {{ background: {text}; width: 12px; margin: -5px 0; border-radius: 6px; }}
QSlider::handle:horizontal:focus {{ background: {accent}; }}
QProgressBar {{ background: {field}; border: 1px solid {edge}; border-radius: 4px; max-height: 8px; }}
QProgressBar::chunk {{ background: {accent}; border-radius: 3px; }}
"""


class Theme(QObject):
    """The look in force; `changed` is emitted when another one is."""

    changed = Signal()
    scaled = Signal()  # after `changed`, where text has another size

    def __init__(self, application: QApplication, look: Look = Look.DARK, scale: float = 1.0) -> None:
        super().__init__(application)
        self._application = application
        self._family = QFontDatabase.systemFont(QFontDatabase.SystemFont.GeneralFont).family()
        self.look, self.scale = look, scale
        self.colours = PALETTES[look]
        self.set(look, scale)

    def set(self, look: Look | None = None, scale: float | None = None) -> None:
        """Take another palette, or another size of all text between 80 and 200 %."""
        before = self.scale
        self.look = self.look if look is None else look
        self.scale = self.scale if scale is None else min(max(scale, SMALLEST_SCALE), LARGEST_SCALE)
        self.colours = PALETTES[self.look]
        font = QFont(self._family)
        font.setPointSizeF(BASE_POINTS * self.scale)
        if (self._application.font(), self._application.styleSheet()) == (font, self._style()):
            return  # every widget would take them anew, for a second
        self._application.setFont(font)
        self._application.setPalette(self._palette())
        _restyle(self._application, self._style())
        self.changed.emit()
        if self.scale != before:
            self.scaled.emit()

    def colour(self, name: str) -> QColor:
        """Return a colour of the palette by its name."""
        return QColor(getattr(self.colours, name))

    def px(self, pixels: float) -> int:
        """Return a length that grows with the text."""
        return round(pixels * self.scale)

    @property
    def urgent(self) -> QColor:
        """The card's colour with a tint of alarm."""
        card, bad = self.colour("card"), self.colour("bad")

        def mixed(own: int, alarm: int) -> int:
            return round(own + URGENT * (alarm - own))

        return QColor(
            mixed(card.red(), bad.red()), mixed(card.green(), bad.green()), mixed(card.blue(), bad.blue())
        )

    def side(self, component: str) -> QColor:
        """Left is blue, right is orange, what has no side is plain."""
        side = component.partition("_")[0]
        return self.colour(side) if side in ("left", "right") else self.colour("text")

    def number_font(self, factor: float = 1.0, *, bold: bool = False) -> QFont:
        """Return the font for numbers that change: every digit as wide as the others."""
        font = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
        font.setPointSizeF(BASE_POINTS * self.scale * factor)
        font.setBold(bold)
        return font

    def text_font(self, factor: float = 1.0, *, bold: bool = False) -> QFont:
        """Return the font for everything else."""
        font = QFont(self._family)
        font.setPointSizeF(BASE_POINTS * self.scale * factor)
        font.setBold(bold)
        return font

    def _style(self) -> str:
        colours = {name: getattr(self.colours, name) for name in Colours.__slots__}
        selection = self.colour("accent")
        selection.setAlpha(70)
        return STYLE.format(
            **colours, loose=LOOSE, tight=TIGHT, selection=selection.name(QColor.NameFormat.HexArgb)
        )

    def _palette(self) -> QPalette:
        roles = {
            QPalette.ColorRole.Window: "window",
            QPalette.ColorRole.WindowText: "text",
            QPalette.ColorRole.Base: "field",
            QPalette.ColorRole.AlternateBase: "panel",
            QPalette.ColorRole.Text: "text",
            QPalette.ColorRole.Button: "card",
            QPalette.ColorRole.ButtonText: "text",
            QPalette.ColorRole.Highlight: "accent",
            QPalette.ColorRole.HighlightedText: "on_accent",
            QPalette.ColorRole.PlaceholderText: "old",
            QPalette.ColorRole.ToolTipBase: "card",
            QPalette.ColorRole.ToolTipText: "text",
        }
        palette = QPalette()
        for role, name in roles.items():
            palette.setColor(role, self.colour(name))
        return palette


def _restyle(application: QApplication, sheet: str) -> None:
    """Take another style sheet, and style every widget by it once.

    Qt alone styles a widget once for itself and once for each that it is within, so eight times in the main
    window. It does so with all that it remembers the style of, and so is made to forget that.
    """
    application.style().unpolish(application)
    # Never without a sheet in between: Qt 6.11 then keeps widgets that are gone, and crashes later.
    application.setStyleSheet(sheet)
    style, changed = application.style(), QEvent(QEvent.Type.StyleChange)
    for window in application.topLevelWidgets():
        if window.parentWidget() is None:
            for widget in (window, *window.findChildren(QWidget)):  # each behind what it is within
                style.polish(widget)
                application.sendEvent(widget, changed)
