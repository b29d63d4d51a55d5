"""An experiment that goes on: where it stands, and the way to end it, always in sight."""

from msgspec.structs import replace
from PySide6.QtWidgets import QFrame, QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.experiments.machine import ExperimentState
from server_gui.core.experiments.result import result
from server_gui.core.experiments.run import Run
from server_gui.core.experiments.wording import progress
from server_gui.core.follow.news import NewsKind
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.plain import PlainLabel


class ExperimentBar(QFrame):
    """Hidden while there is none. It also watches: a sweep ends when the window is minimised, or hangs."""

    def __init__(self, desk: Desk) -> None:
        super().__init__()
        self._desk = desk
        self._told: list[Run] = []  # that are over, and were told
        self._closed: list[Run] = []
        self._station: Station | None = None
        self.setObjectName("card")
        self.setAccessibleName("Experiment")
        self.words = PlainLabel()
        self.words.setObjectName("title")
        self.words.setWordWrap(True)
        self._bar = QProgressBar()
        self._bar.setTextVisible(False)
        self._bar.setAccessibleName("How much of the experiment is done")
        self.end = QPushButton("Stop and take back")
        self.end.setObjectName("primary")
        self.end.clicked.connect(self._end)
        row = QHBoxLayout()
        row.addWidget(self._bar, 1)
        row.addWidget(self.end)
        everything = QVBoxLayout(self)
        everything.addWidget(self.words)
        everything.addLayout(row)
        self.hide()

    def refresh(self) -> None:
        """Let every experiment go on, and show one: of the robot that is looked at, else of another."""
        for station in self._desk:
            run = station.experiment
            if run is not None and run not in self._told:
                self._go_on(station, run)
        found = self._station = self._whose()
        run = None if found is None else found.experiment
        self.setVisible(run is not None)
        if found is None or run is None:
            return
        whose = "" if found is self._desk.selected else f"{found.title}: "
        set_text(self.words, whose + progress(run))
        set_tone(self.words, "bad" if run.state is ExperimentState.NOT_CONFIRMED else "")
        self._bar.setRange(0, len(run.plan.steps))
        self._bar.setValue(run.place)
        self._bar.setVisible(not run.is_over)
        self.end.setText("Close" if run.is_over else "Stop and take back")

    def _go_on(self, station: Station, run: Run) -> None:
        if self.isVisible() and not self.window().isMinimized():
            run.beat()
        run.tick([one.alarm for one in station.alarms.active])
        if run.is_over:
            self._told = [*self._told[-9:], run]
            self._tell(station, run)

    def _tell(self, station: Station, run: Run) -> None:
        failed = run.state is ExperimentState.NOT_CONFIRMED
        station.tell(NewsKind.WARNING if failed or run.why else NewsKind.PARAMETER, progress(run))
        info = station.known.get(run.plan.name)
        told = result(run, station.who or "this desk", "" if info is None else info.unit)
        if told is not None:
            told = replace(told, edit=replace(told.edit, robot=station.name))
            station.judged.take(told)
            self._desk.keep_evidence(station.name, told)

    def _whose(self) -> Station | None:
        shown = [self._desk.selected, *self._desk]
        found = [one for one in shown if one is not None and one.experiment not in (None, *self._closed)]
        running = (one for one in found if one.experiment is not None and not one.experiment.is_over)
        return next(running, next(iter(found), None))

    def _end(self) -> None:
        run = None if self._station is None else self._station.experiment
        if run is None:
            return
        if run.is_over:
            self._closed = [*self._closed[-9:], run]
        else:
            run.halt("asked for")
        self.refresh()
