"""One robot's records, open: its folder, its lock, its journal, and what is to be taken back."""

import logging
from pathlib import Path

from gateway.process.boot import boot_id
from gateway.records.folder import RecordsFolder
from gateway.records.journal import Journal
from gateway.records.undo import UndoFile
from gateway.wire.control import RecordsInfo

log = logging.getLogger(__name__)


class Records:
    """Durable records of the process.

    Where the folder cannot be used, every entry fails and says why: what must be explained is then refused,
    and what must happen all the same, a stop above all, happens.
    """

    def __init__(self, path: Path) -> None:
        self.folder = RecordsFolder(path)
        unusable = None
        try:
            self.folder.open()
        except OSError as error:
            unusable = error.strerror or str(error)
            log.error("%s", unusable)
        self.unusable = unusable
        self.journal = Journal(self.folder.journal, boot_id(), unusable)
        self.undo = UndoFile(self.folder.undo, unusable)

    @property
    def info(self) -> RecordsInfo:
        """As `robot.describe` shows it."""
        return RecordsInfo(str(self.folder.path), self.journal.problem or self.undo.problem)

    def close(self) -> None:
        """Write the appended entries, and release the folder."""
        self.journal.close()
        self.folder.close()
