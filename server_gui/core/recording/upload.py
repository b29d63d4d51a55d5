"""One frozen segment into the store, exactly once, whatever happened before."""

import contextlib
import functools
import uuid
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import msgspec
import pyarrow as pa
import pyarrow.dataset

from gateway.amounts import counted
from ml.store import upkeep
from ml.store.errors import ColumnTaken, NoSuchTable
from ml.store.store import Store
from ml.store.tables import EVENTS, SESSIONS, TABLES, TELEMETRY, Table
from ml.store.translation import translated
from server_gui.core.recording import missing_rows
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.clocks import Moment
from server_gui.core.recording.columns import Columns
from server_gui.core.recording.errors import Contradicted, Damaged
from server_gui.core.recording.losses import told_time
from server_gui.core.recording.receipts import ANEW, Receipt, ReceiptPart, went_to
from server_gui.core.recording.rows import Record
from server_gui.core.recording.segment import DamagedRecord, DamagedRun, Segment
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.tally import Tally, tallied

_CUT: Final = -(1 << 62)  # the number of its event
_WHOLE: Final = _CUT - 1
_PLACED: Final = 3  # times that columns are placed anew


@dataclass(frozen=True, slots=True)
class Sent:
    """Rows of a segment that are in the store now; `lost` is the loss by its damage."""

    writer: str
    parts: tuple[ReceiptPart, ...]
    lost: tuple[str, ...]
    is_damaged: bool  # itself; what its log has lost is no longer in it


def send(spool: Spool, number: int, store: Store) -> None:
    """Bring a frozen segment of the spool into the store, and tell the spool; raises as `upload` does.

    One that is damaged is set aside, and raises `Damaged`: those after it may be sent. Of one where only runs
    or records are damaged all the rest is in the store then, and that these are lost.
    """
    try:
        with contextlib.closing(spool.read(number)) as segment:
            sent = upload(segment, spool.id, store)
    except Damaged as error:
        aside = spool.set_aside(number)
        text = f"{error}; it is kept as {aside.name}, and is not in the store as a whole"
        _tell(spool, number, text, store)
        raise Damaged(text) from error
    _tell_anew(spool, number, sent.parts, store)
    spool.receipts.add(Receipt(sent.writer, number, store.url, sent.parts, sent.lost))
    if sent.is_damaged:
        aside = spool.set_aside(number)
        raise Damaged(f"{'; '.join(sent.lost)}; {aside.name} is kept, and all else of it is in the store")
    spool.uploaded(number)


def lost_batches(spool: Spool, store: Store) -> list[str]:
    """Tell the store which batches are lost as a whole, each once; in words, those that were told now.

    Raises:
        StoreError: it is not known whether that is in the store.
        SpoolUnusable: the spool's disk refuses what is noted of it.

    """
    return [text for number, text in spool.untold().items() if _tell(spool, number, text, store)]


def _tell(spool: Spool, number: int, text: str, store: Store) -> bool:
    """Record an event for each robot of a lost batch; return False if the store has it already.

    One that was set aside gets a receipt too. Of one that is gone `gwrms cloud verify` finds none.
    """
    lost = _Lost(_WHOLE, text, tuple(sorted(spool.robots_beside(number))), None, None, {"batch": number})
    new = _append(spool, store, lost, spool.loss_name(number), number, number)
    if spool.is_aside(number):
        spool.receipts.add(Receipt(spool.id, number, store.url, (), (text,)))
    spool.told(number)
    return new


def _tell_anew(spool: Spool, number: int, parts: Sequence[ReceiptPart], store: Store) -> None:
    """Record an event if the store is not the one that earlier batches went to."""
    gone = sorted(spool.receipts.begun_anew(store.url, parts).items())
    if not gone:
        return
    sent = went_to(spool.receipts.whole(), store.url)
    count = len({(each.writer, each.batch) for each in sent})
    robots = {part.stream.robot for each in sent for part in each.parts if part.stream}
    text = (
        f"{counted(count, 'batch', 'batches')} of the spool {spool.folder} went to {store.url}, and that is "
        f"not the same store any more ({gone[0][0]} was begun anew with batch {number}): it was emptied, or "
        "another one is in its place. What is recorded goes to this one now; bring the earlier one back, or "
        "end the collector and run gwrms cloud mend, which brings again what the spool still has"
    )
    lost = _Lost(_WHOLE, text, tuple(sorted(robots)), None, None, {"batches": count})
    _append(spool, store, lost, f"{spool.id}/{ANEW}", number, gone[0][1])
    spool.notices.append(text)


def _append(spool: Spool, store: Store, lost: "_Lost", writer: str, number: int, named: object) -> bool:
    """Return the events that tell a loss, once, and their receipt; False where the store has them already."""
    origin = {"spool": writer, "batch": number}
    now_ns = Moment.now().utc_ns
    rows = EVENTS.rows([each.fields | origin | {"number": place} for place, each in lost.records(now_ns)])
    new = _bring(store, rows, f"{writer}.{named}")
    if not (new or _is_retained(spool, store, writer, number)):
        gone = missing_rows.of_rows(store, EVENTS, rows)
        new = gone.num_rows > 0 and _bring(store, gone, f"{writer}.{named}.{uuid.uuid4().hex[:12]}")
    if new:
        spool.receipts.add(Receipt(writer, number, store.url, (_told(store, writer, number),), (lost.text,)))
    return new


def _is_retained(spool: Spool, store: Store, writer: str, number: int) -> bool:
    """Return whether such events were removed because they were old."""
    until = upkeep.retained(store, EVENTS.name)
    sent = (each for each in spool.receipts.whole() if (each.writer, each.batch) == (writer, number))
    ends_us = [part.end_us for each in sent for part in each.parts if part.end_us is not None]
    return until is not None and bool(ends_us) and max(ends_us) < until.timestamp() * 1e6


def _bring(store: Store, rows: pa.Table, named: str) -> bool:
    return store.append(EVENTS, EVENTS.name, rows.schema, functools.partial(rows.to_reader, None), named, 1)


def _told(store: Store, writer: str, number: int) -> ReceiptPart:
    """Return the store's count of such events."""
    column = pyarrow.dataset.field
    mine = (column("spool") == writer) & (column("batch") == number)
    with translated(f"{store.url}/{EVENTS.name} cannot be read"):
        found = store.dataset(EVENTS.name).to_table(filter=mine)
    units = _units(store, EVENTS.name, found.schema)
    return tallied(found, EVENTS.name, store.identity(EVENTS.name), units)


def upload(segment: Segment, spool: str, store: Store) -> Sent:
    """Append everything in the segment to the store's tables; what is damaged, as events.

    Its number is the transaction's version in each table that it touches, and its own writer's name, or
    `spool` where it has none, the transaction's. Where a table knows the number, what it lacks of the segment
    is added. Interrupted anywhere, it is simply called again.

    Raises:
        StoreError: it is not known what of it is in the store.
        Contradicted: the store has something else by the same name.

    """
    writer = segment.writer or spool
    parts: list[ReceiptPart] = []
    for location, robots in _robots(segment, store).items():
        parts += _telemetry(segment, writer, store, location, robots)
    lost = [*map(_run_lost, segment.damaged()), *_records_lost(segment)]
    is_damaged = bool(lost)
    lost += _commits_lost(segment)
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    losses = (each for event in lost for each in event.records(segment.began_utc_ns))
    for number, record in (*segment.numbered(), *losses):
        origin = {"spool": writer, "batch": segment.number, "number": number}
        found[record.table].append(record.fields | origin)
    parts += [
        _rows(TABLES[name], TABLES[name].rows(rows), writer, segment.number, store)
        for name, rows in found.items()
    ]
    return Sent(writer, tuple(parts), tuple(event.text for event in lost), is_damaged)


def ahead(spool: Spool, store: Store) -> list[str]:
    """In words, where the store has batches of this spool that the spool itself has never had.

    Then somebody has put an older copy of the spool in its place. What is recorded now is kept apart.
    """
    found = []
    writers = spool.earlier_writers() | _openings(spool, store)
    for location in (*TELEMETRY.locations(store.about.shards), SESSIONS.name):
        with contextlib.suppress(NoSuchTable):
            store.mend(location)
            table = store.table(location)
            newest = max((table.transaction_version(each) or 0 for each in writers), default=0)
            if newest >= spool.first:
                found.append(
                    f"{store.url}/{location} has batch {newest} of the spool {spool.folder}, which had only "
                    f"{spool.first - 1} when it was opened: an older copy of it was put in its place, or "
                    "files were removed. What was not uploaded of them is lost; what is recorded now is not"
                )
    return found


def _openings(spool: Spool, store: Store) -> set[str]:
    """Return the names of this spool's other openings, even after a copy.

    Each begins sessions.
    """
    with contextlib.suppress(NoSuchTable):
        store.mend(SESSIONS.name)
        with translated(f"{store.url}/{SESSIONS.name} cannot be read"):
            names = store.dataset(SESSIONS.name).to_table(columns=["spool"])["spool"].unique().to_pylist()
        return {name for name in names if name and name.startswith(f"{spool.id}/")} - {spool.writer}
    return set()


def _telemetry(
    segment: Segment, writer: str, store: Store, location: str, robots: set[str]
) -> Iterable[ReceiptPart]:
    """Place the columns anew where another collector has just made one of them, in another unit."""
    for _ in range(_PLACED):
        with contextlib.suppress(ColumnTaken):
            return _placed(segment, writer, store, location, robots)
    return _placed(segment, writer, store, location, robots)


def _placed(
    segment: Segment, writer: str, store: Store, location: str, robots: set[str]
) -> Iterable[ReceiptPart]:
    layouts = (layout for robot, layout in segment.layouts() if robot in robots)
    columns = Columns(layouts, store.columns(location))
    tally = Tally()

    def batches() -> Iterator[pa.RecordBatch]:
        tally.clear()
        for run in segment.runs():
            if run.robot in robots:
                batch = columns.batch(run)
                tally.add(batch)
                yield batch

    if not store.append(TELEMETRY, location, columns.schema, batches, writer, segment.number):
        look = functools.partial(missing_rows.of_telemetry, store, location)
        _complete(store, TELEMETRY, location, writer, segment.number, lambda: look(batches()))
    return tally.parts(location, store.identity(location), _units(store, location, columns.schema))


def _rows(table: Table, data: pa.Table, writer: str, batch: int, store: Store) -> ReceiptPart:
    again = functools.partial(data.to_reader, None)
    if not store.append(table, table.name, data.schema, again, writer, batch):
        look = functools.partial(missing_rows.of_rows, store, table, data)
        _complete(store, table, table.name, writer, batch, lambda: look().to_batches())
    units = _units(store, table.name, data.schema)
    return tallied(data, table.name, store.identity(table.name), units)


def _units(store: Store, location: str, schema: pa.Schema) -> dict[str, str | None]:
    """Return the units of these columns in the table."""
    found = store.units(location)
    return {name: found[name] for name in schema.names if name in found}


def _complete(
    store: Store,
    table: Table,
    location: str,
    writer: str,
    batch: int,
    look: Callable[[], list[pa.RecordBatch]],
) -> None:
    """Bring what the table lacks of a batch whose number it knows, but for what retention has removed."""
    rows = missing_rows.newer(look(), store, location)
    if not rows:
        return
    named = missing_rows.name(writer, batch, rows)
    new = store.append(table, location, rows[0].schema, lambda: iter(rows), named, 1)
    if not new and missing_rows.newer(look(), store, location):
        count = sum(each.num_rows for each in rows)
        raise Contradicted(
            f"{store.url}/{location} had {count} rows of batch {batch}, which were removed since"
        )


@dataclass(frozen=True, slots=True)
class _Lost:
    """Something of a segment that its damage has taken; its events have numbers that no record has."""

    number: int
    text: str
    robots: tuple[str, ...]
    session: str | None
    connection: str | None
    data: dict[str, int]

    def records(self, utc_ns: int) -> Iterator[tuple[int, Record]]:
        """Yield the events that tell it, one a robot."""
        for place, robot in enumerate(self.robots or ("",)):
            fields = {
                "robot": robot,
                "session": self.session,
                "utc": utc_ns,
                "stamp_ns": None,
                "connection": self.connection,
                "kind": EventKind.LOST.value,
                "text": self.text,
                "data": msgspec.json.encode(self.data).decode(),
            }
            yield self.number - (place << 32), Record("events", fields)


def _run_lost(lost: DamagedRun) -> _Lost:
    text = (
        f"{lost.rows} rows of {lost.robot}, stream {lost.stream} from notification {lost.seq} on, "
        "were damaged in the spool and are not in the store"
    )
    data = {"rows": lost.rows, "stream": lost.stream, "seq": lost.seq}
    return _Lost(-2 * lost.number, text, (lost.robot,), lost.session, lost.connection, data)


def _records_lost(segment: Segment) -> Iterator[_Lost]:
    damaged = segment.damaged_records()
    times = [(number, record.fields.get("utc")) for number, record in segment.numbered()] if damaged else []
    for lost in damaged:
        near = [(abs(number - lost.number), utc_ns) for number, utc_ns in times if isinstance(utc_ns, int)]
        yield _record_lost(lost, segment.number, min(near, default=(0, segment.began_utc_ns))[1])


def _record_lost(lost: DamagedRecord, batch: int, about_ns: int) -> _Lost:
    whose = lost.robots[0] if len(lost.robots) == 1 else f"one of {', '.join(lost.robots) or 'no robot'}"
    text = (
        f"row {lost.number} of batch {batch}, of {whose}, from about {told_time(about_ns)} (a session, "
        "label, event or the like), was damaged in the spool and is not in the store"
    )
    return _Lost(-2 * lost.number - 1, text, lost.robots, None, None, {"rows": 1})


def _commits_lost(segment: Segment) -> list[_Lost]:
    commits = segment.cut_commits
    if not commits:
        return []
    text = (
        f"up to {commits} commits at the end of batch {segment.number} (rows of all robots, some 50 ms a "
        "commit) are lost: the log of the spool's file was damaged"
    )
    return [_Lost(_CUT, text, tuple(sorted(segment.robots())), None, None, {"commits": commits})]


def _robots(segment: Segment, store: Store) -> dict[str, set[str]]:
    """Return the robots whose rows go to each of the telemetry's locations."""
    robots = defaultdict(set)
    for robot, _ in segment.layouts():
        robots[TELEMETRY.location(robot, store.about.shards)].add(robot)
    return robots
