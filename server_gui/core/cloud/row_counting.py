"""Counts and sums of the rows in a store's files that receipts claim."""

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from ml.store import checksums, damage
from ml.store.errors import StoreError
from ml.store.fragments import DataFile
from ml.store.sessions import footer
from ml.store.store import Store
from ml.store.tables import TELEMETRY
from ml.store.translation import translated
from server_gui.core.cloud import extents
from server_gui.core.recording.receipts import Mark, ReceiptPart
from server_gui.core.recording.tally import NAMING, NUMBER, Units, named, times_us

Advance = Callable[[int], object]
AT_ONCE: Final = 4  # files
TIME: Final = "utc"
WHOSE: Final = ("connection", "stream")
ORIGIN: Final = ("spool", "batch")
_OWN: Final = {each.name: each.type for each in TELEMETRY.schema}

Batch = tuple[str, int]  # its writer and number
_Whose = tuple[str, str | None, str | None]  # location, robot, session


@dataclass(slots=True)
class Count:
    """Rows, their sum and that of their names; of those from a claim's mark on, rows and sum alone."""

    rows: int = 0
    sum: int = 0
    names: int = 0
    rest_rows: int = 0
    rest_sum: int = 0

    def add(self, other: "Count") -> None:
        """Add these."""
        self.rows += other.rows
        self.sum += other.sum
        self.names += other.names
        self.rest_rows += other.rest_rows
        self.rest_sum += other.rest_sum


@dataclass(slots=True)
class Claim:
    """A receipt's claim of rows in a table, and the rows found.

    Where it `is_old` rows may have been removed because they were; from `rest` on all are expected, which
    `is_all` that retention has left of it.
    """

    batch: Batch
    part: ReceiptPart
    is_old: bool = False
    rest: Mark | None = None
    is_all: bool = True
    found: Count = field(default_factory=Count)

    @property
    def expected(self) -> tuple[int, str]:
        """Number of rows, and their sum, that `there` should have."""
        return (self.rest.rows, self.rest.sum) if self.rest and self.went else (self.part.rows, self.part.sum)

    @property
    def there(self) -> tuple[int, str]:
        """So many rows, and their sum."""
        found = self.found
        is_rest = self.rest and self.went
        rows, total = (found.rest_rows, found.rest_sum) if is_rest else (found.rows, found.sum)
        return rows, checksums.told(total)

    @property
    def is_open(self) -> bool:
        """Whether nobody can say what of it retention has left."""
        return self.went and self.rest is None

    @property
    def went(self) -> bool:
        """Whether rows of it seem to have been removed because they were old."""
        return self.is_old and self.found.rows < self.part.rows


def count(
    store: Store,
    claims: Sequence[Claim],
    files: Sequence[DataFile],
    units: Mapping[str, Units],
    advance: Advance,
    *,
    values: bool,
) -> tuple[list[str], list[DataFile]]:
    """Count what is there of each claim, as who reads the tables sees it.

    In words, what is wrong with files; and those of them that have not the columns that they should have.

    Raises:
        StoreError: it could not be looked.

    """
    streams: dict[_Whose, list[Claim]] = defaultdict(list)
    others: dict[str, dict[Batch, Claim]] = defaultdict(dict)
    for claim in claims:
        part, whose = claim.part, claim.part.stream
        if whose is None:
            others[part.location][claim.batch] = claim
        else:
            streams[part.location, whose.robot, whose.session].append(claim)
    ordered = {whose: _Streams(mine) for whose, mine in streams.items()}

    def look(file: DataFile) -> _Look:
        found = _Look()
        mine = ordered.get((file.location, file.robot, file.session))
        theirs = others.get(file.location)
        name = f"{store.url}/{file.location}/{file.path}"
        told: list[str] = []
        try:
            if mine is not None:
                rows = _rows(store, file, units[file.location], () if values else (*WHOSE, *NAMING), told)
                found.seen = _merged(mine.seen(batch, file, values) for batch in rows)
            elif theirs:
                rows = _rows(store, file, units[file.location], () if values else (*ORIGIN, *NUMBER), told)
                found.seen = _merged(_seen(theirs, batch, values) for batch in rows)
            else:
                told += extents.differing(file, footer(store, file))
            found.problems += (f"{name}: {each}" for each in told)
        except StoreError as error:
            found.misread = damage.proven(store, file, str(error))
        except (pa.ArrowException, LookupError, TypeError, ValueError) as error:
            why = error.args[0] if isinstance(error, KeyError) else error
            found.misread = f"{name} is not as it was written: {why}"
        finally:
            advance(1)
        return found

    with ThreadPoolExecutor(AT_ONCE, "prove") as pool:
        problems: list[str] = []
        misread: list[DataFile] = []
        for file, looked in zip(files, pool.map(look, files), strict=True):
            problems += looked.problems
            if looked.misread:
                problems.append(looked.misread)
                misread.append(file)
            for claim, found in looked.seen:
                claim.found.add(found)
    return problems, misread


_Seen = tuple[Claim, Count]


@dataclass(slots=True)
class _Look:
    """At one file: what is in it of claims, and in words what is wrong with it."""

    seen: Sequence[_Seen] = ()
    problems: list[str] = field(default_factory=list)
    misread: str | None = None  # where it has not the columns that it should have


def _merged(found: Iterable[Sequence[_Seen]]) -> Sequence[_Seen]:
    """Return all of a file, or nothing where it cannot be read to its end."""
    return [seen for batch in found for seen in batch]


def _rows(
    store: Store, file: DataFile, known: Units, naming: Sequence[str], told: list[str]
) -> Iterator[pa.RecordBatch]:
    """Yield these columns and the times, or all; `told` gets wrong statistics of times."""
    name = f"{file.location}/{file.path}"
    with translated(f"{store.url}/{name} cannot be read"), store.files.open_input_file(name) as opened:
        parquet, extent = pq.ParquetFile(opened), extents.RowExtents()
        there = [each for each in parquet.schema_arrow.names if each in known]
        for batch in parquet.iter_batches(columns=[*naming, TIME] if naming else there):
            extent.add(batch)
            yield _plain(batch)
        told += itertools.chain(extent.differing(parquet.metadata), extents.differing(file, parquet.metadata))


def _plain(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Texts as texts: the table format's library has a way of its own to write them."""
    for place, column in enumerate(batch.schema):
        if column.type == pa.string_view():
            batch = batch.set_column(place, column.name, batch.column(place).cast(pa.string()))
    return batch


@dataclass(slots=True)
class _Rows:
    """Sum, identity sum and time of some rows; unneeded ones are None."""

    each: checksums.Sums | None
    names: checksums.Sums | None
    times_us: npt.NDArray[np.int64]

    def of(self, claim: Claim, mine: npt.NDArray[np.intp]) -> Count:
        """Return those of them that are the claim's."""
        found = Count(len(mine), _total(self.each, mine), _total(self.names, mine))
        if claim.rest is not None:
            left = mine[self.times_us[mine] >= claim.rest.from_us]
            found.rest_rows, found.rest_sum = len(left), _total(self.each, left)
        return found


def _total(each: checksums.Sums | None, mine: npt.NDArray[np.intp]) -> int:
    return 0 if each is None else int(each[mine].sum(dtype=np.uint64))


class _Streams:
    """The claims on one robot's session, to be found by connection, stream and notification."""

    def __init__(self, claims: Sequence[Claim]) -> None:
        self._claims: dict[tuple[str, int], list[Claim]] = defaultdict(list)
        for claim in claims:
            if claim.part.stream is not None:
                self._claims[claim.part.stream.connection, claim.part.stream.stream].append(claim)
        self._firsts: dict[tuple[str, int], np.ndarray[tuple[int], np.dtype[np.int64]]] = {}
        for name, mine in self._claims.items():
            mine.sort(key=_first)
            self._firsts[name] = np.array([_first(claim) for claim in mine], np.int64)

    def seen(self, batch: pa.RecordBatch, file: DataFile, values: bool) -> Sequence[_Seen]:
        """Return what these rows of a file are of each claim."""
        connections, streams, seqs = (
            batch[name].to_numpy(zero_copy_only=False) for name in (*WHOSE, NAMING[0])
        )
        found: list[_Seen] = []
        for connection in batch["connection"].unique().to_pylist():
            mine = connections == connection
            for stream in np.unique(streams[mine]).tolist():
                rows = np.flatnonzero(mine & (streams == stream))
                claims = self._claims.get((connection, stream))
                if claims:
                    same = {"robot": str(file.robot), "session": str(file.session), "connection": connection}
                    each = _told(batch.take(pa.array(rows)), same, values)
                    found += _shared(claims, self._firsts[connection, stream], seqs[rows], each)
        return found


def _first(claim: Claim) -> int:
    return claim.part.stream.first if claim.part.stream else 0


def _shared(
    claims: Sequence[Claim],
    firsts: np.ndarray[tuple[int], np.dtype[np.int64]],
    seqs: np.ndarray[tuple[int], np.dtype[np.int64]],
    each: _Rows,
) -> Iterator[_Seen]:
    """Yield rows of one stream among the claims on it, each of which begins with one of `firsts`."""
    places = np.searchsorted(firsts, seqs, "right") - 1
    for place in np.unique(places[places >= 0]).tolist():
        claim = claims[place]
        stream = claim.part.stream
        rows = (places == place) & (seqs <= (stream.last if stream else 0))
        yield claim, each.of(claim, np.flatnonzero(rows))


def _told(batch: pa.RecordBatch, same: Mapping[str, str], values: bool) -> _Rows:
    """Sum rows of telemetry."""
    each, names = (_sums(batch, same), None) if values else (None, named(batch, NAMING))
    return _Rows(each, names, times_us(batch[TIME]))


def _sums(batch: pa.RecordBatch, same: Mapping[str, str]) -> checksums.Sums:
    """Return the sums of telemetry rows, whatever their types have become."""
    names = [name for name in batch.schema.names if name not in same]
    columns = [batch[name].cast(_OWN.get(name, pa.float64()), safe=False) for name in names]
    return checksums.of_numbers(pa.record_batch(columns, names=names), same)


def _seen(claims: Mapping[Batch, Claim], batch: pa.RecordBatch, values: bool) -> Sequence[_Seen]:
    """Return the contribution of these rows of another table to each claim."""
    each = checksums.of_rows(pa.Table.from_batches([batch])) if values else None
    rows = _Rows(each, None if values else named(batch, NUMBER), times_us(batch[TIME]))
    found: dict[Batch, list[int]] = defaultdict(list)
    for place, name in enumerate(zip(*(batch[column].to_pylist() for column in ORIGIN), strict=True)):
        if name in claims:
            found[name].append(place)
    return [(claims[name], rows.of(claims[name], np.array(mine))) for name, mine in found.items()]
