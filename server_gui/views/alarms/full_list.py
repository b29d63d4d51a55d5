"""Every active alarm in full, and what may be done about each: a sheet over the tabs, opened by hand."""

from typing import Final, Protocol

from PySide6.QtCore import QEvent, QRect, QSize, Qt, Signal
from PySide6.QtWidgets import (
    QApplication,
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.alarms.texts import UNSTOPPED
from server_gui.views.alarms.words import Key, Told, blames, details, headline, key_of, now_s
from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.overlay import Overlay
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.wrapping_label import WrappingLabel

WIDEST: Final = 900  # at text of 100 %
AROUND_BUTTONS: Final = 24  # pixels, of a row
SPACE: Final = 6  # pixels above the buttons of a row
MOST_PX: Final = 16_777_215  # what Qt takes for no end
MORE: Final = "… more: rest the pointer here, or move it out of the list"
LAYERS: Final = 4  # of layouts within layouts
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
HINT_RESOURCES: Final = "What keeps the robot's computer busy, process by process"
OVER: Final = Mark("ring", "dim", "over")


class Deeds(Protocol):
    """Actions on an alarm."""

    told: tuple[Told, ...]

    @property
    def named(self) -> bool:
        """Whether it must be said whose an alarm is."""
        ...

    def clear(self, told: Told) -> None:
        """Ask for a reset of its robot's faults."""
        ...

    def show_signal(self, told: Told) -> None:
        """Bring what shows it, around the instant that it began."""
        ...

    def show_resources(self, told: Told) -> None:
        """Bring the page of what keeps its robot's computer busy."""
        ...

    def acknowledge(self, told: Told) -> None:
        """Acknowledge the alarm."""
        ...


class AlarmRow(QFrame):
    """One alarm in full, as it stands in the list; while it is held, as high as it is.

    What has no room then is left out, the last line first, and stands in its tip: the row would push those
    below it from under the pointer.
    """

    cleared = Signal()
    signal = Signal()
    resources = Signal()
    acknowledged = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._held: QSize | None = None
        self.setObjectName("alarm")
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self._icon = MarkIcon(theme, 13)
        self.headline, self.details = WrappingLabel(), WrappingLabel("dim")
        words = QVBoxLayout()
        words.setSpacing(1)
        words.addWidget(self.headline)
        words.addWidget(self.details)
        said = QHBoxLayout()
        said.setSpacing(8)
        said.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignTop)
        said.addLayout(words, 1)
        self.buttons = AlarmButtons()
        self.clear, self.show_signal = self.buttons.clear, self.buttons.show_signal
        self.acknowledge = self.buttons.acknowledge
        self.clear.clicked.connect(self.cleared)
        self.show_signal.clicked.connect(self.signal)
        self.buttons.show_resources.clicked.connect(self.resources)
        self.acknowledge.clicked.connect(self.acknowledged)
        column = QVBoxLayout(self)
        column.setContentsMargins(9, 5, 8, 5)
        column.setSpacing(SPACE)
        column.addLayout(said)
        column.addWidget(self.buttons, 0, Qt.AlignmentFlag.AlignLeft)
        theme.changed.connect(self._restyle)
        self._restyle()

    def say(self, told: Told, *, named: bool, is_over: bool = False) -> None:
        """Show this alarm, or that it `is_over`."""
        station, one = told
        mark = OVER if is_over else one.alarm.mark
        self._icon.show_mark(mark)
        set_tone(self, mark.colour)
        more = "over" if is_over else ""
        wordings = [headline(told, named=named, more=more, brief=brief) for brief in range(4)]
        said = details(one, now_s(station), each=True)
        self.buttons.offer(told)
        self.buttons.setVisible(not is_over)
        self.setAccessibleName(wordings[0])
        self.setAccessibleDescription("\n".join(said))
        main = wordings[0] if self._held is None else self._fitting_headline(wordings)
        set_text(self.headline, main)
        shown = said if self._held is None else self._fitting(said)
        set_text(self.details, "\n".join(shown))
        all_of_it = (wordings[0], said) == (main, shown)
        set_tip(self, "" if all_of_it else "\n".join([wordings[0], *said]))

    def hold(self, wanted: bool) -> None:
        """Be as high as now from now on; not where another width needs another height."""
        wanted = wanted and (self._held is None or self._held.width() == self.width())
        if wanted and self._held is None:
            self._held = self.size()
            self.setFixedHeight(self.height())
        elif not wanted and self._held is not None:
            self._held = None
            self.setMinimumHeight(0)
            self.setMaximumHeight(MOST_PX)

    @property
    def _room(self) -> int:
        """How high the words may be, above the buttons."""
        column = self.layout()
        around = 0 if column is None else self.height() - column.contentsRect().height()
        below = 0 if self.buttons.isHidden() else self.buttons.sizeHint().height() + SPACE
        return self.height() - around - below

    def _fitting_headline(self, wordings: list[str]) -> str:
        """Return the fullest one that has room."""
        fits = (text for text in wordings if _high(self.headline, text) <= self._room)
        return next(fits, wordings[-1])

    def _fitting(self, said: list[str]) -> list[str]:
        """As many of these lines as have room below the headline, and above the buttons."""
        room = self._room - self.headline.heightForWidth(self.headline.width()) - 1
        for count in range(len(said), 0, -1):
            shown = said if count == len(said) else [*said[:count], MORE]
            if _high(self.details, "\n".join(shown)) <= room:
                return shown
        return []

    def _restyle(self) -> None:
        self.headline.setFont(self._theme.text_font(bold=True))
        self.setStyleSheet(style(self._theme))


def _high(label: WrappingLabel, text: str) -> int:
    """Return the height of a label with this text."""
    box = QRect(0, 0, max(label.width(), 1), MOST_PX)
    return label.fontMetrics().boundingRect(box, WRAPPED, text).height()


class AlarmButtons(QWidget):
    """Buttons for the actions on an alarm; those that do not concern it are hidden."""

    def __init__(self) -> None:
        super().__init__()
        self.clear = QPushButton("Clear fault…")
        self.clear.setToolTip("Reset the drives' fault: they go to switch on disabled, none is enabled")
        self.show_signal = QPushButton("Show the signals ± 5 s")
        self.show_resources = QPushButton("Resources")
        self.show_resources.setToolTip(HINT_RESOURCES)
        self.acknowledge = QPushButton("Acknowledge")
        self.acknowledge.setToolTip("Mark as read: other alarms come before it until it is over")
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(6)
        self._all = (self.clear, self.show_signal, self.show_resources, self.acknowledge)
        for button in self._all:
            self._row.addWidget(button)

    def fit(self, room: int) -> None:
        """Stand below each other where there is less room (pixels) than they need beside each other."""
        needed = sum(one.sizeHint().width() + self._row.spacing() for one in self._all if not one.isHidden())
        direction = QBoxLayout.Direction
        self._row.setDirection(direction.TopToBottom if needed > room else direction.LeftToRight)

    def offer(self, told: Told | None, *, all_of_them: bool = True) -> None:
        """Offer what there is for this one; what is not offered at once stands in the list."""
        station, one = told or (None, None)
        alarm = None if one is None else one.alarm
        self.clear.setVisible(alarm is not None and alarm.clears)
        self.clear.setEnabled(station is not None and station.is_linked)
        shows = one is not None and one.alarm.channel is not None and one.at_ns is not None
        self.show_signal.setVisible(all_of_them and shows)
        is_of_load = alarm is not None and station is not None and blames(alarm)
        self.show_resources.setVisible(all_of_them and is_of_load)
        unread = one is not None and not one.is_acknowledged and one.alarm.kind not in UNSTOPPED
        is_past = station is not None and station.robot.is_recording  # nobody has to have read it
        self.acknowledge.setVisible(all_of_them and unread and not is_past)


class AlarmList(Overlay):
    """Every alarm in full. While it is open no row moves: new ones come last, and what is over stays.

    Texts grow and buttons go; as long as the pointer is over the list, no row changes its height by that.
    """

    def __init__(self, strip: Deeds, theme: Theme, below: QWidget) -> None:
        words = QWidget()
        super().__init__("All alarms", words, theme, below, WIDEST)
        self._strip = strip
        self._is_laid_out = False
        self._shown: dict[Key, Told] = {}
        self.rows: list[AlarmRow] = []
        self._column = QVBoxLayout(words)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(4)
        self._none = WrappingLabel("dim")
        self._none.setText("No alarms.")
        self._column.addWidget(self._none)
        self._column.addStretch(1)

    def turn(self) -> None:
        self._shown.clear()
        self._is_laid_out = False
        for row in self.rows:
            row.hold(False)
        super().turn()
        self.refresh()
        self._settle()
        self._is_laid_out = True
        self._fit()
        self._settle()

    def high(self, width: int) -> int:
        """As high as its rows, once they are laid out: what is below stays in sight."""
        if not self._is_laid_out:
            return super().high(width)
        around = self.height() - self._scrolled.viewport().height()
        room = max(width - (self.width() - self._scrolled.viewport().width()), 1)
        has_height = self._column.hasHeightForWidth()
        rows = self._column.totalHeightForWidth(room) if has_height else self._column.totalSizeHint().height()
        return rows + around

    def _settle(self) -> None:
        """Let words that need more lines have them before they are first seen: each layer tells the next."""
        for _ in range(LAYERS if self.isVisible() else 0):
            QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest)

    def refresh(self) -> None:
        """Show how each is now."""
        if not self.isVisible():
            return
        now = {key_of(told): told for told in self._strip.told}
        self._shown |= now
        is_used = self.underMouse()
        for row in self.rows:
            row.hold(is_used and row.isVisible())
        while len(self.rows) < len(self._shown):
            self._add_row()
        for row, (key, told) in zip(self.rows, self._shown.items(), strict=False):
            row.say(told, named=self._strip.named, is_over=key not in now)
            row.buttons.fit(self.room - AROUND_BUTTONS)
        for place, row in enumerate(self.rows):
            row.setVisible(place < len(self._shown))
        self._none.setVisible(not self._shown)
        if self.high(self.width()) > self.height():  # never lower while it is open
            self._fit()

    def _add_row(self) -> None:
        row, place = AlarmRow(self._theme), len(self.rows)
        row.cleared.connect(lambda: self._strip.clear(self._at(place)))
        row.signal.connect(lambda: self._strip.show_signal(self._at(place)))
        row.resources.connect(lambda: self._strip.show_resources(self._at(place)))
        row.acknowledged.connect(lambda: self._strip.acknowledge(self._at(place)))
        self.rows.append(row)
        self._column.insertWidget(place, row)

    def _at(self, place: int) -> Told:
        return list(self._shown.values())[place]


def style(theme: Theme) -> str:
    """Return the frame of an alarm, by its tone."""
    colours = theme.colours
    return (
        f"QFrame#alarm {{ background: {colours.card}; border: 1px solid {colours.border}; "
        f"border-left: 4px solid {colours.warn}; border-radius: 4px; }}"
        f'QFrame#alarm[tone="bad"] {{ border-color: {colours.bad}; }}'
        f'QFrame#alarm[tone="urgent"] {{ border-color: {colours.bad}; background: {theme.urgent.name()}; }}'
        f'QFrame#alarm[tone="good"] {{ border-left-color: {colours.border}; }}'
        f'QFrame#alarm[tone="dim"], QFrame#alarm[tone="old"] {{ border-left-color: {colours.dim}; }}'
        f"QFrame#alarm:focus {{ border-color: {colours.accent}; }}"
    )
