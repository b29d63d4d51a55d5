"""Whether what the store has is what was handed in: each once, in its right name, or told as lost."""

import contextlib
import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

from ml.store import Store, StoreError, upkeep
from ml.store.snapshot import Snapshot
from ml.store.tables import EVENTS, TELEMETRY
from server_gui.core.cloud import verify
from server_gui.core.recording.batching import EventKind
from tests.explore_store import damages, exporting, said, telling
from tests.explore_store.ledger import Fate, Row
from tests.explore_store.robots import ANGLE, NO_DIMENSION, RATIO
from tests.explore_store.server import Server
from tests.explore_store.there import Line, There, identity, number_of, rows_of, spool_of, values_of
from tests.explore_store.world import TORN, World
from tests.explore_store.wrong import Wrong

ATTEMPTS = 3  # at an upload, of a server that is well
ROUNDED_NS = 2_000  # the store's times are microseconds
_NUMBERS = re.compile(r"\bbatch(?:es)? (\d+(?: to \d+)?(?:, \d+(?: to \d+)?)*)|/(\d{8})\.")


def retire(world: World, before_ns: int) -> None:
    """These rows may go."""
    world.retained_ns = max(before_ns, world.retained_ns or before_ns)
    for row in world.ledger.rows():
        if row.utc_ns(min(row.walls_ns)) < before_ns:
            row.fate = Fate.OPEN


def roll_back(world: World, server: Server) -> None:
    """A server's spool is an older one: of what was acknowledged only what is in the store must be there."""
    try:
        store = Store.existing(world.url)
        lines, events = rows_of(store, TELEMETRY), rows_of(store, EVENTS)
    except StoreError:
        lines, events = [], []
    there = {number_of(line) for line in lines}
    for thing in world.ledger.things:
        if thing.server == server.name:
            thing.batch = 0
            if not (isinstance(thing, Row) and thing.number in there):
                thing.fate = Fate.OPEN
    for loss in world.ledger.losses:
        loss.told &= loss.server != server.name
    server.rolled_back = True
    server.spoilt.clear()
    server.told_before = Counter(line["batch"] for line in events if telling.is_of_a_batch(line, server))
    server.damaged = set(server.copied_damaged)


def judge(world: World) -> None:
    """Let everything come to rest, and look."""
    rest(world)
    if not any(True for _ in world.safe()):
        world.store()  # nobody needs to have made it
    problems = _problems(world)
    there = There(Snapshot.existing(world.url))  # nobody writes any more: each table is opened once
    for server in world.lived:
        _verify_is_right(world, server, problems[server.name])
    lacks = telemetry(world, there)
    for server in world.lived:
        _lacks_are_told(world, server, there, lacks, problems[server.name])
        telling.spoilt(world, server, there, blamed(problems[server.name]))
        telling.losses(world, server, there)
    telling.events(world, there)
    said.records(world, there)
    for server in world.lived:
        exporting.exports(world, server)
    for look in world.looks:
        look(world, there.store)
    for location, version, rows in world.pinned:
        found = rows_of_version(there.store, location, version)
        world.check(found == rows, "a pinned version has other rows", location, version, found, rows)
    _damage(world, problems)


def rest(world: World) -> None:
    """No more faults: every server ends as it should, and a new one brings what it has left."""
    world.disk.disarm()
    if world.s3 is not None:
        world.s3.disarm()
    for server in world.lived:
        world.times.sleep(2.0)
        with world.alive(server.name):
            for _ in range(ATTEMPTS - 1):  # to end is the last one
                server.upload()
            server.stop()
            problem = server.uploader.state.problem
            world.check(problem is None, f"server {server.name} cannot upload", problem)


# --- verify


def verified(store: Store, server: Server) -> list[str]:
    """What `gwrms cloud verify` says is wrong."""
    return [*verify.whole(store, server.folder, lambda _: contextlib.nullcontext(lambda _: None)).problems]


def blamed(problems: Sequence[str]) -> set[int]:
    """The batches that these name."""
    found: set[int] = set()
    for told, file in (each for problem in problems for each in _NUMBERS.findall(problem)):
        for run in told.split(", ") if told else [file]:
            first, _, last = run.partition(" to ")
            found |= set(range(int(first), int(last or first) + 1))
    return found


def _problems(world: World) -> dict[str, list[str]]:
    """What verify says of each server; what it says of torn files is done before."""
    store = Snapshot.existing(world.url)
    found = {server.name: verified(store, server) for server in world.lived}
    if world.disk.cuts and any(TORN[0] in problem for some in found.values() for problem in some):
        upkeep.compact(Store.existing(world.url))
        store = Snapshot.existing(world.url)
        found = {server.name: verified(store, server) for server in world.lived}
    return found


def _verify_is_right(world: World, server: Server, problems: Sequence[str]) -> None:
    """It finds damage in the batches alone that somebody has damaged."""
    wrong = [each for each in problems if not (server.ever_damaged and blamed([each]) <= server.ever_damaged)]
    world.check(not wrong, "verify finds damage where there is none", wrong)


def _lacks_are_told(
    world: World, server: Server, there: There, lacks: Sequence[Row], problems: Sequence[str]
) -> None:
    """Of each batch of which rows are missing an event tells, or verify; but for its newest commit."""
    told = {line["batch"] for line in there.events(EventKind.LOST) if spool_of(line) == identity(server)}
    for batch in {row.batch for row in lacks if row.server == server.name} - told - blamed(problems):
        things = (each for each in world.ledger.things if (each.server, each.batch) == (server.name, batch))
        newest = max(each.turn for each in things)
        gone = [row for row in lacks if (row.server, row.batch) == (server.name, batch) and row.turn < newest]
        world.check(not gone, "rows are missing, and nobody tells of it", batch, gone)


def _damage(world: World, problems: Mapping[str, Sequence[str]]) -> None:
    """Somebody damages the store, and verify says so."""
    if world.damage is None or world.s3 is not None:
        return
    spools = [server.folder for server in world.lived]
    all_proven = world.retained_ns is None and not any(server.rolled_back for server in world.lived)
    store = Store.existing(world.url)
    if not damages.do(store, world.damage, spools, _proven(world), all_proven=all_proven):
        return
    store = Snapshot.existing(world.url)
    new = [each for server in world.lived for each in verified(store, server)
           if each not in problems[server.name]]  # fmt: skip
    world.check(bool(new), "verify does not find a damage", damages.NAMES[world.damage])


def _proven(world: World) -> set[int]:
    """The rows of which verify knows that they must be there.

    Of a batch's stream of which retention may have removed rows it does not count the others; of a batch that
    was damaged before it had its receipt it tells the loss, and what had arrived of it stands nowhere.
    """
    rows, until_ns = list(world.ledger.rows()), world.retained_ns or 0
    cut = {(row.link, row.stream, row.batch) for row in rows if row.utc_ns(min(row.walls_ns)) < until_ns}
    return {
        row.number for row in rows if row.sure and row.batch and (row.link, row.stream, row.batch) not in cut
    }


def rows_of_version(store: Store, location: str, version: int) -> int:
    """How many rows a pinned version has, each of which is read."""
    try:
        return int(store.dataset(location, version).to_table().num_rows)
    except (StoreError, OSError) as error:
        raise Wrong(f"a version is pinned and cannot be read: {error}") from None


# --- telemetry


def telemetry(world: World, there: There) -> list[Row]:
    """Each row once, under its robot, session, time and unit; which are missing of damaged files."""
    known = {row.number: row for row in world.ledger.rows()}
    strange = sorted(there.rows.keys() - known.keys())
    world.check(not strange, "rows that nobody has sent", strange)
    for number, lines in there.rows.items():
        world.check(len(lines) <= 1, "a row is there more than once", len(lines), known[number])
        _is(world, known[number], lines[0], there.units)
    _times(world, known, there)
    lacks = [row for row in known.values() if row.fate is Fate.SAFE and row.number not in there.rows]
    for row in lacks:
        world.check(row.harmed, "a row was acknowledged and is not there", row)
    return lacks


def _is(world: World, row: Row, line: Line, units: Mapping[str, str | None]) -> None:
    said = {name: line[name] for name in ("robot", "session", "stream", "seq", "row", "stamp_ns")}
    meant = (row.robot, row.session, row.stream, row.seq, row.place, row.stamp_ns)
    world.check(tuple(said.values()) == meant, "a row is misnamed", said, meant)
    times = {row.utc_ns(wall_ns) for wall_ns in row.walls_ns}
    world.check(
        telling.ns(line["utc"]) in times, "a row has a time that no clock of its server had", line["utc"], row
    )
    for channel, value, unit in ((ANGLE, row.angle, row.unit), (RATIO, row.ratio, NO_DIMENSION)):
        found = values_of(line, channel)
        world.check(list(found.values()) == ([] if value is None else [value]),
                    "a row has another value", row.number, found, value)  # fmt: skip
        for name in found:
            world.check(unit in (units[name], None), "a row stands in a column of another unit",
                        row.number, name, units[name], unit)  # fmt: skip


def _times(world: World, known: Mapping[int, Row], there: There) -> None:
    """Whoever sets a clock: in a connection no row moves against another of its stream."""
    offsets: dict[Any, set[int]] = defaultdict(set)
    for number, lines in there.rows.items():
        row = known[number]
        offsets[row.link, row.stream].update(
            telling.ns(line["utc"]) - line["stamp_ns"] // 1000 * 1000 for line in lines
        )
    for name, some in offsets.items():
        world.check(
            max(some) - min(some) <= ROUNDED_NS,
            "rows of a connection have moved against each other",
            name,
            some,
        )
