"""The overview's first line: drives, activity with how far to believe it, and what is on trial."""

import itertools
from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QBoxLayout, QFrame, QGridLayout, QHBoxLayout, QPushButton, QSizePolicy, QWidget

from gateway.units import Units, rounded
from server_gui.core.alarms.drive_states import any_enabled, unknown_joints
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.alarms.unconfirmed import enabled_mark, remedy, unstopped
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.stop import StopState
from server_gui.core.tuning.writing import Trial
from server_gui.views.edits.trial_words import TO_AB, changes, ends, is_judged, so_far, why_no_ab, wordings
from server_gui.views.marks import SHORTER, Mark, drives_mark, enabled_text, time_of_day
from server_gui.views.predictions import AS_KNOWN, STOPPED, activity, is_last_held, no_data
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_primary
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.visibility import is_all_seen

A_FACT: Final = 230  # wide at least, at text of 100 %, where several stand beside each other
BESIDE: Final = 8  # between the words and the detail of one line
ON_TRIAL: Final = Mark("half", "warn", "on trial")


class Fact(QWidget):
    """A mark, what it says in large letters, and a line below."""

    def __init__(self, theme: Theme, name: str) -> None:
        super().__init__()
        self._theme = theme
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self._icon, self.main, self.detail = (
            MarkIcon(theme, 13),
            ShrinkingLabel("title"),
            ShrinkingLabel("dim"),
        )
        self._details: tuple[str, ...] = ("",)
        self._words = words = QBoxLayout(QBoxLayout.Direction.TopToBottom)
        words.setSpacing(0)
        words.addWidget(self.main)
        words.addWidget(self.detail, 1)
        self.row = QHBoxLayout(self)
        self.row.setContentsMargins(0, 0, 0, 0)
        self.row.setSpacing(8)
        self.row.addWidget(self._icon)
        self.row.addLayout(words, 1)
        theme.changed.connect(self._restyle)
        self._restyle()

    def say(self, mark: Mark, main: tuple[str, ...], detail: tuple[str, ...], tip: str = "") -> None:
        """Say this; of each the fullest wording first."""
        self._icon.show_mark(mark)
        self.main.say(*main)
        self._details = detail
        self._say_detail()
        self.setAccessibleDescription(f"{main[0]}, {detail[0]}")
        set_tip(self, "\n".join(filter(None, (main[0], detail[0], tip))))

    def be_flat(self, is_flat: bool) -> None:
        """Have both in one line, where there is little room."""
        way = QBoxLayout.Direction.LeftToRight if is_flat else QBoxLayout.Direction.TopToBottom
        if way is not self._words.direction():
            self._words.setDirection(way)
            self._words.setSpacing(BESIDE if is_flat else 0)
            self._say_detail()

    @property
    def widths(self) -> tuple[int, int, int]:
        """How wide its one line is (pixels): with its fewest words, with all, with the least beside them."""
        icon = self.wide - self.main.sizeHint().width()
        least = min(map(self.detail.fontMetrics().horizontalAdvance, self._details))
        return icon + self.main.minimumSizeHint().width(), self.wide, self.wide + BESIDE + least

    @property
    def wide(self) -> int:
        """How wide it is with its first line whole (pixels)."""
        return self._icon.sizeHint().width() + self.row.spacing() + self.main.sizeHint().width()

    def _say_detail(self) -> None:
        """Say it; in one line nothing at all where its words alone have room."""
        is_flat = self._words.direction() is QBoxLayout.Direction.LeftToRight
        self.detail.say(*self._details, *([""] if is_flat else []))

    def _restyle(self) -> None:
        self.main.setFont(self._theme.text_font(1.15, bold=True))
        self.detail.setFont(self._theme.text_font())


class NowLine(QFrame):
    """Facts beside each other, or below each other where there is less room.

    `compare` brings the station whose trial is to become an A/B trial.
    """

    compare = Signal(object)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.setObjectName("card")
        self.setAccessibleName("What is so now")
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self.drives, self.activity = Fact(theme, "Drives"), Fact(theme, "Activity")
        self.trial = Fact(theme, "Trial")
        self.trial.setParent(self)  # also while it has no place, so that it is no window of its own
        self.keep, self.take_back = QPushButton("Keep"), QPushButton("Take back")
        self.keep.setToolTip("Keep the values on trial")
        self.take_back.setToolTip("Return to the values from before")
        self.keep.clicked.connect(lambda: desk.selected.keep_trial() if desk.selected else None)
        self.take_back.clicked.connect(lambda: desk.selected.end_trial() if desk.selected else None)
        self.ab = QPushButton("A/B …")
        set_tip(self.ab, TO_AB)
        self.ab.clicked.connect(lambda: self.compare.emit(desk.selected) if desk.selected else None)
        self._decide = QWidget()
        row = QHBoxLayout(self._decide)
        row.setContentsMargins(0, 0, 0, 0)
        row.addStretch(1)
        for button in (self.take_back, self.ab, self.keep):
            row.addWidget(button)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(10, 3, 10, 3)
        self._grid.setHorizontalSpacing(18)
        self._placed: tuple[int, bool] = (0, False)
        self._is_offered = True
        self.is_flat = False
        self._arrange(2, on_trial=False)

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(150), super().minimumSizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit(on_trial=self._placed[1])

    @property
    def can_be_decided(self) -> bool:
        """Whether a trial can be kept and taken back here: both buttons are whole in sight."""
        return is_all_seen(self.keep) and is_all_seen(self.take_back)

    def offer(self, wanted: bool) -> None:
        """Choose whether a trial is judged, kept or taken back here: not while its panel is in sight."""
        self._is_offered = wanted
        self._decide.setVisible(wanted and self._placed[1])

    def be_flat(self, is_flat: bool) -> None:
        """Have each fact in one line; what is on trial keeps its two."""
        self.is_flat = is_flat
        for fact in (self.drives, self.activity):
            fact.be_flat(is_flat)

    @property
    def gain(self) -> int:
        """How much lower it is where it is flat."""
        return self.drives.detail.sizeHint().height()

    def refresh(self) -> None:
        """Show how it is now."""
        station = self._desk.selected
        trial = None if station is None else station.writing.trial
        if station is not None and trial is not None:
            self._show_trial(station, trial)
            set_primary(self.keep, is_judged(station))
        self._fit(on_trial=trial is not None)
        if station is None:
            return
        self.drives.say(*_drives(station, self._desk.shown.units))
        line = activity(station)
        gait = station.processing.derived().gait
        walks = (
            station.is_live and line.mark.word != STOPPED and gait.walking and gait.cadence_spm is not None
        )
        cadence = f"  {gait.cadence_spm:.0f} steps/min" if walks else ""
        details = tuple(dict.fromkeys((line.detail, line.short or line.detail)))
        self.activity.say(line.mark, (f"{line.text}{cadence}", line.text), details, line.tip)

    def _show_trial(self, station: Station, trial: Trial) -> None:
        units = self._desk.shown.units
        tip = "\n".join(changes(station, trial, units))
        back = ends(station, trial)
        seen = tuple(f"{back}; {words}" for words in so_far(station))
        self.trial.say(ON_TRIAL, wordings(station, trial, units), (*seen, back), tip)
        why_not = why_no_ab(trial)
        self.ab.setEnabled(not why_not)
        set_tip(self.ab, why_not or TO_AB)

    def _fit(self, *, on_trial: bool) -> None:
        """Put the trial beside the other facts if it fits, else below them.

        How it is judged changes with each stride, and nothing may move with that: it has what room there is.
        """
        a_fact, around = self._theme.px(A_FACT), self.width() - self._grid.contentsRect().width()
        needed = 2 * a_fact + 2 * self._grid.horizontalSpacing() + self.trial.wide + around
        is_beside = on_trial and not self._is_offered and self.width() >= needed
        columns = 3 if is_beside else min(max(self.width() // a_fact, 1), 2)
        self._arrange(columns, on_trial=on_trial)
        self._grid.setColumnMinimumWidth(2, self.trial.wide if columns > 2 else 0)
        self._share(columns)

    def _share(self, columns: int) -> None:
        """Give both facts of a line room for their words first, then for what stands beside these."""
        facts, least = (self.drives, self.activity), [0, 0]
        if self.is_flat and columns > 1:
            taken = (columns - 1) * self._grid.horizontalSpacing() + self._grid.columnMinimumWidth(2)
            room = self._grid.contentsRect().width() - taken
            least = [fact.widths[0] for fact in facts]
            for step, place in itertools.product((1, 2), (0, 1)):
                wider = facts[place].widths[step]
                least[place] = wider if least[1 - place] + wider <= room else least[place]
        for column, wide in enumerate(least):
            self._grid.setColumnMinimumWidth(column, wide)

    def _arrange(self, columns: int, *, on_trial: bool) -> None:
        if (columns, on_trial) == self._placed:
            return
        self._placed = columns, on_trial
        facts = [self.drives, self.activity, *([self.trial] if on_trial else [])]
        for place, fact in enumerate(facts):
            row, column = divmod(place, columns)
            is_last = place == len(facts) - 1
            span = columns - column if is_last else 1
            self._grid.addWidget(fact, row, column, 1, span, Qt.AlignmentFlag.AlignVCenter)
        if columns > 1:
            self.trial.row.addWidget(self._decide)
        else:  # below it: beside them its value has no room
            self._grid.addWidget(self._decide, len(facts), 0)
        self.trial.setVisible(on_trial)
        self._decide.setVisible(on_trial and self._is_offered)
        for column in range(3):
            self._grid.setColumnStretch(column, 1 if column < columns else 0)


def _drives(station: Station, units: Units) -> tuple[Mark, tuple[str, ...], tuple[str, ...]]:
    count = enabled_text(station.robot, live=station.is_live)
    mark = drives_mark(station.robot, enabled_mark(station.robot, station.stopping))
    if (kind := unstopped(station.robot, station.stopping)) is not None:
        known = mark.word if station.is_live else "drives not known"
        led, first = TEXTS[kind].mark, remedy(station.robot, station.stopping)[0]
        words = () if kind is Kind.NOT_STOPPED else (f"{led.word}: {first}",)
        return led, (*words, led.word), (f"{known} · {count}", count)
    if not station.is_live and not is_last_held(station):
        return Mark("ring", "old", "not known"), ("Drives not known",), (count,)
    if not station.is_live:
        return TEXTS[Kind.STOPPED].mark, _last_since(station), _last_details(station)
    is_off = not any_enabled(station.robot) and not unknown_joints(station.robot)
    if station.stopping.held and is_off:
        details = (*_proven(station), f"{mark.word} · {count}", count)
        return TEXTS[Kind.STOPPED].mark, _since(station), details
    said = dict.fromkeys((mark.word.capitalize(), SHORTER.get(mark.word, mark.word).capitalize()))
    worst = station.mark
    if mark.colour == "good" and worst.colour in ("warn", "bad"):  # as its card says
        brief = SHORTER.get(mark.word, mark.word)
        return worst, (capitalised(worst.word),), (f"{mark.word} · {count}", f"{brief} · {count}", count)
    return mark, tuple(said), (*_warmest(station, units, count), count)


def capitalised(word: str) -> str:
    """Return it as a title; what is in capitals already stays so."""
    return word[:1].upper() + word[1:]


def _warmest(station: Station, units: Units, count: str) -> tuple[str, ...]:
    """Return which drive is the warmest, behind how many are enabled; nothing where none says so."""
    told = {joint: station.robot.values.get(f"{joint}.temperature") for joint in station.robot.names("joint")}
    known = {joint: value for joint, value in told.items() if value is not None}
    if len(known) < 2:
        return ()
    joint = max(known, key=lambda one: known[one])
    unit = units.unit("temperature", "°C")
    return (
        f"{count} · warmest: {joint.replace('_', ' ')} {rounded(known[joint] * unit.scale, 0)} {unit.symbol}",
    )


def _since(station: Station) -> tuple[str, ...]:
    since_s = station.stopping.since_s
    if since_s is None:
        return ("STOPPED",)
    return f"STOPPED since {time_of_day(since_s)}", "STOPPED"


def _last_since(station: Station) -> tuple[str, ...]:
    """Return since when it is stopped; without a link somebody may have reset it meanwhile."""
    since = _since(station)
    if station.is_linked:
        return since
    return *(f"{said}, {AS_KNOWN}" for said in since), "STOPPED when last seen"


def _last_details(station: Station) -> tuple[str, ...]:
    return " · ".join((*_proven(station), no_data(station))), no_data(station)


def _proven(station: Station) -> tuple[str, ...]:
    """Return that every drive has confirmed the STOP, where this window knows."""
    stopping = station.stopping
    if stopping.state is not StopState.CONFIRMED:
        return ()
    return (stopping.timed(f"{stopping.drives}/{stopping.drives} confirmed"),)
