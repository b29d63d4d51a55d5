"""Sections of the overview, and the pages that they are on where not all of them have room."""

from collections.abc import Collection, Mapping
from enum import Enum
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QButtonGroup, QFrame, QHBoxLayout, QPushButton

from server_gui.core.alarms.marks import GLYPHS, Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_tone


class Section(Enum):
    """What is shown or left out whole, the most important first."""

    JOINTS = "joints"
    WEARER = "wearer"  # ring, posture and soles
    PLOTS = "plots"


Wrong = tuple[Collection[str], Mark]  # what is not well, and the mark of the worst of it
TONES: Final = ("", "warn", "bad")  # the worst last
Page = frozenset[Section]
JOINTS, WEARER, PLOTS = (frozenset({section}) for section in Section)
ALL: Final[tuple[Page, ...]] = (JOINTS | WEARER | PLOTS,)
Arrangements = tuple[tuple[Page, ...], ...]  # the first that fits is taken; the last whatever room there is
NUMBERS_FIRST: Final[Arrangements] = (
    ALL,
    (JOINTS | WEARER, JOINTS | PLOTS),
    (JOINTS, WEARER | PLOTS),
    (JOINTS, WEARER, PLOTS),
)
REPLAYED: Final[Arrangements] = (ALL, (JOINTS, WEARER | PLOTS), (JOINTS, WEARER, PLOTS))  # of a recording
HINT: Final = "Not all of the overview has room at once. Larger window, smaller text or F9: more of it"


def arranged(
    needs: Mapping[Section, int], room: int, bar: int, between: int, offered: Arrangements = NUMBERS_FIRST
) -> tuple[Page, ...]:
    """Return the pages for so much `room`, of which the `bar` that chooses one takes some (pixels)."""
    for pages in offered:
        left = room - (bar + between if len(pages) > 1 else 0)
        if all(sum(needs[one] + between for one in page) <= left for page in pages):
            return pages
    return offered[-1]


def name_of(page: Page) -> str:
    """Return what a page is called: by all that is on it."""
    return " and ".join(one.value for one in Section if one in page).capitalize()


class SectionBar(QFrame):
    """A button for each page, `chosen` tells its sections; hidden where all of them are in sight."""

    chosen = Signal(object)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._pages: tuple[Page, ...] = ()
        self.setAccessibleName("Pages of the overview")
        self.buttons: list[QPushButton] = []
        self._group = QButtonGroup(self)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(4)
        for place, section in enumerate(Section):
            button = QPushButton(section.value.capitalize())
            button.setObjectName("section")
            button.setCheckable(True)
            button.setToolTip(HINT)
            button.clicked.connect(lambda _on, place=place: self.chosen.emit(self._pages[place]))
            self._group.addButton(button)
            self._row.addWidget(button, 1)
            self.buttons.append(button)
        self.hide()

    def show_pages(self, pages: tuple[Page, ...], shown: Page) -> None:
        """Show a button for each of them, where there are several."""
        self._pages = pages
        for place, button in enumerate(self.buttons):
            button.setVisible(place < len(pages))
            button.setChecked(place < len(pages) and pages[place] == shown)
        self.setVisible(len(pages) > 1)
        self.say({})

    def say(self, wrong: Mapping[Section, Wrong]) -> None:
        """Say on the buttons what of joints and wearer is not well: it may be on the page behind one."""
        if len(self._pages) < 2:
            return
        everywhere = frozenset.intersection(*self._pages)
        for button, page in zip(self.buttons, self._pages, strict=False):
            here = [wrong[one] for one in Section if one in page - everywhere and one in wrong]
            behind = [(found, mark) for found, mark in here if found]
            names = [name for found, _ in behind for name in found]
            worst = max((mark for _, mark in behind), key=_badness, default=None)
            tone = "" if worst is None or worst.colour not in TONES else worst.colour
            text = name_of(page)
            if names and worst is not None:
                which = names[0] if len(names) == 1 else f"{len(names)} not ok"
                text = f"{GLYPHS[worst.shape]} {text}: {which}"
            if button.text() != text:
                button.setText(text)
            set_tone(button, tone if names else "")


def _badness(mark: Mark) -> int:
    """Return how bad it is, the more the worse; what nobody knows more of is not well either."""
    return TONES.index(mark.colour) if mark.colour in TONES else 0
