"""The parameters panel: filter, tree, chosen one; review, write or try, undo; a file; storing to flash."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QResizeEvent
from PySide6.QtWidgets import (
    QGridLayout,
    QMenu,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from gateway.parameter_files.contents import FileProblem
from gateway.wire.parameter import PARAMETER_STORE, PARAMETER_WRITE
from server_gui.core.alarms.drive_states import any_enabled
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.tuning.comparison import open_file, save_file, staged_as
from server_gui.core.tuning.edits import ReviewedEdit, refusal, unit_of
from server_gui.core.tuning.several_joints import Offer
from server_gui.core.tuning.writing import WriteProgress, WriteState
from server_gui.views.edits.trial_words import verdict_takes
from server_gui.views.marks import time_of_day
from server_gui.views.parameters.control_bar import ControlBar
from server_gui.views.parameters.detail import Detail
from server_gui.views.parameters.file_bar import FileBar
from server_gui.views.parameters.filter import FilterBar
from server_gui.views.parameters.review import Review
from server_gui.views.parameters.store_page import StorePage
from server_gui.views.parameters.tree import ParameterTree
from server_gui.views.parameters.trial_bar import TrialBar
from server_gui.views.theme import Theme
from server_gui.views.widgets.files import ask_open, ask_save
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.scroll_area import ScrollArea

EDIT, REVIEW, STORE = range(3)  # pages; those that are not in front ask for no room
NOT_KNOWN: Final = "Whether drives are enabled is not known now."
ACTS: Final = "Drives are enabled: it acts at once, on whoever stands in the robot."
NEWS_S: Final = 10.0  # that something is as it should be, it is said in green
NO_LINK: Final = "There is no link to the robot: nothing can be stored"
NARROW: Final = 300  # wide, at text of 100 %: below that all of the card would take the rows of the table
REVIEW_WIDE: Final = 95  # its button with a number of two digits, at text of 100 %
STORING: Final = "Make a device keep its parameters without power; a separate step"


class ParametersPanel(QWidget):
    """Values and edits of the robot that is looked at."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self._problem = ""
        self._is_short = self._is_in_two = False
        self.setObjectName("dock")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.tree, self.detail, self.review = ParameterTree(desk, theme), Detail(desk, theme), Review(theme)
        self.trial, self.control = TrialBar(desk), ControlBar(desk, theme)
        self.filters, self.file = FilterBar(desk, theme), FileBar(desk)
        self.storing = StorePage(desk, theme)
        self.pages = QStackedWidget()
        self.banner = PlainLabel()
        self.banner.setObjectName("banner")
        self.banner.setWordWrap(True)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(self.control)
        everything.addWidget(self.pages, 1)
        self.pages.addWidget(ScrollArea(self._edit_page()))  # what leads on, below, stays in sight
        for page in (ScrollArea(self.review), ScrollArea(self.storing)):
            page.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Ignored)
            self.pages.addWidget(page)
        everything.addWidget(self.banner)
        everything.addWidget(self.trial)
        self._below = QWidget()
        self._below.setLayout(self._buttons())
        everything.addWidget(self._below)
        self._connect()

    def heightForWidth(self, width: int) -> int:
        """As low as it can be: what scrolls it would give the tree all that it would like to have."""
        layout = self.layout()
        return -1 if layout is None else layout.totalMinimumHeightForWidth(width)

    def refresh(self) -> None:
        """Show how it is now."""
        self.detail.is_low = self._is_short and self.width() < self._theme.px(NARROW)
        for part in (self.control, self.file, self.tree, self.trial, self.detail):
            part.refresh()
        station = self._desk.selected
        staged = 0 if station is None else len(station.difference(self._desk.shown.units))
        editing = self.pages.currentIndex() == EDIT
        self.review_button.setText(f"Review {staged} …" if staged else "Review …")
        not_written = "" if station is None else station.refused(PARAMETER_WRITE)
        self.review_button.setEnabled(bool(staged) and editing and not not_written)
        set_tip(self.review_button, not_written)
        self._discard.setEnabled(bool(staged))
        self.undo.setEnabled(station is not None and bool(station.writing.undo) and editing)
        for button in (self._compare, self._save, self.store_button):
            button.setEnabled(station is not None and bool(station.known) and editing)
        not_stored = "" if station is None else station.refused(PARAMETER_STORE)
        if station is not None and not station.is_linked:
            not_stored = NO_LINK
        if not_stored:
            self.store_button.setEnabled(False)
        set_tip(self.store_button, not_stored or STORING)
        self._below.setVisible(editing)  # a page that leads on itself has that room
        self._filter()
        self._refresh_banner(station, staged)
        if self.pages.currentIndex() == REVIEW and station is not None:
            self._refresh_review(station)
        elif self.pages.currentIndex() == STORE:
            self.storing.refresh()

    @property
    def is_in_use(self) -> bool:
        """Whether something is staged, reviewed, written or on trial, or what came of it is to be read."""
        station = self._desk.selected
        if station is None:
            return False
        staged, writing = station.difference(self._desk.shown.units), station.writing
        is_over = writing.state in (WriteState.IDLE, WriteState.DONE) and writing.trial is None
        return bool(staged) or self.pages.currentIndex() != EDIT or not is_over

    def be_short(self, is_short: bool) -> None:
        """Put what is done seldom behind one button, where there is little room."""
        self.more.setVisible(is_short)
        for button in self._seldom:
            button.setVisible(not is_short)
        self.detail.be_short(is_short)
        self._is_short = is_short
        self._below.setMinimumWidth(1 if is_short else 0)  # narrower, they are in two rows
        self._place_buttons()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._place_buttons()

    def _place_buttons(self) -> None:
        """Put all in one row where they have room: else they take that of the tree and the card."""
        grid, margins = self._buttons_grid, self.contentsMargins()
        needed = sum(one.sizeHint().width() for one in (self.undo, self._discard, self.more))
        wide = needed + 3 * grid.horizontalSpacing() + self._theme.px(REVIEW_WIDE) + 16
        in_two = self._is_short and self.width() - margins.left() - margins.right() < wide
        if in_two is self._is_in_two:
            return
        self._is_in_two = in_two
        for button in (self.review_button, self.more):
            grid.removeWidget(button)
        place = {False: ((0, 2), (0, 3)), True: ((1, 0), (1, 1))}[in_two]
        for button, (row, column) in zip((self.review_button, self.more), place, strict=True):
            grid.addWidget(button, row, column)

    def stage_text(self, name: str, text: str) -> None:
        """Stage what was typed, in the unit that is shown."""
        station = self._desk.selected
        if station is None or name not in station.known:
            return
        unit = unit_of(name, station.known[name].unit, self._desk.shown.units)
        try:
            value = unit.si_value(text.strip().replace(",", "."))
        except ValueError as error:
            self._problem = f"{name}: {error}"
            return
        held = station.robot.parameters.get(name)
        why = refusal(value, None if held is None else held.value, station.known[name], unit)
        if why is not None:
            self._problem = f"{name}: {text.strip()} {unit.symbol}".rstrip() + f" is not staged: it is {why}"
            return
        self.stage(name, value)

    def stage(self, name: str, value: float) -> None:
        """Stage an SI value; nothing is sent."""
        station = self._desk.selected
        if station is not None:
            self._problem = ""
            station.edits.stage(name, value, station.robot.parameters.get(name))
            station.writing.rows.pop(name, None)

    def stage_several(self, offer: Offer) -> None:
        """Stage the same for several joints; where one cannot take it, none of it, and why is said."""
        if offer.problem:
            self._problem = offer.problem
        for name, value in offer.changes.items():
            self.stage(name, value)

    def begin_review(self) -> None:
        """Show exactly what would be written."""
        station = self._desk.selected
        if station is not None:
            now = station.difference(self._desk.shown.units)
            self.review.show_changes(now, _acts(station), self._desk.whose)
            self.pages.setCurrentIndex(REVIEW)
            # The button that led here gives way: else the next one in the window would have the keyboard.
            self.review.take_keyboard()

    def find_parameter(self) -> None:
        """Let words be typed that filter the parameters."""
        self.pages.setCurrentIndex(EDIT)
        self.filters.words.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filters.words.selectAll()

    def edit_parameter(self, name: str) -> None:
        """Let a new value be typed for this one, as a double click on it does; nothing is staged yet."""
        self.pages.setCurrentIndex(EDIT)
        self.filters.show_all()
        self.refresh()
        self.tree.edit_name(name)

    def open_file(self, path: Path) -> None:
        """Compare with a file from now on; nothing is staged and nothing is sent."""
        station = self._desk.selected
        if station is None or station.robot.description is None:
            return
        chosen = station.known.get(self.tree.current_name or "")
        component = None if chosen is None else chosen.component
        try:
            station.file = open_file(path, station.robot.description, component)
        except FileProblem as error:
            self._problem = str(error)
            return
        self._problem = ""
        self.refresh()

    def save_file(self, path: Path) -> None:
        """Save what the robot holds."""
        station = self._desk.selected
        if station is None or station.robot.description is None:
            return
        try:
            count = save_file(path, station.robot.description, station.robot.parameters)
        except FileProblem as error:
            self._problem = str(error)
            return
        self._problem = ""
        station.writing.say(WriteState.DONE, f"{path}: {count} parameters saved as the robot holds them")

    # --- how it is put together

    def _edit_page(self) -> QWidget:
        page = QWidget()
        layout = QVBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.filters)
        layout.addWidget(self.tree, 1)
        layout.addWidget(self.file)
        layout.addWidget(self.detail)
        return page

    def _buttons(self) -> QGridLayout:
        self.undo, self._discard = QPushButton("Undo …"), QPushButton("Discard edits")
        self.undo.setToolTip("Stages the inverse of the latest write, to be reviewed and written")
        self.review_button = QPushButton("Review …")
        self.review_button.setObjectName("primary")
        self._compare, self._save = QPushButton("Compare …"), QPushButton("Save …")
        self._compare.setToolTip(
            "Compare with a .toml or .dcf file, and load edits from it. Nothing is written"
        )
        self._save.setToolTip("Save the robot's values as a .toml file")
        self.store_button = QPushButton("Store to flash …")
        set_tip(self.store_button, STORING)
        grid = self._buttons_grid = QGridLayout()
        grid.setContentsMargins(0, 0, 0, 0)
        grid.addWidget(self.undo, 0, 0)
        grid.addWidget(self._discard, 0, 1)
        grid.addWidget(self.review_button, 0, 2)
        grid.addWidget(self._compare, 1, 0)
        grid.addWidget(self._save, 1, 1)
        grid.addWidget(self.store_button, 1, 2)
        grid.addWidget(self._more_button(), 0, 3)
        grid.setColumnStretch(2, 1)
        return grid

    def _more_button(self) -> QPushButton:
        """Return the button whose menu replaces the rarely used buttons."""
        self._seldom = (self._compare, self._save, self.store_button)
        self.more = QPushButton("More")
        menu = QMenu(self.more)
        actions = {button: menu.addAction(button.text()) for button in self._seldom}
        for button, action in actions.items():
            action.setToolTip(button.toolTip())
            action.triggered.connect(button.click)
        menu.addMenu(self.detail.several)
        menu.setToolTipsVisible(True)
        menu.aboutToShow.connect(lambda: _enable_alike(actions))
        self.more.setMenu(menu)
        self.more.hide()
        return self.more

    def _connect(self) -> None:
        self.filters.changed.connect(self._filter)
        self.tree.typed.connect(self.stage_text)
        self.tree.chosen.connect(self.detail.choose)
        self.detail.typed.connect(self.stage_text)
        self.detail.slid.connect(self.stage)
        self.detail.several.taken.connect(self.stage_several)
        self.detail.dropped.connect(lambda name: self._with(lambda station: station.edits.drop(name)))
        for part in (self.tree, self.detail):
            part.pinned.connect(self._pin)
        self.file.stage.connect(lambda: self._with(self._load))
        self.file.forget.connect(lambda: self._with(_close_file))
        self.trial.keep.connect(lambda: self._with(Station.keep_trial))
        self.trial.take_back.connect(lambda: self._with(Station.end_trial))
        self.control.take.connect(lambda: self._with(Station.take_control))
        self.control.release.connect(lambda: self._with(Station.release_control))
        self._discard.clicked.connect(lambda: self._with(lambda station: station.edits.drop()))
        self.undo.clicked.connect(self._undo_latest)
        self.review_button.clicked.connect(self.begin_review)
        self.review.back.connect(lambda: self.pages.setCurrentIndex(EDIT))
        self.review.write.connect(self._write)
        self.review.dropped.connect(lambda names: self._with(lambda station: station.edits.drop(*names)))
        self._compare.clicked.connect(lambda: ask_open(self, "Compare with", ("toml", "dcf"), self.open_file))
        self._save.clicked.connect(
            lambda: ask_save(self, "Save parameters", "toml", self.save_file, self._title)
        )
        self.store_button.clicked.connect(self._begin_store)
        self.storing.back.connect(lambda: self.pages.setCurrentIndex(EDIT))
        self.storing.store.connect(self._store)
        self._desk.on_select.append(self._selected)

    @property
    def _title(self) -> str:
        """The robot's name."""
        return "parameters" if self._desk.selected is None else self._desk.selected.title

    # --- what people do

    def _with(self, do: Callable[[Station], None]) -> None:
        if self._desk.selected is not None:
            do(self._desk.selected)

    def _selected(self, _station: Station | None) -> None:
        self._problem = ""
        self.pages.setCurrentIndex(EDIT)

    def _pin(self, name: str) -> None:
        station = self._desk.selected
        if station is not None:
            self._desk.pins.toggle(station.title, name)
            self.refresh()

    def _load(self, station: Station) -> None:
        if station.file is not None:
            for name, value in staged_as(station.file.different).items():
                self.stage(name, value)

    def _begin_store(self) -> None:
        chosen = (
            None
            if self._desk.selected is None
            else self._desk.selected.known.get(self.tree.current_name or "")
        )
        self.storing.begin(None if chosen is None else chosen.component)
        self.pages.setCurrentIndex(STORE)

    def _store(self, components: tuple[str, ...]) -> None:
        self.pages.setCurrentIndex(EDIT)
        self._with(lambda station: station.store(*components))

    def _undo_latest(self) -> None:
        self._with(Station.stage_undo)
        self.begin_review()

    def _write(self, changes: tuple[ReviewedEdit, ...], trial_s: float | None) -> None:
        """Write the reviewed changes; if the robot's values have changed since, show the review again."""
        station = self._desk.selected
        if station is None:
            return
        if changes != station.difference(self._desk.shown.units):
            self.begin_review()
            return
        self.pages.setCurrentIndex(EDIT)
        station.write(changes, trial_s)

    # --- what is shown

    def _filter(self) -> None:
        self.tree.show_only(self.filters.words.text(), self.filters.refresh())

    def _refresh_review(self, station: Station) -> None:
        now = station.difference(self._desk.shown.units)
        if (now, _acts(station)) != (self.review.changes, self.review.acts):
            self.review.show_changes(now, _acts(station), self._desk.whose)
        self.review.say_how_long(*verdict_takes(station))
        if not now:
            self.pages.setCurrentIndex(EDIT)

    def _refused(self, station: Station | None) -> str:
        """Return the staged values that the robot would refuse now."""
        changes = () if station is None else station.difference(self._desk.shown.units)
        said = [f"{change.name}: {change.problem}" for change in changes if change.problem]
        return "\n".join(said)

    def _refresh_banner(self, station: Station | None, staged: int) -> None:
        is_review = self.pages.currentIndex() == REVIEW  # which says itself what would be refused
        text, tone = _banner(station, staged, self._problem or ("" if is_review else self._refused(station)))
        if (self.banner.text(), self.banner.property("tone")) != (text, tone):
            self.banner.setText(text)
            self.banner.setProperty("tone", tone)
            self.banner.style().polish(self.banner)
        self.banner.setVisible(not is_review or tone == "bad")


def _enable_alike(actions: Mapping[QPushButton, QAction]) -> None:
    for button, action in actions.items():
        action.setEnabled(button.isEnabled())


def _dated(writing: WriteProgress) -> tuple[str, str]:
    """Return what came of the latest write: in green as news, then with the time of day."""
    for_s = time.monotonic() - writing.said_s
    if for_s < NEWS_S:
        return writing.text, "good"
    return f"{time_of_day(time.time() - for_s)}  {writing.text}", "plain"


def _acts(station: Station) -> str:
    """Return what is written to acts on, where somebody may stand in it."""
    if not station.is_live:
        return NOT_KNOWN
    if any_enabled(station.robot):
        return ACTS
    robot = station.robot
    are_known = all(robot.word(f"{joint}.state") is not None for joint in robot.names("joint"))
    return "" if are_known else NOT_KNOWN


def _close_file(station: Station) -> None:
    station.file = None


def _banner(station: Station | None, staged: int, problem: str) -> tuple[str, str]:
    """Return the most important message, and its style."""
    if station is None:
        return "No robot chosen: there is nothing to change.", "plain"
    if problem:
        return problem, "bad"
    writing = station.writing
    if writing.state in (WriteState.FAILED, WriteState.NOT_STORED, WriteState.UNKNOWN):
        return f"{writing.state.value}: {writing.text}", "bad"
    if writing.state is WriteState.WRITING:
        return writing.text, "warn"
    run = station.experiment
    if run is not None and not run.is_over:
        what = f"{run.plan.kind.value} of {run.plan.name}"
        return f"{what[0].upper()}{what[1:]} goes on, and writes by itself: a write of yours ends it.", "warn"
    if staged:
        return f"{staged} staged · nothing has been sent to the robot", "warn"
    if not station.known:
        return "This robot lets no parameter be changed, or has not said which yet.", "plain"
    if writing.text:
        return _dated(writing)
    return "Double-click a value in the column New to change it.", "plain"
