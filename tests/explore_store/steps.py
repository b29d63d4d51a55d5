"""What may happen, each in a word with numbers: `rows A 1 3` is that robot 1 sends server A three rows."""

import contextlib
import errno
import functools
from collections.abc import Callable, Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import Enum
from pathlib import Path
from typing import Final, Self

from ml.store import NoSuchTable, Store, StoreError, reading, upkeep
from ml.store.query import query
from ml.store.tables import TELEMETRY
from server_gui.core.cloud import spool_reader
from tests.explore_store import exporting, forgetting, judging
from tests.explore_store.damages import NAMES
from tests.explore_store.disk import Ended
from tests.explore_store.ledger import Begun
from tests.explore_store.robots import COUNT, SECOND, STREAM
from tests.explore_store.s3 import S3, Fault
from tests.explore_store.server import PEOPLE, flip
from tests.explore_store.world import World

SERVERS: Final = ("A", "B")
ROBOTS: Final = ("exo-0", "exo-1")
UNITS: Final = ("rad", "deg", None)
CLOCK_S: Final = (-3600.0, -0.05, 0.05, 10.0, -86_400.0, 86_400.0)
LABELS: Final = ("walk", "wearer P01")
EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


class Place(Enum):
    """Where the store is."""

    FOLDER = "folder"
    SHARDS = "shards"  # a folder, and the telemetry in two tables
    S3 = "s3-store"


Play = Callable[[World, int, int, int], object]


@dataclass(frozen=True, slots=True)
class Kind:
    """One word: how many numbers it has below which values, and what it does."""

    play: Play
    below: tuple[int, ...]
    weight: int = 1


def _rows(world: World, s: int, r: int, count: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.rows(ROBOTS[r], count + 1, world.number(count + 1))


def _second(world: World, s: int, r: int, count: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.rows(ROBOTS[r], count + 1, world.number(count + 1), SECOND)


def _miss(world: World, s: int, r: int, count: int) -> None:
    """Notifications of the robot's first stream never come."""
    with world.alive(SERVERS[s]) as server:
        server.links[ROBOTS[r]].miss(STREAM, count + 1)


def _turn(world: World, s: int, *_: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.turn()


def _cut(world: World, s: int, *_: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.cut()


def _send(world: World, s: int, *_: int) -> None:
    with world.alive(SERVERS[s]) as server:
        faults = world.faults
        server.cut()
        if not server.upload():
            problem = server.uploader.state.problem
            world.check(world.explains(problem, faults), "an upload fails without cause", problem)


def _reboot(world: World, s: int, r: int, _: int) -> None:
    robot = world.servers[SERVERS[s]].robots[ROBOTS[r]]
    robot.boot(world.times.now_ns)
    for server in world.servers.values():
        for name, each in server.robots.items():
            if each is robot and server.runs:
                world.times.wall_ns = server.wall_ns
                server.link(name)


def _link(world: World, s: int, r: int, _: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.link(ROBOTS[r])


def _unit(world: World, s: int, r: int, unit: int) -> None:
    with world.alive(SERVERS[s]) as server:
        robot = server.robots[ROBOTS[r]]
        robot.unit = UNITS[unit]
    for other, each in world.servers.items():
        if names := [name for name, known in each.robots.items() if known is robot and each.runs]:
            with world.alive(other):  # by its own clock
                for name in names:
                    each.link(name)


def _rename(world: World, s: int, r: int, other: int) -> None:
    world.servers[SERVERS[s]].robots[ROBOTS[r]].called = ("", "exo-0", "exo-9")[other]
    _link(world, s, r, 0)


def _clock(world: World, s: int, step: int, _: int) -> None:
    server = world.servers[SERVERS[s]]
    server.walls_ns.append(server.wall_ns + int(CLOCK_S[step] * 1e9))


def _say(world: World, s: int, r: int, what: int) -> None:
    with world.alive(SERVERS[s]) as server:
        if session := server.keeping[ROBOTS[r]].session:
            server.say(ROBOTS[r], session, world.number(), LABELS[what % 2], removed=what >= 2)


def _relabel(world: World, s: int, back: int, what: int) -> None:
    """Of an earlier session, as somebody does who looks at what was recorded."""
    begun = [each for each in world.ledger.all_of(Begun) if each.server == SERVERS[s]]
    if len(begun) > back:
        with world.alive(SERVERS[s]) as server:
            of = begun[-1 - back]
            if (of.robot, of.session) in world.forgotten:
                return
            server.say(of.robot, of.session, world.number(), LABELS[what % 2], removed=what >= 2)


def _teach(world: World, s: int, one: int, other: int) -> None:
    """Three new sessions with labels, each of one wearer, spelled somehow; brought to the store."""
    for r, who in ((0, one), (1, other), (0, len(PEOPLE) - 1)):
        _reboot(world, s, r, 0)
        with world.alive(SERVERS[s]) as server:
            server.turn()
            server.rows(ROBOTS[r], 4, world.number(4))
            server.turn()
            server.teach(ROBOTS[r], world.number(3), tuple(PEOPLE)[who])
            server.turn()
            server.rows(ROBOTS[r], 4, world.number(4))
            server.turn()
    _send(world, s)


def _train(world: World, who: int, *_: int) -> None:
    from tests.explore_store import learning

    learning.train(world, who)
    _buried(world)


def _promote(world: World, who: int, robot: int, race: int) -> None:
    from tests.explore_store import learning

    names = ("", ROBOTS[0])
    other = functools.partial(learning.promote, world, 1 - who, "")
    learning.promote(world, who, names[robot], other if race else None)
    _buried(world)


def _mark(world: World, s: int, r: int, _: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.mark(ROBOTS[r], world.number())


def _amend(world: World, s: int, r: int, _: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.amend(ROBOTS[r], world.number())


def _journal(world: World, s: int, r: int, count: int) -> None:
    with world.alive(SERVERS[s]) as server:
        for _ in range(count):
            server.robots[ROBOTS[r]].write()
        server.journal(ROBOTS[r])


def _bad_journal(world: World, s: int, r: int, how: int) -> None:
    bad = ({"n": 1, "hash": {}}, {"n": 2**63 + 5, "hash": "x"}, {"n": 1, "hash": None})[how]
    with world.alive(SERVERS[s]) as server:
        server.bad_journal(ROBOTS[r], bad)


def _stop(world: World, s: int, *_: int) -> None:
    with world.alive(SERVERS[s]) as server:
        server.stop()


def _kill(world: World, s: int, *_: int) -> None:
    world.end(SERVERS[s], 0, power=False)


def _power(world: World, seed: int, *_: int) -> None:
    world.end("A", seed, power=True)


def _crash(world: World, points: int, power: int, seed: int) -> None:
    world.disk.arm(points + 1, seed, power=bool(power))


def _full(world: World, full: int, *_: int) -> None:
    world.disk.full = bool(full)
    world.times.sleep(2.0)


def _fails(world: World, which: int, times: int, _: int) -> None:
    world.disk.fail((errno.ENOSPC, errno.EIO)[which], times + 1)


def _flip(world: World, s: int, file: int, seed: int) -> None:
    """In a file of the spool that nobody has open."""
    server = world.servers[SERVERS[s]]
    if server.runs:
        world.end(SERVERS[s], 0, power=False)
    files = sorted(path for path in server.folder.glob("0*") if not path.name.endswith("-shm"))
    files = [path for path in files if ".uploaded" not in path.name]
    if files:
        flipped = files[file % len(files)]
        flip(flipped, seed)
        server.damage(int(flipped.name[:8]))


def _spoil(world: World, s: int, file: int, how: int) -> None:
    """A batch that waits is emptied, cut off, or, where there is one before it, removed."""
    server = world.servers[SERVERS[s]]
    world.end(SERVERS[s], 0, power=False)
    waiting = spool_reader.waiting(server.folder)
    files = [server.folder / f"{number:08}.db" for number in waiting[how == 2 : -1]]
    files = [each for each in files if not each.with_name(f"{each.name}-wal").exists()]
    if not files:
        return
    spoilt = files[file % len(files)]
    with world.disk.unseen():
        if how == 2:
            spoilt.unlink()
        else:
            spoilt.write_bytes(spoilt.read_bytes()[: how * spoilt.stat().st_size // 2])
        world.disk.sync()
    server.damage(int(spoilt.stem))
    server.spoilt.add(int(spoilt.stem))


def _copy(world: World, s: int, *_: int) -> None:
    """Somebody copies the spool's folder, while nobody records."""
    server = world.servers[SERVERS[s]]
    world.end(SERVERS[s], 0, power=False)
    if server.folder.is_dir():
        server.copied = {path.name: path.read_bytes() for path in server.folder.iterdir()}
        server.copied_damaged = set(server.damaged)


def _roll_back(world: World, s: int, *_: int) -> None:
    """And puts that back later; or, without one, removes the databases."""
    server = world.servers[SERVERS[s]]
    world.end(SERVERS[s], 0, power=False)
    if not server.folder.is_dir():
        return
    judging.roll_back(world, server)
    with world.disk.unseen():
        for path in server.folder.iterdir():
            if server.copied or path.name.startswith("0"):
                path.unlink()
        for name, data in server.copied.items():
            (server.folder / name).write_bytes(data)
        world.disk.sync()


def _damage(world: World, which: int, *_: int) -> None:
    world.damage = which


def _s3(world: World, fault: int, writes: int, _: int) -> None:
    if world.s3 is not None:
        world.s3.arm(writes + 1, Fault(fault))


def _kept_up(work: Callable[[Store], object]) -> Play:
    """Somebody else keeps the store in order; that may end too, and fail where there is a cause."""

    def play(world: World, *_: int) -> None:
        faults = world.faults
        try:
            work(Store.existing(world.url))
        except (StoreError, OSError) as error:
            world.check(world.explains(str(error), faults), "a command fails without cause", error)
        except Ended:
            pass
        _buried(world)

    return play


def _buried(world: World) -> None:
    """Where it ended within."""
    if world.disk.left is not None:
        world.bury("A")


def _retain(world: World, age: int, *_: int) -> None:
    """Up to some row, which stays."""
    times = sorted(row.utc_ns(row.walls_ns[-1]) for row in world.ledger.rows())
    if times:
        before_ns = times[max(0, len(times) - 1 - 3 * age)]
        before = EPOCH + timedelta(microseconds=before_ns // 1000)
        judging.retire(world, before_ns)
        _kept_up(lambda store: upkeep.retain(store, [TELEMETRY], before))(world, 0, 0, 0)


def _pin(world: World, back: int, *_: int) -> None:
    """Of this or an earlier version; what is pinned can be read from then on."""

    def pin(store: Store) -> None:
        location = TELEMETRY.locations(store.about.shards)[0]
        with contextlib.suppress(NoSuchTable):  # no such version, or vacuum has removed files of it
            version = max(0, store.table(location).version() - back)
            upkeep.pin(store, location, version, "model")
            world.pinned.append((location, version, judging.rows_of_version(store, location, version)))

    _kept_up(pin)(world, 0, 0, 0)


def _query(world: World, *_: int) -> None:
    def ask(store: Store) -> None:
        if COUNT not in reading.dataset(store, TELEMETRY).schema.names:
            return
        with query(store, 'SELECT "x.count" AS n, count(*) AS c FROM telemetry GROUP BY 1') as found:
            counts = [count for batch in found.batches for count in batch["c"].to_pylist()]
            world.check(set(counts) <= {1}, "a query finds rows twice", counts)

    _kept_up(ask)(world, 0, 0, 0)


def _export(world: World, s: int, *_: int) -> None:
    exporting.exports(world, world.servers[SERVERS[s]])


KINDS: Final = {
    "rows": Kind(_rows, (2, 2, 8), 10),
    "second": Kind(_second, (2, 2, 3), 3),
    "miss": Kind(_miss, (2, 2, 3), 1),
    "turn": Kind(_turn, (2,), 5),
    "cut": Kind(_cut, (2,), 2),
    "send": Kind(_send, (2,), 5),
    "reboot": Kind(_reboot, (2, 2), 2),
    "link": Kind(_link, (2, 2), 1),
    "unit": Kind(_unit, (2, 2, 3), 2),
    "rename": Kind(_rename, (2, 2, 3), 1),
    "clock": Kind(_clock, (2, 6), 2),
    "label": Kind(_say, (2, 2, 4), 3),
    "relabel": Kind(_relabel, (2, 4, 4), 2),
    "teach": Kind(_teach, (2, len(PEOPLE), len(PEOPLE)), 2),
    "train": Kind(_train, (2,), 1),
    "promote": Kind(_promote, (2, 2, 2), 1),
    "mark": Kind(_mark, (2, 2), 2),
    "amend": Kind(_amend, (2, 2), 2),
    "journal": Kind(_journal, (2, 2, 9), 2),
    "bad-journal": Kind(_bad_journal, (2, 2, 3), 1),
    "stop": Kind(_stop, (2,), 1),
    "kill": Kind(_kill, (2,), 2),
    "power": Kind(_power, (100,), 2),
    "crash": Kind(_crash, (60, 2, 100), 6),
    "full": Kind(_full, (2,), 2),
    "s3": Kind(_s3, (3, 12), 3),
    "fails": Kind(_fails, (2, 3), 2),
    "flip": Kind(_flip, (2, 4, 10_000), 1),
    "spoil": Kind(_spoil, (2, 4, 3), 1),
    "copy": Kind(_copy, (2,), 1),
    "roll-back": Kind(_roll_back, (2,), 1),
    "damage": Kind(_damage, (len(NAMES),), 2),
    "forget": Kind(forgetting.play, (len(forgetting.PERSONS),), 2),
    "compact": Kind(_kept_up(upkeep.compact), (), 2),
    "vacuum": Kind(_kept_up(lambda store: upkeep.vacuum(store, grace=timedelta(0))), (), 1),
    "retain": Kind(_retain, (6,), 1),
    "pin": Kind(_pin, (4,), 2),
    "query": Kind(_query, (), 1),
    "export": Kind(_export, (2,), 3),
}


@dataclass(frozen=True, slots=True)
class Step:
    """One thing that happens."""

    word: str
    numbers: tuple[int, ...]

    def __str__(self) -> str:
        return " ".join([self.word, *map(str, self.numbers)])

    def play(self, world: World) -> None:
        numbers = (*self.numbers, 0, 0, 0)[:3]
        KINDS[self.word].play(world, *numbers)


@dataclass(frozen=True, slots=True)
class Script:
    """A whole play: `at shards; rows A 1 3; …`."""

    place: Place
    steps: tuple[Step, ...]

    def __str__(self) -> str:
        return "; ".join([f"at {self.place.value}", *map(str, self.steps)])

    @classmethod
    def parsed(cls, text: str) -> Self:
        """What `str` has made."""
        first, *words = (step.split() for step in text.split(";") if step.strip())
        unknown = [word for word, *_ in words if word not in KINDS]
        if first[:1] != ["at"] or len(first) != 2 or unknown:
            places = ", ".join(each.value for each in Place)
            raise ValueError(
                f"{text!r} is no play: it begins with 'at', a place ({places}) and a semicolon; steps are "
                f"{', '.join(KINDS)}"
            )
        return cls(Place(first[1]), tuple(Step(word, tuple(map(int, numbers))) for word, *numbers in words))


def _learning() -> Callable[[World], object]:
    """Only where it is needed: scikit-learn takes seconds."""
    from tests.explore_store import learning

    return learning.prepare


def _nothing(_: World) -> None:
    pass


BETWEEN_NS: Final = 1_234_567  # two steps


def play(script: Script, folder: Path, s3: S3, known: Collection[str] = ()) -> World:
    """Play these steps, come to rest, and judge; raises `Wrong`, but of what is `known` already."""
    shards = 2 if script.place is Place.SHARDS else 1
    prepare = _learning() if any(step.word == "train" for step in script.steps) else _nothing
    with World(folder, shards, s3 if script.place is Place.S3 else None, known) as world:
        prepare(world)
        for step in script.steps:
            world.times.now_ns += BETWEEN_NS
            step.play(world)
        judging.judge(world)
    return world
