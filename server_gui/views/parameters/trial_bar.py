"""A trial that counts down: keep it, or let it go back."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.writing import Trial
from server_gui.views.edits.trial_words import TO_AB, changes, ends, is_judged, so_far, why_no_ab, wordings
from server_gui.views.widgets.card import set_primary, set_text, set_tone
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.visibility import is_all_seen
from server_gui.views.widgets.wrapping_label import WrappingLabel

WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
MOST: Final = 100_000  # pixels
LINES: Final = 2  # of text below the tabs
LOW: Final = 12  # lines: a middle of the window that is lower has room for one only
MIDDLE: Final = Qt.TextElideMode.ElideMiddle


class TrialBar(QFrame):
    """Hidden while nothing is on trial. `keep`, `take_back` and `compare` are what people decide.

    `compare` tells the station: its value is to be tried against the one from before. The window has one of
    the parameters' panel, and one above its tabs for when that is not in sight: the one above is `of_all`
    robots, `station` is the one whose trial it shows. Its time and its buttons are whole wherever it is:
    the rest is said more briefly where there is less room.
    """

    keep = Signal()
    take_back = Signal()
    compare = Signal(object)

    def __init__(self, desk: Desk, *, of_all: bool = False) -> None:
        super().__init__()
        self._desk = desk
        self._of_all = of_all
        self.station: Station | None = None
        self._write: tuple[str, int] | None = None
        self.setObjectName("card")
        self.setAccessibleName("Trial")
        self._wordings: tuple[str, ...] = ()
        self._briefest = "", ""
        self.words = WrappingLabel("title")
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setAccessibleName("Time left of the trial")
        keep, back = QPushButton("Keep it"), QPushButton("Take it back now")
        self._keep, self._back = keep, back
        keep.clicked.connect(self.keep)
        back.clicked.connect(self.take_back)
        self.ab = QPushButton("A/B …")
        set_tip(self.ab, TO_AB)
        self.ab.clicked.connect(lambda: self.compare.emit(self.station))
        row = QHBoxLayout()
        row.addWidget(back)
        row.addWidget(self.ab)
        row.addWidget(keep)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(9, 4, 9, 5)
        everything.setSpacing(4)
        everything.addWidget(self.words)
        everything.addWidget(self._bar)
        everything.addLayout(row)
        self.hide()

    @property
    def can_be_decided(self) -> bool:
        """Whether its buttons are whole in sight."""
        return is_all_seen(self._keep) and is_all_seen(self._back)

    def refresh(self, *, shown: bool = True) -> None:
        """Count down; `shown`: that of the robot that is looked at is to be seen here."""
        station = self.station = self._whose(shown=shown)
        trial = None if station is None else station.writing.trial
        self.setVisible(trial is not None)
        if station is None or trial is None:
            return
        why_not = why_no_ab(trial)
        self.ab.setEnabled(not why_not)
        set_tip(self.ab, why_not or TO_AB)
        left_s = trial.left_s()
        if (station.name, trial.write) != self._write:
            self._write = station.name, trial.write
            self._bar.setRange(0, max(1, round(left_s * 10)))
        self._bar.setValue(round(left_s * 10))
        set_primary(self._keep, is_judged(station))
        set_tone(self.words, "bad" if station.writing.failed_ask else "")
        whose = "" if station is self._desk.selected else f"{station.title}: "
        self._wordings = self._said(station, trial, whose)
        self._briefest = whose, ends(station, trial)
        set_tip(self.words, self._wordings[0])
        self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _said(self, station: Station, trial: Trial, whose: str) -> tuple[str, ...]:
        """Return its wordings, the fullest first: each has the time that is left."""
        units, end = self._desk.shown.units, ends(station, trial)
        full = f"{whose}on trial: {', '.join(changes(station, trial, units))}; {end}"
        judged = [f"{full}; {seen}" for seen in so_far(station)]
        brief = [f"{whose}{said}; {end}" for said in wordings(station, trial, units)[1:]]
        return *judged, full, *brief

    def _fit(self) -> None:
        """Say the fullest that has room, else how long it lasts, with a long name cut in its middle."""
        metrics, width = self.words.fontMetrics(), max(self.words.width(), 1)
        most = self._lines * metrics.lineSpacing()

        def has_room(text: str) -> bool:
            return metrics.boundingRect(0, 0, width, MOST, WRAPPED, text).height() <= most

        whose, end = self._briefest
        short = metrics.elidedText(whose, MIDDLE, width - metrics.horizontalAdvance(end))
        set_text(self.words, next(filter(has_room, self._wordings), f"{short}{end}"))

    @property
    def _lines(self) -> int:
        """How many lines of text it has: below the tabs few, or other rows have no room."""
        if not self._of_all:
            return MOST
        around, line = self.parentWidget(), self.words.fontMetrics().lineSpacing()
        return 1 if around is not None and around.height() < LOW * line else LINES

    def _whose(self, *, shown: bool) -> Station | None:
        """Return the robot of the shown trial; of several, the next one when that is over."""
        selected = self._desk.selected
        found = [selected] if selected is not None and shown else []
        found += [one for one in self._desk if one is not selected] if self._of_all else []
        return next((one for one in found if one.writing.trial is not None), None)
