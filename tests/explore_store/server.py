"""One collector in one process, its threads called in turn: the real recorder, spool and uploader."""

import contextlib
import random
import sqlite3
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from gateway.client import ClockOffset, ConnectionState
from gateway.wire.control import JournalEntries
from ml.store import Store
from ml.store.labels import Label
from server_gui.core.fleet.robot_recording import RobotRecording
from server_gui.core.follow.events import Described, Journalled, LinkChanged, Telemetry
from server_gui.core.recording import records
from server_gui.core.recording.recorder import Recorder, RecorderSettings
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from tests.explore_store.disk import Disk, Ended
from tests.explore_store.ledger import (
    Amended,
    Asked,
    Bad,
    Begun,
    Entry,
    Fate,
    Ledger,
    Loss,
    Mark,
    Over,
    Row,
    Said,
    Thing,
)
from tests.explore_store.robots import ANGLE, COUNT, EVERY_NS, LATE_NS, RATIO, STREAM, TAIL, Link, Robot
from tests.explore_store.times import Moment, Times

CAPACITY = 20  # rows that may wait: few, so that a queue is soon full
LONG = 10**9  # batches end when a step says so
PEOPLE = {"P01": "1", "p01 ": "1", "P-01": "1", "P02": "2", "P03": "3"}  # who is called so
EVER_NS = 4_000_000_000_000_000_000  # the year 2096
IN_UNIT = {"rad": 0.0, "deg": 0.25, None: 0.5}  # what an angle's fraction says of the unit it was given in


class _Turned(BaseException):
    """The recorder's thread would wait now."""


class Stepped(Recorder):
    """The real recorder, whose thread is called for one turn at a time."""

    def __init__(self, spool: Spool, times: Times) -> None:
        super().__init__(spool, settings=RecorderSettings(CAPACITY, LONG, LONG))
        self._ending = Moment(times)  # type: ignore[assignment]
        self._turns = 0

    def turn(self) -> None:
        self._turns = 1
        with contextlib.suppress(_Turned):
            self._run()

    def _next(self):  # type: ignore[no-untyped-def]
        if not self._turns:
            raise _Turned
        self._turns -= 1
        return super()._next()


class Server:
    """A collector with its spool; `robots` by the names that its file gives them."""

    def __init__(
        self,
        name: str,
        disk: Disk,
        times: Times,
        ledger: Ledger,
        robots: dict[str, Robot],
        connect: Callable[[], Store],
    ) -> None:
        self.name = name
        self.disk = disk
        self.times = times
        self.ledger = ledger
        self.robots = robots
        self.connect = connect
        self.walls_ns = [times.wall_ns]  # what its clock has added to the true time; the last one does now
        self.folder = disk.root / f"spool-{name}"
        self.damaged: set[int] = set()  # files of its spool that somebody has damaged
        self.ever_damaged: set[int] = set()  # also such as are there no more
        self.spoilt: set[int] = set()  # batches that somebody has emptied, cut off or removed as they waited
        self.told_before: Counter[int] = Counter()  # events of such, when the spool was rolled back
        self.rolled_back = False  # somebody has put an older copy of it in its place
        self.copied: dict[str, bytes] = {}
        self.copied_damaged: set[int] = set()
        self.life = 0
        self.ended_well: set[int] = set()  # lives
        self.spool: Spool | None = None
        self._began_walls = 0  # how many of `walls_ns` were over when this life began
        self._turns = 0
        self._turned_ns = 0
        self._pending: list[Thing] = []
        self._lost = 0

    # --- lives

    @property
    def wall_ns(self) -> int:
        return self.walls_ns[-1]

    @property
    def _walls_ns(self) -> tuple[int, ...]:
        """What its clock has added in this life."""
        return tuple(self.walls_ns[self._began_walls :])

    @property
    def runs(self) -> bool:
        return self.spool is not None

    def start(self) -> None:
        """Begin a life, and link to every robot."""
        self.life += 1
        self._began_walls = len(self.walls_ns) - 1
        self.spool = Spool(self.folder, reserve_bytes=1, keep_bytes=1 << 20, free_bytes=self._free)
        self.recorder = Stepped(self.spool, self.times)
        self.uploader = Uploader(self.spool, self.connect)
        self.links = {name: Link(robot) for name, robot in self.robots.items()}
        self.keeping = {name: RobotRecording(name, self.recorder) for name in self.robots}
        self._pending, self._lost, self._turned_ns = [], 0, self.times.now_ns
        for name in self.robots:
            self.link(name)

    def _free(self, _folder: Path) -> int:
        return 0 if self.disk.full else 1 << 40

    def stop(self) -> None:
        """End as Ctrl-C does."""
        if self.spool is None:
            return
        for name, keeping in self.keeping.items():
            if keeping.session:
                self._hand(Over(0, self.name, name, keeping.session))
        self.recorder._ending.set()
        self._turn()
        self.ended_well.add(self.life)
        self.uploader._empty(asked=True)
        self.spool.close()
        self.spool = None

    def abandon(self) -> None:
        """The process is gone: the system closes its files."""
        for opened in [each for each in self.disk.connections if each.file.parent == self.folder]:
            sqlite3.Connection.close(opened)
            self.disk.connections.discard(opened)
        if self.spool is not None:
            self.spool._lock.close()
        self.spool = None
        for thing in self._pending:
            thing.fate = Fate.OPEN
        self._pending = []

    # --- what comes

    def link(self, name: str) -> None:
        """The link is made, for the first time or again, and the robot says what it is."""
        link = self.links[name]
        if link.number:
            waiting = LinkChanged(ConnectionState.WAITING, "it dropped", self.times.now_ns)
            self.keeping[name].take(waiting)
        link.again()
        self.keeping[name].take(LinkChanged(ConnectionState.CONNECTED, None, self.times.now_ns))
        self.describe(name)

    def describe(self, name: str) -> None:
        before = self.keeping[name].session
        self.keeping[name].take(Described(self.links[name].robot.description))
        session = self.keeping[name].session
        if session != before:
            if before:
                self._hand(Over(0, self.name, name, before))
            self._hand(Begun(0, self.name, name, session))

    def rows(self, name: str, count: int, first: int, stream: int = STREAM) -> None:
        """A notification; of every third row the angle is missing. The second stream is late."""
        link, robot = self.links[name], self.links[name].robot
        counts = list(range(first, first + count))
        stamps_ns, trues_ns = [], []
        for _ in counts:
            self.times.now_ns += EVERY_NS
            stamps_ns.append(self.times.now_ns - robot.began_ns)
            trues_ns.append(self.times.now_ns)
        angles: list[float | None] = [
            None if each % 3 == 2 else each + IN_UNIT[robot.unit] for each in counts
        ]
        ratios: list[float | None] = [each / 8 for each in counts]
        columns: dict[str, list[float | None]] = {COUNT: [*map(float, counts)], ANGLE: angles, RATIO: ratios}
        if stream != STREAM:
            angles = [None] * count
            del columns[ANGLE]
        behind_ns = 0 if stream == STREAM else LATE_NS
        batch = link.batch(stream, stamps_ns, columns, self.times.now_ns + behind_ns)
        clock = ClockOffset(-robot.began_ns, 0) if robot.can_be_asked else None
        self.keeping[name].take(Telemetry(stream, batch, clock))
        key = (self.name, name, self.life * 1_000 + link.number)
        session = self.keeping[name].session
        for place, number in enumerate(counts):
            self._hand(
                Row(
                    number, self.name, name, session, link=key, stream=stream, seq=batch.seq, place=place,
                    unit=robot.unit, stamp_ns=stamps_ns[place], true_ns=trues_ns[place],
                    late_ns=0 if robot.can_be_asked else behind_ns, angle=angles[place], ratio=ratios[place],
                )
            )  # fmt: skip

    def mark(self, name: str, number: int) -> None:
        self.recorder.mark(name, f"mark {number}")
        self._hand(Mark(number, self.name, name, self.keeping[name].session))

    def say(self, name: str, session: str, number: int, label: str, *, removed: bool) -> None:
        """That a label of a session holds, or no more."""
        began_ns = self.times.now_ns // 10**12 * 10**12  # the same one, for a long time
        self._say(name, session, number, label, began_ns, began_ns, removed=removed)

    def teach(self, name: str, first: int, wearer: str) -> None:
        """A session in which a wearer walks, and then stands; with three numbers from this one on."""
        until_ns, session = self.times.time_ns() + EVERY_NS // 2, self.keeping[name].session
        self._say(name, session, first, "walk", 0, until_ns)
        self._say(name, session, first + 1, "stand", until_ns, EVER_NS)
        self._say(name, session, first + 2, f"wearer {wearer}", 0, EVER_NS)

    def _say(
        self,
        name: str,
        session: str,
        number: int,
        label: str,
        began_ns: int,
        ended_ns: int,
        *,
        removed: bool = False,
    ) -> None:
        said = Label(name, session, began_ns, ended_ns, label, "ada")
        self.recorder.add(records.label(said, removed=removed))
        self._hand(
            Said(
                number, self.name, name, session, label=label, began_ns=said.began_utc_ns,
                ended_ns=said.ended_utc_ns, removed=removed,
            )
        )  # fmt: skip

    def amend(self, name: str, value: int) -> None:
        keeping = self.keeping[name]
        facts = msgspec.structs.replace(keeping._facts, parameters={"value": value})
        self.recorder.amend(name, facts)
        self._hand(Amended(value, self.name, name, keeping.session, value=value))

    def journal(self, name: str) -> None:
        """Ask for the newest entries of the robot's journal."""
        entries = self.robots[name].journal[-TAIL:]
        self.keeping[name].take(Journalled(JournalEntries(entries)))
        for entry in entries:
            self._hand(Entry(0, self.name, name, "", n=entry["n"], hash=entry["hash"]))
        if entries:
            self._hand(Asked(0, self.name, name, "", first=entries[0]["n"], last=entries[-1]["n"]))

    def bad_journal(self, name: str, entry: dict[str, Any]) -> None:
        """What is none."""
        self.recorder.journal(name, [entry])
        self._hand(Bad(0, self.name, name, ""))

    def _hand(self, thing: Thing) -> None:
        thing.life, thing.at_ns = self.life, self.times.now_ns
        thing.walls_ns = self._walls_ns
        self.ledger.things.append(thing)
        self._pending.append(thing)

    # --- what its threads do

    def turn(self) -> None:
        """The recorder keeps what was handed in."""
        if self.recorder._acknowledged < self.recorder._handed:
            self._turn()

    def _turn(self) -> None:
        assert self.spool is not None
        batch = self.spool._current.number
        self.recorder.turn()
        self._turns += 1
        lost = self.recorder.state.lost - self._lost
        self._lost += lost
        for thing in self._pending:
            thing.fate = Fate.COUNTED if lost else Fate.SAFE
            thing.kept_ns, thing.turn = self.times.now_ns, self._turns
            thing.batch, thing.harmed = batch, batch in self.damaged
            if isinstance(thing, Over):  # which has the time of the turn
                thing.walls_ns = self._walls_ns
        if lost:
            self.ledger.losses.append(
                Loss(self.name, self.life, self.spool.writer, lost, self._pending, self._turned_ns)
            )
        if not self.recorder.untold:
            for loss in self.ledger.losses:
                if (loss.server, loss.life, loss.told) == (self.name, self.life, False):
                    loss.told, loss.told_ns, loss.walls_ns = True, self.times.now_ns, self._walls_ns
                    loss.batch, loss.harmed = batch, batch in self.damaged
        self._turned_ns = self.times.now_ns
        self._pending = []

    def damage(self, batch: int) -> None:
        """Somebody damages a file of its spool."""
        self.damaged.add(batch)
        self.ever_damaged.add(batch)
        self.ledger.harm(self.name, batch)

    def cut(self) -> None:
        """The batch ends."""
        self.recorder.cut(lambda: None)
        self._turn()

    def upload(self) -> bool:
        """The uploader brings what waits; whether all is there."""
        self.uploader._empty(asked=True)
        if self.disk.left is not None:
            raise Ended
        return self.uploader.state.problem is None


def flip(path: Path, seed: int) -> None:
    """One bit of a file, where it holds something."""
    chance = random.Random(seed)
    data = bytearray(path.read_bytes())
    places = [place for place, byte in enumerate(data) if byte]
    if places:
        data[chance.choice(places)] ^= 1 << chance.randrange(8)
        with path.open("r+b") as out:
            out.write(data)
