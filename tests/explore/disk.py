"""A disk in memory that knows what would outlive the process, and what would outlive a loss of power.

What is written is there for every process at once, and for good only after an fsync: of the file for its
content, of its folder for its name.
"""

import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from types import SimpleNamespace, TracebackType
from typing import ClassVar, Self, cast

from tests.explore.runtime import Runtime

SYNC_NS = 1_000_000  # how long an fsync takes


@dataclass(slots=True, eq=False)
class File:
    """One file: as everybody reads it, and as it is after a loss of power."""

    data: bytearray = field(default_factory=bytearray)
    durable: bytes = b""


class Disk:
    """All files by their paths; also what may go wrong with it."""

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self.files: dict[str, File] = {}
        self.durable: dict[str, File] = {}  # names that outlive a loss of power
        self.locks: dict[str, object] = {}
        self.full = False  # takes nothing more
        self.read_only = False  # nor can anything be renamed or removed
        self.sync_ns = SYNC_NS
        self.changes = 0  # counts whatever anybody could see afterwards
        self._open: dict[int, OpenFile | str] = {}
        self._next = 1000

    def lose_process(self) -> None:
        """The only process has ended: its locks are free."""
        self.locks = {}

    def make_durable(self) -> None:
        """Everything as it is now."""
        self.durable = dict(self.files)
        for file in self.files.values():
            file.durable = bytes(file.data)

    def lose_power(self) -> None:
        """Only what was made durable is left."""
        self.files = dict(self.durable)
        for file in self.files.values():
            file.data = bytearray(file.durable)
        self.changed()

    def changed(self) -> None:
        self.changes += 1
        self.runtime.point()

    def check(self, *, room: bool = True) -> None:
        if self.read_only:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        if room and self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def heal(self) -> None:
        self.full, self.read_only, self.sync_ns = False, False, SYNC_NS

    def opened(self, what: "OpenFile | str") -> int:
        self._next += 1
        self._open[self._next] = what
        return self._next

    def closed(self, descriptor: int) -> None:
        self._open.pop(descriptor, None)

    def sync(self, descriptor: int) -> None:
        """Make durable what the descriptor stands for; takes its time."""
        what = self._open[descriptor]
        if self.runtime.current is not None:
            self.runtime.block(self.sync_ns)
        if isinstance(what, str):
            inside = f"{what}/"
            kept = {path: one for path, one in self.durable.items() if not path.startswith(inside)}
            now = {path: one for path, one in self.files.items() if path.startswith(inside)}
            self.durable = kept | now
        else:
            what.file.durable = bytes(what.file.data)
        self.changed()

    def truncate(self, descriptor: int, size: int) -> None:
        what = self._open[descriptor]
        if isinstance(what, OpenFile):
            del what.file.data[size:]
        self.changed()

    def room(self, _path: object) -> SimpleNamespace:
        """`os.statvfs`, as far as it is asked for."""
        return SimpleNamespace(f_frsize=1, f_bavail=0 if self.full else 1 << 40)


class DiskPath(PurePosixPath):
    """As much of `pathlib.Path` as records need."""

    disk: ClassVar[Disk]

    def file(self) -> File:
        found = self.disk.files.get(str(self))
        if found is None:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(self))
        return found

    def exists(self) -> bool:
        return str(self) in self.disk.files

    is_file = exists

    def is_symlink(self) -> bool:
        """It has no links."""
        return False

    def mkdir(self, **_options: bool) -> None:
        """Folders need no making."""

    def read_bytes(self) -> bytes:
        return bytes(self.file().data)

    def read_text(self, encoding: str = "utf-8") -> str:
        return self.read_bytes().decode(encoding)

    def write_bytes(self, data: bytes) -> int:
        with self.open("wb") as file:
            return file.write(data)

    def open(self, mode: str = "rb", buffering: int = -1) -> "OpenFile":
        files, path = self.disk.files, str(self)
        if mode.startswith("w"):
            self.disk.check()
            files[path] = File()
        elif mode.startswith("a"):
            files.setdefault(path, File())
        self.disk.changed()
        return OpenFile(self.disk, path, self.file())

    def iterdir(self) -> "Iterator[DiskPath]":
        inside = f"{self}/"
        names = [path for path in self.disk.files if path.startswith(inside)]
        return iter([DiskPath(path) for path in names if "/" not in path.removeprefix(inside)])

    def stat(self) -> SimpleNamespace:
        return SimpleNamespace(st_size=len(self.file().data))

    def replace(self, target: "DiskPath") -> "DiskPath":
        self.disk.check(room=False)
        self.disk.files[str(target)] = self.file()
        del self.disk.files[str(self)]
        self.disk.changed()
        return target

    def unlink(self, missing_ok: bool = False) -> None:
        if not missing_ok or self.exists():
            self.file()
            self.disk.check(room=False)
            del self.disk.files[str(self)]
            self.disk.changed()


class OpenFile:
    """An open file; whatever is written goes to its end."""

    def __init__(self, disk: Disk, path: str, file: File) -> None:
        self.disk, self.path, self.file = disk, path, file
        self._at = 0
        self._number = disk.opened(self)

    def fileno(self) -> int:
        return self._number

    def write(self, data: bytes) -> int:
        self.disk.check()
        self.file.data += data
        self.disk.changed()
        return len(data)

    def read(self, size: int = -1) -> bytes:
        end = len(self.file.data) if size < 0 else self._at + size
        found = bytes(self.file.data[self._at : end])
        self._at += len(found)
        return found

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + (len(self.file.data) if whence == os.SEEK_END else 0)
        return self._at

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        """Nothing is kept back."""

    def close(self) -> None:
        self.disk.closed(self._number)
        locks = self.disk.locks
        if locks.get(self.path) == self._number:
            del locks[self.path]

    def __iter__(self) -> Iterator[bytes]:
        return iter(bytes(self.file.data[self._at :]).splitlines(keepends=True))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Locking:
    """`fcntl`: a lock belongs to who holds the file open."""

    LOCK_EX, LOCK_NB, LOCK_UN = 2, 4, 8

    @staticmethod
    def flock(file: OpenFile, operation: int) -> None:
        if operation & Locking.LOCK_UN:
            file.disk.locks.pop(file.path, None)
        elif file.path in file.disk.locks:
            raise BlockingIOError(errno.EWOULDBLOCK, os.strerror(errno.EWOULDBLOCK))
        else:
            file.disk.locks[file.path] = file.fileno()


def at(disk: Disk, path: str) -> Path:
    """A path on that disk."""
    DiskPath.disk = disk
    return cast("Path", DiskPath(path))
