"""A trial that counts down: keep it, or let it go back."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.edits.trial_words import TO_AB, changes, ends, is_judged, so_far, why_no_ab
from server_gui.views.widgets.card import set_primary, set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip


class TrialBar(QFrame):
    """Hidden while nothing is on trial. `keep`, `take_back` and `compare` are what people decide.

    `compare` tells the station: its value is to be tried against the one from before. The window has one of
    the parameters' panel, and one above its tabs for when that is not in sight: the one above is `of_all`
    robots, `station` is the one whose trial it shows.
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
        self.words = PlainLabel()
        self.words.setObjectName("title")
        self.words.setWordWrap(True)
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setAccessibleName("Time left of the trial")
        keep, back = QPushButton("Keep it"), QPushButton("Take it back now")
        self._keep = keep
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
        everything.addWidget(self.words)
        everything.addWidget(self._bar)
        everything.addLayout(row)
        self.hide()

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
        whose = "" if station is self._desk.selected else f"{station.title}: "
        said = ", ".join(changes(station, trial, self._desk.shown.units))
        seen = so_far(station)[0]
        set_primary(self._keep, is_judged(station))
        set_text(self.words, f"{whose}on trial: {said}; {ends(trial)}; {seen}")

    def _whose(self, *, shown: bool) -> Station | None:
        """Return the robot of the shown trial; of several, the next one when that is over."""
        selected = self._desk.selected
        found = [selected] if selected is not None and shown else []
        found += [one for one in self._desk if one is not selected] if self._of_all else []
        return next((one for one in found if one.writing.trial is not None), None)
