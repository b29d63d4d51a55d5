"""The tab of the store: how it is reached, what waits for it, what is in it, and work on it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QBoxLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QMenu,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from gateway.amounts import counted, size
from ml.store.sessions import Session
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.actions import check, download, upload
from server_gui.core.cloud.credentials import endpoint_told, keys_told
from server_gui.core.cloud.store_reach import AGAIN, Reach
from server_gui.core.desk.recording import Recording
from server_gui.core.recording.uploader import UploaderState
from server_gui.core.settings.server_file import default_file
from server_gui.views.cloud.browser import Browser
from server_gui.views.cloud.jobs_table import JobsTable, under_way
from server_gui.views.cloud.settings_form import SettingsForm
from server_gui.views.marks import Mark
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.elided import PathLabel
from server_gui.views.widgets.files import ask_folder
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import PlainLabel, set_tip

SLOW: Final = 6  # frames between two looks
NARROW: Final = 480  # at text of 100 %: what is narrower has no room for two cards beside each other
UPLOAD_NOW: Final = "Upload now"
HOLDS_HINT: Final = "Everything that lies in the store: the tables with their logs, and the models"
UPLOAD_HINT: Final = "Everything recorded so far, without waiting for a full batch"
TRY: Final = "Try again now"
TRY_HINT: Final = "Look for the store at once, and upload what waits if it is there"
LOOK_HINT: Final = "Read again what the store holds; nothing is uploaded"
UPLOAD: Final = "Upload what waits"
NO_STORE: Final = (
    "Nothing has been uploaded yet. What is recorded comes here by itself, a batch at a time; "
    "Upload now brings it at once."
)
NOT_READ: Final = "Its contents are unknown while it cannot be read."
REACHES: Final = {
    Reach.NOT_LOOKED: Mark("ring", "dim", "looking"),
    Reach.REACHED: Mark("disc", "good", "reached"),
    Reach.EMPTY: Mark("ring", "dim", "empty"),
    Reach.AWAY: Mark("triangle", "warn", "away"),
    Reach.UNREADABLE: Mark("triangle", "warn", "damaged"),
    Reach.FAILING: Mark("triangle", "warn", "an upload failed"),
    Reach.OLD: Mark("ring", "old", "not known"),
}
NO_JOBS: Final = "Uploads, verifications and downloads that you begin here show how far they are."


class Cloud(QWidget):
    """Everything that takes long is done in threads; a store that is away says so and is tried again."""

    def __init__(self, archive: Archive, recording: Recording, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self._theme = theme
        self._recording = recording
        self._frame = 0
        self.setObjectName("page")
        self.browser = Browser(archive.library, archive.deliver, theme)
        self.jobs = JobsTable(archive.jobs, theme)
        self._cards = {name: Card(name) for name in ("Store", "Waiting for upload", "In the store", "Jobs")}
        self._facts = {name: _value() for name in ("URL", "Service", "Keys", "Holds")}
        set_tip(self._facts["Holds"], HOLDS_HINT)
        self._icon, self.state = MarkIcon(theme), PlainLabel()
        self.state.setWordWrap(True)
        self.settings = SettingsForm(archive.settings, archive.file or default_file())
        self.settings.hide()
        self._cards["Store"].body.addLayout(self._store())
        self.waiting = PlainLabel()
        self.waiting.setWordWrap(True)
        self.waiting.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.upload = QPushButton(UPLOAD_NOW)
        self.upload.setObjectName("primary")
        self.upload.clicked.connect(self._upload)
        self.spool = PathLabel("dim")
        self._cards["Waiting for upload"].body.addWidget(self.waiting, 1)
        self._cards["Waiting for upload"].body.addWidget(self.spool)
        self._cards["Waiting for upload"].body.addWidget(self.upload)
        self.hint = PlainLabel(NO_STORE)
        self.hint.setObjectName("dim")
        self.hint.setWordWrap(True)
        self._cards["In the store"].body.addWidget(self.hint)
        self._cards["In the store"].body.addWidget(self.browser, 1)
        self._cards["In the store"].body.addLayout(self._actions())
        self.no_jobs = PlainLabel(NO_JOBS)
        self.no_jobs.setObjectName("dim")
        self.no_jobs.setWordWrap(True)
        self._cards["Jobs"].body.addWidget(self.no_jobs)
        self._cards["Jobs"].body.addWidget(self.jobs)
        self._top = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._top.addWidget(self._cards["Store"], 3)
        self._top.addWidget(self._cards["Waiting for upload"], 2)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addLayout(self._top)
        everything.addWidget(self.settings)
        everything.addWidget(self._cards["In the store"], 3)
        everything.addWidget(self._cards["Jobs"], 2)

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._archive.library.look(now=True)
        self._frame = 0
        self.refresh()  # what was so when it was hidden is not shown for a moment

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        is_narrow = self.width() < self._theme.px(NARROW)
        direction = QBoxLayout.Direction
        self._top.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)

    def refresh(self) -> None:
        """Look again where it is time, and show how it is."""
        self._frame += 1
        if self._frame % SLOW != 1:
            return
        self._archive.library.look()
        self._refresh_store()
        self._refresh_waiting()
        self.browser.refresh()
        self.jobs.refresh()
        self.no_jobs.setVisible(not self._archive.jobs.jobs)
        count = under_way(self._archive.jobs.jobs)
        self._cards["Jobs"].set_note(f"{count} under way" if count else "none under way")

    # --- how it is put together

    def _store(self) -> QGridLayout:
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        row, said = QHBoxLayout(), QHBoxLayout()
        said.addWidget(self._icon)
        said.addWidget(self.state, 1)
        row.addStretch(1)
        again = QPushButton("Look again")
        set_tip(again, LOOK_HINT)
        again.clicked.connect(lambda: self._archive.library.look(now=True))
        row.addWidget(again)
        self.edit = QPushButton("Settings")
        self.edit.setCheckable(True)
        self.edit.setVisible(self._archive.file is not None)
        self.edit.setToolTip("Change them in the server's file")
        self.edit.toggled.connect(self.settings.setVisible)
        row.addWidget(self.edit)
        grid.addLayout(row, 0, 0, 1, 2)
        grid.addLayout(said, 1, 0, 1, 2)  # all of the width: a reason is long
        for place, (name, value) in enumerate(self._facts.items(), 2):
            title = PlainLabel(name)
            title.setObjectName("dim")
            grid.addWidget(title, place, 0)
            grid.addWidget(value, place, 1)
        url = self._archive.settings.store.url
        told = {"URL": url, "Service": endpoint_told(url), "Keys": keys_told(url)}
        for name, text in told.items():
            self._facts[name].setText(text)
        return grid

    def _actions(self) -> QHBoxLayout:
        self.verify, self.download = QPushButton("Verify"), QPushButton("Download")
        menu = QMenu(self.verify)
        menu.addAction("Every file is there and whole").triggered.connect(lambda: self._verify(deep=False))
        menu.addAction("Every value can be read").triggered.connect(lambda: self._verify(deep=True))
        self.verify.setMenu(menu)
        menu = QMenu(self.download)
        menu.addAction("The whole store …").triggered.connect(lambda: self._ask(()))
        menu.addAction("The chosen recording …").triggered.connect(self._ask_chosen)
        self.download.setMenu(menu)
        self.download.setToolTip(
            "Into a folder, which is then a store; an interrupted download continues where it ended"
        )
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(self.verify)
        row.addWidget(self.download)
        return row

    # --- what is shown

    def _refresh_store(self) -> None:
        library = self._archive.library
        found, reach = library.found, library.reach
        self._icon.show_mark(REACHES[reach.state])
        set_text(self.state, reach.said)
        set_text(self._facts["Holds"], self._holds())
        away = library.looked_s is not None and (found.problem or reach.problem) is not None
        set_text(self.hint, NOT_READ if away and not found.usage else NO_STORE)
        self.hint.setVisible(found.is_empty or (away and not found.usage))
        there = bool(found.usage)
        self.verify.setEnabled(there)
        self.download.setEnabled(there)

    def _holds(self) -> str:
        """Return what nobody could look at holds not nothing."""
        library = self._archive.library
        if library.looked_s is None or library.found.problem is not None or library.reach.problem is not None:
            return "not known"
        stored = sum(session.uploaded for session in library.found.sessions)
        return f"{size(library.found.size_bytes)} in all; recordings: {stored}"

    def _refresh_waiting(self) -> None:
        report = self._recording.report
        busy = under_way([job for job in self._archive.jobs.jobs if job.name == UPLOAD])
        self.upload.setEnabled(not busy)
        is_away = self._archive.library.reach.problem is not None
        if self.upload.text() != (does := TRY if is_away else UPLOAD_NOW):
            self.upload.setText(does)
        set_tip(self.upload, TRY_HINT if is_away else UPLOAD_HINT)
        if report is None:
            self.spool.say("spool", str(self._archive.settings.recorder.spool))
            set_text(self.waiting, f"{self._recording.said(None).text}.")
            return
        self.spool.say("spool", str(report.spool))
        uploader = report.uploader
        lines = [
            f"{_waiting(uploader)} · {_uploaded(uploader.uploaded)}",
            f"{size(report.disk_free_bytes)} free on the disk of the spool",
        ]
        if uploader.problem is not None:
            lines.insert(0, f"▲ Not uploaded, {AGAIN}: {uploader.problem}")
        lines += [f"▲ {alarm.text}" for alarm in report.recorder.alarms]
        set_text(self.waiting, "\n".join(lines))

    # --- what people do

    def _upload(self) -> None:
        self._archive.library.knock(now=True)  # a store that was away may be back
        if self._recording.can_ask:
            self._recording.upload()
        else:
            self._archive.jobs.add(UPLOAD, upload(self._archive.settings))

    def _verify(self, *, deep: bool) -> None:
        self._archive.jobs.add(
            "Verify every value" if deep else "Verify", check(self._archive.settings, deep=deep)
        )

    def _ask_chosen(self) -> None:
        session = self._archive.chosen
        if session is not None and session.uploaded:
            self._ask((session,))

    def _ask(self, wanted: Sequence[Session]) -> None:
        ask_folder(self, "Download into a folder", lambda folder: self.download_to(folder, wanted))

    def download_to(self, folder: Path, wanted: Sequence[Session]) -> None:
        """Download the store, or these sessions of it, in the background."""
        what = wanted[0].session if wanted else "the store"
        self._archive.jobs.add(f"Download {what}", download(self._archive.settings.store.url, folder, wanted))


def _waiting(uploader: UploaderState) -> str:
    """Say what is on this computer alone: batches, and the newest rows, which are no batch yet."""
    if not uploader.backlog_bytes:
        return "nothing waits"
    batches = counted(uploader.waiting, "batch", "batches") if uploader.waiting else "less than a batch"
    return f"{size(uploader.backlog_bytes)} not uploaded yet: {batches}"


def _uploaded(batches: int) -> str:
    return "1 batch uploaded" if batches == 1 else f"{batches} batches uploaded"


def _value() -> QLabel:
    label = PlainLabel()
    label.setWordWrap(True)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
    return label
