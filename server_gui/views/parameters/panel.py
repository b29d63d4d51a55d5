"""The parameters panel: filter, tree, chosen one; review, write or try, undo."""

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QButtonGroup,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.edits import Change, unit_of
from server_gui.core.desk.station import Station
from server_gui.core.desk.writing import WriteState
from server_gui.views.parameters.control_bar import ControlBar
from server_gui.views.parameters.detail import Detail
from server_gui.views.parameters.review import Review
from server_gui.views.parameters.tree import ParameterTree
from server_gui.views.parameters.trial_bar import TrialBar
from server_gui.views.theme import Theme


class ParametersPanel(QWidget):
    """Values and edits of the robot that is looked at."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._problem = ""
        self.setObjectName("dock")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.tree, self.detail, self.review = ParameterTree(desk, theme), Detail(desk), Review(theme)
        self.trial, self.control = TrialBar(desk), ControlBar(desk, theme)
        self.pages = QStackedWidget()
        self.pages.addWidget(self._edit_page())
        self.pages.addWidget(self.review)
        self.banner = QLabel()
        self.banner.setObjectName("banner")
        self.banner.setWordWrap(True)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(self.control)
        everything.addWidget(self.pages, 1)
        everything.addWidget(self.banner)
        everything.addWidget(self.trial)
        everything.addLayout(self._buttons())
        self._connect()

    def refresh(self) -> None:
        """Show how it is now."""
        for part in (self.control, self.tree, self.trial, self.detail):
            part.refresh()
        station = self._desk.selected
        staged = 0 if station is None else len(station.difference(self._desk.shown.units))
        total = 0 if station is None else len(station.known)
        reviewing = self.pages.currentWidget() is self.review
        self.all.setText(f"All {total}")
        self.changed.setText(f"Changed {staged}")
        self._review_button.setText(f"Review {staged} …" if staged else "Review …")
        self._review_button.setEnabled(bool(staged) and not reviewing)
        self._discard.setEnabled(bool(staged))
        self.undo.setEnabled(station is not None and bool(station.writing.undo) and not reviewing)
        self._filter()
        self._refresh_banner(station, staged)
        if reviewing and station is not None:
            self._refresh_review(station)

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
        self.stage(name, value)

    def stage(self, name: str, value: float) -> None:
        """Stage an SI value; nothing is sent."""
        station = self._desk.selected
        if station is not None:
            self._problem = ""
            station.edits.stage(name, value, station.robot.parameters.get(name))
            station.writing.rows.pop(name, None)

    def begin_review(self) -> None:
        """Show exactly what would be written."""
        station = self._desk.selected
        if station is not None:
            self.review.show_changes(station.difference(self._desk.shown.units))
            self.pages.setCurrentWidget(self.review)

    # --- how it is put together

    def _edit_page(self) -> QWidget:
        page = QWidget()
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter: name, 0x6072, unit …   Ctrl+F")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Filter of the parameters")
        self.all, self.changed = QPushButton("All"), QPushButton("Changed")
        kinds = QButtonGroup(self)
        row = QHBoxLayout()
        for button in (self.all, self.changed):
            button.setCheckable(True)
            kinds.addButton(button)
            row.addWidget(button)
        row.addStretch(1)
        self.all.setChecked(True)
        layout = QVBoxLayout(page)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.words)
        layout.addLayout(row)
        layout.addWidget(self.tree, 1)
        layout.addWidget(self.detail)
        return page

    def _buttons(self) -> QGridLayout:
        self.undo, self._discard = QPushButton("Undo …"), QPushButton("Discard edits")
        self.undo.setToolTip("Stages the inverse of the latest write, to be reviewed and written")
        self._review_button = QPushButton("Review …")
        self._review_button.setObjectName("primary")
        grid = QGridLayout()
        grid.addWidget(self.undo, 0, 0)
        grid.addWidget(self._discard, 0, 1)
        grid.addWidget(self._review_button, 0, 2)
        grid.setColumnStretch(2, 1)
        return grid

    def _connect(self) -> None:
        QShortcut(QKeySequence.StandardKey.Find, self, self.words.setFocus)
        self.tree.typed.connect(self.stage_text)
        self.tree.chosen.connect(self.detail.choose)
        self.detail.typed.connect(self.stage_text)
        self.detail.slid.connect(self.stage)
        self.detail.dropped.connect(lambda name: self._with(lambda station: station.edits.drop(name)))
        self.trial.keep.connect(lambda: self._with(Station.keep_trial))
        self.trial.take_back.connect(lambda: self._with(Station.end_trial))
        self.control.take.connect(lambda: self._with(Station.take_control))
        self.control.release.connect(lambda: self._with(Station.release_control))
        self._discard.clicked.connect(lambda: self._with(lambda station: station.edits.drop()))
        self.undo.clicked.connect(self._undo_latest)
        self._review_button.clicked.connect(self.begin_review)
        self.review.back.connect(lambda: self.pages.setCurrentIndex(0))
        self.review.write.connect(self._write)
        self._desk.on_select.append(self._selected)

    # --- what people do

    def _with(self, do: Callable[[Station], None]) -> None:
        if self._desk.selected is not None:
            do(self._desk.selected)

    def _selected(self, _station: Station | None) -> None:
        self._problem = ""
        self.pages.setCurrentIndex(0)

    def _undo_latest(self) -> None:
        self._with(Station.stage_undo)
        self.begin_review()

    def _write(self, changes: tuple[Change, ...], trial_s: float | None) -> None:
        """Write what was shown, unless the robot holds something else by now: then that is shown first."""
        station = self._desk.selected
        if station is None:
            return
        if changes != station.difference(self._desk.shown.units):
            self.begin_review()
            return
        self.pages.setCurrentIndex(0)
        station.write(changes, trial_s)

    # --- what is shown

    def _filter(self) -> None:
        station = self._desk.selected
        names = None if station is None or not self.changed.isChecked() else list(station.edits.staged)
        self.tree.filter.show(self.words.text(), names)

    def _refresh_review(self, station: Station) -> None:
        now = station.difference(self._desk.shown.units)
        if now != self.review.changes:
            self.review.show_changes(now)
        if not now:
            self.pages.setCurrentIndex(0)

    def _refresh_banner(self, station: Station | None, staged: int) -> None:
        text, tone = _banner(station, staged, self._problem)
        if (self.banner.text(), self.banner.property("tone")) != (text, tone):
            self.banner.setText(text)
            self.banner.setProperty("tone", tone)
            self.banner.style().polish(self.banner)


def _banner(station: Station | None, staged: int, problem: str) -> tuple[str, str]:
    """What matters most now, and how it is meant."""
    if station is None:
        return "No robot chosen: there is nothing to change.", "good"
    if problem:
        return problem, "bad"
    writing = station.writing
    if writing.state in (WriteState.FAILED, WriteState.UNKNOWN):
        return f"{writing.state.value}: {writing.text}", "bad"
    if writing.state is WriteState.WRITING:
        return writing.text, "warn"
    if staged:
        return f"{staged} staged · nothing of it has been sent to the robot", "warn"
    if not station.known:
        return "This robot lets no parameter be changed, or has not said which yet.", "good"
    return writing.text or "Double-click a value in the column New to change it.", "good"
