"""Every robot: state, age of its data, a stop of its own; add and remove one; STOP ALL."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QFontMetrics, QResizeEvent
from PySide6.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QScrollArea,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from gateway.client import Address, BadAddress
from gateway.wire.pairing import is_link
from server_gui.core.alarms.drive_states import any_enabled
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.worst_state import STOP_SENT
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.left import left_alarm
from server_gui.core.desk.station import Station
from server_gui.core.settings.server_file import name_of
from server_gui.core.tuning.stop import StopState
from server_gui.views.confirmation import ask
from server_gui.views.marks import SHORTER, age_text
from server_gui.views.predictions import doing
from server_gui.views.robots.pairing import PairingDialog, show_pairing
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.clickable_frame import ClickableFrame
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.stop_button import StopButton
from server_gui.views.widgets.visibility import is_all_seen, let_go

NO_ROBOT: Final = "No robot yet: type an address below, such as 192.0.2.7:7420, and press Enter."
HINT_ALL: Final = (
    "Quick stop on every drive of every robot of the list (Shift+F12). It is software over a network, NOT a "
    "safety-rated emergency stop: keep the hardware ones within reach."
)
SIGNS: Final = "_-.: "  # behind which a name goes on in another line
LINES: Final = 3  # of a name
LEAST_ROOM: Final = 40  # pixels: a label with less has no place yet
MIDDLE: Final = Qt.TextElideMode.ElideMiddle
PAIRING_ENDS_S: Final = 1.0  # how long the window waits for that when it closes


class RobotCard(ClickableFrame):
    """One robot; `chosen` when it is clicked, or Return or Space is pressed on it; `removed` likewise."""

    removed = Signal()

    def __init__(self, station: Station, theme: Theme) -> None:
        super().__init__("card")
        self.station = station
        self.setAccessibleName(f"Robot {station.name}")
        self._icon = MarkIcon(theme, 12)
        self._name = PlainLabel()
        self._name.setObjectName("title")
        self._state, self._link = ShrinkingLabel("dim"), ShrinkingLabel("dim")
        self._doing = ShrinkingLabel("dim")
        self._where = ShrinkingLabel("dim")  # only where another robot is called so, too
        for label in (self._name, self._where, self._state, self._doing, self._link):
            label.setMinimumWidth(1)  # else the card is wider than its list
        self.stop = StopButton("robot_stop")
        self.remove = QToolButton()
        self.remove.setText("✕")
        self.remove.setToolTip("Remove it from this window: nothing of it is stopped")
        self.remove.setStyleSheet("padding: 1px 3px; border: none;")
        self.remove.clicked.connect(self.removed)
        words = QGridLayout()
        words.setVerticalSpacing(1)
        words.setColumnStretch(1, 1)
        words.addWidget(self._icon, 0, 0)
        words.addWidget(self._name, 0, 1)
        words.addWidget(self.remove, 0, 2)
        for row, label in enumerate((self._where, self._state, self._doing, self._link), 1):
            words.addWidget(label, row, 0, 1, 3)  # a state's own words have room
        column = QVBoxLayout(self)
        column.setContentsMargins(9, 7, 8, 7)
        column.setSpacing(5)
        column.addLayout(words)
        column.addWidget(self.stop)

    @property
    def is_whole(self) -> bool:
        """Whether all of it is on the screen."""
        return is_all_seen(self)

    @property
    def texts(self) -> tuple[str, str, str, str]:
        """The shown texts: name, state, age, activity of the robot."""
        return self.station.title, self._state.text(), self._link.text(), self._doing.text()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fold()

    def _fold(self) -> None:
        name = self._name.accessibleName()
        set_text(self._name, folded(name, self._name.fontMetrics(), self._name.width()))

    def refresh(self, *, selected: bool) -> None:
        """Show how it is now."""
        station, robot = self.station, self.station.robot
        mark = station.mark
        self._icon.show_mark(mark)
        has_twin = station.title != station.name and station.has_twin
        name = station.called if has_twin else station.title
        self._name.setAccessibleName(name)
        self._fold()
        self._where.say(f"at {station.address}", station.address, f":{station.address.rpartition(':')[2]}")
        self._where.setVisible(has_twin)
        self.stop.name(station.title)
        self.remove.setAccessibleName(f"Remove {station.title}")
        # One line: its STOP does not move with what is wrong.
        self._state.say(*state_words(station))
        set_tip(self._state, state_tip(station))
        self._doing.say(*doing(station))
        age = f"{age_text(robot.age_s())}{' old' if robot.age_s() is not None else ''}"
        live = "" if robot.is_stale() else f" · {robot.rate_text()}"
        self._link.say(*dict.fromkeys((f"{age}{live}", age)))
        set_tip(self, f"You are {station.who} here." if station.who else "")
        if self.property("selected") != selected:
            self.setProperty("selected", selected)
            self.style().polish(self)


def state_words(station: Station) -> tuple[str, ...]:
    """Return how a robot is, the fullest wording first: the last is the word of its mark, or shorter."""
    mark, worst, stopping = station.mark, station.alarms.worst, station.stopping
    if mark is STOP_SENT:
        return (mark.word,)
    where = "" if worst is None or not worst.spoken or worst.spoken in mark.word else worst.spoken
    said = () if worst is None else (worst.brief, f"{mark.word}: {where}" if where else "")
    if stopping.state is StopState.CONFIRMED and worst is not None and worst.kind is Kind.STOPPED:
        said = (*said, stopping.timed(f"{mark.word} {stopping.drives}/{stopping.drives}"))
    return tuple(filter(None, (*said, mark.word, SHORTER.get(mark.word, mark.word))))


def state_tip(station: Station) -> str:
    """Return its worst alarm in full."""
    worst = station.alarms.worst
    return "" if worst is None else worst.line


def folded(name: str, metrics: QFontMetrics, room: int) -> str:
    """Return a name in as many lines as it needs, up to `LINES`; the last is cut in its middle at most."""
    lines, rest = list[str](), name
    while room >= LEAST_ROOM and metrics.horizontalAdvance(rest) >= room and len(lines) < LINES - 1:
        places = [at for at, sign in enumerate(rest, 1) if sign in SIGNS and at < len(rest)]
        fits = (at for at in reversed(places) if metrics.horizontalAdvance(rest[:at]) < room)
        letters = (at for at in range(len(rest) - 1, 0, -1) if metrics.horizontalAdvance(rest[:at]) < room)
        cut = next(fits, 0) or next(letters, len(rest))
        lines, rest = [*lines, rest[:cut]], rest[cut:]
    return "\n".join((*lines, metrics.elidedText(rest, MIDDLE, room) if lines else rest))


class RobotsPanel(QWidget):
    """`added` brings an address, or NAME=ADDRESS, `removed` the station of a robot to leave.

    `stop_all` is STOP ALL.
    """

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
        self.address.setPlaceholderText("Add a robot")
        self.address.setAccessibleName("Address of a robot to add")
        self.address.setToolTip(
            "HOST:PORT, or NAME=HOST:PORT: called so in this window, whatever it calls itself"
        )
        self.address.returnPressed.connect(self._add)
        self.pair = QPushButton("Pair…")
        self.pair.setToolTip("With a robot that has keys: it shows a code (gwrms keys pair)")
        self.pair.clicked.connect(lambda: self.begin_pairing(self.address.text().strip()))
        self.said = PlainLabel()
        self.said.setObjectName("dim")
        self.said.setWordWrap(True)
        self.said.hide()
        self.none = PlainLabel(NO_ROBOT)
        self.none.setObjectName("dim")
        self.none.setWordWrap(True)
        self._list.insertWidget(0, self.none)
        self.all_stop = StopButton()
        self.all_stop.name("ALL")
        self.all_stop.setAccessibleName("STOP every robot")
        self.all_stop.setToolTip(HINT_ALL)
        self.all_stop.setAccessibleDescription(HINT_ALL)
        self.all_stop.stopped.connect(self.stop_all)
        self.all_stop.setEnabled(False)  # there is no robot yet
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(scroll, 1)
        everything.addWidget(self.said)
        adding = QHBoxLayout()
        adding.addWidget(self.address, 1)
        adding.addWidget(self.pair)
        everything.addLayout(adding)
        everything.addWidget(self.all_stop)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Show how all of them are now."""
        stations = self._desk.stations
        for card in [card for card in self.cards if card.station not in stations]:
            self.cards.remove(card)
            self._list.removeWidget(card)
            let_go(card)
            card.hide()
            card.deleteLater()
        for station in stations[len(self.cards) :]:
            self._add_card(station)
        for card in self.cards:
            card.refresh(selected=card.station is self._desk.selected)
        is_light = not all(card.stop.has_room_in_bold for card in self.cards)
        for card in self.cards:  # names in one weight: none looks more important
            card.stop.be_light(is_light)
        self.all_stop.setEnabled(bool(stations))
        self.none.setVisible(not stations)

    @property
    def shows_all(self) -> bool:
        """Whether the cards of all robots are whole on the screen, none to be scrolled to, none floating."""
        return all(card.is_whole for card in self.cards)

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
        goes = ""
        if station.is_live and any_enabled(station.robot):
            does = "walks" if station.processing.derived().gait.walking else "has enabled drives"
            goes = f"{station.title} {does}: its STOP leaves this window.\n\n"
        elif (left := left_alarm(station)) is not None:
            was = left.what.partition(";")[0].removeprefix("while ")
            goes = f"When last seen {was}; from here it could not be stopped any more.\n\n"
        text = (
            f"{goes}Remove {station.title} ({station.address}) from this window?\n\n"
            "Nothing of it is stopped: it goes on as it is, but no longer in sight, and STOP of this window "
            "does not reach it any more. What this window has on trial there goes back. Its recording by "
            "this window ends; what is recorded is kept."
        )
        ask(self, f"Remove {station.title}", text, "Remove", lambda: self.removed.emit(station))

    def _add(self) -> None:
        text = self.address.text().strip()
        if is_link(text):
            self.begin_pairing(text)
            return
        name, equals, address = text.rpartition("=")
        if equals and (not name or name_of(name) != name):
            self.say(f"{name!r} is not a name: use letters, digits, _, . and -, then = and the address")
            return
        if name in {station.name for station in self._desk}:
            self.say(f"{name} is in the list already: give it another name")
            return
        try:
            where = str(Address.parse(address)) if text else ""
        except BadAddress as error:
            self.say(str(error))
            return
        if any(station.address == where for station in self._desk):
            self.say(f"{where} is in the list already")
        elif where:
            self.say("")
            self.address.clear()
            self.added.emit(f"{name}{equals}{where}")

    def begin_pairing(self, where: str) -> PairingDialog:
        """Ask for address and code of a robot that pairs; when it has, it is followed."""
        self.say("")
        return show_pairing(self, where, self._paired)

    def end_pairing(self) -> None:
        """End it before the window goes."""
        for dialog in self.findChildren(PairingDialog):
            dialog.end(PAIRING_ENDS_S)

    def _paired(self, where: str) -> None:
        """One that is in the list is reached by its key at the next attempt."""
        self.address.clear()
        if not any(station.address == where for station in self._desk):
            self.added.emit(where)

    def say(self, text: str) -> None:
        """Say what is wrong with the address that was typed."""
        self.said.setText(text)
        self.said.setVisible(bool(text))
