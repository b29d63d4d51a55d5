"""A robot's channels by component, to be ticked; found by words."""

import fnmatch
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QMimeData, QPoint, Qt, Signal
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QAbstractItemView, QTreeWidget, QTreeWidgetItem

from gateway.units import Units
from gateway.wire.component import ChannelInfo
from server_gui.core.desk.station import Station
from server_gui.core.workspace.curve_binding import channels_of
from server_gui.core.workspace.workspace import MOST_CURVES
from server_gui.views.widgets.dragging import CURVES, dragged

USUAL: Final = ("left_hip.position", "right_hip.position", "left_insole.force", "right_insole.force")
NAME_ROLE: Final = Qt.ItemDataRole.UserRole + 1


class ChannelTree(QTreeWidget):
    """`itemChanged` when somebody ticks a channel; not when it is ticked by `choose`.

    `asked` brings a channel, and where the menu of what can be done with it is to open. They can be dragged.
    """

    asked = Signal(str, QPoint)
    dragging = Signal(bool)  # one has begun, or is over

    def __init__(self) -> None:
        super().__init__()
        self.usual: Sequence[str] = USUAL  # globs of what is ticked before anybody has chosen
        self._described: tuple[object, ...] = ()
        self.setHeaderHidden(True)
        self.setObjectName("framed")
        self.setAccessibleName("Channels")
        self.setDragEnabled(True)
        self.setDragDropMode(QAbstractItemView.DragDropMode.DragOnly)

    @property
    def items(self) -> list[QTreeWidgetItem]:
        """Every channel, in the robot's order."""
        return [item for group in self._groups for item in _within(group)]

    @property
    def _groups(self) -> list[QTreeWidgetItem]:
        """The components."""
        found = [self.topLevelItem(row) for row in range(self.topLevelItemCount())]
        return [group for group in found if group is not None]

    @property
    def chosen(self) -> list[str]:
        """The channels that are ticked."""
        return [
            str(item.data(0, NAME_ROLE)) for item in self.items if item.checkState(0) is Qt.CheckState.Checked
        ]

    def choose(self, names: Sequence[str]) -> None:
        """Tick exactly these."""
        self.blockSignals(True)
        for item in self.items:
            wanted = item.data(0, NAME_ROLE) in names
            item.setCheckState(0, Qt.CheckState.Checked if wanted else Qt.CheckState.Unchecked)
        self.blockSignals(False)

    def show_channels(self, station: Station, units: Units, revision: int) -> bool:
        """List a robot's; whether it, or the units by their `revision`, are others than before."""
        infos = channels_of(station)
        described = (station, revision, *(info.name for info in infos))
        if described == self._described:
            return False
        usual = [info.name for info in infos if any(fnmatch.fnmatchcase(info.name, g) for g in self.usual)]
        before = self.chosen if self.items else usual[:MOST_CURVES]
        self._described = described
        self._fill(infos, units)
        self.choose(before)
        for item in self.items:
            if item.checkState(0) is Qt.CheckState.Checked:
                _open_group(item)
        return True

    def show_only(self, words: str) -> None:
        """Show only the channels whose names have all of these words."""
        wanted = words.lower().split()
        for item in self.items:
            name = str(item.data(0, NAME_ROLE))
            item.setHidden(not all(word in name for word in wanted))
            if words and not item.isHidden():
                _open_group(item)
        for group in self._groups:
            group.setHidden(all(item.isHidden() for item in _within(group)))

    def startDrag(self, actions: Qt.DropAction) -> None:
        self.dragging.emit(True)
        try:
            super().startDrag(actions)  # which returns when it is over
        finally:
            self.dragging.emit(False)

    def mimeTypes(self) -> list[str]:
        return [CURVES]

    def mimeData(self, items: Sequence[QTreeWidgetItem]) -> QMimeData:
        return dragged([str(item.data(0, NAME_ROLE)) for item in items if item.data(0, NAME_ROLE)])

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Open the menu of the channel under the mouse; by the keyboard, of the focused one."""
        by_mouse = event.reason() is QContextMenuEvent.Reason.Mouse
        item = self.itemAt(event.pos()) if by_mouse else self.currentItem()
        name = None if item is None else item.data(0, NAME_ROLE)
        if item is not None and name:
            at = event.pos() if by_mouse else self.visualItemRect(item).bottomLeft()
            self.asked.emit(str(name), self.viewport().mapToGlobal(at))

    def _fill(self, infos: Sequence[ChannelInfo], units: Units) -> None:
        self.blockSignals(True)
        self.clear()
        groups: dict[str, QTreeWidgetItem] = {}
        for info in infos:
            if info.component not in groups:
                groups[info.component] = QTreeWidgetItem(self, [info.component.replace("_", " ")])
                groups[info.component].setFlags(Qt.ItemFlag.ItemIsEnabled)
            item = QTreeWidgetItem(groups[info.component], [_title(info, units)])
            item.setData(0, NAME_ROLE, info.name)
            item.setCheckState(0, Qt.CheckState.Unchecked)
        self.blockSignals(False)


def _title(info: ChannelInfo, units: Units) -> str:
    """Return the name of a channel below its component, in the unit of its plot."""
    symbol = units.unit(info.quantity, info.unit).symbol
    return f"{info.quantity.replace('_', ' ')}  {symbol}".rstrip()


def _within(group: QTreeWidgetItem) -> list[QTreeWidgetItem]:
    found = [group.child(row) for row in range(group.childCount())]
    return [item for item in found if item is not None]


def _open_group(item: QTreeWidgetItem) -> None:
    group = item.parent()
    if group is not None:
        group.setExpanded(True)
