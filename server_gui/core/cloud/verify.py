"""Whether everything is there: every file of every table, and every batch that the spool has sent."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import pyarrow.parquet as pq

from ml.store import reading
from ml.store.errors import NoSuchTable, StoreError, translated
from ml.store.fragments import DataFile
from ml.store.sessions import footer
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY
from server_gui.core.cloud import spooled
from server_gui.core.recording.errors import Damaged

Advance = Callable[[int], object]
AT_ONCE: Final = 4  # files


def files(store: Store) -> list[DataFile]:
    """Every file that the newest versions of the tables consist of."""
    return [file for table in TABLES.values() for file in reading.files(store, table)]


def damages(store: Store, wanted: Sequence[DataFile], advance: Advance, *, deep: bool) -> Iterator[str]:
    """What is wrong with these files, in words: absent, of another size, unreadable, other rows.

    Each file's footer is read, and with `deep` every value.
    """
    sizes = {found.path: found.size_bytes for found in store.objects.listing()}

    def check(file: DataFile) -> str | None:
        problem = _damage(store, file, sizes.get(f"{file.location}/{file.path}"), deep=deep)
        advance(1)
        return problem

    with ThreadPoolExecutor(AT_ONCE, "verify") as pool:
        yield from filter(None, pool.map(check, wanted))


def _damage(store: Store, file: DataFile, size_bytes: int | None, *, deep: bool) -> str | None:
    name = f"{store.url}/{file.location}/{file.path}"
    if size_bytes is None:
        return f"{name} is not there: {file.rows} rows are lost"
    if size_bytes != file.size_bytes:
        return f"{name} has {size_bytes} bytes instead of {file.size_bytes}"
    try:
        rows = _decoded(store, file) if deep else footer(store, file).num_rows
    except StoreError as error:
        return str(error)
    return None if rows == file.rows else f"{name} has {rows} rows instead of {file.rows}"


def _decoded(store: Store, file: DataFile) -> int:
    """How many rows it has, each of which was read."""
    name = f"{file.location}/{file.path}"
    with translated(f"{store.url}/{name} cannot be read"), store.files.open_input_file(name) as opened:
        return sum(batch.num_rows for batch in pq.ParquetFile(opened).iter_batches())


def batches_missing(store: Store, spool: Path) -> Iterator[str]:
    """The spool's batches that are marked as uploaded, and are not in every table that they belong to."""
    known: dict[tuple[str, str], int] = {}
    for number in spooled.uploaded(spool):
        try:
            batch = spooled.batch(spool, number)
        except Damaged as error:
            yield str(error)
            continue
        for location in _locations(store, batch):
            if (location, batch.writer) not in known:
                known[location, batch.writer] = _newest(store, location, batch.writer)
            if known[location, batch.writer] < batch.number:
                yield f"batch {batch.number} of the spool {spool} is not in {store.url}/{location}"


def _locations(store: Store, batch: spooled.Batch) -> list[str]:
    telemetry = {TELEMETRY.location(robot, store.about.shards) for robot in batch.robots}
    return sorted(telemetry | batch.tables)


def _newest(store: Store, location: str, writer: str) -> int:
    """Up to which of the writer's batches the table has everything."""
    try:
        return store.table(location).transaction_version(writer) or 0
    except NoSuchTable:
        return 0
