"""Edits: what each change of a parameter did to the walk, in words and as strides before and after."""

import datetime
import re
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QGridLayout,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from gateway.amounts import NONE as NO_TIME
from gateway.amounts import counted
from gateway.units import with_minus
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.evidence.comparison import FEWEST, Measured, Word
from server_gui.core.evidence.cycles import DRAWN
from server_gui.core.evidence.display_units import in_units, symbols
from server_gui.core.evidence.edits import EditState
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.evidence.wording import changes, from_to, interval, number, share, strides, word
from server_gui.core.experiments.plan import ExperimentKind
from server_gui.core.experiments.wording import record, what, whole
from server_gui.core.tuning.edits import spoken
from server_gui.views.experiments.form import ExperimentForm, Tried
from server_gui.views.experiments.response_plot import ResponsePlot
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.stride_curves import StrideCurves

LIST: Final = 240  # wide, at text of 100 %
# Wide, likewise: below that four strides have no room beside the list, which then is above them, and so high.
NARROW, ABOVE = 780, 84
LEAST: Final = 130  # wide, likewise: what a stride has at least
MOST_PX: Final = 16_777_215  # what Qt takes for no end
MOST: Final = 8  # metrics that are told one by one
UNIT: Final = {"position": "rad", "following_error": "rad", "current": "A", "torque": "N·m"}
TONES: Final = {Word.BETTER: "good", Word.WORSE: "bad", Word.MIXED: "bad"}
ARROW: Final = "\N{NO-BREAK SPACE}→\N{NO-BREAK SPACE}"
NONE: Final = (
    "No edit is known yet. Change a parameter while somebody walks: what that does to tracking, current, "
    "torque and gait is judged here, stride by stride, before and after."
)
COLOURS: Final = "A stride, from 0 to 100 % of it · {}{} · bands: ± one standard deviation"
DASHED: Final = f" · dashed: fewer than {FEWEST} strides"
AGAIN: Final = "Try it again…"
AGAIN_TIP: Final = "Stage the same value again, and open its review: nothing is sent before"
EDIT: Final = re.compile(
    r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)Z \([0-9a-f]+\)"
)  # when, and its id for the command
BACK: Final = ", also since it was taken back"


class Edits(QWidget):
    """Every edit of the robot that is looked at, newest first, and what the chosen one did.

    `again` brings the values (SI, by parameter) that had too few strides, to be reviewed and tried again.
    """

    again = Signal(object)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._known: tuple[object, ...] = ()  # what is shown was made of this
        self._units: dict[str, dict[str, str]] = {}  # symbols of each edit, by parameter
        self._shown: list[EditEvidence] = []
        self._drawn: EditEvidence | None = None
        self._followed = ""  # the trial that was chosen because it had begun
        self.setAccessibleName("Edits")
        self.list = QListWidget()
        self.list.setObjectName("framed")
        self.list.setAccessibleName("Edits, newest first")
        self.list.setWordWrap(True)
        self.list.currentRowChanged.connect(lambda _row: self._choose())
        self.verdict, self.words, self._legend = PlainLabel(), PlainLabel(NONE), PlainLabel()
        self.verdict.setObjectName("title")
        self._legend.setObjectName("dim")
        for label in (self.verdict, self.words, self._legend):
            label.setWordWrap(True)
        self.words.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.curves: dict[str, StrideCurves] = {}
        self._grid = QGridLayout()
        self.response = ResponsePlot(theme)
        self.response.hide()
        right = QVBoxLayout()
        right.addWidget(self.verdict)
        right.addWidget(self.words)
        right.addWidget(self._legend)  # before what it explains, which may have to be scrolled to
        right.addLayout(self._grid, 1)
        right.addWidget(self.response, 1)
        right.addStretch()
        self._row = QBoxLayout(QBoxLayout.Direction.LeftToRight, self)
        self._row.addLayout(self._left())
        self._row.addLayout(right, 1)
        self._scale()
        theme.scaled.connect(self._scale)
        self._choose()

    def refresh(self) -> None:
        """Show what is known now."""
        station = self._desk.selected
        self.ab.setEnabled(station is not None)
        self.sweep.setEnabled(station is not None)
        self.try_again.setVisible(bool(self._to_try_again))
        run = None if station is None else station.experiment
        writes = () if run is None else run.writes
        judged = [] if station is None else whole(tuple(station.judged), writes)
        known = sorted(judged, key=lambda one: -one.edit.utc_ns)
        made_of = (known, self._desk.shown.revision, 0 if station is None else len(station.known))
        if made_of == self._known:
            return
        self._known = made_of
        known = self._in_units(known, station)
        if [told.edit.id for told in known] == [told.edit.id for told in self._shown]:
            self._grow(known)
        else:
            self._list(known)
        self._follow()
        self._choose()

    def _follow(self) -> None:
        """Show a trial that has begun, until another edit is chosen."""
        running = (
            place
            for place, one in enumerate(self._shown)
            if one.edit.state is EditState.ON_TRIAL and not one.is_final
        )
        place = next(running, None)
        if place is not None and self._shown[place].edit.id != self._followed:
            self._followed = self._shown[place].edit.id
            self.list.blockSignals(True)
            self.list.setCurrentRow(place)
            self.list.blockSignals(False)

    def _in_units(self, known: list[EditEvidence], station: Station | None) -> list[EditEvidence]:
        """Return them as people read values, whose symbols are kept."""

        def si(name: str) -> str | None:
            info = None if station is None else station.known.get(name)
            return None if info is None else info.unit

        units = self._desk.shown.units
        self._units = {one.edit.id: symbols(one, units, si) for one in known}
        return [in_units(one, units, si) for one in known]

    def _left(self) -> QVBoxLayout:
        """Return the list, and what else may be tried."""
        self.ab, self.sweep = QPushButton("A/B trial…"), QPushButton("Sweep…")
        self.try_again = QPushButton(AGAIN)
        set_tip(self.try_again, AGAIN_TIP)
        self.try_again.clicked.connect(lambda: self.again.emit(self._to_try_again))
        self.try_again.hide()
        self.ab.setToolTip("Compare two values of a parameter, several times in random order")
        self.sweep.setToolTip("Increase a parameter in small steps, while you watch")
        self.ab.clicked.connect(lambda: self._ask(ExperimentKind.AB, self._desk.selected))
        self.sweep.clicked.connect(lambda: self._ask(ExperimentKind.SWEEP, self._desk.selected))
        buttons, column = QHBoxLayout(), QVBoxLayout()
        column.addWidget(self.list, 1)
        column.addWidget(self.try_again)
        buttons.addWidget(self.ab)
        buttons.addWidget(self.sweep)
        column.addLayout(buttons)
        column.addStretch(0)  # while there is no list, they stand at the top
        return column

    def compare(self, station: Station) -> None:
        """Take back what is on trial there, and ask about an A/B trial of its value and the one before."""
        trial = station.writing.trial
        if trial is None or len(trial.values) != 1:
            return
        ((name, value),) = trial.values.items()
        station.end_trial()
        self._ask(ExperimentKind.AB, station, Tried(name, float(trial.before[name]), float(value)))

    def _ask(self, kind: ExperimentKind, station: Station | None, tried: Tried | None = None) -> None:
        if station is not None:
            tried = tried or self._chosen_edit(station)
            self.form = ExperimentForm(self, self._desk, station, self._theme, kind, tried)
            self.form.show()

    @property
    def _to_try_again(self) -> dict[str, float]:
        """Values of the shown edit that had too few strides and is over; none while others are staged."""
        told, station = self._chosen, self._desk.selected
        if told is None or station is None or told.experiment is not None:
            return {}
        is_over = told.edit.state is EditState.REVERTED and told.evidence.word is Word.FEW
        if not is_over or station.writing.trial or station.edits.staged:
            return {}
        known = next((one for one in station.judged if one.edit.id == told.edit.id), None)  # SI
        changes_si = () if known is None else known.edit.changes
        found = {one.name: one.new for one in changes_si}
        return found if found.keys() <= station.known.keys() else {}

    def _chosen_edit(self, station: Station) -> Tried | None:
        """Return the shown edit, unless something was staged or tried since."""
        told = self._chosen
        known = next((one for one in station.judged if told and one.edit.id == told.edit.id), None)
        if known is None or len(known.edit.changes) != 1 or station.writing.trial or station.edits.staged:
            return None
        (change,) = known.edit.changes
        if change.old is None or change.name not in station.known:
            return None
        return Tried(change.name, change.old, change.new)

    def _grow(self, known: list[EditEvidence]) -> None:
        """More is known of some: hundreds of others are not laid out again each second."""
        for row, (told, shown) in enumerate(zip(known, self._shown, strict=True)):
            if told != shown:
                self.list.item(row).setText(self._line(told))
        self._shown = known

    def _list(self, known: list[EditEvidence]) -> None:
        chosen = self._chosen
        self._shown = known
        self.list.blockSignals(True)
        self.list.clear()
        for told in known:
            self.list.addItem(QListWidgetItem(self._line(told)))
        places = [place for place, told in enumerate(known) if chosen and told.edit.id == chosen.edit.id]
        # Who looks at the newest one wants to see the next one, too.
        was_newest = self._drawn is None or not places
        self.list.setCurrentRow(0 if was_newest and known else places[0] if places else -1)
        self.list.blockSignals(False)

    @property
    def _chosen(self) -> EditEvidence | None:
        row = self.list.currentRow()
        return self._shown[row] if 0 <= row < len(self._shown) else None

    def _choose(self) -> None:
        told = self._drawn = self._chosen
        self.try_again.setVisible(bool(self._to_try_again))
        self._legend.setVisible(bool(told and told.curves))
        self.list.setVisible(bool(self._shown))  # an empty frame says nothing
        self.verdict.setVisible(told is not None)
        if told is None:
            set_text(self.words, NONE)
        else:
            set_text(self.verdict, self._verdict(told))
            set_tone(self.verdict, TONES.get(told.evidence.word, ""))
            set_text(self.words, with_minus("\n".join(_said(told))))
            sides = (side for one in told.curves for side in (one.before, one.after) if side is not None)
            dashed = DASHED if any(side.cycles < FEWEST for side in sides) else ""
            set_text(self._legend, COLOURS.format(_sides(told), dashed))
        set_tip(self.words, "" if told is None else with_minus("\n".join(map(_in_unit, _strong(told)))))
        tried = None if told is None else told.experiment
        self.response.setVisible(tried is not None and self.response.show_response(tried))
        self._draw(told)

    def _draw(self, told: EditEvidence | None) -> None:
        found = {} if told is None else {one.channel: one for one in told.curves}
        for channel in self.curves.keys() - found.keys():
            gone = self.curves.pop(channel)
            gone.hide()  # at once: what comes in its place is drawn before it is gone
            self._grid.removeWidget(gone)
            gone.deleteLater()
        for channel, one in found.items():
            quantity = channel.rpartition(".")[2]
            if channel not in self.curves:
                self.curves[channel] = StrideCurves(self._theme)
                self.curves[channel].hovered.connect(self._hover)
            self.curves[channel].show_curves(one, self._desk.shown.units.unit(quantity, UNIT[quantity]))
        self._place()

    def _place(self) -> None:
        """Arrange one row per joint; without room, two or four."""
        told, px = self._drawn, self._theme.px
        room = self.width() - (0 if self._is_narrow else px(LIST))
        columns = next((one for one in (len(DRAWN), 2) if one * px(LEAST) <= room), 1)
        channels = [] if told is None else [one.channel for one in told.curves]
        joints = list(dict.fromkeys(channel.rpartition(".")[0] for channel in channels))
        for channel in channels:
            joint, _, quantity = channel.rpartition(".")
            place = joints.index(joint) * len(DRAWN) + DRAWN.index(quantity)
            self._grid.addWidget(self.curves[channel], place // columns, place % columns)

    def _hover(self, at: float | None) -> None:
        """All are read at the same percent of the stride."""
        for one in self.curves.values():
            one.show_hover(at)

    def _what(self, told: EditEvidence) -> str:
        """Return the changed parameters, in their units."""
        if told.experiment is None:
            return changes(told.edit, self._units.get(told.edit.id, {}), spoken)
        return f"{what(told)} {told.experiment.unit}".rstrip()

    def _line(self, told: EditEvidence) -> str:
        ended = told.edit.became if told.experiment is None else told.experiment.kind
        values = self._what(told).replace(" → ", ARROW)  # no line ends within them, nor before a unit
        values = re.sub(r"(?<=\d) (?=[^\W\d]|[°%])", "\N{NO-BREAK SPACE}", values)
        return f"{_when(told.edit.utc_ns)}  {values}\n{ended} · {word(told)}"

    def _verdict(self, told: EditEvidence) -> str:
        evidence, tried = told.evidence, told.experiment
        if tried is not None:
            said = f"{counted(len(tried.periods), 'period')}" if tried.responses else str(evidence.word)
            back = "" if tried.is_back else "; NOT CONFIRMED that it is back"
            return f"{self._what(told)}: {said}{back}"
        return f"{self._what(told)}: {word(told)} ({strides(evidence)})"

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._scale()

    @property
    def _is_narrow(self) -> bool:
        return self.width() < self._theme.px(NARROW)

    def _scale(self) -> None:
        """Put the list beside the strides, or above them without room."""
        px, direction, is_narrow = self._theme.px, QBoxLayout.Direction, self._is_narrow
        self._row.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)
        self.list.setMaximumSize(MOST_PX if is_narrow else px(LIST), px(ABOVE) if is_narrow else MOST_PX)
        self.list.setMinimumWidth(0 if is_narrow else px(LIST))
        self._place()


def _sides(told: EditEvidence) -> str:
    """Return what is drawn in which colour."""
    old = f"grey: the old value{BACK if told.evidence.cycles_back else ''}"
    if not any(one.before for one in told.curves):
        old = "too few strides with the old value to draw"
    new = "blue: the new value" if any(one.after for one in told.curves) else ""
    return " · ".join(filter(None, (new, old)))


def _when(utc_ns: int) -> str:
    """In the time of this place; of another day that, too."""
    try:
        at = datetime.datetime.fromtimestamp(utc_ns / 1e9, datetime.UTC).astimezone()
    except (OverflowError, ValueError, OSError):  # nobody's calendar has it
        return NO_TIME
    is_today = at.date() == datetime.datetime.now().astimezone().date()
    return f"{at:%H:%M:%S}" if is_today else f"{at:%Y-%m-%d %H:%M}"


def _said(told: EditEvidence) -> list[str]:
    evidence, tried = told.evidence, told.experiment
    done = [] if tried is None else list(record(tried))
    strong = _strong(told)
    lines = [*done, *(f"Not as before: {line}." for line in told.edit.not_back)]
    lines += map(_metric, strong[:MOST])
    if len(strong) > MOST:
        lines.append(f"and {len(strong) - MOST} more: gwrms edits show {told.edit.id}")
    same = sum(one.word is Word.SAME for one in evidence.metrics)
    if same:
        others = "the other " if strong else ""
        lines.append(f"No difference seen in {others}{counted(same, 'metric')}.")
    few = sum(one.word is Word.FEW for one in evidence.metrics)
    if few:
        lines.append(f"Not enough cycles for {counted(few, 'metric')}.")
    silent = sum(one.word is Word.NO_DATA for one in evidence.metrics)
    if silent:
        lines.append(f"No data for {counted(silent, 'metric')}.")
    lines += [f"{note[0].upper()}{note[1:]}." for note in map(_by_our_clock, evidence.notes)]
    lines += [
        f"Left out: {counted(count, 'cycle')}, {why.replace('_', ' ')}."
        for why, count in evidence.left_out.items()
    ]
    return lines


def _by_our_clock(note: str) -> str:
    """Name an edit in a note by its time, by which the list has it, instead of by the command's id."""

    def time_of(found: re.Match[str]) -> str:
        try:
            at = datetime.datetime.fromisoformat(f"{found[1]}+00:00")
        except ValueError:  # as of a month 13: no time at all, which stays as it was written
            return found[0]
        return _when(int(at.timestamp()) * 10**9)

    return EDIT.sub(time_of, note)


def _strong(told: EditEvidence) -> list[Measured]:
    """Return the differing metrics, the strongest first."""
    found = (one for one in told.evidence.metrics if one.word in (Word.BETTER, Word.WORSE, Word.CHANGED))
    return sorted(found, key=lambda one: -abs(one.size or 0.0))


def _metric(one: Measured) -> str:
    name = one.title.replace("_", " ")
    means = f"{from_to(one.before, one.after)} {one.unit}".rstrip()
    of_edit = f"{share(one)} (95 % interval {interval(one)})"
    return f"{name} {one.word}: {of_edit}; as measured, drift and all: {means}"


def _in_unit(one: Measured) -> str:
    """Return the difference in the metric's unit."""
    ends = f"{number(one.low)} to {number(one.high)} {one.unit}".rstrip()
    return f"{one.title.replace('_', ' ')}: {number(one.difference)} {one.unit}, 95 % interval {ends}"
