"""A store by its URL: tables that are appended to exactly once, by several servers at a time."""

import contextlib
import functools
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final, Self

import msgspec
import pyarrow as pa
import pyarrow.dataset
from deltalake import (
    ColumnProperties,
    CommitProperties,
    DeltaTable,
    PostCommitHookProperties,
    Transaction,
    WriterProperties,
    write_deltalake,
)
from deltalake import Schema as DeltaSchema
from deltalake.exceptions import CommitFailedError
from deltalake.transaction import AddAction
from pyarrow.fs import FileSystem

from ml.store import durable, torn, writing
from ml.store.errors import ColumnTaken, NoSuchTable, StoreError, StoreRefused, StoreUnreachable, UnsafeStore
from ml.store.files import filesystem
from ml.store.fragments import as_dataset
from ml.store.objects import RETRIES, Objects, s3_options
from ml.store.probe import probe
from ml.store.tables import ColumnFacts, Table
from ml.store.translation import translated
from ml.store.url import checked_url, default_url

ATTEMPTS: Final = 20  # races that an append may lose before it gives up
CHECKPOINT_EVERY: Final = 50  # commits; a reader never replays more log than this
ABOUT: Final = "store.json"
FORMAT: Final = 1  # of the store as a whole
# We make checkpoints ourselves, so that those in a folder are synchronised like everything else.
NO_HOOKS: Final = PostCommitHookProperties(create_checkpoint=False, cleanup_expired_logs=False)

Batches = Callable[[], Iterator[pa.RecordBatch]]


class About(msgspec.Struct, frozen=True):
    """Properties of a store, fixed when it is first used."""

    format: int = FORMAT
    shards: int = 1  # of sharded tables; see docs/explanation/scale.md
    several_writers: bool = True


class Store:
    """Tables under a `file://` or `s3://` URL; for one thread at a time.

    `shards` and `several_writers` count when the store is first used, and are kept in it.

    Raises:
        UnsafeStore: it cannot keep several writers apart, and was not said to have one alone.
        StoreError: it cannot be reached or used.

    """

    def __init__(self, url: str | None = None, shards: int = 1, several_writers: bool = True) -> None:
        self.url = checked_url(url or default_url())
        self.objects = Objects(self.url)
        self.folder = self.objects.folder
        self.about = self._about(About(shards=shards, several_writers=several_writers))
        if several_writers and not self.about.several_writers:
            raise UnsafeStore(
                f"the store {self.url} is for one writer alone: no other may open it for writing"
            )
        self._open: dict[str, DeltaTable] = {}
        self._lasting: dict[Path, int] = {}  # up to which version each table is known to last

    @classmethod
    def existing(cls, url: str | None = None) -> Self:
        """Open a store that has been used already, to read or tidy it; make nothing.

        Raises:
            NoSuchTable: there is none.

        """
        url = checked_url(url or default_url())
        if Objects(url).read(ABOUT) is None:
            raise NoSuchTable(
                f"there is no store at {url} yet: nothing has been uploaded to it (gwrms collect --upload)"
            )
        return cls(url, several_writers=False)

    def append(
        self, table: Table, location: str, schema: pa.Schema, batches: Batches, writer: str, sequence: int
    ) -> bool:
        """Append these batches as transaction `sequence` (1, 2, 3, …) of `writer`; False if it is there.

        However often it is repeated, after whatever failure, the rows are there once; in a folder they are
        synchronised when this returns. Columns that the table does not have are added to it.

        Raises:
            ColumnTaken: not with these columns; place them by `columns` again, and repeat it.
            StoreError: it is not known whether they were appended; repeat it.

        """
        files: list[AddAction] = []
        with translated(f"{self.url}/{location} cannot be written"):
            for _ in range(ATTEMPTS):
                delta = self._writable(table, location, schema)
                seen = delta.version()
                with self.unfinished(location):
                    try:
                        self._widen(delta, table, location, schema)
                        new = (delta.transaction_version(writer) or 0) < sequence
                        if new:
                            files = files or self._files(table, location, batches())
                            self._commit(delta, table, files, Transaction(writer, sequence))
                    except CommitFailedError:
                        continue  # another writer was faster, or we ourselves, when that seemed to fail
                    full = delta.version() // CHECKPOINT_EVERY > seen // CHECKPOINT_EVERY
                    self.make_last(location, delta, checkpoint=full)
                self._open[location] = delta
                return new
        raise StoreError(
            f"{self.url}/{location} cannot be written: {ATTEMPTS} times another writer was faster"
        )

    def add(self, table: Table, location: str, rows: pa.RecordBatchReader) -> None:
        """Add these rows, all at once, which the table does not have.

        Raises:
            StoreError: it is not known whether that was done; see which rows it lacks, and add those.

        """
        with translated(f"{self.url}/{location} cannot be written"):
            delta = self._writable(table, location, table.schema)
            with self.unfinished(location):
                write_deltalake(
                    delta,
                    rows,
                    mode="append",
                    schema_mode="merge",
                    writer_properties=writer_properties(rows.schema),
                    post_commithook_properties=NO_HOOKS,
                )
                self.make_last(location, delta)

    @functools.cached_property
    def files(self) -> FileSystem:
        """The store's files, for Arrow; for any thread."""
        with translated(f"the store {self.url} cannot be opened"):
            return filesystem(self.url)

    def table(self, location: str, version: int | None = None) -> DeltaTable:
        """Return the table as it is now, or was at `version`.

        Raises:
            NoSuchTable: nothing has been written there, or not that version.

        """
        try:
            with translated(f"{self.url}/{location}"):
                return DeltaTable(self._uri(location), version=version, storage_options=self._options())
        except (StoreUnreachable, StoreRefused):
            raise
        except NoSuchTable:
            if self._has_lost_its_log(location):
                raise StoreError(
                    f"{self.url}/{location} has files and no {durable.LOG}, which says which of them count: "
                    "bring that back from a copy of the store; without one, move the table elsewhere, and "
                    "gwrms cloud mend begins it anew with what the spool still has"
                ) from None
            raise
        except StoreError:
            found = None if self.folder is None else torn.find(self.folder / location)
            if found is None:
                raise
            raise StoreError(str(found)) from None

    def mend(self, location: str) -> None:
        """Set aside what a power cut has torn off, before anything is built on a table in a folder.

        What is there is made to last, whoever wrote it: that may have been killed before.

        Raises:
            StoreError: something else has damaged it, or it may just be written.

        """
        if self.folder is not None:
            with translated(f"{self.url}/{location} cannot be mended"):
                durable.synchronise([self.folder / ABOUT])
                torn.set_aside(self.folder / location)
                try:
                    self._synchronise(self.folder / location, torn.newest(self.folder / location))
                except ValueError:
                    raise StoreError(str(torn.find(self.folder / location))) from None

    def unfinished(self, location: str) -> AbstractContextManager[None]:
        """Around commits that `make_last` has not seen yet: nobody takes them for what a kill has left."""
        if self.folder is None:
            return contextlib.nullcontext()
        return durable.unfinished(self.folder / location)

    def make_last(self, location: str, delta: DeltaTable, *, checkpoint: bool = False) -> None:
        """Synchronise the table in a folder as it is known to `delta`; a checkpoint spares readers its log.

        Only then, so that no checkpoint knows more than its log after a power cut.
        """
        if self.folder is not None:
            self._synchronise(self.folder / location, delta.version())
        if checkpoint:
            delta.create_checkpoint()
            if self.folder is not None:
                log = self.folder / location / durable.LOG
                made = log / f"{delta.version():020}.checkpoint.parquet"
                durable.synchronise([made, log / torn.HINT])
                durable.mark([made])

    def dataset(self, location: str, version: int | None = None) -> pyarrow.dataset.Dataset:
        """Return the table's rows for pyarrow and duckdb, lazily; units are in the fields' metadata."""
        delta = self.table(location, version)
        with translated(f"{self.url}/{location}"):
            return as_dataset(delta, location, self.files)

    def units(self, location: str) -> dict[str, str | None]:
        """Return each column's unit, None where none was given; nothing where there is no table yet."""
        return {name: known.unit for name, known in self.columns(location).items()}

    def columns(self, location: str) -> dict[str, ColumnFacts]:
        """Return the facts about each column; empty if there is no table yet."""
        try:
            delta = self._open.get(location) or self.table(location)
        except NoSuchTable:
            return {}
        return _known(delta.schema())

    def identity(self, location: str) -> str:
        """Return the table's permanent identity, which copies of the store share."""
        return str((self._open.get(location) or self.table(location)).metadata().id)

    # --- inside

    def _synchronise(self, table: Path, newest: int) -> None:
        durable.make_last(table, newest, self._lasting.get(table, -1))
        self._lasting[table] = newest

    def _about(self, wanted: About) -> About:
        """Return the store's facts; a new store is probed first."""
        data = self.objects.read(ABOUT)
        if data is None:
            if self.folder is None and wanted.several_writers:
                probe(self.objects)
            self.objects.create(ABOUT, msgspec.json.encode(wanted))
            data = self.objects.read(ABOUT) or b""
        try:
            about = msgspec.json.decode(data, type=About)
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise StoreError(
                f"{self.url}/{ABOUT} is damaged: {error}; bring it back from a copy of the store, or write "
                '{"format":1,"shards":N,"several_writers":true} into it, N for the folders in telemetry'
            ) from error
        if about.format != FORMAT:
            raise StoreError(f"the store {self.url} has format {about.format}; this GWRMS reads {FORMAT}")
        return about

    def _has_lost_its_log(self, location: str) -> bool:
        """Return whether there are files of rows; a table's log is made before them."""
        names = [found.path for found in self.objects.listing(location)]
        return not any(f"/{durable.LOG}/" in name for name in names) and any(
            name.endswith(".parquet") for name in names
        )

    def _uri(self, location: str) -> str:
        return f"{self.url}/{location}"

    def _options(self) -> dict[str, str]:
        return {} if self.folder is not None else s3_options() | {"max_retries": str(RETRIES)}

    def _writable(self, table: Table, location: str, schema: pa.Schema) -> DeltaTable:
        delta = self._open.pop(location, None)  # whoever has changed it with success puts it back
        if delta is not None:
            return delta
        self.mend(location)
        try:
            return self.table(location)
        except NoSuchTable:
            return self._create(table, location, schema)

    def _create(self, table: Table, location: str, schema: pa.Schema) -> DeltaTable:
        delta = DeltaTable.create(
            self._uri(location),
            schema,
            mode="ignore",
            partition_by=list(table.partition_by),
            description=table.meaning,
            configuration={"delta.dataSkippingNumIndexedCols": str(table.indexed)},
            storage_options=self._options(),
        )
        self.make_last(location, delta)
        return delta

    def _files(self, table: Table, location: str, batches: Iterator[pa.RecordBatch]) -> list[AddAction]:
        """Return new files with these rows, in a folder already synchronised.

        A log never names what may vanish.
        """
        files = writing.write(self.objects, table, location, batches)
        if self.folder is not None:
            durable.synchronise(self.folder / location / file.path for file in files)
        return files

    def _widen(self, delta: DeltaTable, table: Table, location: str, schema: pa.Schema) -> None:
        """Add the columns that the table does not have."""
        known = {field.name: field.type for field in delta.schema().fields}
        wanted = DeltaSchema.from_arrow(schema).fields
        wrong = [field.name for field in wanted if known.get(field.name, field.type) != field.type]
        if wrong:
            raise StoreError(f"{self.url}/{location} has {', '.join(wrong)} of another type")
        self._check_units(delta, table, location, schema)
        new = [field for field in wanted if field.name not in known]
        if new:
            delta.alter.add_columns(new, post_commithook_properties=NO_HOOKS)

    def _check_units(self, delta: DeltaTable, table: Table, location: str, schema: pa.Schema) -> None:
        """Values in different units, or of two channels, never share a column, even a new one."""
        there, where = _known(delta.schema()), f"{self.url}/{location}"
        for name, (unit, channel) in _known(DeltaSchema.from_arrow(schema)).items():
            known = there.get(name, ColumnFacts(unit))
            if name not in table.schema.names and known.unit != unit:
                raise ColumnTaken(
                    f"{where} has {name} in {known.unit or 'no unit'}, and it was to be written in "
                    f"{unit or 'no unit'}: look at its units again, and upload again"
                )
            if None not in (channel, known.channel) and known.channel != channel:
                raise ColumnTaken(
                    f"{where} has {known.channel} in the column {name}, to which {channel} was to be "
                    "written: look at its columns again, and upload again"
                )

    def _commit(
        self, delta: DeltaTable, table: Table, files: list[AddAction], transaction: Transaction
    ) -> None:
        delta.create_write_transaction(
            [*files],
            "append",
            delta.schema(),
            list(table.partition_by),
            commit_properties=CommitProperties(app_transactions=[transaction]),
            post_commithook_properties=NO_HOOKS,
        )
        delta.update_incremental()


def _known(schema: DeltaSchema) -> dict[str, ColumnFacts]:
    fields = msgspec.json.decode(schema.to_json())["fields"]  # asked one by one, each is decoded twice
    return {
        each["name"]: ColumnFacts(each["metadata"].get("unit"), each["metadata"].get("channel"))
        for each in fields
    }


def writer_properties(schema: pa.Schema) -> WriterProperties:
    """Return how Parquet is written: measured in docs/adr/0009."""
    plain = ColumnProperties(dictionary_enabled=False, statistics_enabled="CHUNK")
    split = ColumnProperties(
        dictionary_enabled=False, statistics_enabled="CHUNK", encoding="BYTE_STREAM_SPLIT"
    )
    numbers: dict[str, Any] = {field.name: split for field in schema if pa.types.is_float64(field.type)}
    return WriterProperties(
        compression="ZSTD",
        compression_level=1,
        max_row_group_size=writing.ROW_GROUP,
        default_column_properties=plain,
        column_properties=numbers,
    )
