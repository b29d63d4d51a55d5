"""A trial that counts down: keep it, or let it go back."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import unit_of
from server_gui.core.tuning.writing import Trial
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import PlainLabel


class TrialBar(QFrame):
    """Hidden while nothing is on trial. `keep` and `take_back` are what people decide.

    The window has one of the parameters' panel, and one above its tabs for when that is not in sight.
    """

    keep = Signal()
    take_back = Signal()

    def __init__(self, desk: Desk) -> None:
        super().__init__()
        self._desk = desk
        self._write: int | None = None
        self.setObjectName("card")
        self.setAccessibleName("Trial")
        self.words = PlainLabel()
        self.words.setObjectName("title")
        self.words.setWordWrap(True)
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setAccessibleName("Time left of the trial")
        keep, back = QPushButton("Keep it"), QPushButton("Take it back now")
        keep.setObjectName("primary")
        keep.clicked.connect(self.keep)
        back.clicked.connect(self.take_back)
        row = QHBoxLayout()
        row.addWidget(back)
        row.addWidget(keep)
        everything = QVBoxLayout(self)
        everything.addWidget(self.words)
        everything.addWidget(self._bar)
        everything.addLayout(row)
        self.hide()

    def refresh(self, *, shown: bool = True) -> None:
        """Count down; `shown`: it is to be seen while there is a trial."""
        station = self._desk.selected
        trial = None if station is None else station.writing.trial
        self.setVisible(trial is not None and shown)
        if station is None or trial is None:
            return
        left_s = trial.left_s()
        if trial.write != self._write:
            self._write = trial.write
            self._bar.setRange(0, max(1, round(left_s * 10)))
        self._bar.setValue(round(left_s * 10))
        ends = (
            f"the robot takes it back in {left_s:.0f} s"
            if left_s
            else "its time is over: reading the values …"
        )
        set_text(self.words, f"On trial: {_values(station, trial, self._desk)}; {ends}")


def _values(station: Station, trial: Trial, desk: Desk) -> str:
    said = []
    for name, value in trial.values.items():
        info = station.known.get(name)
        unit = unit_of(name, "" if info is None else info.unit, desk.shown.units)
        before = trial.before.get(name)
        old = "?" if before is None else unit.editable(before)
        said.append(f"{name} {old} → {unit.editable(value)} {unit.symbol}".rstrip())
    return ", ".join(said)
