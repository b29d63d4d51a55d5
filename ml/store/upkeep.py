"""Keeping a store in order: small files become few, old rows go, what a model names stays."""

import contextlib
import functools
import hashlib
import itertools
import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final, TypeVar
from urllib.parse import unquote

import msgspec
import pyarrow as pa
import pyarrow.dataset
from deltalake import DeltaTable
from deltalake.exceptions import CommitFailedError
from pyarrow.dataset import ParquetFileFragment, get_partition_keys

from ml.store import reading
from ml.store.compaction_lock import alone
from ml.store.errors import NoSuchTable, StoreError, StoreRefused
from ml.store.fragments import as_dataset
from ml.store.store import NO_HOOKS, Store, writer_properties
from ml.store.tables import TABLES, Table
from ml.store.translation import translated

TARGET_BYTES: Final = 256 << 20  # of a file that compaction makes
GRACE: Final = timedelta(
    days=7
)  # a file that nobody needs any more stays so long, for whoever still reads it
ATTEMPTS: Final = 10  # to compact a table, or remove rows of it, while others do
LOOKED_BACK: Final = 20  # versions, from the newest on, for one that can be pinned
_PINS: Final = "pins"
_RETAINED: Final = "retained"
_INSTANT: Final = "%Y%m%dT%H%M%S.%fZ"
Done = TypeVar("Done")


class Pin(msgspec.Struct, frozen=True):
    """A version of a table that `by`, a model for example, was made from."""

    location: str
    version: int
    by: str


@dataclass(frozen=True, slots=True)
class Compacted:
    """Effect of a compaction on one table."""

    location: str
    files_before: int
    files_after: int


def pin(store: Store, location: str, version: int, by: str) -> None:
    """Keep this version of the table readable until `unpin`.

    Raises:
        NoSuchTable: it is not there, or files of it are gone; the message says which versions are whole.

    """
    named = Pin(location, version, by)
    delta, path = store.table(location, version), _path(named)
    _check_whole(store, location, delta)
    new = store.objects.create(path, msgspec.json.encode(named))  # a vacuum that begins now knows of it
    try:
        _check_whole(store, location, delta)
    except NoSuchTable:
        if new:
            store.objects.remove(path)
        raise


def _check_whole(store: Store, location: str, delta: DeltaTable) -> None:
    there = set(store.objects.names(location))
    gone = _gone(location, delta, there)
    if gone:
        raise NoSuchTable(
            f"{store.url}/{location} has {gone} of the files of version {delta.version()} no more: old ones "
            f"were removed (gwrms cloud vacuum): {_can_be_pinned(store, location, there)}"
        )


def _gone(location: str, delta: DeltaTable, there: Set[str]) -> int:
    """Return the number of the version's files that are missing."""
    paths = delta.get_add_actions(flatten=True).column("path").to_pylist()
    return sum(
        f"{location}/{path}" not in there and f"{location}/{unquote(path)}" not in there for path in paths
    )


def _can_be_pinned(store: Store, location: str, there: Set[str]) -> str:
    """Return the newest versions that are whole, in words."""
    newest = store.table(location).version()
    back = range(newest, max(newest - LOOKED_BACK, -1), -1)
    whole = list(itertools.takewhile(lambda each: _whole(store, location, each, there), back))
    if not whole:
        return "nor is the newest one whole, see gwrms cloud verify"
    return f"the versions {whole[-1]} to {newest} can be pinned"


def _whole(store: Store, location: str, version: int, there: Set[str]) -> bool:
    try:
        return not _gone(location, store.table(location, version), there)
    except NoSuchTable:  # the log does not go back so far
        return False


def unpin(store: Store, location: str, version: int, by: str) -> None:
    """Let the version go, as far as `by` is concerned."""
    store.objects.remove(_path(Pin(location, version, by)))


def pins(store: Store) -> list[Pin]:
    """Return every version that somebody names.

    Raises:
        StoreError: one of these objects cannot be read, so nobody knows which version it keeps.

    """
    found = ((name, store.objects.read(name)) for name in store.objects.names(_PINS))
    return [_pin(store, name, data) for name, data in found if data is not None]


def _pin(store: Store, name: str, data: bytes) -> Pin:
    try:
        return msgspec.json.decode(data, type=Pin)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise StoreError(
            f"{store.url}/{name} is damaged: bring it back from a copy of the store; it says which version "
            "of a table a model needs"
        ) from error


def compact(
    store: Store, tables: Sequence[Table] = tuple(TABLES.values()), *, dry_run: bool = False
) -> list[Compacted]:
    """Put small files together; nothing that is written meanwhile is disturbed, and old versions stay.

    With `dry_run` nothing is done; what is told is about what would be.
    """
    if dry_run:
        return [found for table in tables for found in _compactable(store, table)]
    _mend(store, tables)
    return [_compact(store, location) for location in _locations(store, tables)]


def retain(
    store: Store, tables: Sequence[Table], before: datetime, *, dry_run: bool = False
) -> dict[str, int]:
    """Remove rows older than `before` (with a time zone); how many went, or would go, by location.

    They stay readable in old versions until `vacuum`. Before they go it is noted that they are meant to
    (`retained`).
    """
    if before.tzinfo is None:
        raise ValueError("`before` needs a time zone: the store's times are UTC")
    if not dry_run:
        _mend(store, tables)
    went: dict[str, int] = {}
    for location in _locations(store, tables):
        with translated(f"{store.url}/{location} cannot be changed"):
            if dry_run:
                went[location] = store.dataset(location).count_rows(
                    filter=pyarrow.dataset.field("utc") < before
                )
                continue
            _note(store, location, before)
            went[location] = remove(store, location, f"utc < '{before.isoformat()}'")
    return went


def remove(store: Store, location: str, condition: str) -> int:
    """Remove the rows of which this SQL is so, which stay in old versions; how many went."""
    went, made = again(store, location, functools.partial(_remove, store, location, condition))
    if any(map(_has_views, made)):
        with contextlib.suppress(StoreError), alone(store, location):  # who compacts it does the same
            again(store, location, functools.partial(_with_plain_texts, store, location, made))
    return went


def _remove(store: Store, location: str, condition: str) -> tuple[int, Sequence[ParquetFileFragment]]:
    """Remove rows; return their number, and the files rewritten without them."""
    delta = store.table(location)
    before = set(delta.file_uris())
    with store.unfinished(location):
        found = delta.delete(condition, post_commithook_properties=NO_HOOKS)
        store.make_last(location, delta, checkpoint=True)
    new = tuple(unquote(uri) for uri in set(delta.file_uris()) - before)
    files: list[ParquetFileFragment] = list(store.dataset(location).get_fragments()) if new else []
    made = [file for file in files if any(uri.endswith(f"/{file.path}") for uri in new)]
    return int(found["num_deleted_rows"] or 0), made


def again(store: Store, location: str, work: Callable[[], Done]) -> Done:
    """Do it, and again where others have changed the table meanwhile, which undoes it."""
    for _ in range(ATTEMPTS):
        with contextlib.suppress(CommitFailedError):
            return work()
    raise StoreError(f"{store.url}/{location} was changed meanwhile, {ATTEMPTS} times; try again later")


def retained(store: Store, location: str) -> datetime | None:
    """Return up to which time old rows of the table were removed; None if none were.

    Raises:
        StoreError: a note of that is damaged.

    """
    names = [name for name in store.objects.names(_noted(location)) if name.endswith(".json")]
    try:
        return max((_instant(name) for name in names), default=None)
    except ValueError as error:
        raise StoreError(
            f"a note in {store.url}/{_noted(location)} has no time for a name ({error}): bring it back from "
            "a copy of the store, or remove it; by it is known which rows gwrms cloud retain has removed"
        ) from error


def _instant(name: str) -> datetime:
    return datetime.strptime(name.rpartition("/")[2].removesuffix(".json"), _INSTANT).replace(tzinfo=UTC)


def _note(store: Store, location: str, before: datetime) -> None:
    name = f"{_noted(location)}/{before.astimezone(UTC).strftime(_INSTANT)}.json"
    store.objects.create(name, msgspec.json.encode({"location": location, "before": before}))


def _noted(location: str) -> str:
    return f"{_RETAINED}/{location.replace('/', '-')}"


def vacuum(
    store: Store,
    tables: Sequence[Table] = tuple(TABLES.values()),
    grace: timedelta = GRACE,
    *,
    dry_run: bool = False,
) -> list[str]:
    """Delete files that no version newer than `grace` needs, nor one that is pinned; their names.

    `grace` is taken in whole hours, rounded up.
    """
    if not dry_run:
        _mend(store, tables)
    kept: dict[str, list[int]] = {}
    for named in pins(store):
        kept.setdefault(named.location, []).append(named.version)
    gone: list[str] = []
    for location in _locations(store, tables):
        with translated(f"{store.url}/{location} cannot be cleaned"):
            versions = sorted(kept.get(location, []))
            work = functools.partial(_vacuum, store, location, grace, versions, dry_run=dry_run)
            gone += again(store, location, work)
    return gone


def _vacuum(
    store: Store, location: str, grace: timedelta, versions: list[int], *, dry_run: bool
) -> list[str]:
    delta = store.table(location)
    there = set(store.objects.names(location))
    with store.unfinished(location):
        if not dry_run:  # nothing goes before what stands for it lasts
            store.make_last(location, delta)
        gone = delta.vacuum(
            retention_hours=math.ceil(grace / timedelta(hours=1)),
            enforce_retention_duration=False,
            dry_run=dry_run,
            keep_versions=versions or None,
            post_commithook_properties=NO_HOOKS,
        )
        if not dry_run:
            delta.update_incremental()
            store.make_last(location, delta)
    above = "" if store.folder is None else f"{store.folder / location}/"
    named = {f"{location}/{name.removeprefix(above)}" for name in gone}
    return sorted(name for name in there if name in named or name in map(unquote, named))


def _compactable(store: Store, table: Table) -> Iterator[Compacted]:
    """Yield the number of files of each of the table's locations, before and after."""
    small: dict[str, dict[tuple[str | None, str | None], list[int]]] = {}
    counts: Counter[str] = Counter()
    for file in reading.files(store, table):
        counts[file.location] += 1
        if file.size_bytes < TARGET_BYTES:
            partitions = small.setdefault(file.location, {})
            partitions.setdefault((file.robot, file.session), []).append(file.size_bytes)
    for location, count in counts.items():
        spared = (len(sizes) - -(-sum(sizes) // TARGET_BYTES) for sizes in small.get(location, {}).values())
        yield Compacted(location, count, count - sum(spared))


def _compact(store: Store, location: str) -> Compacted:
    with translated(f"{store.url}/{location} cannot be compacted"), alone(store, location):
        return again(store, location, functools.partial(_put_together, store, location))


def _put_together(store: Store, location: str) -> Compacted:
    delta = store.table(location)
    before = len(delta.file_uris())
    with store.unfinished(location):
        delta.optimize.compact(
            target_size=TARGET_BYTES,
            writer_properties=writer_properties(pa.schema(delta.schema().to_arrow())),
            post_commithook_properties=NO_HOOKS,
        )
        store.make_last(location, delta, checkpoint=True)
    if not delta.metadata().partition_columns:
        _with_plain_texts(store, location, list(as_dataset(delta, location, store.files).get_fragments()))
    return Compacted(location, before, len(delta.file_uris()))


def _with_plain_texts(store: Store, location: str, files: Sequence[ParquetFileFragment]) -> None:
    """Write anew what the table format's library has removed rows of, and nobody compacts.

    It writes texts as Arrow's `string_view` then, and Arrow cannot look for one in a file with several.
    """
    views = filter(_has_views, files)
    partitions = {tuple(get_partition_keys(file.partition_expression).items()) for file in views}
    if not partitions:
        return
    delta = store.table(location)
    for partition in sorted(partitions):
        with store.unfinished(location):
            delta.optimize.z_order(
                ["utc"],
                partition_filters=[(name, "=", value) for name, value in partition] or None,
                target_size=TARGET_BYTES,
                writer_properties=writer_properties(pa.schema(delta.schema().to_arrow())),
                post_commithook_properties=NO_HOOKS,
            )
            store.make_last(location, delta, checkpoint=True)


def _has_views(file: ParquetFileFragment) -> bool:
    """Return whether a text that has several values in it is written so."""
    views = {column.name for column in file.physical_schema if column.type == pa.string_view()}
    told = (known for group in file.row_groups for name, known in group.statistics.items() if name in views)
    return any(known["min"] != known["max"] for known in told)


def _mend(store: Store, tables: Sequence[Table]) -> None:
    for location in (location for table in tables for location in table.locations(store.about.shards)):
        if store.folder is not None and (store.folder / location).is_dir():
            _check_writable(store.folder / location)
        store.mend(location)


def _check_writable(folder: Path) -> None:
    """Check it before the table format's library panics."""
    if not os.access(folder, os.W_OK):
        raise StoreRefused(
            f"{folder} cannot be written: run this as whom it belongs to, on a disk for writing"
        )


def _locations(store: Store, tables: Sequence[Table]) -> list[str]:
    """Return where these tables lie, as far as something has been written to them."""
    found: list[str] = []
    for location in (location for table in tables for location in table.locations(store.about.shards)):
        try:
            store.table(location)
        except NoSuchTable:
            continue
        found.append(location)
    return found


def _path(named: Pin) -> str:
    digest = hashlib.sha256(msgspec.json.encode(named)).hexdigest()[:32]
    return f"{_PINS}/{digest}.json"
