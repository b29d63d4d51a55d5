"""The overview: gait phase, posture, pressure of both feet, three plots, and the joint table."""

import time
from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from gateway.units import Unit
from ml.robot.task import ABNORMAL, UNKNOWN
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.leg_phase import leg_phase
from server_gui.core.desk.soles import Sole, sole
from server_gui.core.desk.station import Station
from server_gui.core.processing.gait_events import Leg
from server_gui.views.joint_table import JointModel, JointTable
from server_gui.views.marks import age_text
from server_gui.views.predictions import ACTIVITY, label_text, lines, model_phases
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.colour_bar import ColourBar
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.figure import Pose, StickFigure
from server_gui.views.widgets.gait_ring import GaitRing
from server_gui.views.widgets.lines import Lines
from server_gui.views.widgets.plot import Curve, Plot
from server_gui.views.widgets.pressure_map import PressureMap

SECONDS: Final = 10.0
SHARES: Final = (10, 9, 11)  # of the width, where three cards stand beside each other
A_COLUMN: Final = 160  # wide at least, at text of 100 %
STATUS_LINES: Final = 5
READ_S: Final = 0.2  # between changes of what is read rather than seen
SIDES: Final = ("left", "right")
PLAIN: Final = ("good", "#cc79a7")  # of what belongs to no side
# title, channels, SI unit, smallest range shown (SI)
PLOTS: Final = (
    ("Knee angle", ("left_knee.position", "right_knee.position"), "rad", 0.2),
    ("Knee torque", ("left_knee.torque", "right_knee.torque"), "N·m", 5.0),
    ("Trunk tilt", ("trunk.tilt_forward", "trunk.tilt_side"), "rad", 0.08),
)


class KeyPlot(Card):
    """A plot of a few channels with their newest values in its head."""

    def __init__(
        self, desk: Desk, theme: Theme, title: str, channels: Sequence[str], si: str, least: float
    ) -> None:
        super().__init__(title)
        self._desk = desk
        self._channels = channels
        self._si = si
        self._least = least
        self.plot = Plot(theme, SECONDS, desk.shown.units.unit("", si).scale * least)
        self.plot.set_curves([Curve(name, _colour_of(name, place)) for place, name in enumerate(channels)])
        self.plot.setMinimumHeight(theme.px(80))
        self.body.addWidget(self.plot)

    def refresh(self, station: Station, *, slow: bool) -> None:
        """Draw the past of the channels."""
        unit = self._desk.shown.units.unit("", self._si)
        times = station.rings.times(SECONDS)
        columns = [station.rings.values(name, len(times)) for name in self._channels]
        live = not station.robot.is_stale()
        self.plot.draw(station.rings.source, times, columns, live=live, scale=unit.scale)
        if slow:
            texts = [unit.text(station.robot.values.get(name)) for name in self._channels]
            self.set_note(f"{' / '.join(texts)} {unit.symbol}" if live else _old(station))


class Overview(QWidget):
    """Everything at a glance; drawn only while it is visible."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._read_s = 0.0  # when what is read was last shown
        self._soles = dict.fromkeys(SIDES, Sole())
        self._angles: dict[str, list[str]] = {}
        self.setObjectName("page")
        self._status, self._ring = Card("Status"), GaitRing(theme)
        self.status_lines = Lines(theme, "What is predicted, and what devices say", STATUS_LINES)
        self._status.body.addWidget(self._ring, 1)
        self._status.body.addWidget(self.status_lines)
        self._posture, self._figure = Card("Posture: hip, knee, ankle"), StickFigure(theme)
        self._posture.body.addWidget(self._figure)
        self._maps = {side: PressureMap(theme, side) for side in SIDES}
        self._loads = {side: ElidedLabel("title") for side in SIDES}
        self._pressure = self._pressure_card()
        self._plots = [KeyPlot(desk, theme, *plot) for plot in PLOTS]
        self._joints, self._model = Card("Joints"), JointModel(desk, theme)
        self._joints.body.addWidget(JointTable(self._model, theme))
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(8, 8, 8, 8)
        self._grid.setSpacing(8)
        self._columns = 0
        self._arrange(len(SHARES))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        columns = min(max(self.width() // self._theme.px(A_COLUMN), 1), len(SHARES))
        if columns != self._columns:
            self._arrange(columns)

    def minimumSizeHint(self) -> QSize:
        """As narrow as one column: then it is arranged for less."""
        return QSize(self._theme.px(A_COLUMN), super().minimumSizeHint().height())

    def _arrange(self, columns: int) -> None:
        """The cards beside each other, as many as have room, and the joints below all of them."""
        self._columns, grid = columns, self._grid
        for place, card in enumerate((self._status, self._posture, self._pressure, *self._plots)):
            grid.addWidget(card, place // columns, place % columns)
        rows = -(-6 // columns)
        grid.addWidget(self._joints, rows, 0, 1, columns)
        for column, share in enumerate(SHARES):
            grid.setColumnStretch(column, share if column < columns else 0)
        for row in range(7):
            is_plots = row * columns >= 3
            grid.setRowStretch(row, 0 if row > rows else 7 if row == rows else 6 if is_plots else 10)

    def refresh(self) -> None:
        """Draw how it is now; what is read rather than seen changes more slowly."""
        station = self._desk.selected
        if station is None:
            return
        now_s = time.monotonic()
        slow = now_s - self._read_s >= READ_S
        if slow:
            self._read_s = now_s
        self._refresh_status(station, slow=slow)
        self._refresh_posture(station, slow=slow)
        self._refresh_pressure(station, slow=slow)
        for plot in self._plots:
            plot.refresh(station, slow=slow)
        if slow:
            self._model.refresh()
            live = not station.robot.is_stale()
            self._joints.set_note(f"age {age_text(station.robot.age_s())}" if live else _old(station))

    @property
    def notes(self) -> list[str]:
        """What stands at the right of each card's title."""
        return [
            card.note for card in (self._status, self._posture, self._pressure, *self._plots, self._joints)
        ]

    def _pressure_card(self) -> Card:
        card = Card("Plantar pressure")
        row = QHBoxLayout()
        for side in SIDES:
            column = QVBoxLayout()
            column.addWidget(self._maps[side], 1)
            self._loads[side].setAlignment(Qt.AlignmentFlag.AlignCenter)
            column.addWidget(self._loads[side])
            row.addLayout(column, 1)
        row.addWidget(ColourBar(self._desk, self._theme))
        card.body.addLayout(row)
        return card

    def _refresh_status(self, station: Station, *, slow: bool) -> None:
        derived = station.processing.derived()
        live = not station.robot.is_stale()
        phases = {leg: leg_phase(derived, leg, derived.stamp_ns) for leg in Leg}
        word, below = self._words(station) if live else ("Not known", "")
        self._ring.show_phases(phases, model_phases(station), word, below, live=live)
        if slow:
            sources = {one.value.replace("_", " ") for one in derived.sources.values() if one is not None}
            self._status.set_note(
                f"steps by {', '.join(sorted(sources))}" if live and sources else _old(station)
            )
            self.status_lines.show_lines(list(lines(station)))

    def _words(self, station: Station) -> tuple[str, str]:
        """What it does: by a model where one says so, else by the steps that were seen."""
        gait = station.processing.derived().gait
        cadence = "" if gait.cadence_spm is None else f"{gait.cadence_spm:.0f} steps/min"
        shown = station.predictions.told.get(ACTIVITY)
        if shown is None or shown.is_stale():
            return ("Walking" if gait.walking else "Not walking"), cadence
        prediction = shown.prediction
        how_sure = "" if prediction.label in (UNKNOWN, ABNORMAL) else f"p {prediction.probability:.2f}"
        return label_text(prediction.label), " · ".join(filter(None, (how_sure, cadence)))

    def _refresh_posture(self, station: Station, *, slow: bool) -> None:
        values = station.robot.values
        legs = {
            side: Pose(*(values.get(f"{side}_{joint}.position") for joint in ("hip", "knee", "ankle")))
            for side in SIDES
        }
        wrong = frozenset(part.name for part in station.robot.not_ok())
        live = not station.robot.is_stale()
        if slow:
            angle = self._desk.shown.units.unit("position", "rad")
            self._angles = {side: _angle_texts(pose, angle) for side, pose in legs.items()}
        self._figure.show_pose(legs, values.get("trunk.tilt_forward"), wrong, self._angles, live=live)
        if slow:
            tilt = self._desk.shown.units.unit("tilt_forward", "rad")
            text = f"trunk {tilt.text(values.get('trunk.tilt_forward'))}{tilt.symbol} forward"
            self._posture.set_note(text if live else _old(station))

    def _refresh_pressure(self, station: Station, *, slow: bool) -> None:
        live, values = not station.robot.is_stale(), station.robot.values
        if slow:
            self._refresh_soles(station, live=live)
        for side, known in self._soles.items():
            pressures = [values.get(f"{side}_insole.cell_{number}") for number in range(known.count)]
            x, y = values.get(f"{side}_insole.cop_x"), values.get(f"{side}_insole.cop_y")
            cop = None if x is None or y is None else (x, y)
            self._maps[side].show_pressures(pressures, cop, live=live)

    def _refresh_soles(self, station: Station, *, live: bool) -> None:
        force = self._desk.shown.units.unit("force", "N")
        for side in SIDES:
            known = sole(station.robot, side)
            if known != self._soles[side]:
                self._soles[side] = known
                self._maps[side].set_cells(known.cells)
            value = station.robot.values.get(f"{side}_insole.force")
            set_text(self._loads[side], f"{side.upper()}  {force.text(value)} {force.symbol}")
        sources = dict.fromkeys(known.source for known in self._soles.values())
        self._pressure.set_note("; ".join(sources) if live else _old(station))


def _angle_texts(pose: Pose, unit: Unit) -> list[str]:
    angles = (pose.hip, pose.knee, pose.ankle)
    return [
        "–"
        if angle is None
        else f"{angle * unit.scale:+.0f}{unit.symbol}"
        if unit.symbol == "°"
        else f"{angle:+.2f}"
        for angle in angles
    ]


def _old(station: Station) -> str:
    return (
        f"STALE, {age_text(station.robot.age_s())} old"
        if station.robot.age_s() is not None
        else "no data yet"
    )


def _colour_of(channel: str, place: int) -> str:
    side = channel.partition("_")[0]
    return side if side in SIDES else PLAIN[place % 2]
