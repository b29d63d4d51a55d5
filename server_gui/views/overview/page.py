"""The overview: what is so now, gait phase, posture, pressure of both feet, three plots, and the joints.

Where not all of it is seen at once, the joints come before the pictures: their numbers are never scrolled to.
Where it has less room still, its sections are on pages: fewer things, and whole.
"""

from typing import Final

from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QApplication, QGridLayout, QHBoxLayout, QToolBar, QVBoxLayout, QWidget

from server_gui.core.alarms.severity import worst_of
from server_gui.core.desk.confidence import not_judged
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.soles import Load, Sole, loads, sole
from server_gui.core.desk.station import Station
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.processing.gait_events import Leg
from server_gui.views.marks import old_text
from server_gui.views.overview.joint_table import JointModel, JointTable
from server_gui.views.overview.joint_words import JointWords
from server_gui.views.overview.key_plot import SECONDS, KeyPlot, PlotKind
from server_gui.views.overview.learned_offer import LearnedOffer
from server_gui.views.overview.now_line import NowLine
from server_gui.views.overview.page_words import (
    SIDES,
    age_texts,
    angle_texts,
    legs_of,
    load_texts,
    placed_flags,
    unwell_sensors,
)
from server_gui.views.overview.sections import (
    ALL,
    NUMBERS_FIRST,
    Page,
    Section,
    SectionBar,
    arranged,
)
from server_gui.views.overview.sections import PLOTS as PLOTS_ALONE
from server_gui.views.predictions import (
    STOPPED,
    activity,
    instead_of_insoles,
    lines,
    model_phases,
    most_needed,
    step_phases,
    unwell,
)
from server_gui.views.refresh_rate import READ_NS
from server_gui.views.robots.others_bar import OthersBar
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_tone
from server_gui.views.widgets.colour_bar import ColourBar
from server_gui.views.widgets.figure import Pose, StickFigure
from server_gui.views.widgets.gait_ring import GaitRing, meaning
from server_gui.views.widgets.lines import Lines
from server_gui.views.widgets.pressure_map import PressureMap
from server_gui.views.widgets.shrinking_label import ShrinkingLabel

SHARES: Final = (10, 9, 11)  # of the width, where three cards stand beside each other
A_COLUMN: Final = 178  # wide at least, at text of 100 %
LOOKS: Final = 2  # at a new size of the window: with the first one, docks may be on their way still
WORDS_SHARE: Final = 5  # of the joints' title line
PICTURE_SHARE, PLOT_SHARE = 10, 9  # of the height
SPARE: Final = 100  # high, likewise: so much must be left for lines and alarms that come
PICTURE: Final = 141  # high at least, likewise: what the ring says is read
PLOT: Final = 142  # high at least, likewise: 70 for its curves
STATUS_LINES: Final = 3
WIDEST_N: Final = 888.0  # of what a foot carries
OFF_N: Final = 50.0  # a figure that is further off than its picture is read at once
PLOTS: Final = (
    PlotKind(
        "Knee angle",
        "rad",
        0.2,
        tuple((f"{side}_knee.position", side, side) for side in SIDES),
        ends=True,
    ),
    PlotKind(
        "Knee torque", "N·m", 5.0, tuple((f"{side}_knee.torque", side, side) for side in SIDES), "0x6072"
    ),
    PlotKind(
        "Trunk tilt",
        "rad",
        0.08,
        (("trunk.tilt_forward", "green", "forward"), ("trunk.tilt_side", "pink", "sideways")),
    ),
)


class Overview(QWidget):
    """Everything at a glance; drawn only while it is visible. `opened` asks for channels in Signals."""

    opened = Signal(object)

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._read_ns: int | None = None  # when what is read was last shown
        self.is_numbers_first = True  # where not all is seen at once; else it begins with pictures
        self.arrangements = NUMBERS_FIRST  # of its sections, whatever it begins with
        self.is_paced = True  # by itself; else only as it is told: with what stands beside it
        self._station: Station | None = None
        self._soles = dict.fromkeys(SIDES, Sole())
        self._forces: dict[str, float | None] = dict.fromkeys(SIDES)  # under the feet, as they were read last
        self._angles: dict[str, list[str]] = {}
        self.setObjectName("page")
        self.now = NowLine(desk, theme)
        self._status, self._ring = Card("Wearer"), GaitRing(theme)
        self.status_lines = Lines(theme, "Predictions, and problems of devices", STATUS_LINES)
        self._status.body.addWidget(self._ring, 1)
        self._status.body.addWidget(self.status_lines)
        self.learned = LearnedOffer(desk, theme)
        self._status.body.addWidget(self.learned)
        self._posture, self._figure = Card("Posture"), StickFigure(theme)
        self._posture.body.addWidget(self._figure)
        self._maps = {side: PressureMap(theme, side) for side in SIDES}
        self._loads = {side: ShrinkingLabel("title") for side in SIDES}
        self._shares = {side: ShrinkingLabel("dim") for side in SIDES}
        self._pressure = self._pressure_card()
        self._plots = [self._plot(kind) for kind in PLOTS]
        self._plots[0].note_label.speak_alike(*(plot.note_label for plot in self._plots[1:]))
        self._joints, self._model = Card("Joints"), JointModel(desk, theme)
        self._table = JointTable(self._model, theme)
        self._joints.body.addWidget(self._table, 1)
        self._joints.body.addStretch(0)  # what is more than the rows may have
        self._wrong = JointWords(theme)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(6, 3, 6, 3)
        self._grid.setHorizontalSpacing(6)
        self._grid.setVerticalSpacing(4)
        self.sections = SectionBar(theme)
        self.sections.chosen.connect(self._choose)
        self._pages, self._page = ALL, ALL[0]
        self._cards: dict[Section, list[Card]] = {
            Section.JOINTS: [self._joints],
            Section.WEARER: [self._status, self._posture, self._pressure],
            Section.PLOTS: [*self._plots],
        }
        for card in (card for cards in self._cards.values() for card in cards):
            card.setParent(self)  # else it would be shown as a window of its own
        self._columns, self._is_plots, self._is_low = 0, False, False
        self._ordered_for: object = None
        self._looks, self._was_first = 0, True  # at this size
        self._arrange(len(SHARES))

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Arrange it anew where another number of cards fits."""
        if self._fitting != self._columns:
            self._arrange(self._fitting)

    def _order(self) -> None:
        """Put the joints where they belong in a window of this size, and on pages what has no room.

        As alarms and lines come and go the order stays: nobody looks for a card while something is wrong.
        """
        window = self.window()
        bars = [*window.findChildren(QToolBar), *window.findChildren(OthersBar)]  # the first are the demo's
        high = window.height() - sum(bar.height() for bar in bars if bar.isVisible())
        rows, is_first = self._model.rowCount(), self.is_numbers_first
        room = window.width(), high, self._theme.scale, rows, self._columns, is_first
        looks = 1 if room != self._ordered_for else self._looks
        if looks <= LOOKS:
            self._ordered_for, self._looks = room, looks + 1
            self._reserve_lines()
            is_low, pages = self._is_too_low(), self._fitting_pages()
            if is_low is not self._is_low or pages != self._pages:
                self._is_low, self._pages = is_low, pages
                self._page = self._page if self._page in pages else self._first_of(pages)
                self._arrange(self._fitting)
        if is_first is not self._was_first:
            self._was_first = is_first
            self._page = self._first_of(self._pages)
            self._arrange(self._fitting)

    def _first_of(self, pages: tuple[Page, ...]) -> Page:
        """Return the page that it begins with."""
        return pages[0 if self.is_numbers_first else -1]

    def _reserve_lines(self) -> None:
        """Keep room for all lines below the ring where the plots have theirs all the same; else for one."""
        seen, needs = self.parentWidget(), self._needs()
        self.status_lines.reserve(STATUS_LINES)
        more = self._status.minimumSizeHint().height() - needs[Section.WEARER]
        gaps = len(needs) * self._grid.verticalSpacing()
        if seen is None or seen.height() - self._around - sum(needs.values()) - gaps < more:
            self.status_lines.reserve(1)

    def _is_too_low(self) -> bool:
        """Return whether something has to be scrolled to, now or with a few lines more."""
        seen = self.parentWidget()
        if seen is None or not self.is_numbers_first:
            return False
        needed = sum(self._needs().values()) + self._around
        return seen.height() - needed < self._theme.px(SPARE)

    def _fitting_pages(self) -> tuple[Page, ...]:
        """Return the pages on which everything is whole."""
        seen = self.parentWidget()
        if seen is None:
            return ALL
        gain = self.now.gain if self._columns > 1 else 0
        bar, between = self.sections.sizeHint().height() - gain, self._grid.verticalSpacing()
        return arranged(self._needs(), seen.height() - self._around, bar, between, self.arrangements)

    @property
    def _around(self) -> int:
        """How high all is that is on every page."""
        margins = self._grid.contentsMargins()
        line = self.now.minimumSizeHint().height() + (self.now.gain if self.now.is_flat else 0)
        return margins.top() + margins.bottom() + line

    def _needs(self) -> dict[Section, int]:
        """How high each section is at least (pixels)."""
        px, between, rows = self._theme.px, self._grid.verticalSpacing(), -(-len(SHARES) // self._columns)
        pictures = (self._posture, self._pressure)  # lines of the wearer come and go
        picture = max(px(PICTURE), *(card.minimumSizeHint().height() for card in pictures))
        plot = max(px(PLOT), *(card.minimumSizeHint().height() for card in self._plots))
        return {
            Section.JOINTS: self._joints.minimumSizeHint().height(),
            Section.WEARER: rows * picture + (rows - 1) * between,
            Section.PLOTS: rows * plot + (rows - 1) * between,
        }

    def _choose(self, page: Page) -> None:
        """Show this page."""
        self._page = page
        self._arrange(self._fitting)
        self.read_now()
        self.refresh()

    @property
    def _fitting(self) -> int:
        """How many cards have room beside each other."""
        return min(max(self.width() // self._theme.px(A_COLUMN), 1), len(SHARES))

    def show_plots_alone(self, alone: bool, *, with_now: bool = True) -> None:
        """Show plots, and not the rest, for who labels what they show; the first line where it is wanted."""
        self.now.setVisible(with_now)
        if alone is not self._is_plots:
            self._is_plots = alone
            self._arrange(self._fitting)

    def minimumSizeHint(self) -> QSize:
        """As narrow as one column: then it is arranged for less."""
        return QSize(self._theme.px(A_COLUMN), super().minimumSizeHint().height())

    def _arrange(self, columns: int) -> None:
        """Arrange as many cards as fit in a row, and the joints below; above where there is little room."""
        self._columns, grid = columns, self._grid
        self._place_words(columns)
        self.now.be_flat(len(self._pages) > 1 and columns > 1)
        self.sections.show_pages(ALL if self._is_plots else self._pages, self._page)
        grid.addWidget(self.now, 0, 0, 1, columns)
        grid.addWidget(self.sections, 1, 0, 1, columns)
        cards = self._cards_of_page()
        first = 3 if self._is_low else 2
        for place, card in enumerate(cards):
            row, column = divmod(place, columns)
            span = columns - column if place == len(cards) - 1 else 1
            grid.addWidget(card, first + row, column, 1, span)
        last = first + -(-len(cards) // columns)
        joints = 2 if self._is_low else last
        grid.addWidget(self._joints, joints, 0, 1, columns)
        for column, share in enumerate(SHARES):
            grid.setColumnStretch(column, share if column < columns else 0)
        plots = next((place for place, card in enumerate(cards) if card in self._plots), len(cards))
        is_alone = self._joints.isVisibleTo(self) and not cards
        for row in range(10):
            is_plots = (row - first) * columns >= plots
            is_fixed = row < 2 or row == joints or row >= last
            share = PLOT_SHARE if is_plots and not self._is_low else PICTURE_SHARE
            grid.setRowStretch(row, 0 if is_fixed else share)
        if is_alone:
            grid.setRowStretch(joints, 1)
        self._table.fill(is_alone)
        for one in (self._joints, self):  # else a frame is drawn in which words lie over the table
            QApplication.sendPostedEvents(one, QEvent.Type.LayoutRequest)

    def _place_words(self, columns: int) -> None:
        """Put what is said of the joints into their title's line, or below the table where that is narrow."""
        is_wide = columns == len(SHARES)
        self._wrong.be_high(1 if columns > 1 else 2)  # a line is enough for an error
        self._table.point_to_words(above=is_wide)
        if is_wide:
            self._joints.head.insertWidget(1, self._wrong, WORDS_SHARE)
        else:
            self._joints.body.insertWidget(1, self._wrong)

    def _cards_of_page(self) -> list[Card]:
        """Return the cards of the page that stand beside each other; hide those of the others."""
        page = PLOTS_ALONE if self._is_plots else self._page
        found: list[Card] = []
        for section, cards in self._cards.items():
            for card in cards:
                card.setVisible(section in page)
            found += cards if section in page and section is not Section.JOINTS else []
        return found

    def read_now(self) -> None:
        """Let the next frame show also what is read: what stands beside it is shown anew then."""
        self._read_ns = None

    def refresh(self) -> None:
        """Draw how it is now; what is read rather than seen changes more slowly."""
        station = self._desk.selected
        if station is None:
            return
        if station is not self._station:
            self._station = station
            self._fit_time()
        due_ns = None if self._read_ns is None else self._read_ns + READ_NS
        slow = due_ns is None or (self.is_paced and now_ns() >= due_ns)
        if slow:
            self._read_ns = now_ns()
            self.now.refresh()
            self._order()  # not as the window is resized: its parts have their sizes now
        self._refresh_status(station, slow=slow)
        self._refresh_posture(station, slow=slow)
        self._refresh_pressure(station, slow=slow)
        flags = placed_flags(station, SECONDS)
        for plot in self._plots:
            plot.refresh(station, flags, slow=slow)
        if slow:
            self._model.refresh()
            self._wrong.say(self._table.unsaid, self._table.bars, self._table.tone)
            joints = [joint for joint, _ in self._model.errors]
            worst = worst_of([joint.replace(" ", "_") for joint in joints], station.alarms)
            self.sections.say({Section.JOINTS: (joints, worst), Section.WEARER: unwell_sensors(station)})
            self._joints.set_note(*age_texts(station))

    # --- one time for all plots

    def _plot(self, kind: PlotKind) -> KeyPlot:
        made = KeyPlot(self._desk, self._theme, kind)
        made.plot.zoomed.connect(self._show_time)
        made.plot.fitted.connect(self._fit_time)
        made.plot.hovered.connect(self._hover)
        made.plot.clicked.connect(lambda: self.opened.emit(made.channels))
        return made

    def _show_time(self, left: float, right: float) -> None:
        for one in self._plots:
            one.plot.show_window(left, right)

    def _fit_time(self) -> None:
        for one in self._plots:
            one.plot.set_seconds(SECONDS)

    def _hover(self, at: float | None) -> None:
        for one in self._plots:
            one.show_hover(at)

    @property
    def drives(self) -> tuple[QWidget, QWidget]:
        """What tells of each drive, and of all of them."""
        return self._joints, self.now

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
            for label in (self._loads[side], self._shares[side]):
                label.setAlignment(Qt.AlignmentFlag.AlignCenter)
                column.addWidget(label)
            row.addLayout(column, 1)
        for labels in (self._loads, self._shares):
            labels[SIDES[0]].speak_alike(*(labels[side] for side in SIDES[1:]))
        row.addWidget(ColourBar(self._desk, self._theme))
        card.body.addLayout(row)
        return card

    def _refresh_status(self, station: Station, *, slow: bool) -> None:
        derived = station.processing.derived()
        live = station.is_live
        judged = live and not not_judged(station)
        phases = step_phases(station) if judged else dict.fromkeys(Leg)
        modelled = model_phases(station) if judged else dict.fromkeys(Leg)
        word, below = self._words(station)
        self._ring.show_phases(phases, modelled, word, below, live=live)
        if slow:
            sources = {one.value.replace("_", " ") for one in derived.sources.values() if one is not None}
            model = any(modelled.values())
            told = meaning(sources, instead_of_insoles(station), model=model)
            self._status.set_note(*(told if live else old_text(station)))
            self.status_lines.show_lines(most_needed(list(lines(station))))
            self.learned.refresh(station)

    def _words(self, station: Station) -> tuple[str, str]:
        """Return what the wearer does, and how fast."""
        line, gait = activity(station), station.processing.derived().gait
        if line.mark.word == STOPPED:
            return line.short_text, "not judged"
        walks = station.is_live and gait.walking and gait.cadence_spm is not None
        word = line.short_text if station.is_live else "Not known"
        return word, f"{gait.cadence_spm:.0f} steps/min" if walks else ""

    def _refresh_posture(self, station: Station, *, slow: bool) -> None:
        values = station.robot.values
        legs = {
            side: Pose(*(values.get(f"{side}_{joint}.position") for joint in ("hip", "knee", "ankle")))
            for side in legs_of(station)
        }
        wrong = frozenset(part.name for part in unwell(station))
        live = station.is_live
        if slow:
            angle = self._desk.shown.units.unit("position", "rad")
            self._angles = {side: angle_texts(pose, angle) for side, pose in legs.items()}
        self._figure.show_pose(legs, values.get("trunk.tilt_forward"), wrong, self._angles, live=live)
        if slow:
            tilt = self._desk.shown.units.unit("tilt_forward", "rad")
            said = f"{tilt.text(values.get('trunk.tilt_forward'))}{tilt.symbol}"
            told = (f"from the right · trunk {said} forward", f"trunk {said} forward", f"trunk {said}")
            self._posture.set_note(*(told if live else old_text(station)))

    def _refresh_pressure(self, station: Station, *, slow: bool) -> None:
        live, values = station.is_live, station.robot.values
        if slow or self._is_off(station):
            self._refresh_soles(station, live=live)
        for side, known in self._soles.items():
            pressures = [values.get(f"{side}_insole.cell_{number}") for number in range(known.count)]
            x, y = values.get(f"{side}_insole.cop_x"), values.get(f"{side}_insole.cop_y")
            cop = None if x is None or y is None else (x, y)
            self._maps[side].show_pressures(pressures, cop, live=live)

    def _is_off(self, station: Station) -> bool:
        """Return whether a foot carries much more or less than its figure says."""
        carried = {side: loads(station.robot)[side].force for side in SIDES}
        return any(
            (force is None) is not (self._forces[side] is None)
            or abs((force or 0.0) - (self._forces[side] or 0.0)) > OFF_N
            for side, force in carried.items()
        )

    def _refresh_soles(self, station: Station, *, live: bool) -> None:
        force = self._desk.shown.units.unit("force", "N")
        carried = loads(station.robot)
        self._forces = {side: carried[side].force for side in SIDES}
        for side in SIDES:
            known = sole(station.robot, side)
            if known != self._soles[side]:
                self._soles[side] = known
                self._maps[side].set_cells(known.cells)
            wordings = load_texts(side, carried[side], force)
            self._loads[side].say(*wordings, widest=load_texts(side, Load(WIDEST_N, None), force))
            set_tone(self._loads[side], "" if live else "old")
            share = carried[side].share
            said = "–" if share is None else f"{100 * share:.0f} %"
            value = f"{wordings[0]}, {said} of the load" if live else "not known now"
            self._maps[side].say(carried[side].problem or ("" if known.count else "no data"), value)
            self._shares[side].say(f"{said} of the load", said)
        sources = "; ".join(dict.fromkeys(known.source for known in self._soles.values()))
        count = f"{max(known.count for known in self._soles.values())} cells"
        self._pressure.set_note(*((sources, count, "") if live else old_text(station)))
