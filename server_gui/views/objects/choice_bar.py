"""Choice of the shown objects: device, comparison, search, kind; read all, save."""

from collections.abc import Mapping, Sequence
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QGridLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.objects.devices import Device
from server_gui.core.objects.rows import BY_EDS, RowKind
from server_gui.views.theme import Theme
from server_gui.views.widgets.plain import set_tip

BUTTON: Final = 104  # px at text of 100 % that one needs
EVENLY: Final = (6, 3, 2)  # buttons in a row: no row has only one
READ_ALL, READ_NO_MORE = "Read all", "Stop reading"
TIPS: Final = {
    RowKind.ALL: "Every object of the device's EDS",
    RowKind.PARAMETERS: "Those that may be written: parameters",
    RowKind.DIFFERENT: "Objects that were read and differ from the comparison",
    RowKind.PINNED: "Those that are pinned (Ctrl+P pins the chosen one)",
}


class ChoiceBar(QWidget):
    """`changed` when something else is to be shown, `picked` brings the place of another device."""

    changed = Signal()
    picked = Signal(int)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._columns = 0  # of buttons, for the room that there is
        self.device, self.other = _combo("Device"), _combo("Compare with")
        set_tip(self.other, "The comparison: the EDS default, or the value of another device")
        self.words = QLineEdit()
        self.words.setPlaceholderText("Search: 0x6041, 0x60*, 0x6060-0x607F, words …")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Search of the objects")
        self.kinds = {kind: QPushButton(kind.value) for kind in RowKind}
        self.all, self.export = QPushButton(READ_ALL), QPushButton("CSV …")
        set_tip(self.all, "Read every object once, at most some hundred a second, while this page is shown")
        set_tip(self.export, "Everything read from this device, with every digit")
        self._group = QButtonGroup(self)
        for kind, button in self.kinds.items():
            button.setCheckable(True)
            set_tip(button, TIPS[kind])
            self._group.addButton(button)
        self.kinds[RowKind.ALL].setChecked(True)
        self._build()

    @property
    def kind(self) -> RowKind:
        """The chosen kind."""
        return next(kind for kind, button in self.kinds.items() if button.isChecked())

    @property
    def beside(self) -> str | None:
        """The component that the device is compared with; `None`: its EDS."""
        found = self.other.currentData()
        return found if isinstance(found, str) else None

    def offer(self, devices: Sequence[Device], device: Device | None) -> None:
        """Let these be chosen; `device` is."""
        _fill(self.device, [(one.title, one.component) for one in devices])
        if device is not None:
            self.device.setCurrentIndex(devices.index(device))
        others = [(one.title, one.component) for one in devices if one is not device]
        _fill(
            self.other,
            [(f"compared with {title}", component) for title, component in ((BY_EDS, None), *others)],
        )

    def count(self, kinds: Mapping[RowKind, Sequence[object]], *, is_reading: bool) -> None:
        """Show the number of objects of each kind, and whether all are being read."""
        for kind, button in self.kinds.items():
            _set_text(button, f"{kind.value} {len(kinds[kind])}")
        _set_text(self.all, READ_NO_MORE if is_reading else READ_ALL)

    def arrange(self, room: int) -> int:
        """Arrange beside each other as far as there is room; return how many buttons that are."""
        found = room // self._theme.px(BUTTON)
        columns = next((evenly for evenly in EVENLY if evenly <= found), 1)
        if columns != self._columns:
            self._columns = columns
            buttons = (*self.kinds.values(), self.all, self.export)
            _place(self._above, (self.device, self.other), columns // 2)
            _place(self._buttons, buttons, columns)
        return columns

    def _build(self) -> None:
        self._above, self._buttons = QGridLayout(), QGridLayout()
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        everything.addLayout(self._above)
        everything.addWidget(self.words)
        everything.addLayout(self._buttons)
        for grid in (self._above, self._buttons):
            grid.setSpacing(4)
        self.device.activated.connect(self.picked)
        self.other.activated.connect(lambda _place: self.changed.emit())
        self.words.textChanged.connect(lambda _text: self.changed.emit())
        self._group.buttonClicked.connect(lambda _button: self.changed.emit())


def _place(grid: QGridLayout, widgets: Sequence[QWidget], columns: int) -> None:
    for place, widget in enumerate(widgets):
        row, column = divmod(place, min(max(columns, 1), len(widgets)))
        grid.addWidget(widget, row, column)


def _set_text(button: QPushButton, text: str) -> None:
    if button.text() != text:
        button.setText(text)


def _combo(name: str) -> QComboBox:
    combo = QComboBox()
    combo.setAccessibleName(name)
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    combo.setMinimumContentsLength(8)
    return combo


def _fill(combo: QComboBox, entries: Sequence[tuple[str, str | None]]) -> None:
    """Offer these; what is chosen stays, where it still is there."""
    if [combo.itemText(place) for place in range(combo.count())] == [title for title, _ in entries]:
        return
    chosen = combo.currentData()
    combo.blockSignals(True)
    combo.clear()
    for title, component in entries:
        combo.addItem(title, component)
    combo.setCurrentIndex(max(0, combo.findData(chosen)))
    combo.blockSignals(False)
