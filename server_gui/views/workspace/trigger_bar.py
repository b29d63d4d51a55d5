"""The trigger of the signals: what is waited for, what then, and how it is."""

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QBoxLayout, QComboBox, QDoubleSpinBox, QHBoxLayout, QPushButton

from gateway.units import Unit
from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.trigger import LONGEST_HOLD_S, WINDOWS, Condition, Mode, On
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.elided import ElidedLabel

MOST = 1e9
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
        self._unit = NO_UNIT
        self.of = _choice("What triggers: a curve, or a drive for EMCY")
        self.of.currentTextChanged.connect(self._show_unit)
        self.on = _choice("When it triggers", [one.value for one in On])
        self.on.currentTextChanged.connect(self._fit)
        self.level, self.high = _number("Level, or lower end", -MOST, MOST), _number("Upper end", -MOST, MOST)
        self.mode = _choice("What comes after", [one.value for one in Mode])
        self.mode.setCurrentText(Mode.NORMAL.value)
        self.before = _number("Share of what is seen that is before it", 0, 100, " % before")
        self.before.setDecimals(0)
        self.before.setValue(50)
        self.hold_off = _number("Hold-off", 0, LONGEST_HOLD_S, " s hold-off")
        self.hold_off.setDecimals(1)
        self.arm = QPushButton("Arm")
        self.arm.setToolTip("Wait for it, from now on; data and recording go on whatever is shown")
        self.arm.clicked.connect(lambda: self.armed.emit(self.condition))
        self.live = QPushButton("Off")
        self.live.setAccessibleName("Trigger off")
        self.live.setToolTip("Wait for nothing, and show what comes")
        self.live.clicked.connect(self.ended)
        self.said = ElidedLabel()
        self._rows = QBoxLayout(QBoxLayout.Direction.TopToBottom)
        for widgets in (
            (self.of, self.on, self.level, self.high),
            (self.mode, self.before, self.hold_off, self.arm, self.live),
        ):
            row = QHBoxLayout()
            for widget in widgets:
                row.addWidget(widget, int(widget is self.of))
            self._rows.addLayout(row)
        self.body.addLayout(self._rows)
        self.body.addWidget(self.said)
        self._fit()
        self.hide()

    @property
    def condition(self) -> Condition:
        """What is asked for."""
        scale = self._unit.scale
        return Condition(
            On(self.on.currentText()),
            self.of.currentText(),
            self.level.value() / scale,
            self.high.value() / scale,
            Mode(self.mode.currentText()),
            self.before.value() / 100,
            self.hold_off.value(),
        )

    def show_choices(self, scene: Scene) -> None:
        """What there is to trigger by: curves that are drawn, with their units, and drives."""
        meant = map(scene.meaning, scene.workspace.curves)
        self._units = {one.text: one.unit for one in meant if one.unit is not None}
        self._components = scene.drives
        self._fit()

    def show_condition(self, condition: Condition) -> None:
        """Have all fields say this."""
        self.on.setCurrentText(condition.on.value)
        if self.of.findText(condition.of) < 0:
            self.of.addItem(condition.of)
        self.of.setCurrentText(condition.of)
        self.level.setValue(condition.level * self._unit.scale)
        self.high.setValue(condition.high * self._unit.scale)
        self.mode.setCurrentText(condition.mode.value)
        self.before.setValue(condition.before * 100)
        self.hold_off.setValue(condition.hold_off_s)

    def _fit(self) -> None:
        """Only what counts for what is waited for."""
        on = On(self.on.currentText())
        choices = list(self._components if on is On.EMCY else self._units)
        known = [self.of.itemText(place) for place in range(self.of.count())]
        if choices != known:
            before = self.of.currentText()
            self.of.clear()
            self.of.addItems(choices)
            if before in choices:
                self.of.setCurrentText(before)
        self.level.setVisible(on is not On.EMCY)
        self.high.setVisible(on in WINDOWS)
        self._show_unit()

    def _show_unit(self) -> None:
        self._unit = self._units.get(self.of.currentText(), NO_UNIT)
        for field in (self.level, self.high):
            field.setSuffix(f" {self._unit.symbol}" if self._unit.symbol else "")


def _choice(name: str, texts: Sequence[str] = ()) -> QComboBox:
    combo = QComboBox()
    combo.addItems(list(texts))
    combo.setAccessibleName(name)
    combo.setToolTip(name)
    combo.setMinimumContentsLength(9)
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    return combo


def _number(name: str, least: float, most: float, suffix: str = "") -> QDoubleSpinBox:
    field = QDoubleSpinBox()
    field.setRange(least, most)
    field.setDecimals(3)
    field.setSuffix(suffix)
    field.setAccessibleName(name)
    field.setToolTip(name)
    field.setMaximumWidth(130)
    return field
