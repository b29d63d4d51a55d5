"""Asks for a file's name without being modal: nothing stands in the way of STOP; says what came of saving."""

import contextlib
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget

from gateway.plain_text import plain

NO_NAME: Final = r"[^\w.+-]+"  # what no file of any system should be called


def ask_open(
    parent: QWidget, title: str, kinds: Sequence[str], done: Callable[[Path], object]
) -> QFileDialog:
    """Ask for a file that is there, of these kinds (`toml`, `dcf`)."""
    dialog = _dialog(parent, title, kinds, done)
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptOpen)
    dialog.show()
    return dialog


def ask_save(
    parent: QWidget, title: str, kind: str, done: Callable[[Path], object], name: str
) -> QFileDialog:
    """Ask for a file to be written, `name` at first, and whether one may be overwritten."""
    dialog = _dialog(parent, title, (kind,), lambda path: _unless_there(parent, path, done))
    dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
    dialog.setDefaultSuffix(kind)
    dialog.selectFile(f"{re.sub(NO_NAME, '-', name)}.{kind}")
    dialog.show()
    return dialog


def ask_folder(parent: QWidget, title: str, done: Callable[[Path], object]) -> QFileDialog:
    """Ask for a folder, which may be a new one."""
    dialog = _dialog(parent, title, (), done)
    dialog.setFileMode(QFileDialog.FileMode.Directory)
    dialog.setOption(QFileDialog.Option.ReadOnly, on=False)
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
    # What Qt itself would ask, of a file that is there or not, to be deleted or named anew, is modal.
    dialog.setFileMode(QFileDialog.FileMode.AnyFile)
    dialog.setOptions(QFileDialog.Option.DontConfirmOverwrite | QFileDialog.Option.ReadOnly)
    dialog.fileSelected.connect(lambda name: done(Path(name)))
    return dialog


def _unless_there(parent: QWidget, path: Path, done: Callable[[Path], object]) -> None:
    """Write at once, or ask first."""
    if not path.exists():
        done(path)
        return
    said = f"{plain(path.name)} is there already."
    box = QMessageBox(QMessageBox.Icon.Question, "Overwrite?", said, parent=parent)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.addButton("Overwrite", QMessageBox.ButtonRole.AcceptRole)
    box.addButton(QMessageBox.StandardButton.Cancel)
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.setModal(False)
    box.accepted.connect(lambda: done(path))
    box.show()
