"""Where a play takes place: a computer with two servers, their robots, and a store."""

import concurrent.futures
import contextlib
import functools
import importlib.metadata
import os
import random
import re
import sqlite3
import time
import uuid
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, Final, Self

import msgspec

from ml.store import NoSuchTable, Store, objects, store
from ml.store.objects import Objects
from ml.store.store import ABOUT, About
from ml.store.tables import TABLES
from server_gui.core.recording import recorder
from server_gui.core.recording.errors import SpoolUnusable
from tests.explore_store.disk import Disk, Ended, changes, watching
from tests.explore_store.ledger import Classes, Fate, Ledger
from tests.explore_store.robots import Robot
from tests.explore_store.s3 import BUCKET, S3
from tests.explore_store.server import Server
from tests.explore_store.times import Names, Times, ours
from tests.explore_store.wrong import Wrong, sentence

TORN: Final = ("was never acknowledged: the next upload", "is being written, or is cut off")
UNREAD: Final = "let gwrms cloud mend take it out of its table"  # or whoever writes next sets its entry aside
CLAIMED: Final = "is being compacted by another"  # which was killed, and S3 knows nothing of that
NO_STORE: Final = "there is no store at"
AGAIN: Final = 5  # attempts on a disk that refuses; one refuses less often


class World:
    """A context manager, in which the path stands on our time, names and disk."""

    def __init__(
        self, folder: Path, shards: int = 1, s3: S3 | None = None, known: Collection[str] = ()
    ) -> None:
        self.times = Times()
        self.disk = Disk(folder)
        self.ledger = Ledger()
        self.classes = Classes()
        self.looks: list[Callable[[World, Store], None]] = []  # at the end, besides the usual ones
        self.shards = shards
        self.s3 = s3
        self.url = (folder / "store").as_uri() if s3 is None else f"s3://{BUCKET}/store"
        self.pinned: list[tuple[str, int, int]] = []  # location, version, rows
        self.forgotten: set[tuple[str, str]] = set()  # robots and sessions of wearers who are
        self.retained_ns: int | None = None  # rows that are older may be gone
        self.known = known  # what may be wrong, as regular expressions
        self.known_wrong = 0  # and how often it was
        self.damage: int | None = None  # what is done to the store at the end
        both, mine, other = Robot("p0", "rad"), Robot("p1", "rad"), Robot("p2", "deg", can_be_asked=False)
        self.robots = [both, mine, other]
        self.servers = {
            "A": self._server("A", {"exo-0": both, "exo-1": mine}),
            "B": self._server("B", {"exo-0": both, "exo-1": other}),  # another one of this name
        }
        self._stack = contextlib.ExitStack()
        self._count = 0

    def _server(self, name: str, robots: dict[str, Robot]) -> Server:
        return Server(name, self.disk, self.times, self.ledger, robots, self.store)

    def __enter__(self) -> Self:
        put = self.put
        names = Names(random.Random(0))
        for module in ours():
            for ours_, theirs in ((self.times, time), (names, uuid)):
                for name, value in list(vars(module).items()):
                    if value is theirs:
                        put(module, name, ours_)
        for module in [module for module in ours() if hasattr(module, "ThreadPoolExecutor")]:
            put(module, "ThreadPoolExecutor", _AtOnce)
        put(importlib.metadata, "version", _version)
        put(recorder, "COMMIT_S", 0.0)
        put(sqlite3, "connect", watching(self.disk))
        for name, stand_in in changes(self.disk).items():
            put(os, name, stand_in)
        if self.s3 is not None:
            self._reach(self.s3)
        return self

    def _reach(self, s3: S3) -> None:
        s3.clear()
        s3.objects["store/store.json"] = msgspec.json.encode(About(shards=self.shards))  # no probe
        s3.on_write = self._on_write
        for name, value in s3.environment.items():
            os.environ[name] = value
        for module in (objects, store):
            self.put(module, "RETRIES", 2)

    def _on_write(self) -> None:
        """Between two requests a program may end, too; then the service hears no more of it."""
        assert self.s3 is not None
        try:
            self.disk.point()
        except Ended:
            self.s3.dead = True

    def put(self, module: Any, name: str, value: Any) -> None:
        """Let this stand there until the end."""
        before = getattr(module, name)
        setattr(module, name, value)
        self._stack.callback(setattr, module, name, before)

    def __exit__(self, *exc: object) -> None:
        for server in self.servers.values():
            server.abandon()
        self._stack.close()

    def store(self) -> Store:
        return Store(self.url, self.shards)

    def number(self, count: int = 1) -> int:
        """Numbers that nothing has yet; the first of them."""
        self._count += count
        return self._count - count + 1

    @contextlib.contextmanager
    def alive(self, name: str) -> Iterator[Server]:
        """A server at work; where it ends within the block, the disk is then what is left of it."""
        server = self.servers[name]
        self.times.wall_ns = server.wall_ns
        while not server.runs:
            self._start(server)
        try:
            yield server
        except Ended:
            self.bury(name)
        if self.disk.left is not None:
            self.bury(name)

    def _start(self, server: Server) -> None:
        """As whoever looks after it: where it ends, or the disk refuses, again."""
        for again in reversed(range(AGAIN)):
            try:
                server.start()
                return
            except Ended:
                self.bury(server.name)
            except (SpoolUnusable, OSError):
                server.abandon()
                if not again:
                    raise

    def bury(self, name: str) -> None:
        """A server has ended, by a power cut all of them."""
        gone = self.servers.values() if self.disk.power else [self.servers[name]]
        for server in gone:
            server.abandon()
        self.disk.become(self.servers[name].folder)
        if self.s3 is not None:
            self.s3.dead = False

    def end(self, name: str, seed: int, *, power: bool) -> None:
        """End a server now, or cut the power."""
        if self.servers[name].runs or power:
            self.disk.end(seed, power=power)
            self.bury(name)

    @property
    def faults(self) -> int:
        """What has gone wrong outside of the path until now, as its programs see it."""
        return self.disk.refusals + (self.s3.failed if self.s3 is not None else 0)

    def explains(self, problem: str | None, faults: int) -> bool:
        """Whether something outside is why somebody could not do what he was to do, since `faults`."""
        problem = problem or ""
        return (
            self.disk.left is not None
            or self.faults > faults
            or (self.disk.cuts > 0 and any(each in problem for each in TORN))
            or (self.disk.cuts > 0 and UNREAD in problem and self._heals())
            or (self.s3 is not None and self.disk.ends > 0 and CLAIMED in problem)
            or (NO_STORE in problem and not self._is_there())
        )

    def _heals(self) -> bool:
        """Whether all can be read again once somebody writes: what a power cut has torn is set aside then."""
        with self.disk.unseen():
            store = Store.existing(self.url)
            for location in [
                name for table in TABLES.values() for name in table.locations(store.about.shards)
            ]:
                with contextlib.suppress(NoSuchTable):
                    store.mend(location)
                    store.dataset(location).to_table()
        return True

    def _is_there(self) -> bool:
        with self.disk.unseen():
            return Objects(self.url).read(ABOUT) is not None

    def check(self, holds: bool, what: str, *found: object) -> None:
        """Raises `Wrong` where this does not hold, and that is not known."""
        if holds:
            return
        told = sentence(what, *found)
        if not any(re.search(pattern, told) for pattern in self.known):
            raise Wrong(told)
        self.known_wrong += 1

    @property
    def lived(self) -> list[Server]:
        """The servers that have ever run."""
        return [server for server in self.servers.values() if server.life]

    def safe(self) -> Iterable[Any]:
        return (thing for thing in self.ledger.things if thing.fate is Fate.SAFE)


_version: Final = functools.cache(importlib.metadata.version)  # of what is installed: it looks on the disk


class _AtOnce:
    """Stands for a pool of threads: everything is done by whoever hands it in, in its order."""

    def __init__(self, *_: object) -> None:
        pass

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        pass

    def map(self, work: Callable[..., Any], *values: Iterable[Any]) -> list[Any]:
        return list(map(work, *values))

    def submit(self, work: Callable[..., Any], *values: Any) -> "concurrent.futures.Future[Any]":
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()
        done.set_result(work(*values))
        return done
