"""Rows of a batch that are missing in a store which knows the batch's number.

Usually nothing: a server was killed after the batch had arrived and before it knew. But a number may have
been used by other rows, or by the same batch when parts of it were damaged: then what is not there is still
to be brought, and what is there stays as it is.
"""

import hashlib
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset

from ml.store import checksums, upkeep
from ml.store.store import Store
from ml.store.tables import Table
from ml.store.translation import translated
from server_gui.core.recording.errors import Contradicted

TEXTS = ("robot", "session", "connection")  # alike in all rows of a run
_column = pyarrow.dataset.field
Hear = Callable[[str], object]  # what contradicts, in words


def refuse(text: str) -> None:
    """Bring nothing where something contradicts."""
    raise Contradicted(text)


def of_telemetry(
    store: Store, location: str, batches: Iterable[pa.RecordBatch], hear: Hear = refuse
) -> list[pa.RecordBatch]:
    """Return the rows of these runs that the table does not have; `hear` of one twice, or with other values.

    Raises:
        Contradicted: there is one, and nobody else wants to hear of it.

    """
    with translated(f"{store.url}/{location} cannot be read"):
        rows = store.dataset(location)
        found = [_lacking(rows, batch, f"{store.url}/{location}", hear) for batch in batches]
    return [batch for batch in found if batch.num_rows]


def of_rows(store: Store, table: Table, rows: pa.Table, hear: Hear = refuse) -> pa.Table:
    """Return the same of a batch's rows in another table."""
    mine = (_column("spool") == rows["spool"][0]) & (_column("batch") == rows["batch"][0])
    with translated(f"{store.url}/{table.name} cannot be read"):
        found = store.dataset(table.name).to_table(filter=mine)
    numbers = rows["number"].to_pylist()
    where = f"{store.url}/{table.name}"
    known = _once(found["number"].to_pylist(), checksums.of_rows(found).tolist(), where, hear)
    wrong = [
        number
        for number, ours in zip(numbers, checksums.of_rows(rows).tolist(), strict=True)
        if number >= 0 and known.get(number, ours) != ours  # below: losses, as they were told the first time
    ]
    if wrong:
        hear(
            f"{where} has something else as row {wrong[0]} of this batch; "
            f"so it has of {len(wrong)} of {len(numbers)} rows"
        )
    return rows.filter(pa.array([number not in known for number in numbers]))


def by_key(store: Store, location: str, batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return the rows of a run that the table does not have by their names alone, whatever columns it has."""
    with translated(f"{store.url}/{location} cannot be read"):
        found = store.dataset(location).to_table(columns=["seq", "row"], filter=_like(batch))
    known = set(_keys(found))
    return batch.filter(pa.array([key not in known for key in _keys(batch)]))


def newer(rows: Sequence[pa.RecordBatch], store: Store, location: str) -> list[pa.RecordBatch]:
    """Return those of them that retention does not mean to be gone; what has no time is never too old."""
    until = upkeep.retained(store, location) if rows else None
    if until is None:
        return list(rows)
    young = (pc.greater_equal(each["utc"], pa.scalar(until, each["utc"].type)) for each in rows)
    found = [each.filter(pc.fill_null(mask, True)) for each, mask in zip(rows, young, strict=True)]
    return [each for each in found if each.num_rows]


def name(writer: str, batch: int, rows: Sequence[pa.RecordBatch]) -> str:
    """Return a name for these rows that lets them be added only once."""
    keys = ("connection", "stream", "seq", "row") if "connection" in rows[0].schema.names else ("number",)
    told = repr([[each[key].to_pylist() for key in keys if key in each.schema.names] for each in rows])
    return f"{writer}/{batch}.{hashlib.blake2b(told.encode(), digest_size=8).hexdigest()}"


def numbers_alone(batch: pa.RecordBatch) -> tuple[pa.RecordBatch, dict[str, str]]:
    """Return a run's columns of numbers, and the texts that its rows have in common."""
    return batch.drop_columns(list(TEXTS)), {name: batch[name][0].as_py() for name in TEXTS}


def _lacking(rows: pyarrow.dataset.Dataset, batch: pa.RecordBatch, where: str, hear: Hear) -> pa.RecordBatch:
    mine, same = numbers_alone(batch)
    found = rows.to_table(columns=mine.schema.names, filter=_like(batch)).combine_chunks()
    [theirs] = found.to_batches() or [mine.slice(0, 0)]
    known = _once(_keys(theirs), checksums.of_numbers(theirs, same).tolist(), where, hear)
    keys = list(_keys(mine))
    wrong = [
        key
        for key, ours in zip(keys, checksums.of_numbers(mine, same).tolist(), strict=True)
        if known.get(key, ours) != ours
    ]
    if wrong:
        hear(
            f"{where} has other values in {len(wrong)} of {len(keys)} rows of {same['robot']}, session "
            f"{same['session']}, connection {same['connection']}, from notification {wrong[0][0]} on"
        )
    return batch.filter(pa.array([key not in known for key in keys]))


def _like(batch: pa.RecordBatch) -> pc.Expression:
    """Return the condition for rows of the same robot, session, connection, stream and time as this run."""
    extent = pc.min_max(batch["utc"])
    found = (_column("utc") >= extent["min"]) & (_column("utc") <= extent["max"])
    for key in (*TEXTS, "stream"):
        found &= _column(key) == batch[key][0]
    return found


def _keys(batch: pa.RecordBatch | pa.Table) -> Iterator[tuple[int, int]]:
    return zip(batch["seq"].to_pylist(), batch["row"].to_pylist(), strict=True)


def _once(keys: Iterable[Hashable], found: Sequence[int], where: str, hear: Hear) -> dict[Hashable, int]:
    known = dict(zip(keys, found, strict=True))
    if len(known) < len(found):
        hear(f"{where} has {len(found) - len(known)} rows of this batch twice")
    return known
