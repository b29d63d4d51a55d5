"""Audit: who changed what on which robot, when, old, new, read back; and whether the record holds."""

import csv
import datetime
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.archive.collected_journals import JournalsFound, KeptJournals
from server_gui.core.archive.histories import History, histories
from server_gui.core.desk.desk import Desk
from server_gui.core.follow.news import NewsKind
from server_gui.core.tuning.edits import unit_of
from server_gui.views.audit.acts_model import ROBOT, TIME, ActRow, ActsModel
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.rows import Filtered, Index, RowsTable
from server_gui.views.widgets.wrapping_label import WrappingLabel

EVERY_ROBOT, EVERYBODY = "All robots", "Everybody"
WIDEST: Final = 300  # of a column, at text of 100 %: its tip has the rest
MOST: Final = 4  # robots of which everything is said at once
AWAY: Final = "Earlier collected entries cannot be read now; retrying"
NONE: Final = (
    "Nothing was done to a robot yet, as far as its journal has come. Each change is a row here: who, when, "
    "old → new, what the robot read back, and how it ended; likewise each STOP, reset, trial and store to "
    "flash, from this window, a command or the robot itself.\n\n"
    "To make the first: change a value under Parameters, and try it."
)
NONE_CHOSEN: Final = "No entry matches robot, person and words: remove a filter."
CSV_TITLES: Final = (
    "utc",
    "robot",
    "entry",
    "who",
    "what",
    "thing",
    "old",
    "new",
    "read_back",
    "unit",
    "told_by",
    "outcome",
)


class Chosen(Filtered):
    """The lines of one robot and one person that have all words; none of them means any."""

    def __init__(self, model: ActsModel) -> None:
        super().__init__(model)
        self._wanted: tuple[str, str, list[str]] = ("", "", [])

    def show(self, robot: str, who: str, words: str) -> None:
        wanted = robot, who, words.lower().split()
        if wanted != self._wanted:
            self._wanted = wanted
            self.invalidate()

    def filterAcceptsRow(self, row: int, parent: Index) -> bool:
        model = self.sourceModel()
        robot, who, words = self._wanted
        if not isinstance(model, ActsModel):
            return False
        line = model.rows[row]
        if (robot and line.robot != robot) or (who and line.act.who != who):
            return False
        text = f"{line.act.thing} {line.act.what} {line.act.who} {line.act.outcome}".lower()
        return all(word in text for word in words)


class Audit(QWidget):
    """Every robot's journal as far as it has been read, newest first; with what is `kept` of it, if given."""

    def __init__(self, desk: Desk, theme: Theme, kept: KeptJournals | None = None) -> None:
        super().__init__()
        self._desk = desk
        self._kept = kept
        self._seen: tuple[object, ...] = ()
        self._called: dict[str, History] = {}
        self.setObjectName("page")
        self.model = ActsModel(theme)
        self.chosen = Chosen(self.model)
        self.robot, self.who = _combo("Robot", EVERY_ROBOT), _combo("Who", EVERYBODY)
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter: parameter, what, outcome …")
        self.words.setClearButtonEnabled(True)
        self.words.setAccessibleName("Filter of the audit")
        self.words.textChanged.connect(self._filter)
        for combo in (self.robot, self.who):
            combo.currentIndexChanged.connect(self._filter)
        export = QPushButton("CSV …")
        export.setToolTip("The visible entries, in SI units with every digit")
        export.clicked.connect(lambda: ask_save(self, "Export as CSV", "csv", self._export, "audit"))
        self._theme = theme
        self.table = self._table()
        theme.scaled.connect(self._restyle)
        self._restyle()
        self.empty = WrappingLabel("dim")
        self.empty.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignVCenter)
        self.empty.hide()
        self.verdict = PlainLabel()
        self.verdict.setObjectName("banner")
        self.verdict.setWordWrap(True)
        row = QHBoxLayout()
        for widget in (self.robot, self.who):
            row.addWidget(widget)
        row.addWidget(self.words, 1)
        row.addWidget(export)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(row)
        everything.addWidget(self.table, 1)
        everything.addWidget(self.empty, 1)
        everything.addWidget(self.verdict)

    def refresh(self) -> None:
        """Show what has come."""
        if self._kept is not None:
            self._kept.look()
        kept = JournalsFound() if self._kept is None else self._kept.found
        known = self._called
        self._called = {
            name: known[name] if known.get(name) == history else history
            for name, history in histories(self._desk, kept).items()
        }
        seen = (kept.problem, self._desk.shown.revision, *self._called.items())
        if seen == self._seen:
            return
        self._seen = seen
        self.model.take(
            [line for name, history in self._called.items() for line in self._lines(name, history)]
        )
        self.table.setColumnHidden(ROBOT, len(self._called) < 2)
        policy, has_rows = Qt.ScrollBarPolicy, bool(self.model.rows)
        self.table.horizontalHeader().setVisible(has_rows)  # titles alone say nothing, and are cut
        self.table.setHorizontalScrollBarPolicy(
            policy.ScrollBarAsNeeded if has_rows else policy.ScrollBarAlwaysOff
        )
        _offer(self.robot, list(self._called))
        _offer(self.who, sorted({line.act.who for line in self.model.rows}))
        self._filter()

    def save_csv(self, path: Path) -> None:
        """Save what is shown, in its order."""
        places = (self.chosen.mapToSource(self.chosen.index(row, 0)) for row in range(self.chosen.rowCount()))
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(CSV_TITLES)
            writer.writerows(_cells(self.model.rows[place.row()]) for place in places)

    def _export(self, path: Path) -> None:
        self._desk.news.add(NewsKind.STATE, "audit", save_whole(self.save_csv, path))

    def _lines(self, name: str, history: History) -> Iterator[ActRow]:
        units = self._desk.shown.units
        parameters = [] if history.description is None else history.description.parameters
        si_of = {info.name: info.unit for info in parameters}
        for act, told_by in history.acts:
            yield ActRow(name, act, unit_of(act.thing, si_of.get(act.thing, ""), units), told_by)

    def _filter(self) -> None:
        robot = "" if self.robot.currentIndex() <= 0 else self.robot.currentText()
        who = "" if self.who.currentIndex() <= 0 else self.who.currentText()
        self.chosen.show(robot, who, self.words.text())
        has_rows = bool(self.chosen.rowCount())
        set_text(self.empty, NONE_CHOSEN if self.model.rows else NONE)
        self.table.setVisible(has_rows)
        self.empty.setVisible(not has_rows)
        asked = {name: history for name, history in self._called.items() if robot in ("", name)}
        told = {name: one for name, one in asked.items() if len(asked) <= MOST or one.is_altered}
        said = [f"{name}: {one.verdict}" for name, one in told.items()]
        said += [f"{len(asked) - len(told)} robots: nothing altered; choose one for more"][
            : len(asked) - len(told)
        ]
        problem = None if self._kept is None else self._kept.found.problem
        said += [] if problem is None else [f"{AWAY}: {problem}"]
        set_text(self.verdict, "\n".join(said))
        broken = any(one.is_altered for one in asked.values())
        known = bool(asked) and all(one.is_known for one in asked.values())
        self.verdict.setProperty("tone", "bad" if broken else "good" if known else "plain")
        self.verdict.style().polish(self.verdict)

    def _restyle(self) -> None:
        self.table.verticalHeader().setDefaultSectionSize(self._theme.px(20))
        self.table.horizontalHeader().setMaximumSectionSize(self._theme.px(WIDEST))

    def _table(self) -> RowsTable:
        table = RowsTable(self.chosen, "What was done to the robots", TIME)
        header = table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setStretchLastSection(True)
        return table


def _combo(name: str, all_of_them: str) -> QComboBox:
    combo = QComboBox()
    combo.setAccessibleName(name)
    combo.addItem(all_of_them)
    combo.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
    return combo


def _offer(combo: QComboBox, texts: list[str]) -> None:
    """Offer these behind the first, which is all of them; what is chosen stays."""
    if texts == [combo.itemText(place) for place in range(1, combo.count())]:
        return
    chosen = combo.currentText()
    combo.blockSignals(True)
    while combo.count() > 1:
        combo.removeItem(1)
    combo.addItems(texts)
    combo.setCurrentIndex(max(0, combo.findText(chosen)))
    combo.blockSignals(False)


def _cells(line: ActRow) -> tuple[object, ...]:
    act = line.act
    when = datetime.datetime.fromtimestamp(act.utc_ns / 1e9, datetime.UTC).isoformat(timespec="milliseconds")
    values = ("" if value is None else value for value in (act.old, act.new, act.read_back))
    return (
        when,
        line.robot,
        act.n,
        act.who,
        act.what,
        act.thing,
        *values,
        line.unit.si,
        line.told_by,
        act.outcome,
    )
