"""Every recorded session, newest first: what is known of it, what happened in it; to be played."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Final

import msgspec
from PySide6.QtCore import QRect, Qt, Signal
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QSplitter,
    QStyle,
    QVBoxLayout,
    QWidget,
)

from gateway.amounts import size
from gateway.plain_text import plain
from ml.store.sessions import UNREAD, Session
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.store_reach import AGAIN
from server_gui.core.cloud.tape import Tape, as_time
from server_gui.core.desk.flags import Flag, of_events
from server_gui.core.desk.recording import Recording
from server_gui.views.recordings.timeline import SECOND_NS, clock_text
from server_gui.views.theme import Theme
from server_gui.views.widgets import columns
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.elided import WrappingDelegate
from server_gui.views.widgets.plain import PlainLabel, set_tip, tip
from server_gui.views.widgets.rows import SORT_ROLE, Filtered, Index, RowsModel, RowsTable

TITLES: Final = ("Began", "Robot", "Length", "Rows", "Size", "State", "Operator", "Notes")
BEGAN, ROBOT, LENGTH, ROWS, SIZE, STATE, OPERATOR, NOTES = range(len(TITLES))
NUMBERS: Final = frozenset({LENGTH, ROWS, SIZE})
NAMES: Final = {NOTES: 140, ROBOT: 60, OPERATOR: 60, STATE: 60}  # wide at least, at text of 100 %
STAMP: Final = re.compile(r"\d{8}T\d{6}Z")  # begins a session's name
SPARE: Final = (ROWS, SIZE, STATE, OPERATOR, NOTES)  # left out in this order where there is less room
EMPTY: Final = (
    "Nothing is recorded yet. What a robot sends while this window is open is recorded by itself: "
    "add a robot at the left, and its session appears here within seconds."
)
ROW: Final = 21  # high, at text of 100 %
LINES: Final = 6  # of notes, at most
WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
EVENTS_TOLD: Final = 200
REST: Final = "the rest is in the store, which is not reached"
MORE: Final = "the store, which may have more of it, is not reached"
OTHERS: Final = "others may be in the store"
GOES_ON: Final = "goes on"
NOW: Final = "recorded now"
NOT_KNOWN: Final = "not known while the store is not reached"
MARK_TWO: Final = "Mark two recordings: a click on one, a click with Ctrl on the other"
TOGETHER: Final = "Both in the same plots, played together: aligned by a heel strike or their beginnings"
COMPARING: Final = "Differences in the set-up of the later one, and measures of the walk that moved with it"


class SessionModel(RowsModel[Session]):
    """A row a session."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(TITLES, lambda session: (session.robot, session.session), NUMBERS | {0})
        self._theme = theme
        self.recorded: frozenset[str] = frozenset()  # the sessions that are recorded now
        self._words: dict[str, Session] = {}  # by session, where the store that has these is not reached

    def show_words(self, words: dict[str, Session]) -> None:
        """Show of these what people said of them, which the store would tell."""
        if words != self._words:
            self._words = words
            self._change_all()

    def show_recorded(self, recorded: frozenset[str]) -> None:
        """Show that these are recorded now."""
        if recorded != self.recorded:
            self.recorded = recorded
            self._change_all()

    def _change_all(self) -> None:
        last = self.index(max(self.rowCount() - 1, 0), len(TITLES) - 1)
        self.dataChanged.emit(self.index(0, 0), last)

    def _with_words(self, session: Session) -> Session:
        said = self._words.get(session.session)
        if said is None:
            return session
        return msgspec.structs.replace(session, operator=said.operator, notes=said.notes)

    def data(self, index: Index, role: int = 0) -> Any:
        session, column = self._with_words(self.rows[index.row()]), index.column()
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return plain(_cells(session, is_now=session.session in self.recorded)[column])
            case _ if role == SORT_ROLE:
                return _keys(session)[column]
            case Qt.ItemDataRole.ToolTipRole:
                return tip("\n".join(filter(None, (session.session, _notes(session)))))
            case Qt.ItemDataRole.TextAlignmentRole if column in NUMBERS:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case Qt.ItemDataRole.FontRole if column in NUMBERS:
                return self._theme.number_font()
        return None


class SessionsTable(RowsTable):
    """Table of sessions, with notes in lines; columns without room are shown for the chosen one beside it."""

    def __init__(self, model: Filtered, theme: Theme) -> None:
        super().__init__(model, "Recordings", BEGAN)
        self._theme = theme
        self._lines = WrappingDelegate(NOTES)
        self.setItemDelegate(self._lines)
        columns.prepare(self)
        for changed in (model.dataChanged, model.rowsInserted, model.rowsRemoved, model.layoutChanged):
            changed.connect(self.fit)
        theme.changed.connect(self.fit)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self.fit()

    def fit(self) -> None:
        """Share what room there is."""
        columns.fit(self, {column: self._theme.px(least) for column, least in NAMES.items()}, SPARE)
        for row in range(self.model().rowCount()):
            if self.rowHeight(row) != (high := self._high(row)):
                self.setRowHeight(row, high)

    def _high(self, row: int) -> int:
        """Return the height of a row with its notes, which are whole if they are not too long."""
        notes, one = str(self.model().index(row, NOTES).data() or ""), self._theme.px(ROW)
        if not notes or self.isColumnHidden(NOTES):
            return one
        margin = self.style().pixelMetric(QStyle.PixelMetric.PM_FocusFrameHMargin) + 1
        box = QRect(0, 0, max(self.columnWidth(NOTES) - 2 * margin, 1), 100_000)
        needed = self.fontMetrics().boundingRect(box, WRAPPED, notes).height()
        return max(one, min(needed, LINES * self.fontMetrics().lineSpacing()) + self._theme.px(4))


class SessionsPage(QWidget):
    """`played` when the chosen session is to be played; of two that are marked, `beside` each other.

    `compared` when these are compared.
    """

    played = Signal()
    beside = Signal()
    compared = Signal()

    def __init__(self, archive: Archive, recording: Recording, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self._recording = recording
        self._theme = theme
        self._revision = -1
        self._told: object = None
        self.sessions = SessionModel(theme)
        self.table = self._table()
        self.words = QLineEdit()
        self.words.setPlaceholderText("Filter recordings: robot, operator, notes, day")
        self.words.setAccessibleName("Filter of the recordings")
        self.words.setClearButtonEnabled(True)
        self.words.textChanged.connect(self._filter.setFilterFixedString)
        self.said = PlainLabel()
        self.said.setWordWrap(True)
        self.said.setObjectName("dim")
        self.play = QPushButton("Play")
        self.play.setObjectName("primary")
        self.play.clicked.connect(self.played)
        self.compare = QPushButton("What changed?")
        self.compare.clicked.connect(self._compare)
        self.together = QPushButton("Side by side")
        self.together.clicked.connect(self.beside)
        self.details = QPlainTextEdit(readOnly=True)
        self.details.setAccessibleName("Facts of the selected recording")
        self._card = Card("Recording")
        self._card.body.addWidget(self.details, 1)
        self._card.body.addWidget(self.play)
        self._list = Card("Recordings")
        self._list.body.addWidget(self.words)
        self._list.body.addWidget(self.said)
        self._list.body.addWidget(self.table, 1)
        of_two = QHBoxLayout()
        of_two.addWidget(self.compare)
        of_two.addWidget(self.together)
        self._list.body.addLayout(of_two)
        split = QSplitter()
        split.addWidget(self._list)
        split.addWidget(self._card)
        split.setStretchFactor(0, 3)
        split.setStretchFactor(1, 2)
        split.setSizes([600, 400])
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(self._mark_row())
        everything.addWidget(split, 1)
        theme.changed.connect(self._restyle)
        self._restyle()

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.refresh()  # what was so when it was hidden is not shown for a moment

    def refresh(self) -> None:
        """Look again where it is time, and show what there is."""
        library = self._archive.library
        library.look()
        if library.revision != self._revision:
            self._revision = library.revision
            self.sessions.take(library.found.sessions)
        self._show_recorded()
        set_text(self.said, self._state())
        self.said.setVisible(bool(self.said.text()))
        count = len(library.found.sessions)
        counted = "1 session" if count == 1 else f"{count} sessions"
        is_whole = library.reach.problem is None and library.reach.list_problem is None
        wordings = (counted,) if is_whole else (f"{counted} known; {OTHERS}", f"{counted} known")
        self._list.set_note(*(wordings if library.revision else ("looking …",)))
        self.mark.setEnabled(self._recording.can_ask)
        self._refresh_compare()
        self._refresh_details()

    def _show_recorded(self) -> None:
        """Show which are recorded now, as whoever records says."""
        report = self._recording.report
        links = {} if report is None or report.is_paused else report.robots
        self.sessions.show_recorded(frozenset(link.session for link in links.values() if link.session))
        unread = (one for one in self.sessions.rows if one.notes == UNREAD)
        self.sessions.show_words({one.session: said for one in unread if (said := self._words(one))})

    @property
    def chosen(self) -> Session | None:
        """The session that is chosen in the table."""
        marked = self.marked
        return marked[0] if marked else None

    @property
    def marked(self) -> list[Session]:
        """The sessions that are marked in the table, in the order in which that was done."""
        rows = self.table.selectionModel().selectedRows()
        return [self.sessions.rows[self._filter.mapToSource(row).row()] for row in rows]

    def _refresh_compare(self) -> None:
        marked = self.marked
        self.compare.setEnabled(len(marked) == 2)
        set_tip(self.compare, COMPARING if len(marked) == 2 else MARK_TWO)
        self.together.setEnabled(len(marked) == 2 and self._archive.tape is not None)
        set_tip(self.together, TOGETHER if len(marked) == 2 else MARK_TWO)

    def _compare(self) -> None:
        marked = self.marked
        if len(marked) == 2:
            self._archive.compared.open(*marked)
            self.compared.emit()

    def _state(self) -> str:
        library = self._archive.library
        if library.reach.problem is not None:
            return f"The store is not reached, {AGAIN}: {library.reach.problem}"
        if library.reach.list_problem is not None:
            return f"The store's list cannot be read, {AGAIN}: {library.reach.list_problem}"
        return EMPTY if library.revision and not library.found.sessions else ""

    def _refresh_details(self) -> None:
        archive, session = self._archive, self.chosen
        self.play.setEnabled(archive.tape is not None)
        is_now = session is not None and session.session in self.sessions.recorded
        known = (session, archive.tape, archive.problem, archive.shown_units, is_now)
        if known != self._told:
            self._told = known
            held = [] if session is None else archive.held_then(session)
            words = None if session is None else self._words(session)
            told = facts_text(session, archive.tape, archive.problem, held, is_now=is_now, words=words)
            self.details.setPlainText(told)

    def _words(self, session: Session) -> Session | None:
        """Return what people said of it, as whoever records it knows, or as the store had it before."""
        report, known = self._recording.report, self._archive.library.known_before(session)
        links = () if report is None else report.robots.values()
        link = next((one for one in links if one.session == session.session), None)
        if link is None:
            return known
        return msgspec.structs.replace(known or session, notes=link.notes, wearer=link.wearer)

    # --- how it is put together

    def _table(self) -> SessionsTable:
        self._filter = Filtered(self.sessions)
        table = SessionsTable(self._filter, self._theme)
        table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        table.selectionModel().selectionChanged.connect(lambda *_: self._archive.choose(self.chosen))
        table.activated.connect(lambda _: self.play.click())
        return table

    def _mark_row(self) -> QHBoxLayout:
        self.mark = QLineEdit()
        self.mark.setPlaceholderText("Mark this instant in every robot's recording: what happens?")
        self.mark.setAccessibleName("Text of a mark at this instant")
        self.mark.returnPressed.connect(self._mark)
        button = QPushButton("Mark now")
        button.clicked.connect(self._mark)
        row = QHBoxLayout()
        row.addWidget(self.mark, 1)
        row.addWidget(button)
        return row

    def _mark(self) -> None:
        text = self.mark.text().strip()
        if text:
            self._recording.mark(text)
            self.mark.clear()

    def _restyle(self) -> None:
        self.table.verticalHeader().setDefaultSectionSize(self._theme.px(ROW))
        self.table.fit()
        self.details.setMinimumWidth(self._theme.px(120))


def _cells(session: Session, *, is_now: bool = False) -> tuple[str, ...]:
    length = clock_text(session.length.total_seconds()) if session.rows else "–"
    return (
        _when(_began(session)),
        session.robot,
        GOES_ON if is_now else length,
        f"{session.rows:,}" if session.rows else "–",
        size(session.size_bytes) if session.rows else "–",
        NOW if is_now else _state(session),
        session.operator,
        _notes(session),
    )


def _notes(session: Session) -> str:
    """Return what people noted; that the store is not reached is said elsewhere."""
    return "" if session.notes == UNREAD else session.notes


def _began(session: Session) -> datetime | None:
    """Return when it began; of one that is in a store out of reach, by its name."""
    known = session.began or session.first
    stamp = session.session.partition("-")[0]
    if known is not None or not STAMP.fullmatch(stamp):
        return known
    try:
        return datetime.strptime(stamp, "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
    except ValueError:
        return None


def _keys(session: Session) -> tuple[Any, ...]:
    began = _began(session)
    cells = _cells(session)
    numbers = (session.length.total_seconds(), session.rows, session.size_bytes)
    return (0.0 if began is None else began.timestamp(), cells[1], *numbers, *cells[5:])


def _state(session: Session) -> str:
    if not session.uploaded:
        return "waits for upload"
    return "goes on" if session.ended is None else "stored"


def _when(time: datetime | None) -> str:
    return "–" if time is None else f"{time.astimezone():%Y-%m-%d %H:%M:%S}"


def facts_text(
    session: Session | None,
    tape: Tape | None,
    problem: str,
    held: Sequence[str],
    *,
    is_now: bool = False,
    words: Session | None = None,
) -> str:
    """Return the facts of a session as text; `is_now`: it is recorded now.

    `words` has what people said of it, where the store that has that is not reached.
    """
    if session is None:
        return "Choose a recording to see what is in it; with Ctrl a second one, to compare the two."
    away = session.notes == UNREAD or (tape is not None and tape.is_partial)
    told = words if words is not None and session.notes == UNREAD else session
    known = {
        "Session": session.session,
        "Robot": session.robot,
        "Began": NOT_KNOWN if away and _began(session) is None else _when(_began(session)),
        "Ended": _ended(session, is_now=is_now),
        "Length": _length(session, away=away, is_now=is_now),
        "State": "" if is_now else _state(session),
        "Operator": told.operator,
        "Wearer": told.wearer,
        "Notes": told.notes if words is not None or session.notes != UNREAD else NOT_KNOWN,
        "Here": _here(session, tape, away=away),
        "Software": ", ".join(f"{name} {version}" for name, version in session.versions.items()),
    }
    lines = [f"{name}: {value}" for name, value in known.items() if value]
    if problem:
        lines += ["", f"It cannot be played: {problem}"]
    elif tape is None:
        lines += ["", "looking into it …"]
    else:
        lines += ["", *_inside(tape, is_partial=away, is_now=is_now)]
    return "\n".join([*lines, *(["", "Parameters when it began:", *held] if held else [])])


def _ended(session: Session, *, is_now: bool) -> str:
    if session.ended is not None:
        return _when(session.ended)
    return "not yet: it is recorded now" if is_now else "not known: its server was killed, or goes on"


def _length(session: Session, *, away: bool, is_now: bool) -> str:
    """Return how long it is; of one that is recorded now the header says it, and here is what is kept."""
    if is_now and not session.rows:
        return f"it {GOES_ON}"
    if away and not session.rows:
        return NOT_KNOWN
    length, rows, size_ = (_cells(session)[column] for column in (LENGTH, ROWS, SIZE))
    return f"it {GOES_ON}; kept so far: {rows} rows, {size_}" if is_now else f"{length}, {rows} rows, {size_}"


def _here(session: Session, tape: Tape | None, *, away: bool) -> str:
    """Return what of it is on this computer alone, by its times; "" where all of it can be read."""
    if not away:
        return ""
    rest = REST if session.notes == UNREAD else MORE
    if tape is None:
        return rest
    first, last = (_when(as_time(at_ns)) for at_ns in (tape.first_ns, tape.last_ns))
    day, _, time = last.partition(" ")
    return (
        f"only {first[-8:]} to {time if first.startswith(day) else last} of it are on this computer; {rest}"
    )


def _inside(tape: Tape, *, is_partial: bool, is_now: bool) -> list[str]:
    length = clock_text((tape.last_ns - tape.first_ns) / SECOND_NS, 1)
    head = f"{length}, {len(tape.units)} channels"
    if is_partial:
        head = f"{length} of it can be played, {len(tape.units)} channels"
    elif is_now:
        head = f"Its first {length} can be played by now, {len(tape.units)} channels"
    if not tape.events:
        return [head] if is_partial else [head, "It has no gaps and no marks."]
    return [head, "", *(_event(tape, flag) for flag in of_events(tape.events[:EVENTS_TOLD]))]


def _event(tape: Tape, flag: Flag) -> str:
    """Return what happened when, in the words of the time axis."""
    at = clock_text(max(flag.at_ns - tape.first_ns, 0) / SECOND_NS, 1)
    return f"{at}  {flag.kind.value}: {flag.text}"
