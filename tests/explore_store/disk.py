"""A disk that says what a power cut leaves: what was synchronised, and of the rest anything.

A node is a file's contents, as an inode; a name in a folder leads to it. Both last only once they are
synchronised, each for itself. Of contents that are not, a power cut leaves the old ones, the new ones, a
beginning of them, nothing, or some sectors of each. SQLite's own synchronising cannot be seen from Python:
its statements stand for it (`Watched`).
"""

import contextlib
import errno
import os
import random
import sqlite3
import weakref
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

SECTOR: Final = 512
DATABASE: Final = ".db"
WRITING: Final = ("INSERT", "UPDATE", "DELETE", "CREATE", "ALTER")
INDEX: Final = "-shm"  # of a log: SQLite writes into it what it has synchronised, and never synchronises it


class Ended(BaseException):
    """The program ends here and now: killed, or by a power cut."""


@dataclass(eq=False, slots=True)
class Node:
    """A file's contents as they are on the disk for sure."""

    synced: bytes = b""


@dataclass(frozen=True, slots=True)
class Left:
    """What the disk has after an end: folders, and files with their contents."""

    folders: list[str] = field(default_factory=list)
    files: dict[str, bytes] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict)


class Disk:
    """Everything below `root`. `arm` ends the program at a point to come; `fail` lets writes fail."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.full = False  # nearly: what the spool asks before it writes
        self.left: Left | None = None  # since the program has ended
        self.power = False  # it ended by a power cut
        self.points = 0
        self.refusals = 0  # writes that have failed
        self.cuts = 0  # of power
        self.ends = 0  # of programs
        self._quiet = False  # we ourselves are at work
        self._nodes: dict[int, Node] = {}
        self._names: dict[str, Node | None] = {}  # that last; None: a folder
        self._armed: tuple[int, bool, int] | None = None
        self._failing: list[int] = []  # the next writes' errors
        self.connections: weakref.WeakSet[Watched] = weakref.WeakSet()

    # --- what is to happen

    def arm(self, points: int, seed: int, *, power: bool) -> None:
        """End the program at this point, counted from now on."""
        self._armed = (self.points + points, power, seed)

    def disarm(self) -> None:
        """Nothing is to happen any more."""
        self._armed, self._failing, self.full = None, [], False

    def fail(self, error: int, times: int) -> None:
        """The next writes fail."""
        self._failing = [error] * times

    def end(self, seed: int, *, power: bool) -> None:
        """End the program now."""
        self.power, self._armed = power, None
        self.left = self._cut(random.Random(seed)) if power else self._kept()

    # --- what happens

    def point(self, kept: str | None = None) -> None:
        """Something is about to last; here the program may end. `kept`: a name that lasts until then."""
        if self._quiet:
            return
        if self.left is not None:
            raise Ended
        self.points += 1
        if self._armed is not None and self.points >= self._armed[0]:
            _, self.power, seed = self._armed
            self._armed = None
            self.left = self._cut(random.Random(seed), kept) if self.power else self._kept()
            raise Ended

    def check(self, what: Callable[[int], Exception]) -> None:
        """Raises where this write is to fail."""
        if self._failing:
            self.refusals += 1
            raise what(self._failing.pop(0))

    def fsync(self, descriptor: int) -> None:
        """Stands for `os.fsync`."""
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        if path.is_relative_to(self.root):
            self.point()
            self.check(lambda number: OSError(number, os.strerror(number)))
            self.synced(path)

    def sync(self) -> None:
        """Stands for `os.sync`."""
        self.point()
        self._all_lasts()

    def synced(self, path: Path) -> None:
        """This file, or the names in this folder, last from now on."""
        if not path.is_dir():
            self._node(path).synced = path.read_bytes()
            return
        before = self._name(path)
        above = f"{before}/" if before else ""
        beneath = [name for name in self._names if name.startswith(above) and "/" not in name[len(above) :]]
        there = {f"{above}{each.name}": each for each in path.iterdir()}
        for name in beneath:
            if name not in there:
                del self._names[name]
        self._names |= {name: None if each.is_dir() else self._node(each) for name, each in there.items()}

    def become(self, spool: Path) -> None:
        """Be what was left, once nobody has anything open; of a killed program only its spool had that."""
        left, self.left = self.left, None
        if left is not None:
            self.ends += 1
            self.cuts += self.power
            with self.unseen():
                self._become(left, "" if self.power else f"{self._name(spool)}/")

    @contextlib.contextmanager
    def unseen(self) -> Iterator[None]:
        """What is done within the block is no program's doing that might end."""
        self._quiet = True
        try:
            yield
        finally:
            self._quiet = False

    # --- inside

    def _become(self, left: Left, below: str) -> None:
        for path in sorted(self.root.rglob("*"), reverse=True):
            name = self._name(path)
            if name.startswith(below) and name not in left.files and name not in left.folders:
                path.rmdir() if path.is_dir() else path.unlink()
        for folder in left.folders:
            (self.root / folder).mkdir(exist_ok=True)
        for name, data in left.files.items():
            if name.startswith(below):
                (self.root / name).write_bytes(data)
                self._nodes[(self.root / name).stat().st_ino] = left.nodes.get(name, Node())
        if self.power:
            self._all_lasts()

    def _name(self, path: Path) -> str:
        return "" if path == self.root else str(path.relative_to(self.root))

    def _node(self, path: Path) -> Node:
        return self._nodes.setdefault(path.stat().st_ino, Node())

    def _all_lasts(self) -> None:
        self._nodes, self._names = {}, {}
        for path in [self.root, *self.root.rglob("*")]:
            if not path.is_dir():
                self.synced(path)
        for path in [self.root, *self.root.rglob("*")]:
            if path.is_dir():
                self.synced(path)

    def _there(self) -> Iterator[tuple[str, Path]]:
        for path in sorted(self.root.rglob("*")):
            yield self._name(path), path

    def _kept(self) -> Left:
        """All of it: a kill loses nothing that was written."""
        left = Left()
        for name, path in self._there():
            if path.is_dir():
                left.folders.append(name)
            else:
                left.files[name], left.nodes[name] = path.read_bytes(), self._node(path)
        return left

    def _cut(self, chance: random.Random, kept: str | None = None) -> Left:
        """What a power cut leaves."""
        now = self._kept()
        contents = {node: now.files[name] for name, node in now.nodes.items()}
        came: dict[Node, bool] = {}  # whether a change of names has reached the disk

        def has_come(node: Node) -> bool:
            if node not in came:
                came[node] = chance.random() < 0.5
            return came[node]

        left = Left()
        lasting = {name for name, node in self._names.items() if node is None}
        for folder in sorted({*now.folders, *lasting}):
            above = folder.rpartition("/")[0]
            if (not above or above in left.folders) and (folder in lasting or chance.random() < 0.5):
                left.folders.append(folder)
        files = {name for name, node in self._names.items() if node is not None}
        for name in sorted({*now.files, *files}):
            above = name.rpartition("/")[0]
            node = self._named(name, now.nodes.get(name), self._names.get(name), has_come, kept)
            if node is not None and (not above or above in left.folders):
                new = node.synced if name.endswith(INDEX) else contents.get(node, node.synced)
                mixed = _overwritten if name.endswith(DATABASE) else _mixed
                left.files[name] = mixed(node.synced, new, chance)
        return left

    @staticmethod
    def _named(
        name: str, new: Node | None, old: Node | None, has_come: Callable[[Node], bool], kept: str | None
    ) -> Node | None:
        """Which contents a name leads to after a power cut."""
        if new is old:
            return new
        if name == kept:
            return old
        decides = new or old
        return new if decides is not None and has_come(decides) else old


def _mixed(old: bytes, new: bytes, chance: random.Random) -> bytes:
    """What is left of contents that were to become others; where both are the same they stay."""
    if old == new:
        return old
    same = next((at for at in range(0, len(old), SECTOR) if not new.startswith(old[at : at + SECTOR], at)), 0)
    if new.startswith(old):
        same = len(old)
    match chance.randrange(5):
        case 0:
            return old
        case 1:
            return new
        case 2:
            return new[: chance.randrange(same, len(new) + 1)]
        case 3:
            return new[:same] + bytes(len(new) - same)
    length = chance.choice((len(old), len(new)))
    padded = [each.ljust(length, b"\0") for each in (old, new)]
    return b"".join(
        padded[chance.randrange(2)][begin : min(begin + SECTOR, length)] for begin in range(0, length, SECTOR)
    )


def _overwritten(old: bytes, new: bytes, chance: random.Random) -> bytes:
    """The same of a database, which is overwritten in place: a sector that was there is the old or the new.

    SQLite relies on that too ("powersafe overwrite"); what it appends may be anything.
    """
    if old == new:
        return old
    both = min(len(old), len(new))
    sectors = ((begin, min(begin + SECTOR, both)) for begin in range(0, both, SECTOR))
    there = b"".join(chance.choice((old, new))[begin:end] for begin, end in sectors)
    return there + _mixed(old[both:], new[both:], chance)


class Watched(sqlite3.Connection):
    """A database on the disk: what its statements make last, and where it may end or fail."""

    disk: Disk
    file: Path
    _named = False

    def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:
        commits = sql == "COMMIT" or (sql.startswith(WRITING) and not self.in_transaction)
        if commits:
            self.disk.check(_refusal)
        found = super().execute(sql, *values)
        if commits:
            self._lasts()
        return found

    def executescript(self, sql: str) -> sqlite3.Cursor:
        self.disk.synced(self.file)  # the first page, which had a journal beside it until it lasted
        self.disk.check(_refusal)
        found = super().executescript(sql)
        self._lasts()
        return found

    def close(self) -> None:
        log = self._log
        had = log.exists()
        super().close()
        self.disk.connections.discard(self)
        if self.disk.left is None and had and not log.exists() and self.file.exists():
            try:
                self.disk.point(str(log.relative_to(self.disk.root)))  # SQLite keeps it until the rest lasts
            finally:
                self.disk.synced(self.file)  # for a kill too: where the log has gone, the rest lasts

    def __del__(self) -> None:
        if self in self.disk.connections:  # nobody has closed it
            self.close()

    @property
    def _log(self) -> Path:
        return self.file.with_name(f"{self.file.name}-wal")

    def _lasts(self) -> None:
        """SQLite has synchronised its log, the first time with the folder."""
        self.disk.point()
        for path in (self._log, self.file, self.file.with_name(f"{self.file.name}{INDEX}")):
            if path.exists():
                self.disk.synced(path)
        if not self._named:
            self._named = True
            self.disk.synced(self.file.parent)


def _refusal(number: int) -> sqlite3.Error:
    text = "database or disk is full" if number == errno.ENOSPC else "disk I/O error"
    return sqlite3.OperationalError(text)


def watching(disk: Disk) -> Callable[..., sqlite3.Connection]:
    """Stands for `sqlite3.connect`."""
    real = sqlite3.connect

    def connect(path: Any, **options: Any) -> sqlite3.Connection:
        if not isinstance(path, Path) or not path.is_relative_to(disk.root):
            plain: sqlite3.Connection = real(path, **options)
            return plain
        if disk.left is not None:
            raise Ended
        opened: Watched = real(path, factory=Watched, **options)
        opened.disk, opened.file = disk, path
        disk.connections.add(opened)
        return opened

    return connect


Changes = Mapping[str, Callable[..., Any]]


def changes(disk: Disk) -> Changes:
    """What stands for the functions of the module `os`."""

    def pointed(real: Callable[..., Any]) -> Callable[..., Any]:
        def called(path: Any, *more: Any, **options: Any) -> Any:
            if isinstance(path, Path) and path.is_relative_to(disk.root):
                disk.point()
            return real(path, *more, **options)

        return called

    return {
        "fsync": disk.fsync,
        "sync": disk.sync,
        "rename": pointed(os.rename),
        "replace": pointed(os.replace),
        "unlink": pointed(os.unlink),
    }
