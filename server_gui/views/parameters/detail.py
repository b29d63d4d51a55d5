"""The chosen parameter: a slider as far as one write may go, an exact field, and what is known of it."""

import math
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QPushButton, QSlider

from gateway.units import Unit
from gateway.wire.method import Number
from gateway.wire.parameter import ParameterInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import brief, refusal, unit_of
from server_gui.core.tuning.flash import RULE
from server_gui.views.parameters.range_bar import RangeBar
from server_gui.views.parameters.several_joints_menu import SeveralMenu
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel, set_tip

STEPS: Final = 200
CHOOSE: Final = "Choose a parameter above; F2 or typing edits it."
NOT_THERE: Final = "Nothing is known of it at this robot."
MOST_FACTS: Final = 2  # where there is the least room; the tip has all
BAR_SHARE: Final = 9  # of the title's line, where the limits' bar stands in it
SEVERAL: Final = "The same for other joints: one change, reviewed, written and reverted as a whole"


class CalmSlider(QSlider):
    """The wheel moves it only when it has the focus."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


class Detail(Card):
    """`typed` brings name and text, `slid` name and SI value, `dropped` and `pinned` the name."""

    typed = Signal(str, str)
    slid = Signal(str, float)
    dropped = Signal(str)
    pinned = Signal(str)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__("No parameter chosen")
        self._desk = desk
        self._name: str | None = None
        self._range: tuple[float, float] | None = None
        self._is_short = self.is_low = False  # low: so little room that rows of the table need it more
        self.slider = CalmSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, STEPS)
        self.slider.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.slider.setAccessibleName("New value")
        self.slider.valueChanged.connect(self._slid)
        self.field = QLineEdit()
        self.field.setAccessibleName("New value, exactly")
        self.field.editingFinished.connect(self._typed)
        self._unit = PlainLabel()
        self._unit.setObjectName("dim")
        self._drop = QPushButton("Forget edit")
        self._drop.clicked.connect(self._dropped)
        self.pin = QPushButton("☆")
        self.pin.setAccessibleName("Pinned")
        self.pin.setToolTip("Pin or unpin it: kept for this robot, and shown with the filter ★ (Ctrl+P)")
        self.pin.clicked.connect(self._pinned)
        row = QHBoxLayout()
        row.addWidget(self.pin)
        row.addWidget(self.slider, 3)
        row.addWidget(self.field, 2)
        row.addWidget(self._unit)
        row.addWidget(self._drop)
        self.body.addLayout(row)
        self.several = SeveralMenu(desk, self)
        self._several = QPushButton("Several …")
        set_tip(self._several, SEVERAL)
        self._several.setMenu(self.several)
        self.range = RangeBar(theme)
        self._below = QHBoxLayout()
        self._below.addWidget(self.range, 1)
        self._below.addWidget(self._several)
        self.body.addLayout(self._below)
        self._facts = PlainLabel(CHOOSE)
        self._facts.setObjectName("dim")
        self._facts.setWordWrap(True)
        set_tip(self._facts, f"Stored: {RULE}")
        self.body.addWidget(self._facts)

    def be_short(self, is_short: bool) -> None:
        """Take little room: seen when one is chosen, with the limits' bar in the line of its name."""
        self._is_short = is_short
        self._several.setVisible(not is_short)
        if is_short:
            self.head.insertWidget(1, self.range, BAR_SHARE)
        else:
            self._below.insertWidget(0, self.range, 1)
        self.refresh()

    def choose(self, name: str | None) -> None:
        """Show this one."""
        self._name = self.several.name = name
        self.refresh(anew=True)

    def refresh(self, *, anew: bool = False) -> None:
        """Show how it is now; what is being typed is left alone."""
        station = self._desk.selected
        info = None if station is None or self._name is None else station.known.get(self._name)
        for widget in (self.slider, self.field, self._drop, self.pin):
            widget.setEnabled(info is not None)
        self.setVisible(info is not None or not self._is_short)
        if station is None or info is None:
            self._show_none()
            return
        unit = unit_of(info.name, info.unit, self._desk.shown.units)
        held, staged = station.robot.parameters.get(info.name), station.edits.staged.get(info.name)
        is_read = info.name not in station.reverted.awaited
        current = None if held is None or not is_read else held.value
        value = staged.value if staged is not None else current
        self.set_title(info.name)
        set_text(self._unit, unit.symbol)
        star = "★" if info.name in self._desk.pins.of(station.title) else "☆"
        if self.pin.text() != star:
            self.pin.setText(star)
        self._drop.setEnabled(staged is not None)
        if anew or not (self.field.hasFocus() and self.field.isModified()):
            text = "" if value is None else unit.editable(value)
            if self.field.text() != text:
                self.field.setText(text)
        self._refresh_slider(info, current, value)
        self.range.show_range(info, unit, current, None if staged is None else staged.value, self._range)
        self._several.setEnabled(info.component in station.robot.names("joint"))
        facts = _facts(station, info, unit, current)
        known, _, problem = facts.partition("\n")  # the more important first where it may be scrolled
        self.range.setVisible(not self.is_low)
        if self.is_low:
            known = "" if problem else " · ".join(known.split(" · ")[:MOST_FACTS])
        set_tip(self._facts, f"{facts}\nStored: {RULE}")
        set_text(self._facts, "\n".join(filter(None, (problem, known))) if self._is_short else facts)

    def _show_none(self) -> None:
        """Show no value: none is chosen, or nothing is known of it at this robot."""
        self.set_title(self._name or "No parameter chosen")
        for part, text in ((self._unit, ""), (self._facts, NOT_THERE if self._name else CHOOSE)):
            set_text(part, text)
        set_tip(self._facts, "")
        self.field.clear()
        self.range.show_range(None)
        self._range = None
        self._several.setEnabled(False)
        self._place(0)

    def _refresh_slider(self, info: ParameterInfo, current: Number | None, value: Number | None) -> None:
        self._range = reach(info, current)
        self.slider.setEnabled(self._range is not None and info.live and value is not None)
        if self._range is None or value is None:
            self._place(0)
        elif not self.slider.isSliderDown():
            low, high = self._range
            self._place(round((value - low) / (high - low) * STEPS))

    def _place(self, place: int) -> None:
        self.slider.blockSignals(True)
        self.slider.setValue(min(max(place, 0), STEPS))
        self.slider.blockSignals(False)

    def _slid(self, place: int) -> None:
        station = self._desk.selected
        if station is None or self._name is None or self._range is None:
            return
        low, high = self._range
        info = station.known[self._name]
        unit = unit_of(info.name, info.unit, self._desk.shown.units)
        wanted = low + (high - low) * place / STEPS
        self.slid.emit(self._name, min(max(_round(wanted, high - low, info.scale, unit), low), high))

    def _typed(self) -> None:
        if self._name is not None and self.field.isModified():
            self.field.setModified(False)
            self.typed.emit(self._name, self.field.text())

    def _pinned(self) -> None:
        if self._name is not None:
            self.pinned.emit(self._name)

    def _dropped(self) -> None:
        if self._name is not None:
            self.dropped.emit(self._name)


def reach(info: ParameterInfo, current: Number | None) -> tuple[float, float] | None:
    """Return the range of one write, in SI; None without limits."""
    if info.min is None or info.max is None or info.max <= info.min:
        return None
    if info.max_step is None or current is None:
        return float(info.min), float(info.max)
    low, high = max(info.min, current - info.max_step), min(info.max, current + info.max_step)
    return (float(low), float(high)) if low < high else None


def _round(value: float, span: float, scale: float, unit: Unit) -> float:
    """Return a slider's value rounded for people, in `unit`, no finer than a count of the device."""
    digits = max(0, 2 - math.floor(math.log10(span * unit.scale)))
    if scale > 0:
        digits = min(digits, max(0, -math.floor(math.log10(scale * unit.scale) + 1e-9)))
    return unit.si_value(f"{value * unit.scale:.{digits}f}")


def _facts(station: Station, info: ParameterInfo, unit: Unit, current: Number | None) -> str:
    held = station.robot.parameters.get(info.name)
    robot = "–" if current is None else f"{brief(unit, current)} {unit.symbol}".rstrip()
    symbol = unit.symbol
    step = (
        ""
        if info.max_step is None
        else f" · one write moves it by at most {brief(unit, info.max_step)} {symbol}".rstrip()
    )
    live = "may be changed while it moves" if info.live else "only while its drive is at rest"
    staged = station.edits.staged.get(info.name)
    problem = (
        (None if staged is None else refusal(staged.value, current, info, unit))
        or station.writing.rows.get(info.name)
        or info.problem
        or (held.problem if held is not None else None)
    )
    said = f"\n✕ {problem}" if problem else ""
    stored = f"stored: {'yes' if station.is_stored(info.name) else 'unknown'}"
    default = "" if info.default is None else f" · default {brief(unit, info.default)}"
    row = None if station.file is None else station.file.rows.get(info.name)
    file = "" if row is None or row.file is None else f" · file {brief(unit, row.file)}"
    low, high = ("–" if end is None else brief(unit, end) for end in (info.min, info.max))
    limits = f" · from {low} to {high} {symbol}".rstrip()
    return f"robot {robot}{limits}{default}{file} · {stored} · {live}{step} · object {info.object}{said}"
