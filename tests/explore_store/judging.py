"""Whether what the store has is what was handed in: each once, in its right name, or told as lost."""

import contextlib
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from datetime import datetime
from typing import Any

import msgspec

from ml.store import NoSuchTable, Store, StoreError, reading, sessions
from ml.store.labels import holding, utc_ns
from ml.store.snapshot import Snapshot
from ml.store.tables import EVENTS, JOURNAL, LABELS, TELEMETRY, Table
from server_gui.core.cloud import verify
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.errors import RecordingError
from tests.explore_store import damages
from tests.explore_store.ledger import Amended, Entry, Fate, Mark, Row, Said
from tests.explore_store.robots import ANGLE, COUNT
from tests.explore_store.server import Server
from tests.explore_store.world import World

ATTEMPTS = 3  # at an upload, of a server that is well
LENGTH_OF_AN_ID = 36
ROUNDED_NS = 2_000  # the store's times are microseconds
TOLD = frozenset({EventKind.LOST.value, EventKind.REFUSED.value})


class Wrong(AssertionError):
    """Something that was acknowledged is lost, doubled or misnamed, and no event tells of it."""


def check(holds: bool, sentence: str, *found: object) -> None:
    if not holds:
        raise Wrong(": ".join([sentence, *map(str, found)]))


def retire(world: World, before: datetime) -> None:
    """These rows may go."""
    for row in world.ledger.rows():
        if row.true_ns + min(world.servers[row.server].walls_ns) < utc_ns(before):
            row.fate = Fate.OPEN


def roll_back(world: World, server: Server) -> None:
    """A server's spool is an older one: of what was acknowledged only what is in the store must be there."""
    try:
        lines = rows_of(Store.existing(world.url), TELEMETRY)
    except StoreError:
        lines = []
    there = {int(line[name]) for line in lines for name in line if name == COUNT and line[name] is not None}
    for thing in world.ledger.things:
        if thing.server == server.name and not (isinstance(thing, Row) and thing.number in there):
            thing.fate = Fate.OPEN
    for loss in world.ledger.losses:
        loss.told &= loss.server != server.name


def judge(world: World) -> None:
    """Let everything come to rest, and look."""
    rest(world)
    if not any(True for _ in world.safe()):
        world.store()  # nobody needs to have made it
    store = Snapshot.existing(world.url)  # nobody writes any more: each table is opened once
    problems = {name: verified(store, server) for name, server in world.servers.items()}
    for name, server in world.servers.items():
        check(server.damaged or not problems[name], "verify finds damage where there is none", problems[name])
    lacks = telemetry(world, store)
    for name, server in world.servers.items():
        told = any(_tells(line, server) for line in rows_of(store, EVENTS))
        check(
            bool(problems[name]) or told or server.name not in lacks,
            "rows are missing, and nobody tells of it",
            lacks,
        )
    for name, server in world.servers.items():
        _losses(server, world, store)
        _spoilt(server, store, problems[name])
    _records(world, store)
    _sessions(world, store)
    for server in world.servers.values():
        exports(world, server)
    for look in world.looks:
        look(world, store)
    for location, version, rows in world.pinned:
        found = rows_of_version(store, location, version)
        check(found == rows, "a pinned version has other rows", location, version, found, rows)
    if (
        world.damage is not None
        and not world.retained
        and world.s3 is None
        and damages.do(
            Store.existing(world.url), world.damage, [server.folder for server in world.servers.values()]
        )
    ):
        store = Snapshot.existing(world.url)
        seen = [problem for server in world.servers.values() for problem in verified(store, server)]
        check(bool(seen), "verify does not find a damage", damages.NAMES[world.damage])


def verified(store: Store, server: Server) -> list[str]:
    """What `gwrms cloud verify` says is wrong."""
    return [*verify.whole(store, server.folder, lambda _: contextlib.nullcontext(lambda _: None)).problems]


def rest(world: World) -> None:
    """No more faults: every server ends as it should, and a new one brings what it has left."""
    world.disk.disarm()
    if world.s3 is not None:
        world.s3.disarm()
    for name, server in world.servers.items():
        world.times.sleep(2.0)
        with world.alive(name):
            server.cut()
            for _ in range(ATTEMPTS):
                if server.upload():
                    break
            server.stop()
            problem = server.uploader.state.problem
            check(problem is None, f"server {name} cannot upload", problem)


def rows_of_version(store: Store, location: str, version: int) -> int:
    """How many rows a pinned version has, each of which is read."""
    try:
        return int(store.dataset(location, version).to_table().num_rows)
    except (StoreError, OSError) as error:
        raise Wrong(f"a version is pinned and cannot be read: {error}") from None


def rows_of(store: Store, table: Table) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = reading.dataset(store, table).to_table().to_pylist()
    return found


# --- telemetry


def telemetry(world: World, store: Store) -> set[str]:
    """Each row once, under its robot, session, time and unit; which damaged spools' rows are missing."""
    units = {**reading.units(store, TELEMETRY)}
    found: dict[int, list[dict[str, Any]]] = defaultdict(list)
    for line in rows_of(store, TELEMETRY):
        count = next((line[name] for name in line if name.startswith(COUNT) and line[name] is not None), None)
        found[int(count or 0)].append(line)
    known = {row.number: row for row in world.ledger.rows()}
    check(found.keys() <= known.keys(), "rows that nobody has sent", sorted(found.keys() - known.keys()))
    for number, row in known.items():
        lines = found.get(number, [])
        check(len(lines) <= 1, "a row is there more than once", len(lines), row)
        for line in lines:
            _is(row, line, units, world.servers[row.server])
    _times(known, found)
    lacks = {row.server for row in known.values() if row.fate is Fate.SAFE and row.number not in found}
    for number, row in known.items():
        if row.fate is Fate.SAFE and number not in found and not world.servers[row.server].damaged:
            raise Wrong(f"a row was acknowledged and is not there: {row}")
    for loss in world.ledger.losses:
        gone = [each for each in loss.things if isinstance(each, Row) and each.number not in found]
        gone = [each for each in gone if each.fate is Fate.COUNTED]
        damaged = world.servers[loss.server].damaged
        check(damaged or len(gone) <= loss.rows, "more rows are lost than were counted", len(gone), loss.rows)
    return lacks


def _is(row: Row, line: Mapping[str, Any], units: Mapping[str, str | None], server: Server) -> None:
    said = {name: line[name] for name in ("robot", "session", "seq", "row", "stamp_ns")}
    meant = dict(zip(said, (row.robot, row.session, row.seq, row.place, row.stamp_ns), strict=True))
    check(said == meant, "a row is misnamed", said, meant)
    times = {(row.true_ns + wall_ns) // 1000 * 1000 for wall_ns in server.walls_ns}
    check(utc_ns(line["utc"]) in times, "a row has a time that no clock ever had", line["utc"], row)
    angles = {name: line[name] for name in line if name.startswith(ANGLE) and line[name] is not None}
    check(list(angles.values()) == ([] if row.angle is None else [row.angle]),
          "a row has another value", row.number, angles, row.angle)  # fmt: skip
    for name in angles:
        check(row.unit in (units[name], None), "a row stands in a column of another unit",
              row.number, name, units[name], row.unit)  # fmt: skip


def _times(known: Mapping[int, Row], found: Mapping[int, list[dict[str, Any]]]) -> None:
    """Whoever sets a clock: in a connection no row moves against another."""
    offsets: dict[Any, set[int]] = defaultdict(set)
    for number, lines in found.items():
        offsets[known[number].link].update(
            utc_ns(line["utc"]) - line["stamp_ns"] // 1000 * 1000 for line in lines
        )
    for link, some in offsets.items():
        check(
            max(some) - min(some) <= ROUNDED_NS,
            "rows of a connection have moved against each other",
            link,
            some,
        )


def _tells(line: Mapping[str, Any], server: Server) -> bool:
    """Whether an event tells of a loss of this server."""
    return line["kind"] in TOLD and spool_of(line) == _identity(server)


def _spoilt(server: Server, store: Store, problems: list[str]) -> None:
    """Batches that were lost as they waited are told by an event each, and verify says so too."""
    told = {
        msgspec.json.decode(line["data"]).get("batch")
        for line in rows_of(store, EVENTS)
        if _tells(line, server)
    }
    check(server.spoilt <= told, "a batch is lost as a whole, and no event tells of it", server.spoilt - told)
    check(bool(problems) or not server.spoilt, "a batch is lost as a whole, and verify says nothing of it")


def _losses(server: Server, world: World, store: Store) -> None:
    """What was counted as lost is told by an event."""
    told = [line for line in rows_of(store, EVENTS) if _tells(line, server)]
    for loss in world.ledger.losses:
        if loss.server == server.name and loss.told and not server.damaged:
            check(bool(told), "rows were lost, and no event tells of it", loss.rows)


def spool_of(line: Mapping[str, Any]) -> str:
    """Whose row it is: the spool's own name, without that of its opening."""
    return str(line["spool"])[:LENGTH_OF_AN_ID]


def _identity(server: Server) -> str:
    return (server.folder / "id").read_text().strip()


# --- the other tables


def _records(world: World, store: Store) -> None:
    marks = Counter(line["text"] for line in rows_of(store, EVENTS) if line["kind"] == "marker")
    labels = holding(rows_of(store, LABELS))
    entries = Counter(
        (spool_of(line), line["robot"], line["n"], line["hash"]) for line in rows_of(store, JOURNAL)
    )
    check(not marks or max(marks.values()) == 1, "a marker is there twice", marks)
    rolled = any(server.rolled_back for server in world.servers.values())
    check(
        not entries or rolled or max(entries.values()) == 1, "an entry of a journal is there twice", entries
    )
    for thing in world.safe():
        server = world.servers[thing.server]
        if server.damaged:
            continue
        if isinstance(thing, Mark):
            check(marks[f"mark {thing.number}"] == 1, "a marker was acknowledged and is not there", thing)
        if isinstance(thing, Entry):
            key = (_identity(server), thing.robot, thing.n, thing.hash)
            check(entries[key] >= 1, "an entry of a journal was acknowledged and is not there", thing)
    _labels(
        world,
        {
            (line["robot"], line["session"], line["label"], utc_ns(line["utc"]), utc_ns(line["ended"]))
            for line in labels
        },
    )


def _labels(world: World, hold: set[tuple[str, str, str, int, int]]) -> None:
    """The last that was said of a label holds."""
    said: dict[tuple[str, str, str, int, int], list[Said]] = defaultdict(list)
    for thing in world.ledger.things:
        if isinstance(thing, Said):
            key = (thing.robot, thing.session, thing.label, thing.began_ns, thing.ended_ns)
            said[key].append(thing)
    check(hold <= said.keys(), "labels hold that nobody has given", hold - said.keys())
    for key, things in said.items():
        newest = things[-1]
        if newest.fate is Fate.SAFE and not world.servers[newest.server].damaged:
            check((key in hold) != newest.removed, "a label holds that was removed, or does not", newest)


def _sessions(world: World, store: Store) -> None:
    """Each session with rows is listed, and says what was said of it last."""
    listed, losses = (
        {(each.robot, each.session): each for each in sessions.sessions(store)},
        world.ledger.losses,
    )
    for row in world.ledger.rows():
        server = world.servers[row.server]
        if row.fate is Fate.SAFE and not server.damaged:
            check((row.robot, row.session) in listed, "a session with rows is not listed", row)
            notes = listed[row.robot, row.session].notes
            told = server.rolled_back or any(loss.server == row.server and not loss.told for loss in losses)
            check(told or notes != sessions.UNTOLD, "a session with rows is not told of", row)
    newest = {
        (thing.robot, thing.session): thing
        for thing in world.ledger.things if isinstance(thing, Amended)
    }  # fmt: skip
    for key, thing in newest.items():
        if thing.fate is Fate.SAFE and not world.servers[thing.server].damaged:
            check(key in listed, "a session that was acknowledged is not listed", thing)
            found = listed[key].parameters
            check(found == {"value": thing.value}, "a session says not what was said last", thing, found)


# --- as people read it


def exports(world: World, server: Server) -> None:
    """A session's export has each of its rows once, connection by connection in its order."""
    world.times.wall_ns = server.wall_ns
    try:
        known = Recordings(world.url, server.folder)
        for session in known.sessions():
            _export(world, server, known, session)
    except (NoSuchTable, RecordingError):
        return
    except StoreError as error:
        # A torn entry is set aside by whoever writes next; who reads before that is told so.
        if not (server.damaged or "was never acknowledged: the next upload" in str(error)):
            raise


def _export(world: World, server: Server, known: Recordings, session: sessions.Session) -> None:
    found = list(_exported(known, session))
    mine = {
        row.number: row for row in world.ledger.rows()
        if (row.robot, row.session) == (session.robot, session.session)
    }  # fmt: skip
    check(set(found) <= mine.keys(), "an export has rows of others", sorted(set(found) - mine.keys()))
    check(len(found) == len(set(found)), "an export has rows twice", found)
    wanted = {
        number for number, row in mine.items()
        if row.fate is Fate.SAFE and row.server == server.name and not server.damaged
    }  # fmt: skip
    check(wanted <= set(found), "an export lacks rows", session.session, sorted(wanted - set(found)))
    orders: dict[Any, list[int]] = defaultdict(list)
    for number in found:
        orders[mine[number].link].append(number)
    for link, numbers in orders.items():
        check(numbers == sorted(numbers), "an export has rows in another order", link, numbers)


def _exported(known: Recordings, session: sessions.Session) -> Iterator[int]:
    recorded = known.open(session)
    names = [each.name for each in recorded.channels if each.name.startswith(COUNT)]
    for table in recorded.telemetry(names):
        for line in table.to_pylist():
            yield next(int(line[name]) for name in names if line[name] is not None)
