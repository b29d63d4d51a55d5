"""One frozen segment into the store, exactly once, whatever happened before."""

import contextlib
import functools
import time
from collections import defaultdict
from collections.abc import Iterator

import msgspec
import pyarrow as pa

from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY
from server_gui.core.recording.columns import Columns
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.gathering import EventKind
from server_gui.core.recording.rows import Record
from server_gui.core.recording.segment import DamagedRun, Segment
from server_gui.core.recording.spool import Spool


def send(spool: Spool, number: int, store: Store) -> None:
    """Bring a frozen segment of the spool into the store, and tell the spool; raises as `upload` does.

    One that is damaged is set aside, and raises `Damaged`: those after it may be sent. Of one where only runs
    are damaged all the rest is in the store then, and that these are lost.
    """
    try:
        with contextlib.closing(spool.read(number)) as segment:
            lost = upload(segment, spool.id, store)
    except Damaged as error:
        aside = spool.set_aside(number)
        raise Damaged(f"{error}; it is kept as {aside.name}, and its rows are not in the store") from error
    if lost:
        aside = spool.set_aside(number)
        raise Damaged(
            f"{'; '.join(map(_told, lost))}; {aside.name} is kept, and all else of it is in the store"
        )
    spool.uploaded(number)


def upload(segment: Segment, spool: str, store: Store) -> list[DamagedRun]:
    """Append everything in the segment to the store's tables; the runs that are damaged, as events.

    Its number is the transaction's version in each table that it touches, and `spool` the writer's name.
    Interrupted anywhere, it is simply called again.

    Raises:
        StoreError: it is not known what of it is in the store.

    """
    for location, robots in _robots(segment, store).items():
        _telemetry(segment, spool, store, location, robots)
    found = defaultdict(list)
    lost = segment.damaged()
    for number, record in enumerate([*segment.records(), *map(_event, lost)]):
        origin = {"spool": spool, "batch": segment.number, "number": number}
        found[record.table].append(record.fields | origin)
    for name, rows in found.items():
        data = TABLES[name].rows(rows)
        again = functools.partial(data.to_reader, None)
        store.append(TABLES[name], name, data.schema, again, spool, segment.number)
    return lost


def _told(lost: DamagedRun) -> str:
    return (
        f"{lost.rows} rows of {lost.robot}, stream {lost.stream} from notification {lost.seq} on, "
        "were damaged in the spool and are not in the store"
    )


def _event(lost: DamagedRun) -> Record:
    """That a run is lost, in its robot's recording."""
    data = {"rows": lost.rows, "stream": lost.stream, "seq": lost.seq}
    fields = {
        "robot": lost.robot,
        "session": lost.session,
        "utc": time.time_ns(),
        "stamp_ns": None,
        "connection": lost.connection,
        "kind": EventKind.LOST.value,
        "text": _told(lost),
        "data": msgspec.json.encode(data).decode(),
    }
    return Record("events", fields)


def _robots(segment: Segment, store: Store) -> dict[str, set[str]]:
    """The robots whose rows go to each of the telemetry's locations."""
    robots = defaultdict(set)
    for robot, _ in segment.layouts():
        robots[TELEMETRY.location(robot, store.about.shards)].add(robot)
    return robots


def _telemetry(segment: Segment, spool: str, store: Store, location: str, robots: set[str]) -> None:
    layouts = (layout for robot, layout in segment.layouts() if robot in robots)
    columns = Columns(layouts, store.units(location))

    def batches() -> Iterator[pa.RecordBatch]:
        return (columns.batch(run) for run in segment.runs() if run.robot in robots)

    store.append(TELEMETRY, location, columns.schema, batches, spool, segment.number)
