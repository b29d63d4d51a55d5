"""The menu by which a parameter's value goes to other joints, too: what would be staged, and why not."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QMenu, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.tuning.several_joints import Offer, offers
from server_gui.views.widgets.plain import set_tip


class SeveralMenu(QMenu):
    """`taken` brings the `Offer` that somebody has chosen; `name` is the parameter that it is about."""

    taken = Signal(object)

    def __init__(self, desk: Desk, parent: QWidget) -> None:
        super().__init__("For several joints", parent)
        self._desk = desk
        self.name: str | None = None
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self._fill)

    @property
    def offers(self) -> list[Offer]:
        """The possible offers."""
        station = self._desk.selected
        if station is None or station.robot.description is None or self.name not in station.known:
            return []
        held, staged = station.robot.parameters, station.edits.staged.get(self.name)
        now = held.get(self.name)
        value = staged.value if staged is not None else None if now is None else now.value
        return offers(self.name, value, station.robot.description, held, self._desk.shown.units)

    def _fill(self) -> None:
        self.clear()
        for offer in self.offers:
            action = self.addAction(offer.title)
            set_tip(action, offer.problem or f"Held now:\n{offer.held}")
            action.triggered.connect(lambda _=False, offer=offer: self.taken.emit(offer))
        if self.isEmpty():
            self.addAction("No other joint has one like it").setEnabled(False)
