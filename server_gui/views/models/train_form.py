"""Form for a training, and the running trainings with their progress."""

from collections.abc import Iterable, Sequence
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QAbstractItemView, QComboBox, QGridLayout, QPushButton, QSizePolicy

from server_gui.core.models.lessons import Lessons
from server_gui.core.models.models import Models
from server_gui.core.models.names import EVERY, TASKS
from server_gui.core.models.training import TrainingWish
from server_gui.views.cloud.jobs_table import JobsTable
from server_gui.views.models.judges import Judges
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text, set_tone
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.scroll_area import bring_into_sight

ABOUT: Final = (
    "It learns from every session with labels, in a process of its own, and is judged by wearers whom it has "
    "not seen: that takes labels of three wearers, or sessions, at least. It is listed afterwards; nothing "
    "serves another model before you promote it."
)
LOOKING: Final = "Looking what is labelled …"
QUARTER: Final = "a quarter of them, always the same"


class TrainForm(Card):
    """`wished` brings what is to be trained."""

    wished = Signal(object)

    def __init__(self, models: Models, theme: Theme) -> None:
        super().__init__("Train")
        about = PlainLabel(ABOUT)
        about.setObjectName("dim")
        about.setWordWrap(True)
        self.task, self.robot, self.judges = QComboBox(), QComboBox(), Judges(theme)
        self.said = PlainLabel()
        self.said.setObjectName("dim")
        self.said.setWordWrap(True)
        for task, name in TASKS.items():
            self.task.addItem(name, task)
        self.begin = QPushButton("Start training")
        self.begin.setObjectName("primary")
        self.begin.clicked.connect(self._begin)
        self.jobs = JobsTable(models.jobs, theme)
        self.jobs.setAccessibleName("Trainings")
        self.jobs.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.jobs.setSizeAdjustPolicy(QAbstractItemView.SizeAdjustPolicy.AdjustToContents)
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        names = {"What it predicts": self.task, "For": self.robot, "Wearers": self.judges}
        for row, (name, field) in enumerate(names.items()):
            title = PlainLabel(name)
            title.setObjectName("dim")
            field.setAccessibleName(f"Training: {name}")
            grid.addWidget(title, row, 0)
            grid.addWidget(field, row, 1)
        grid.addWidget(self.said, len(names), 1)
        grid.addWidget(self.begin, len(names) + 1, 1)
        self.body.addWidget(about)
        self.body.addLayout(grid)
        self.body.addWidget(self.jobs)
        self._models = models
        self.offer(())

    def offer(self, robots: Iterable[str]) -> None:
        """Offer these robots."""
        offer_robots(self.robot, robots)

    def refresh(self) -> None:
        """Show how far trainings are."""
        self.jobs.refresh()
        self.jobs.setVisible(self._models.is_training)  # what came of one, the page says
        if not self.isVisible():
            return
        self._models.look_for_lessons(str(self.task.currentData()), str(self.robot.currentData()))
        lessons = self._models.lessons
        if self.judges.show_lessons(lessons or Lessons()):
            bring_into_sight(self.begin)  # which more rows have moved down
        said, is_fine = _said(lessons, self.judges.chosen)
        set_text(self.said, said)
        set_tone(self.said, "" if is_fine else "warn")
        is_reached = self._models.reach.problem is None
        nobody = None if lessons is None else lessons.judges(self.judges.chosen).problem
        can_begin = not self._models.is_training and is_reached and lessons is not None and not nobody
        self.begin.setEnabled(can_begin)
        set_tip(self.begin, nobody or "")

    def _begin(self) -> None:
        task, robot = str(self.task.currentData()), str(self.robot.currentData())
        self.wished.emit(TrainingWish(task, robot, self.judges.chosen))


def _said(lessons: Lessons | None, chosen: Sequence[str]) -> tuple[str, bool]:
    """Return who will judge, or why nobody can; and whether that is fine."""
    if lessons is None:
        return LOOKING, True
    judges = lessons.judges(chosen)
    if judges.problem:
        return f"▲ {judges.problem}", False
    names = ", ".join(sorted(judges.names))
    said = (
        f"Judged by {names}; it learns from the others."
        if chosen
        else f"Nobody is chosen: judged by {names}, {QUARTER}."
    )
    return " ".join([said, *(f"▲ {each}." for each in judges.left_out)]), not judges.left_out


def offer_robots(choice: QComboBox, robots: Iterable[str]) -> None:
    """Offer every robot, and each of these; what was chosen stays."""
    wanted = ["", *sorted(robots)]
    if [choice.itemData(place) for place in range(choice.count())] == wanted:
        return
    chosen = choice.currentData()
    choice.clear()
    for robot in wanted:
        choice.addItem(robot or EVERY, robot)
    choice.setCurrentIndex(max(0, choice.findData(chosen)))
