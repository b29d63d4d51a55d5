"""The store's settings in the server's file: checked before they are saved, in force from the next start."""

from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QGridLayout, QLineEdit, QPushButton, QWidget

from server_gui.core.settings.file_edits import Value, change
from server_gui.core.settings.server_file import ServerSettings, SettingsError, Upload
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel

POLICIES: Final = {
    Upload.ALWAYS: "always, a batch at a time",
    Upload.IDLE: "while no robot sends",
    Upload.MANUAL: "when somebody asks",
}
URL, UPLOAD = ("store", "url"), ("recorder", "upload")
BATCH, COMPACT = ("recorder", "batch_s"), ("store", "compact_h")
WHEN: Final = "takes effect when the window or the collector restarts"
NO_KEYS: Final = "keys are never written: they come from the AWS environment or profile"


class SettingsForm(Card):
    """Form of this file. Unedited values are not written."""

    def __init__(self, settings: ServerSettings, file: Path) -> None:
        super().__init__("Store settings")
        self._file = file
        store, recorder = settings.store, settings.recorder
        self.url, self.upload = QLineEdit(store.url), QComboBox()
        self.batch, self.compact = QLineEdit(f"{recorder.batch_s:g}"), QLineEdit(f"{store.compact_h:g}")
        for policy, text in POLICIES.items():
            self.upload.addItem(text, policy.value)
        self.upload.setCurrentIndex(list(POLICIES).index(recorder.upload))
        self.said, self.save = PlainLabel(), QPushButton("Check and save")
        self.said.setWordWrap(True)
        self.save.setObjectName("primary")
        self.save.clicked.connect(self._save)
        self._known = self._texts()
        self._build()
        for field in (self.url, self.batch, self.compact):
            field.textChanged.connect(self._edited)
        self.upload.currentIndexChanged.connect(self._edited)
        self._edited()

    def _build(self) -> None:
        rows: dict[str, QWidget] = {
            "URL": self.url,
            "Uploads": self.upload,
            "A batch, s": self.batch,
            "Compact every, h": self.compact,
        }
        self.url.setPlaceholderText("file:///folder or s3://bucket/prefix")
        self.compact.setToolTip("How often small files are merged; 0: not by this computer")
        grid = QGridLayout()
        grid.setColumnStretch(1, 1)
        for place, (name, field) in enumerate(rows.items()):
            title = PlainLabel(name)
            title.setObjectName("dim")
            field.setAccessibleName(f"Store settings: {name}")
            grid.addWidget(title, place, 0)
            grid.addWidget(field, place, 1)
        grid.addWidget(self.said, len(rows), 0, 1, 2)
        grid.addWidget(self.save, len(rows) + 1, 1, Qt.AlignmentFlag.AlignRight)
        self.body.addLayout(grid)

    def _texts(self) -> dict[tuple[str, str], str]:
        return {
            URL: self.url.text().strip(),
            UPLOAD: str(self.upload.currentData()),
            BATCH: self.batch.text().strip(),
            COMPACT: self.compact.text().strip(),
        }

    def _changes(self) -> dict[tuple[str, str], str]:
        return {key: text for key, text in self._texts().items() if text != self._known[key]}

    def _edited(self) -> None:
        self.save.setEnabled(bool(self._changes()))
        keys = ", ".join(f"[{table}] {key}" for table, key in self._changes())
        set_text(self.said, f"{keys or 'Nothing'} is to be written into {self._file}; {WHEN}; {NO_KEYS}.")

    def _save(self) -> None:
        texts = self._changes()
        try:
            change(self._file, {key: _value(key, text) for key, text in texts.items()})
        except SettingsError as error:
            set_text(self.said, f"NOT SAVED: {error}")
            return
        self._known |= texts
        self.save.setEnabled(False)
        set_text(self.said, f"Saved in {self._file}; {WHEN}.")


def _value(key: tuple[str, str], text: str) -> Value:
    if key in (URL, UPLOAD):
        return text
    try:
        return float(text.replace(",", "."))
    except ValueError:
        table, name = key
        raise SettingsError(f"[{table}] {name}: {text!r} is not a number") from None
