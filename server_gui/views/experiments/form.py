"""Form for an experiment: a parameter, its values and dwell times; the plan is shown before it begins."""

import random
from typing import Final, NamedTuple

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QGridLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gateway.units import Unit
from gateway.wire.parameter import PARAMETER_WRITE, ParameterInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.experiments.plan import (
    FEWEST_CYCLES,
    FEWEST_PAIRS,
    MOST_CYCLES,
    MOST_PAIRS,
    USUAL_CYCLES,
    USUAL_PAIRS,
    USUAL_TRANSIENT,
    BadPlan,
    Bounds,
    Dwell,
    ExperimentKind,
    ExperimentPlan,
    ab,
    sweep,
)
from server_gui.core.experiments.wording import stated
from server_gui.core.tuning.edits import unit_of
from server_gui.core.tuning.writing import WriteState
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.no_wheel_spin import NoWheelSpin
from server_gui.views.widgets.plain import PlainLabel

WIDTH: Final = 460  # at text of 100 %
FIELDS: Final = {ExperimentKind.AB: ("A", "B"), ExperimentKind.SWEEP: ("From", "To", "Step")}
LOOK_MS: Final = 500
USUAL: Final = "twice what is usual"


class Tried(NamedTuple):
    """A trial: a parameter, the value before, and the one on trial (SI)."""

    parameter: str
    before: float
    value: float


class ExperimentForm(QDialog):
    """Never modal: STOP stays in reach. It begins only what it has said, and only where that can be."""

    def __init__(
        self,
        parent: QWidget,
        desk: Desk,
        station: Station,
        theme: Theme,
        kind: ExperimentKind,
        tried: Tried | None = None,
    ) -> None:
        super().__init__(parent)
        self._desk, self._station, self._kind, self._tried = desk, station, kind, tried
        self._seed = random.SystemRandom().randrange(2**31)  # what is said is what is begun
        self.setWindowTitle(f"{kind.value[0].upper()}{kind.value[1:]} · {station.title}")
        self.setModal(False)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.parameter = QComboBox()
        self.parameter.setAccessibleName("Parameter")
        self.parameter.addItems(list(station.known))
        self.fields = {name: QLineEdit() for name in FIELDS[kind]}
        self.unit = PlainLabel()
        self.pairs = _spin(FEWEST_PAIRS, MOST_PAIRS, USUAL_PAIRS)
        self.cycles = _spin(FEWEST_CYCLES, MOST_CYCLES, USUAL_CYCLES)
        self.transient = _spin(0, 20, USUAL_TRANSIENT)
        self.error, self.current = QLineEdit(), QLineEdit()
        units = desk.shown.units
        self._error_unit = units.unit("following_error", "rad")
        self._current_unit = units.unit("current", "A")
        for bound in (self.error, self.current):
            bound.setPlaceholderText(USUAL)
        self.words = PlainLabel()
        self.words.setWordWrap(True)
        self.words.setMinimumWidth(theme.px(WIDTH))
        self.begin, cancel = QPushButton("Begin"), QPushButton("Cancel")
        self.begin.setObjectName("primary")
        self.begin.setAutoDefault(False)
        self.begin.clicked.connect(self._begin)
        cancel.clicked.connect(self.reject)
        column = QVBoxLayout(self)
        column.addLayout(self._grid())
        column.addWidget(self.words)
        buttons = QGridLayout()
        buttons.setColumnStretch(0, 1)
        buttons.addWidget(cancel, 0, 1)
        buttons.addWidget(self.begin, 0, 2)
        column.addLayout(buttons)
        self.parameter.currentIndexChanged.connect(lambda _: self._chosen())
        for field in (*self.fields.values(), self.error, self.current):
            field.textChanged.connect(lambda _: self._look())
        for spin in (self.pairs, self.cycles, self.transient):
            spin.valueChanged.connect(lambda _: self._look())
        trial = station.writing.trial
        edited = next(iter(trial.values if trial else station.edits.staged), "")
        edited = tried.parameter if tried else edited
        self.parameter.setCurrentIndex(max(0, self.parameter.findText(edited)))
        self._chosen()
        # What is held may change while it is asked about: it does while a trial goes back.
        self._clock = QTimer(self, interval=LOOK_MS)
        self._clock.timeout.connect(self._look)
        self._clock.start()

    @property
    def plan(self) -> ExperimentPlan:
        """The plan as typed; raises `BadPlan`."""
        info, held, unit = self._held()
        refused = self._station.refused(PARAMETER_WRITE)
        if refused:
            raise BadPlan(refused)
        if self._station.writing.trial is not None:
            raise BadPlan("something is on trial: keep it, or take it back, first")
        if self._station.writing.state is WriteState.WRITING:
            raise BadPlan(self._station.writing.text)
        values = [_number(field.text(), name, unit) for name, field in self.fields.items()]
        dwell = Dwell(self.cycles.value(), self.transient.value())
        bounds = Bounds(
            _bound(self.error, "tracking error", self._error_unit),
            _bound(self.current, "current", self._current_unit),
        )
        if self._kind is ExperimentKind.AB:
            first, second = values
            pairs, seed = self.pairs.value(), self._seed
            return ab(info, held, (first, second), unit, pairs=pairs, dwell=dwell, bounds=bounds, seed=seed)
        first, last, step = values
        return sweep(info, held, (first, last, step), unit, dwell=dwell, bounds=bounds)

    def _grid(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        pairs = {"Pairs": self.pairs} if self._kind is ExperimentKind.AB else {}
        rows: dict[str, QWidget] = {
            "Parameter": self.parameter,
            "Unit": self.unit,
            **self.fields,
            **pairs,
            "Gait cycles each": self.cycles,
            "Left out after a change": self.transient,
            f"Most tracking error ({self._error_unit.symbol})": self.error,
            f"Most current ({self._current_unit.symbol})": self.current,
        }
        for row, (name, field) in enumerate(rows.items()):
            title = PlainLabel(name)
            title.setObjectName("dim")
            field.setAccessibleName(name)
            grid.addWidget(title, row, 0)
            grid.addWidget(field, row, 1)
        return grid

    def _held(self) -> tuple[ParameterInfo, float, Unit]:
        name = self.parameter.currentText()
        info, held = self._station.known.get(name), self._station.robot.parameters.get(name)
        if info is None or held is None or held.value is None:
            raise BadPlan("what is held now is not known: wait until it was read")
        return info, float(held.value), unit_of(name, info.unit, self._desk.shown.units)

    def _chosen(self) -> None:
        """Begin another parameter with what was on trial; else with what is held, and was typed for it."""
        tried = self._tried
        is_ab = self._kind is ExperimentKind.AB  # a sweep begins with what is held
        if tried is not None and is_ab and tried.parameter == self.parameter.currentText():
            info = self._station.known[tried.parameter]
            unit = unit_of(info.name, info.unit, self._desk.shown.units)
            self.unit.setText(unit.symbol or "no unit")
            for name, value in (("A", tried.before), ("B", tried.value)):
                self.fields[name].setText(unit.editable(value))
            self._look()
            return
        try:
            info, held, unit = self._held()
        except BadPlan:
            self._look()
            return
        staged = self._station.edits.staged.get(info.name)
        self.unit.setText(unit.symbol or "no unit")
        first = next(iter(self.fields.values()))
        first.setText(unit.editable(held))
        if is_ab:
            self.fields["B"].setText("" if staged is None else unit.editable(staged.value))
        self._look()

    def _look(self) -> None:
        try:
            plan = self.plan
        except BadPlan as error:
            self.begin.setEnabled(False)
            self._say(f"{str(error)[:1].upper()}{str(error)[1:]}.")
            return
        self.begin.setEnabled(True)
        self._say("\n".join(line.strip() for line in stated(plan)))

    def _say(self, text: str) -> None:
        """Grow the form with its contents: Qt would press the fields together."""
        set_text(self.words, text)
        needed = self.heightForWidth(self.width())
        if self.isVisible() and needed > self.height():
            self.resize(self.width(), needed)

    def _begin(self) -> None:
        try:
            self._station.begin(self.plan)
        except BadPlan as error:
            self._say(str(error))
            return
        self.accept()


def _spin(least: int, most: int, usual: int) -> NoWheelSpin:
    spin = NoWheelSpin()
    spin.setRange(least, most)
    spin.setValue(usual)
    return spin


def _number(text: str, name: str, unit: Unit) -> float:
    try:
        return float(unit.si_value(text))
    except ValueError as error:
        raise BadPlan(f"{name}: type a number" if not text else f"{name}: {error}") from error


def _bound(field: QLineEdit, name: str, unit: Unit) -> float | None:
    text = field.text().strip()
    if not text:
        return None
    try:
        value = unit.si_value(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e9:
        raise BadPlan(f"the most {name} is a number above 0, or empty: {USUAL}")
    return value
