"""Every robot: state, age of its data, a stop of its own; add and remove one; STOP ALL."""

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QMouseEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLineEdit,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from gateway.client import Address, BadAddress
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.views.ask import ask
from server_gui.views.marks import age_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.whole import WholeLabel


class RobotCard(QFrame):
    """One robot; `chosen` when it is clicked, or Return or Space is pressed on it; `removed` likewise."""

    chosen = Signal()
    removed = Signal()

    def __init__(self, station: Station, theme: Theme) -> None:
        super().__init__()
        self.station = station
        self.setObjectName("card")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(f"Robot {station.name}")
        self._icon = MarkIcon(theme, 12)
        self._name, self._state, self._link = ElidedLabel("title"), WholeLabel("dim"), ElidedLabel("dim")
        self.stop = StopButton("robot_stop")
        self.remove = QToolButton()
        self.remove.setText("✕")
        self.remove.setToolTip("Remove it from this window: nothing of it is stopped")
        self.remove.setStyleSheet("padding: 1px 3px; border: none;")
        self.remove.clicked.connect(self.removed)
        words = QVBoxLayout()
        words.setSpacing(1)
        for label in (self._name, self._state, self._link):
            words.addWidget(label)
        row = QHBoxLayout()
        row.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(words, 1)
        row.addWidget(self.remove, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.setContentsMargins(9, 7, 8, 7)
        column.setSpacing(5)
        column.addLayout(row)
        column.addWidget(self.stop)

    @property
    def texts(self) -> tuple[str, str, str]:
        """What it says."""
        return self._name.text(), self._state.text(), self._link.text()

    def refresh(self, *, selected: bool) -> None:
        """Show how it is now."""
        station, robot = self.station, self.station.robot
        mark = station.mark
        self._icon.show_mark(mark)
        set_text(self._name, station.title)
        self.stop.name(station.title)
        self.remove.setAccessibleName(f"Remove {station.title}")
        worst = station.alarms.worst
        set_text(self._state, mark.word if worst is None else worst.brief)
        set_tip(self._state, "" if worst is None else worst.line)
        age = age_text(robot.age_s())
        live = "" if robot.is_stale() else f" · {robot.rate_hz():.0f} Hz"
        set_text(self._link, f"{age}{' old' if robot.age_s() is not None else ''}{live}")
        if self.property("selected") != selected:
            self.setProperty("selected", selected)
            self.style().polish(self)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.chosen.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Space) and not event.modifiers():
            self.chosen.emit()
        else:
            super().keyPressEvent(event)


class RobotsPanel(QWidget):
    """`added` brings an address, `removed` the station of a robot to leave; `stop_all` is STOP ALL."""

    added = Signal(str)
    removed = Signal(object)
    stop_all = Signal()

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.cards: list[RobotCard] = []
        self.setObjectName("dock")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        page = QWidget()
        page.setObjectName("page")
        self._list = QVBoxLayout(page)
        self._list.setContentsMargins(0, 0, 0, 0)
        self._list.addStretch(1)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setWidget(page)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.address = QLineEdit()
        self.address.setPlaceholderText("Add a robot: HOST:PORT")
        self.address.setAccessibleName("Address of a robot to add")
        self.address.returnPressed.connect(self._add)
        self.said = PlainLabel()
        self.said.setObjectName("dim")
        self.said.setWordWrap(True)
        self.said.hide()
        self.all_stop = StopButton()
        self.all_stop.name("ALL")
        self.all_stop.setAccessibleName("STOP every robot")
        self.all_stop.stopped.connect(self.stop_all)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(scroll, 1)
        everything.addWidget(self.said)
        everything.addWidget(self.address)
        everything.addWidget(self.all_stop)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Show how all of them are now."""
        stations = self._desk.stations
        for card in [card for card in self.cards if card.station not in stations]:
            self.cards.remove(card)
            self._list.removeWidget(card)
            card.hide()
            card.deleteLater()
        for station in stations[len(self.cards) :]:
            self._add_card(station)
        for card in self.cards:
            card.refresh(selected=card.station is self._desk.selected)

    def _restyle(self) -> None:
        self.setMinimumWidth(self._theme.px(170))

    def _add_card(self, station: Station) -> None:
        card = RobotCard(station, self._theme)
        card.chosen.connect(lambda: self._desk.select(station))
        card.stop.stopped.connect(lambda: station.stop("stop button in the list of robots"))
        card.stop.name(station.title)
        card.removed.connect(lambda: self._ask_to_remove(station))
        self.cards.append(card)
        self._list.insertWidget(self._list.count() - 1, card)

    def _ask_to_remove(self, station: Station) -> None:
        text = (
            f"Remove {station.title} ({station.address}) from this window?\n\n"
            "Nothing of it is stopped: it goes on as it is, but no longer in sight, and STOP of this window "
            "does not reach it any more. What this window has on trial there goes back. Its recording by "
            "this window ends; what is recorded is kept."
        )
        ask(self, f"Remove {station.title}", text, "Remove", lambda: self.removed.emit(station))

    def _add(self) -> None:
        text = self.address.text().strip()
        try:
            where = str(Address.parse(text)) if text else ""
        except BadAddress as error:
            self.say(str(error))
            return
        if any(station.address == where for station in self._desk):
            self.say(f"{where} is in the list already")
        elif where:
            self.say("")
            self.address.clear()
            self.added.emit(where)

    def say(self, text: str) -> None:
        """Say what is wrong with the address that was typed."""
        self.said.setText(text)
        self.said.setVisible(bool(text))
