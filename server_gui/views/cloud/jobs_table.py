"""Jobs in the background: how far each is, what came of it, and a button that ends it."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QProgressBar,
    QPushButton,
    QSizePolicy,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from gateway.amounts import size
from server_gui.core.cloud.jobs import Job, Jobs, JobState
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import set_tip

TITLES: Final = ("Job", "", "", "")
NAME, BAR, SAID, BUTTON = range(4)
STEPS: Final = 1000  # of the bar


class JobsTable(QTableWidget):
    """The newest first; rows change in their place."""

    def __init__(self, jobs: Jobs, theme: Theme) -> None:
        super().__init__(0, len(TITLES))
        self._jobs = jobs
        self._theme = theme
        self._rows: list[Job] = []
        self.setAccessibleName("Jobs in the background")
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.verticalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Ignored)
        self.verticalHeader().hide()
        self.horizontalHeader().hide()
        header = self.horizontalHeader()
        for column in (NAME, BUTTON):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(BAR, QHeaderView.ResizeMode.Fixed)
        header.setSectionResizeMode(SAID, QHeaderView.ResizeMode.Stretch)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Show how far they are."""
        jobs = list(self._jobs.jobs)
        if jobs != self._rows:
            self._rows = jobs
            self.setRowCount(len(jobs))
            for row, job in enumerate(jobs):
                self._build(row, job)
        for row, job in enumerate(jobs):
            self._show(row, job)

    def _build(self, row: int, job: Job) -> None:
        for column in (NAME, SAID):
            self.setItem(row, column, QTableWidgetItem())
        bar, button = QProgressBar(textVisible=False), QPushButton("Cancel")
        bar.setAccessibleName(f"How far {job.name} is")
        button.setAccessibleName(f"Cancel {job.name}")
        button.clicked.connect(job.cancel)
        self.setCellWidget(row, BAR, _centred(bar))
        self.setCellWidget(row, BUTTON, button)

    def _show(self, row: int, job: Job) -> None:
        said = job.said if job.is_over else progress_text(job)
        for column, text in ((NAME, job.name), (SAID, said)):
            item = self.item(row, column)
            if item is not None and item.text() != text:
                item.setText(text)
                set_tip(item, text)
            if item is not None:  # the palette may be another by now
                item.setForeground(self._theme.colour("bad" if job.state is JobState.FAILED else "text"))
        for bar in self.cellWidget(row, BAR).findChildren(QProgressBar):
            bar.setRange(0, 0 if job.state is JobState.RUNNING and job.total is None else STEPS)
            bar.setValue(_steps(job))
        if job.is_over:
            self.removeCellWidget(row, BUTTON)

    def _restyle(self) -> None:
        self.verticalHeader().setMinimumSectionSize(self._theme.px(30))
        self.setColumnWidth(BAR, self._theme.px(120))
        self.setMinimumHeight(self._theme.px(70))


def _centred(bar: QProgressBar) -> QWidget:
    cell = QWidget()
    column = QVBoxLayout(cell)
    column.setContentsMargins(4, 0, 4, 0)
    column.addWidget(bar)
    return cell


def progress_text(job: Job) -> str:
    """Return how far a job is, in its own unit."""
    if job.total is None:
        return job.state.value
    if job.unit == "bytes":
        return f"{size(job.done)} of {size(job.total)}"
    return f"{job.done:,} of {job.total:,} {job.unit}"


def _steps(job: Job) -> int:
    if job.state is JobState.DONE:
        return STEPS
    return 0 if not job.total else min(round(STEPS * job.done / job.total), STEPS)


def under_way(jobs: Sequence[Job]) -> int:
    """Return the number of unfinished jobs."""
    return sum(not job.is_over for job in jobs)
