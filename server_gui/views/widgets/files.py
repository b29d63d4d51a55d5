"""Asks for a file's name without being modal: nothing stands in the way of STOP; says what came of saving."""

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QWidget


def ask_open(
    parent: QWidget, title: str, kinds: Sequence[str], done: Callable[[Path], object]
) -> QFileDialog:
    """A file that is there, of these kinds (`toml`, `dcf`)."""
    dialog = _dialog(parent, title, kinds, done)
    dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
    dialog.show()
    return dialog


def ask_save(parent: QWidget, title: str, kind: str, done: Callable[[Path], object]) -> QFileDialog:
    """A file to be written; whether one may be overwritten is asked."""
    dialog = _dialog(parent, title, (kind,), done)
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
    dialog.setDefaultSuffix(kind)
    dialog.show()
    return dialog


def save_whole(save: Callable[[Path], None], path: Path) -> str:
    """Save, and say what came of it; what was there before stays until all is written."""
    part = path.with_name(f"{path.name}.part")
    try:
        save(part)
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        return f"NOT SAVED as {path.name}: {error.strerror or error}"
    return f"saved as {path.name}"


def _dialog(parent: QWidget, title: str, kinds: Sequence[str], done: Callable[[Path], object]) -> QFileDialog:
    patterns = " ".join(f"*.{kind}" for kind in kinds)
    dialog = QFileDialog(parent, title, "", f"{' or '.join(kinds).upper()} ({patterns})")
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setModal(False)
    dialog.fileSelected.connect(lambda name: done(Path(name)))
    return dialog
