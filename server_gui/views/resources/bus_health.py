"""Bus health: each CAN bus with its load, state and errors, who talks on it, and how its nodes answer."""

from collections.abc import Mapping, Sequence
from typing import Final

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QGridLayout,
    QHeaderView,
    QSizePolicy,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from gateway.wire.bus import BusInfo, NodeInfo
from server_gui.core.alarms.alarm import Alarms
from server_gui.core.alarms.severity import bus_level, worsened_by
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.missing_pdos import told_percent
from server_gui.core.processing.bus_health import (
    ACTIVE,
    BUSY_PERCENT,
    FULL_PERCENT,
    BusHealthLevel,
    Talking,
    level,
    load_text,
    node_level,
    rated,
    seen,
    talking,
)
from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text, set_tone
from server_gui.views.widgets.columns import title_widths
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plot import css
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.wrapping_label import WrappingLabel
from server_gui.views.widgets.wrapping_legend import WrappingLegend

READ: Final = 6  # frames between two looks
LEVELS: Final = {
    BusHealthLevel.GOOD: Mark("disc", "good", "ok"),
    BusHealthLevel.UNKNOWN: Mark("ring", "old", "not known"),
    BusHealthLevel.WARNING: Mark("triangle", "warn", "warning"),
    BusHealthLevel.ALARM: Mark("square", "bad", "ALARM"),
}
OF_COLOUR: Final = {"warn": BusHealthLevel.WARNING, "bad": BusHealthLevel.ALARM}
TITLES: Final = (
    "Node",
    "Components",
    "Share",
    "Frames/s",
    "Sends",
    "SDO p50 / max",
    "Unanswered",
    "PDOs missing",
)
SPARE: Final = (4, 5, 6, 3)  # left out in this order where there is less room; kinds stand above, too
NUMBERS: Final = (2, 3, 5, 6, 7)
NOBODY: Final = "no known node"
TOO_OLD: Final = "The robot's gateway does not report its buses: it is an older version."
NOT_NOW: Final = "The state of the buses is not known now."


class LoadBar(QWidget):
    """Bar of a bus's load, with marks for high and full load."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._percent: float | None = None
        self._colour = "old"
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("Load of the bus")

    def sizeHint(self) -> QSize:
        return QSize(160, self._theme.px(14))

    def show_load(self, percent: float | None, colour: str) -> None:
        """Show this; None: not known."""
        if (percent, colour) != (self._percent, self._colour):
            self._percent, self._colour = percent, colour
            self.setAccessibleDescription("not known" if percent is None else f"{percent:.0f} %")
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        box = QRectF(0, self.height() * 0.2, self.width(), self.height() * 0.6)
        painter.fillRect(box, self._theme.colour("field"))
        if self._percent is None:
            painter.setBrush(Qt.BrushStyle.BDiagPattern)
            painter.fillRect(box, painter.brush())
        else:
            taken = QRectF(box)
            taken.setWidth(box.width() * min(self._percent, 100.0) / 100)
            painter.fillRect(taken, self._theme.colour(self._colour))
        painter.setPen(self._theme.colour("border"))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(box.adjusted(0, 0, -1, -1))
        painter.setPen(self._theme.colour("text"))
        for mark in (BUSY_PERCENT, FULL_PERCENT):
            x = round(self.width() * mark / 100)
            painter.drawLine(x, 0, x, self.height())
        painter.end()


class BusCard(Card):
    """One bus."""

    def __init__(self, theme: Theme) -> None:
        super().__init__("Bus")
        self._theme = theme
        self._icon, self.load, self._bar = MarkIcon(theme, 13), ShrinkingLabel("title"), LoadBar(theme)
        self._counters = WrappingLegend("Counters of the bus")
        self._kinds = WrappingLegend("Who talks, by kind")
        self.table = QTableWidget(0, len(TITLES))
        self.table.setHorizontalHeaderLabels(TITLES)
        self.table.setAccessibleName("Nodes of the bus")
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.NoSelection)
        self.table.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.table.setShowGrid(False)
        self.table.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.table.verticalHeader().hide()
        self.table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        self.table.horizontalHeader().setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self.table.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        theme.changed.connect(self._forget)
        head = QGridLayout()
        head.setColumnStretch(2, 1)
        head.addWidget(self._icon, 0, 0)
        head.addWidget(self.load, 0, 1)
        head.addWidget(self._bar, 0, 2)
        self.body.addLayout(head)
        self.body.addWidget(self._counters)
        self.body.addWidget(self._kinds)
        self.body.addWidget(self.table)

    def _forget(self) -> None:
        """Rows and letters are of the size before."""
        self.table.setRowCount(0)

    def show_bus(self, bus: BusInfo, alarms: Alarms, *, live: bool) -> None:
        """Show it as bad as what is told of it and of its nodes; nothing of a stale robot is good."""
        bad = bus_level(level(bus), bus.name, alarms)
        bad = BusHealthLevel.UNKNOWN if bad is BusHealthLevel.GOOD and not live else bad
        mark = LEVELS[bad]
        self._icon.show_mark(mark)
        rate = "" if bus.bitrate is None else f" of {bus.bitrate / 1e6:g} Mbit/s"
        word = "FULL: " if bad is BusHealthLevel.ALARM and (bus.load_percent or 0.0) >= FULL_PERCENT else ""
        self.load.say(f"{word}{load_text(bus)}{rate}", f"{word}{load_text(bus)}")
        self._bar.show_load(bus.load_percent, _colour_of(bus.load_percent or 0.0) if live else "old")
        set_tone(self.load, "" if live else "old")
        self.set_title(f"Bus {bus.name}")
        self.set_note(f"{bus.state} (normal)" if live and bus.state == ACTIVE else bus.state)
        frames = "–" if bus.frames_per_s is None else f"{bus.frames_per_s:.0f}"
        text, wrong = css(self._theme, "text"), css(self._theme, "warn")
        counters = [(text, "", f"{frames} frames/s")]
        for count, one, many in (
            (bus.error_frames, "error frame", "error frames"),
            (bus.bus_offs, "time bus off", "times bus off"),
            (bus.dropped, "frame lost on its way to the gateway", "frames lost on their way to the gateway"),
        ):
            counters.append(
                (wrong if count else text, "▲" if count else "", f"{count} {one if count == 1 else many}")
            )
        self._counters.say(
            [*counters, (text, "", "opened once" if bus.opened == 1 else f"opened {bus.opened} times")]
        )
        self._kinds.say([(css(self._theme, "dim"), "", f"{kind} {rate:.0f}/s") for kind, rate in _kinds(bus)])
        self._show_nodes(bus, {alarm.subject: alarm.mark.colour for alarm in alarms.each})

    def _show_nodes(self, bus: BusInfo, told: Mapping[str, str]) -> None:
        talks = {one.node_id: one for one in talking(bus)}
        nodes = {node.node_id: node for node in bus.nodes}
        rows = sorted(talks.keys() | nodes.keys(), key=lambda known: _order(known, talks.get(known)))
        if self.table.rowCount() != len(rows):
            self.table.setRowCount(len(rows))
            height = self._theme.px(22)
            self.table.verticalHeader().setDefaultSectionSize(height)
            self.table.setFixedHeight(
                height * max(len(rows), 1) + self.table.horizontalHeader().sizeHint().height() + 4
            )
        for row, node_id in enumerate(rows):
            node, talk = nodes.get(-1 if node_id is None else node_id), talks.get(node_id)
            colours = [told.get(name) for name in (() if node is None else node.components)]
            good = node is None or (node_level(node) is BusHealthLevel.GOOD and "warn" not in colours)
            colour = "bad" if "bad" in colours else "text" if good else "warn"
            for column, said in enumerate(_texts(node_id, node, talk)):
                self._set(row, column, said, colour)
        self._fit()

    def _fit(self) -> None:
        """Leave out parts without room as a whole: no number is cut."""
        titles = title_widths(self.table)
        widths = [max(self.table.sizeHintForColumn(column), title) for column, title in enumerate(titles)]
        shown = set(range(len(TITLES)))
        for column in SPARE:
            if sum(widths[known] for known in shown) > self.table.viewport().width():
                shown.discard(column)
        for column in range(len(TITLES)):
            self.table.setColumnHidden(column, column not in shown)

    def _set(self, row: int, column: int, text: str, colour: str) -> None:
        item = self.table.item(row, column)
        if item is None:
            item = QTableWidgetItem()
            self.table.setItem(row, column, item)
            if column in NUMBERS:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
                item.setFont(self._theme.number_font())
        if item.text() != text:
            item.setText(text)
        if item.foreground().color() != self._theme.colour(colour):
            item.setForeground(self._theme.colour(colour))


class BusHealthView(QWidget):
    """The buses of the robot that is looked at, with what is wrong with them above."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._frame = 0
        self.cards: list[BusCard] = []
        self.setObjectName("page")
        self.said, self.checks = WrappingLabel("banner"), WrappingLabel("dim")
        self._check = Card("What to check")
        self._check.body.addWidget(self.checks)
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(8, 8, 8, 8)
        self._column.setSpacing(8)
        self._column.addWidget(self.said)
        self._column.addWidget(self._check)
        self._column.addStretch(1)

    def read_now(self) -> None:
        """Let the next frame show it anew: what stands above the tab is shown anew then."""
        self._frame = 0

    def refresh(self) -> None:
        """Show how it is now; called each frame while the tab is visible."""
        self._frame += 1
        station = self._desk.selected
        if station is None or self._frame % READ != 1:
            return
        buses = seen(station.robot)
        self._say(station, buses)
        shown = buses or ()
        while len(self.cards) < len(shown):
            self.cards.append(BusCard(self._theme))
            self._column.insertWidget(len(self.cards), self.cards[-1])
        for place, card in enumerate(self.cards):
            card.setVisible(place < len(shown))
            if place < len(shown):
                card.show_bus(shown[place], station.alarms, live=station.is_live)

    def _say(self, station: Station, buses: Sequence[BusInfo] | None) -> None:
        alarms = station.alarms
        found = [
            (bad, f"bus {bus.name}: {what}", check) for bus in buses or () for bad, what, check in rated(bus)
        ]
        worse = [worsened_by(level(bus), bus.name, alarms) for bus in buses or ()]
        found += [(OF_COLOUR[one.mark.colour], one.line, one.check) for one in worse if one is not None]
        found.sort(key=lambda one: one[0] is not BusHealthLevel.ALARM)
        if buses is None:
            is_old = (
                station.is_linked and station.robot.buses_at_ns is not None and station.robot.buses is None
            )
            text = TOO_OLD if is_old else NOT_NOW
        elif not buses:
            text = "This robot has no CAN bus."
        else:
            rows = dict.fromkeys(f"{LEVELS[bad].word}: {what}" for bad, what, _ in found)
            text = "\n".join(rows)
        checks = dict.fromkeys(check for *_, check in found if check)
        set_text(self.checks, "\n".join(f"→ {check}" for check in checks))
        self._check.setVisible(bool(checks))
        tone = "bad" if any(bad is BusHealthLevel.ALARM for bad, *_ in found) else ""
        if self.said.property("tone") != tone:
            self.said.setProperty("tone", tone)
            self.said.style().polish(self.said)
        set_text(self.said, text)
        self.said.setVisible(bool(text))


def _colour_of(load_percent: float) -> str:
    """Return the colour of a load by itself, whatever else is wrong with its bus."""
    return "bad" if load_percent >= FULL_PERCENT else "warn" if load_percent >= BUSY_PERCENT else "accent"


def _kinds(bus: BusInfo) -> list[tuple[str, float]]:
    found: dict[str, float] = {}
    for one in bus.talks:
        found[one.kind] = found.get(one.kind, 0.0) + one.frames_per_s
    return sorted(found.items(), key=lambda item: -item[1])


def _order(node_id: int | None, talk: Talking | None) -> tuple[float, bool, int]:
    """Return the largest share first; of one and the same, as it is shown, the lowest node."""
    return 0.0 if talk is None else -round(100 * talk.share), node_id is None, node_id or 0


def _texts(node_id: int | None, node: NodeInfo | None, talk: Talking | None) -> tuple[str, ...]:
    names = "" if node is None else ", ".join(name.replace("_", " ") for name in node.components)
    share = "–" if talk is None else f"{100 * talk.share:.0f} %"
    frames = "–" if talk is None else f"{talk.frames_per_s:.0f}"
    sends = "" if talk is None else ", ".join(f"{kind} {rate:.0f}/s" for kind, rate in talk.kinds)
    if node is None:
        return NOBODY if node_id is None else str(node_id), names or "", share, frames, sends, "–", "–", "–"
    trips = "–" if node.sdo_p50_ms is None else f"{node.sdo_p50_ms:.1f} / {node.sdo_max_ms or 0.0:.1f} ms"
    percent = told_percent(node) or node.pdos_missing_percent  # what is told of it stands in its row, too
    is_known = percent is not None and (percent > 0.0 or talk is not None)  # who is silent misses none
    missing = f"{percent:.1f} %" if is_known else "–"
    return str(node_id), names, share, frames, sends, trips, str(node.sdo_timeouts), missing
