"""The folder of one robot's records, locked for one gateway."""

import fcntl
import os
import re
from pathlib import Path
from typing import IO


class RecordsFolder:
    """A folder with its lock; the lock ends with the process, however that ends."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock: IO[bytes] | None = None

    @property
    def journal(self) -> Path:
        return self.path / "journal.jsonl"

    @property
    def undo(self) -> Path:
        return self.path / "undo.json"

    @property
    def hold(self) -> Path:
        return self.path / "stop.json"

    @property
    def joint_test(self) -> Path:
        """File of a joint test's changes to its drive."""
        return self.path / "joint-test.json"

    @property
    def unfinished(self) -> bool:
        """Whether a stop is held or a write is still to be taken back, as the last gateway left it.

        Where that cannot be seen, it is to be taken for so.
        """
        try:
            return self.hold.exists() or self.undo.exists()
        except PermissionError:
            return True

    def open(self) -> None:
        """Make the folder and take its lock.

        Raises:
            OSError: it cannot be used, or another gateway uses it; the message says what to do.

        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            lock = (self.path / "lock").open("ab")
        except OSError as error:
            reason = error.strerror or str(error)
            raise OSError(
                error.errno,
                f"the records folder {self.path} cannot be used: {reason}; "
                'give another one with records = "…" in [gateway] of the robot\'s file',
            ) from error
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            lock.close()
            raise OSError(
                error.errno,
                f"another gateway keeps its records in {self.path}; end it first, or give this robot "
                'another folder with records = "…" in [gateway]',
            ) from error
        self._lock = lock

    def close(self) -> None:
        """Let go of the lock. Idempotent."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def default_folder(robot: str) -> Path:
    """Return the folder below systemd's state directory, else below the user's own state (XDG)."""
    name = re.sub(r"[^A-Za-z0-9_.-]", "_", robot).strip(".") or "robot"
    given = os.environ.get("STATE_DIRECTORY")
    if given:
        return Path(given.partition(":")[0]) / name
    state = os.environ.get("XDG_STATE_HOME")
    return (Path(state) if state else Path.home() / ".local" / "state") / "gwrms" / name
