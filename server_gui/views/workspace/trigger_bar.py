"""The trigger of the signals: what is waited for, what then, and how it is."""

import math
from collections.abc import Sequence

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout

from gateway.units import Unit
from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.trigger import WINDOWS, Condition, Mode, On
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plain import set_tip

NO_UNIT = Unit("", "")


class TriggerBar(Card):
    """`armed` brings a condition, `ended` when somebody wants to see what comes."""

    armed = Signal(object)
    ended = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__("Trigger")
        self._theme = theme
        self._units: dict[str, Unit] = {}
        self._components: Sequence[str] = ()
        self._unit, self._unit_of = NO_UNIT, ""
        self._is_of_drives = False
        self.of = _choice("What triggers: a curve, or a drive for EMCY")
        self.of.currentTextChanged.connect(self._show_unit)
        self.on = _choice("When it triggers", [one.value for one in On])
        self.on.currentTextChanged.connect(self._fit)
        self.level, self.high = NumberField("Level, or lower end"), NumberField("Upper end")
        self.mode = _choice("What comes after", [one.value for one in Mode])
        self.mode.setCurrentText(Mode.NORMAL.value)
        self.before = NumberField("Share of the view before the trigger", 50.0, "% before")
        self.hold_off = NumberField("Hold-off", 0.0, "s hold-off")
        self.arm = QPushButton("Arm")
        self.arm.setToolTip("Wait for the trigger; data and recording continue")
        self.arm.clicked.connect(lambda: self.armed.emit(self.condition))
        self.live = QPushButton("Off")
        self.live.setAccessibleName("Trigger off")
        self.live.setToolTip("Trigger off: show live data")
        self.live.clicked.connect(self.ended)
        rows = QVBoxLayout()
        first, second = (self.of, self.on), (self.level, self.high, self.mode)
        for widgets in (first, second, (self.before, self.hold_off, self.arm, self.live)):
            row = QHBoxLayout()
            for widget in widgets:
                row.addWidget(widget, 1)
            rows.addLayout(row)
        self.body.addLayout(rows)
        self._fit()
        self.hide()

    def say(self, text: str) -> None:
        """Say how it is."""
        self.set_title(f"Trigger, {text}")

    @property
    def condition(self) -> Condition:
        """The chosen condition."""
        scale = self._unit.scale
        return Condition(
            On(self.on.currentText()),
            self.of.currentText(),
            self.level.value / scale,
            self.high.value / scale,
            Mode(self.mode.currentText()),
            self.before.value / 100,
            self.hold_off.value,
        )

    def show_choices(self, scene: Scene) -> None:
        """List the trigger sources: drawn curves with their units, and drives."""
        meant = map(scene.meaning, [*scene.workspace.curves, self.of.currentText()])
        self._units = {one.text: one.unit for one in meant if one.unit is not None}
        self._components = scene.drives
        self._fit()

    def show_condition(self, condition: Condition) -> None:
        """Show this in all fields."""
        self.on.setCurrentText(condition.on.value)
        if self.of.findText(condition.of) < 0:
            self.of.addItem(condition.of)
        self.of.setCurrentText(condition.of)
        self.level.set_value(condition.level * self._unit.scale)
        self.high.set_value(condition.high * self._unit.scale)
        self.mode.setCurrentText(condition.mode.value)
        self.before.set_value(condition.before * 100)
        self.hold_off.set_value(condition.hold_off_s)

    def _fit(self) -> None:
        """Only what counts for what is waited for. What was chosen stays so, also where it is not there."""
        on = On(self.on.currentText())
        is_of_drives, before = on is On.EMCY, self.of.currentText()
        choices = list(self._components if is_of_drives else self._units)
        if before and before not in choices and is_of_drives is self._is_of_drives:
            choices.append(before)
        self._is_of_drives = is_of_drives
        if choices != [self.of.itemText(place) for place in range(self.of.count())]:
            with QSignalBlocker(self.of):
                self.of.clear()
                self.of.addItems(choices)
                if before in choices:
                    self.of.setCurrentText(before)
        self.level.setVisible(on is not On.EMCY)
        self.high.setVisible(on in WINDOWS)
        self._show_unit()

    def _show_unit(self) -> None:
        """Levels of one curve stay what they are in whatever unit; those of another keep their numbers."""
        of = self.of.currentText()
        is_same, known = of == self._unit_of, self._units.get(of)
        unit = known or (self._unit if is_same else NO_UNIT)
        factor = unit.scale / self._unit.scale if is_same else 1.0
        self._unit_of = of
        if unit != self._unit:
            self._unit = unit
            for field in (self.level, self.high):
                field.set_suffix(unit.symbol, factor)


def _choice(name: str, texts: Sequence[str] = ()) -> QComboBox:
    combo = QComboBox()
    combo.addItems(list(texts))
    combo.setAccessibleName(name)
    set_tip(combo, name)
    combo.setMinimumContentsLength(7)
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return combo


class NumberField(QLineEdit):
    """A number with its unit behind it; what is no number is NaN, which no trigger takes."""

    def __init__(self, name: str, value: float = 0.0, suffix: str = "") -> None:
        super().__init__()
        self._suffix = suffix
        self.setAccessibleName(name)
        set_tip(self, name)
        self.setMinimumWidth(50)
        self.set_value(value)

    @property
    def value(self) -> float:
        """The number that stands there."""
        text = self.text().strip().removesuffix(self._suffix).replace("−", "-").strip()
        try:
            return float(text)
        except ValueError:
            return math.nan

    def set_value(self, value: float) -> None:
        """Show this number."""
        self.setText(f"{value:.6g} {self._suffix}".rstrip())

    def set_suffix(self, suffix: str, factor: float = 1.0) -> None:
        """Show another unit behind it, and `factor` as many of it."""
        value, self._suffix = self.value, suffix
        if math.isfinite(value):
            self.set_value(value * factor)
