"""Whether what receipts say is in the store: each batch's rows once, and as they were sent."""

import itertools
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from ml.store import sums, upkeep
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable, translated
from ml.store.fragments import DataFile
from ml.store.sessions import footer
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY
from server_gui.core.cloud import extents
from server_gui.core.recording.receipts import (
    RECEIPTS,
    Altered,
    Mark,
    Part,
    Receipt,
    canonical,
    is_of_batch,
    units_told,
    went_to,
)
from server_gui.core.recording.tally import NAMING, NUMBER, Units, named, times_us

Advance = Callable[[int], object]
AT_ONCE: Final = 4  # files
TIME: Final = "utc"
WHOSE: Final = ("connection", "stream")
ORIGIN: Final = ("spool", "batch")
_OWN: Final = {each.name: each.type for each in TELEMETRY.schema}
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)

Batch = tuple[str, int]  # its writer and number
_Whose = tuple[str, str | None, str | None]  # location, robot, session


@dataclass(slots=True)
class _Count:
    """Rows, their sum and that of their names; of those from a claim's mark on, rows and sum alone."""

    rows: int = 0
    sum: int = 0
    names: int = 0
    rest_rows: int = 0
    rest_sum: int = 0

    def add(self, other: "_Count") -> None:
        self.rows += other.rows
        self.sum += other.sum
        self.names += other.names
        self.rest_rows += other.rest_rows
        self.rest_sum += other.rest_sum


@dataclass(slots=True)
class _Claim:
    """What a receipt says of rows in a table, and what is found of them.

    Where it `is_old` rows may have been removed because they were; from `rest` on all are expected.
    """

    batch: Batch
    part: Part
    is_old: bool
    rest: Mark | None
    found: _Count = field(default_factory=_Count)

    @property
    def expected(self) -> tuple[int, str]:
        """How many rows, and their sum, of what `there` counts."""
        return (
            (self.rest.rows, self.rest.sum) if self.rest and self._went else (self.part.rows, self.part.sum)
        )

    @property
    def there(self) -> tuple[int, str]:
        """So many rows, and their sum."""
        found = self.found
        rows, total = (
            (found.rest_rows, found.rest_sum) if self.rest and self._went else (found.rows, found.sum)
        )
        return rows, sums.told(total)

    @property
    def is_open(self) -> bool:
        """Whether nobody can say what of it retention has left."""
        return self._went and self.rest is None

    @property
    def _went(self) -> bool:
        return self.is_old and self.found.rows < self.part.rows


@dataclass(slots=True)
class _Rows:
    """Of some rows, each one's sum, sum of its name, and time; what nobody asks for is None."""

    each: sums.Sums | None
    names: sums.Sums | None
    times_us: npt.NDArray[np.int64]

    def of(self, claim: _Claim, mine: npt.NDArray[np.intp]) -> _Count:
        """Those of them that are the claim's."""
        found = _Count(len(mine), _total(self.each, mine), _total(self.names, mine))
        if claim.rest is not None:
            left = mine[self.times_us[mine] >= claim.rest.from_us]
            found.rest_rows, found.rest_sum = len(left), _total(self.each, left)
        return found


def _total(each: sums.Sums | None, mine: npt.NDArray[np.intp]) -> int:
    return 0 if each is None else int(each[mine].sum(dtype=np.uint64))


@dataclass(slots=True)
class Proof:
    """What was proven; `problems` name what was not, in words."""

    here: int = 0  # batches with a receipt of this store
    batches: int = 0  # of them, those that were found as they were sent
    rows: int = 0  # of them
    seen: int = 0  # rows that receipts speak of, as they were sent or not
    retained: int = 0  # rows of them that were removed because they were old
    elsewhere: int = 0  # batches that went to other stores
    problems: list[str] = field(default_factory=list)
    lacking: set[Batch] = field(default_factory=set)  # of which rows are missing
    wrong: dict[Batch, tuple[Part, ...]] = field(default_factory=dict)  # what of these is there instead


def prove(
    store: Store,
    receipts: Iterable[Receipt | Altered],
    files: Sequence[DataFile],
    advance: Advance,
    *,
    values: bool = True,
    unknown: Collection[str] = (),
) -> Proof:
    """Look for the rows of each receipt in these files, the store's; with `values` whether they are as sent.

    Of the locations that are `unknown`, because nobody can say which files they have, nothing is proven.

    The receipts are older than the list of files: what they speak of was in the store by then.

    Raises:
        StoreUnreachable, StoreRefused: it could not be looked.

    """
    receipts = list(receipts)
    proof, here = Proof(), tables(store)
    sent_here = went_to((each for each in receipts if isinstance(each, Receipt)), store.url)
    here |= {part.table for each in sent_here for part in each.parts}
    newest: dict[Batch, Receipt] = {}
    all_here: list[Receipt] = []
    for found in receipts:
        if isinstance(found, Altered):
            proof.problems.append(f"line {found.line} of the spool's {RECEIPTS} {found.text}")
        elif not found.parts:  # nothing of the batch could be sent
            continue
        elif canonical(found.url) == canonical(store.url) or not here.isdisjoint(
            part.table for part in found.parts
        ):
            newest[found.writer, found.batch] = found
            all_here.append(found)
        else:
            proof.elsewhere += 1
    parts = [(batch, part) for batch, each in newest.items() for part in each.parts]
    retained = {
        location: upkeep.retained(store, location) for location in {part.location for _, part in parts}
    }
    claims = [_claim(batch, part, retained[part.location]) for batch, part in parts]
    told = units_told(all_here)
    units = {location: store.units(location) for location in retained if location not in unknown}
    proof.problems += _count(store, claims, files, units, advance, values=values)
    wrong = _units_wrong(store, claims, told, units, proof)
    for claim in claims:
        rows = claim.found.rows
        proof.seen += rows
        problem = _problem(claim, values=values)
        if claim.part.location in unknown:
            wrong.add(claim.batch)
        elif problem:
            wrong.add(claim.batch)
            if claim.there[0] < claim.expected[0] and is_of_batch(claim.batch[0]):
                proof.lacking.add(claim.batch)
            proof.problems.append(f"{store.url}/{claim.part.location}: {problem}")
        else:
            proof.rows += rows
            proof.retained += claim.part.rows - rows
    proof.problems += _columns_gone(store, (claim for claim in claims if claim.batch in wrong), told, units)
    for batch in wrong:
        mine = (claim for claim in claims if claim.batch == batch)
        proof.wrong[batch] = tuple(_found(claim, told, units) for claim in mine)
    proof.here, proof.batches = len(newest), len(newest) - len(wrong)
    return proof


def tables(store: Store) -> set[str]:
    """What the store's tables are called for ever."""
    found = set()
    for location in (each for table in TABLES.values() for each in table.locations(store.about.shards)):
        try:
            found.add(store.identity(location))
        except (StoreUnreachable, StoreRefused):
            raise
        except StoreError:  # it is not there, or damaged
            continue
    return found


def _units_wrong(
    store: Store,
    claims: Sequence[_Claim],
    told: Mapping[str, Units],
    units: Mapping[str, Units],
    proof: Proof,
) -> set[Batch]:
    """Tell where a column has another unit than what was sent; the newest batch of each such table."""
    newest = {claim.part.location: claim for claim in claims}
    wrong = set()
    for location, claim in newest.items():
        there = units.get(location, {})
        for name, unit in told.get(claim.part.table, {}).items():
            if there.get(name, unit) != unit:
                wrong.add(claim.batch)
                proof.problems.append(
                    f"{store.url}/{location}: {name} is in {there[name] or 'no unit'} there, and its values "
                    f"were sent in {unit or 'no unit'}: bring the table's log back from a copy"
                )
    return wrong


def _columns_gone(
    store: Store, wrong: Iterable[_Claim], told: Mapping[str, Units], units: Mapping[str, Units]
) -> Iterator[str]:
    """Which columns these claims' tables have no more."""
    for location, table in {claim.part.location: claim.part.table for claim in wrong}.items():
        if gone := [name for name in told.get(table, {}) if name not in units.get(location, told[table])]:
            yield (
                f"{store.url}/{location} has no column {', '.join(gone)} any more: bring the table's log "
                "back from a copy"
            )


def _count(
    store: Store,
    claims: Sequence[_Claim],
    files: Sequence[DataFile],
    units: Mapping[str, Units],
    advance: Advance,
    *,
    values: bool,
) -> list[str]:
    """Count what is there of each claim, as who reads the tables sees it; which files cannot be read."""
    streams: dict[_Whose, list[_Claim]] = defaultdict(list)
    others: dict[str, dict[Batch, _Claim]] = defaultdict(dict)
    for claim in claims:
        part, whose = claim.part, claim.part.stream
        if whose is None:
            others[part.location][claim.batch] = claim
        else:
            streams[part.location, whose.robot, whose.session].append(claim)
    ordered = {whose: _Streams(mine) for whose, mine in streams.items()}

    def look(file: DataFile) -> tuple[Sequence["_Seen"], list[str]]:
        mine = ordered.get((file.location, file.robot, file.session))
        theirs = others.get(file.location)
        name = f"{store.url}/{file.location}/{file.path}"
        told: list[str] = []
        try:
            if mine is not None:
                rows = _rows(store, file, units[file.location], () if values else (*WHOSE, *NAMING), told)
                return _merged(mine.seen(batch, file, values) for batch in rows), told
            if theirs:
                rows = _rows(store, file, units[file.location], () if values else (*ORIGIN, *NUMBER), told)
                return _merged(_seen(theirs, batch, values) for batch in rows), told
            told += (f"{name}: {each}" for each in extents.differing(file, footer(store, file)))
        except StoreError as error:
            told.append(str(error))
        except pa.ArrowException as error:
            told.append(f"{name} is not as it was written: {error}")
        finally:
            advance(1)
        return (), told

    with ThreadPoolExecutor(AT_ONCE, "prove") as pool:
        problems: list[str] = []
        for seen, told in pool.map(look, files):
            problems += told
            for claim, found in seen:
                claim.found.add(found)
    return problems


_Seen = tuple[_Claim, _Count]


def _merged(found: Iterable[Sequence[_Seen]]) -> Sequence[_Seen]:
    """All of a file, or nothing where it cannot be read to its end."""
    return [seen for batch in found for seen in batch]


def _rows(
    store: Store, file: DataFile, known: Units, naming: Sequence[str], told: list[str]
) -> Iterator[pa.RecordBatch]:
    """These columns and the times, or all that the table knows; `told` hears which times are not as said."""
    name = f"{file.location}/{file.path}"
    with translated(f"{store.url}/{name} cannot be read"), store.files.open_input_file(name) as opened:
        parquet, extent = pq.ParquetFile(opened), extents.Seen()
        there = [each for each in parquet.schema_arrow.names if each in known]
        for batch in parquet.iter_batches(columns=[*naming, TIME] if naming else there):
            extent.add(batch)
            yield _plain(batch)
        wrong = itertools.chain(extent.differing(parquet.metadata), extents.differing(file, parquet.metadata))
        told += (f"{store.url}/{name}: {each}" for each in wrong)


def _plain(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Texts as texts: the table format's library has a way of its own to write them."""
    for place, column in enumerate(batch.schema):
        if column.type == pa.string_view():
            batch = batch.set_column(place, column.name, batch.column(place).cast(pa.string()))
    return batch


class _Streams:
    """The claims on one robot's session, to be found by connection, stream and notification."""

    def __init__(self, claims: Sequence[_Claim]) -> None:
        self._claims: dict[tuple[str, int], list[_Claim]] = defaultdict(list)
        for claim in claims:
            if claim.part.stream is not None:
                self._claims[claim.part.stream.connection, claim.part.stream.stream].append(claim)
        self._firsts: dict[tuple[str, int], np.ndarray[tuple[int], np.dtype[np.int64]]] = {}
        for name, mine in self._claims.items():
            mine.sort(key=_first)
            self._firsts[name] = np.array([_first(claim) for claim in mine], np.int64)

    def seen(self, batch: pa.RecordBatch, file: DataFile, values: bool) -> Sequence[_Seen]:
        """What these rows of a file are of each claim."""
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


def _shared(
    claims: Sequence[_Claim],
    firsts: np.ndarray[tuple[int], np.dtype[np.int64]],
    seqs: np.ndarray[tuple[int], np.dtype[np.int64]],
    each: _Rows,
) -> Iterator[_Seen]:
    """Rows of one stream among the claims on it, each of which begins with one of `firsts`."""
    places = np.searchsorted(firsts, seqs, "right") - 1
    for place in np.unique(places[places >= 0]).tolist():
        claim = claims[place]
        stream = claim.part.stream
        rows = (places == place) & (seqs <= (stream.last if stream else 0))
        yield claim, each.of(claim, np.flatnonzero(rows))


def _told(batch: pa.RecordBatch, same: Mapping[str, str], values: bool) -> _Rows:
    """Of rows of telemetry."""
    each, names = (_sums(batch, same), None) if values else (None, named(batch, NAMING))
    return _Rows(each, names, times_us(batch[TIME]))


def _sums(batch: pa.RecordBatch, same: Mapping[str, str]) -> sums.Sums:
    """Of rows of telemetry, whatever types somebody may have given them."""
    names = [name for name in batch.schema.names if name not in same]
    columns = [batch[name].cast(_OWN.get(name, pa.float64()), safe=False) for name in names]
    return sums.of_numbers(pa.record_batch(columns, names=names), same)


def _seen(claims: Mapping[Batch, _Claim], batch: pa.RecordBatch, values: bool) -> Sequence[_Seen]:
    """What these rows of another table are of each claim."""
    each = sums.of_rows(pa.Table.from_batches([batch])) if values else None
    rows = _Rows(each, None if values else named(batch, NUMBER), times_us(batch[TIME]))
    found: dict[Batch, list[int]] = defaultdict(list)
    for place, name in enumerate(zip(*(batch[column].to_pylist() for column in ORIGIN), strict=True)):
        if name in claims:
            found[name].append(place)
    return [(claims[name], rows.of(claims[name], np.array(mine))) for name, mine in found.items()]


def _found(claim: _Claim, told: Mapping[str, Units], units: Mapping[str, Units]) -> Part:
    """What is there of a claim, as its receipt would say it."""
    part, there = claim.part, units.get(claim.part.location, {})
    return msgspec.structs.replace(
        part,
        rows=claim.found.rows,
        sum=sums.told(claim.found.sum),
        names="",
        marks=(),
        units={name: there[name] for name in told.get(part.table, {}) if name in there},
    )


def _first(claim: _Claim) -> int:
    return claim.part.stream.first if claim.part.stream else 0


def _claim(batch: Batch, part: Part, retained: datetime | None) -> _Claim:
    old = retained is not None and part.begin_us is not None and _time(part.begin_us) < retained
    marks = (mark for mark in part.marks if retained is not None and _time(mark.from_us) >= retained)
    return _Claim(batch, part, old, next(marks, None) if old else None)


def _problem(claim: _Claim, *, values: bool) -> str | None:
    """What is wrong with the rows of a claim, in words."""
    part, (writer, batch) = claim.part, claim.batch
    (sent, total), (rows, found) = claim.expected, claim.there
    if claim.is_open:
        return None
    whose = f"batch {batch} of {writer}"
    if part.stream is not None:
        whose += f", {part.stream.robot}, session {part.stream.session}, stream {part.stream.stream}"
    if rows < sent:
        return f"{sent - rows} of {sent} rows are missing ({whose})"
    if rows > sent:
        return f"{rows - sent} rows more than the {sent} that were sent: doubled ({whose})"
    if values and found != total:
        return f"the {sent} rows are not as they were sent: altered ({whose})"
    if not values and part.names and rows == part.rows and sums.told(claim.found.names) != part.names:
        return f"of the {sent} rows some are missing and as many others doubled or renamed ({whose})"
    return None


def _time(us: int) -> datetime:
    return _EPOCH + timedelta(microseconds=us)
