"""The tab of models: which there are, one beside another, which serves; train, promote, roll back."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QBoxLayout, QComboBox, QHBoxLayout, QPushButton, QVBoxLayout, QWidget

from gateway.amounts import counted
from server_gui.core.cloud.store_reach import AGAIN, Reach
from server_gui.core.desk.desk import Desk
from server_gui.core.models.catalogue import Entry
from server_gui.core.models.models import Models
from server_gui.core.models.training import TrainingWish
from server_gui.processes.training import training
from server_gui.views.marks import day_and_time
from server_gui.views.models.compare import Compare
from server_gui.views.models.confirm import Confirm
from server_gui.views.models.models_table import ModelsModel, ModelsTable
from server_gui.views.models.train_form import TrainForm, offer_robots
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip, unbroken
from server_gui.views.widgets.scroll_area import bring_into_sight

SLOW: Final = 6  # frames between two looks
NARROW: Final = 480  # at text of 100 %: no room for all buttons in a row
LOOKING: Final = "Looking for models …"
EMPTY: Final = (
    "No model is known here. Train one from labelled recordings, or install those that come with GWRMS."
)


PROMOTES: Final = "Let the selected model serve, after showing the change"
ROLLS_BACK: Final = "Return to the previous model, after showing the change"
TRAINS: Final = "Choose what to learn and who judges it; nothing serves another model before it is promoted"
NO_CHANGE: Final = "{trouble}: nothing can be promoted or rolled back until it is"
NO_LESSONS: Final = "{trouble}: nothing can be learned from until it is"
NOT_REACHED: Final = "The store is not reached"
NOT_READ: Final = "The list of models is not read"
AWAY: Final = f"▲ {{trouble}}, {AGAIN}. {{below}}: {{why}}"
BELOW: Final = "Below is what was known at {when}, {count}; there may be others by now"
NEVER: Final = "It was not read yet: there may be more than the {count} below"


class ModelsPage(QWidget):
    """Nothing here waits: the store is read in a thread, and a training is a process of its own."""

    def __init__(self, models: Models, theme: Theme, desk: Desk | None = None) -> None:
        super().__init__()
        self._models = models
        self._desk = desk
        self._theme = theme
        self._frame = 0
        self._revision = -1
        self._known: set[str] = set()  # of what was trained here
        self.setObjectName("page")
        self.rows = ModelsModel(theme)
        self.table = ModelsTable(self.rows, theme)
        self.state, self.said = PlainLabel(LOOKING), PlainLabel()
        self.state.setWordWrap(True)
        self.state.setObjectName("dim")
        self.said.setWordWrap(True)
        self.said.setObjectName("banner")
        self.said.hide()
        self.learned = PlainLabel()
        self.learned.setWordWrap(True)
        self.learned.hide()
        self.robot = QComboBox()
        self.robot.setAccessibleName("For which robot")
        self.robot.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.promote, self.back = QPushButton("Promote…"), QPushButton("Roll back…")
        self.new = QPushButton("Train a model")
        self.confirm, self.compare = Confirm(models), Compare(theme)
        self.form = TrainForm(models, theme)
        self.form.hide()
        self._build()
        self._connect()

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._models.knock()
        self._frame = 0
        self.refresh()  # what was so when it was hidden is not shown for a moment

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        direction = QBoxLayout.Direction
        is_narrow = self.width() < self._theme.px(NARROW)
        self._actions.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)

    def refresh(self) -> None:
        """Look again where it is time, and show how it is."""
        self._frame += 1
        if self._frame % SLOW != 1:
            return
        models = self._models
        models.look()
        if models.revision != self._revision:
            self._revision = models.revision
            self.rows.take(models.found.entries)
            self._choose_trained()
            if models.found.entries and not self.table.selectionModel().hasSelection():
                self.table.selectRow(0)
        for offered in (self.robot, self.form.robot):
            offer_robots(offered, models.robots())
        self._show_state()
        self._show_learned()
        entry = self.chosen
        trained = None if entry is None else models.trained.get(entry.card.id)
        is_said = trained is None or trained.said in self._models.said  # above already
        judged = "" if trained is None or is_said else f"Training has judged it: {trained.said}"
        self.compare.show_entry(entry, models.found, judged)
        self.confirm.refresh()
        self.form.refresh()
        self._show_actions(entry)

    @property
    def chosen(self) -> Entry | None:
        """The model that is chosen in the list."""
        return self.table.chosen

    # --- inside

    def _build(self) -> None:
        self.new.setCheckable(True)
        words = PlainLabel("for")
        words.setObjectName("dim")
        row = QHBoxLayout()
        row.addStretch(1)
        for part in (words, self.robot, self.promote, self.back):
            row.addWidget(part)
        self._actions = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._actions.addWidget(self.new, 0, Qt.AlignmentFlag.AlignLeft)
        self._actions.addLayout(row, 1)
        self._list = Card("Models")
        self._list.body.addWidget(self.state)
        self._list.body.addWidget(self.learned)
        self._list.body.addWidget(self.table)
        self._list.body.addLayout(self._actions)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(self._list)
        everything.addWidget(self.confirm)
        everything.addWidget(self.said)
        everything.addWidget(self.form)
        everything.addWidget(self.compare, 1)

    def _connect(self) -> None:
        self.new.toggled.connect(self._show_form)
        self.form.wished.connect(self._train)
        self.promote.clicked.connect(self._promote)
        self.back.clicked.connect(self._roll_back)

    def _show_form(self, on: bool) -> None:
        self.form.setVisible(on)
        if on:
            bring_into_sight(self.form.begin)

    def _choose_trained(self) -> None:
        """Show a model trained here next, once."""
        for model in self._models.trained.keys() - self._known:
            if self._models.found.find(model) is not None:
                self._known.add(model)
                self.table.choose(model)
                self.new.setChecked(False)  # what came of it is looked at next
                bring_into_sight(self._list)

    def _train(self, wish: TrainingWish) -> None:
        self._models.train(wish, training)

    def _promote(self) -> None:
        if (entry := self.chosen) is not None:
            self._models.ask_promotion(entry.card.id, str(self.robot.currentData()))

    def _roll_back(self) -> None:
        if (entry := self.chosen) is not None:
            self._models.ask_rollback(entry.card.task, str(self.robot.currentData()))

    def _show_state(self) -> None:
        models, found, reach = self._models, self._models.found, self._models.reach
        away = reach.problem or found.problem
        lines = [AWAY.format(trouble=self._trouble, below=self._below, why=away)] if away else []
        lines += [f"▲ Store: {reach.said}"] if reach.state is Reach.FAILING else []
        lines += [f"▲ {found.problem}"] if found.problem and found.problem != away else []
        lines += [f"▲ {each}" for each in found.damaged]
        if models.looked_s is None:
            lines.append(LOOKING)
        elif not found.entries and not away:
            lines.append(EMPTY)
        set_text(self.state, "\n".join(lines))
        self.state.setVisible(bool(lines))
        set_text(self.said, unbroken(models.said))
        self.said.setVisible(bool(models.said))
        tone = models.tone.value
        if self.said.property("tone") != tone:
            self.said.setProperty("tone", tone)
            self.said.style().polish(self.said)

    def _show_learned(self) -> None:
        """Show adapted models, which are not in the store."""
        known = [(one.title, one.predictions.adapting) for one in self._desk or ()]
        lines = [f"◆ {title}: {one.standing}" for title, one in known if one is not None and one.standing]
        set_text(self.learned, "\n".join(lines))
        self.learned.setVisible(bool(lines))

    def _show_actions(self, entry: Entry | None) -> None:
        asked = self._models.change is not None
        trouble = self._trouble
        for button, does in ((self.promote, PROMOTES), (self.back, ROLLS_BACK)):
            button.setEnabled(entry is not None and not asked and not trouble)
            set_tip(button, NO_CHANGE.format(trouble=trouble) if trouble else does)
        self.new.setEnabled(not trouble or self.new.isChecked())
        set_tip(self.new, NO_LESSONS.format(trouble=trouble) if trouble else TRAINS)
        count = counted(len(self._models.found.entries), "model")
        if trouble:
            self._list.set_note(f"{trouble}: {count} {self._as_of}", f"{count} {self._as_of}")
            self.compare.set_note(f"{trouble}: {self._as_of}", self._as_of)
        else:
            self._list.set_note(f"{count}{' · training' if self._models.is_training else ''}")
            self.compare.set_note("")

    @property
    def _trouble(self) -> str:
        """Why the list may not be what there is; empty where it is."""
        if self._models.is_reached:
            return ""
        return NOT_REACHED if self._models.reach.problem is not None else NOT_READ

    @property
    def _as_of(self) -> str:
        """When the list was read last."""
        known_s = self._models.known_s
        return "at least" if known_s is None else f"as known at {day_and_time(known_s)}"

    @property
    def _below(self) -> str:
        """What the list is while the store is away."""
        count, known_s = counted(len(self._models.found.entries), "model"), self._models.known_s
        if known_s is None:
            return NEVER.format(count=count)
        return BELOW.format(when=day_and_time(known_s), count=count)
