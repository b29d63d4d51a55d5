"""Whether what receipts say is in the store: each batch's rows once, and as they were sent."""

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ml.store import damage, sums, upkeep
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable, translated
from ml.store.fragments import DataFile
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY
from server_gui.core.recording.receipts import RECEIPTS, Altered, Part, Receipt

Advance = Callable[[int], object]
AT_ONCE: Final = 4  # files
NAMING: Final = ("connection", "stream", "seq")
ORIGIN: Final = ("spool", "batch")
_OWN: Final = {each.name: each.type for each in TELEMETRY.schema}
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)

Batch = tuple[str, int]  # its writer and number
_Whose = tuple[str, str | None, str | None]  # location, robot, session


@dataclass(slots=True)
class _Claim:
    """What a receipt says of rows in a table, and what is found of them."""

    batch: Batch
    part: Part
    rows: int = 0
    sum: int = 0


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
    shortened: set[Batch] = field(default_factory=set)  # by retention: how many others there are is not known
    missing: list[tuple[Batch, Part, int]] = field(default_factory=list)  # how many rows of which parts
    misread: Sequence[DataFile] = ()  # files that have not the columns that they should have
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
        StoreError: it could not be looked.

    """
    proof, here = Proof(), _here(store)
    newest: dict[Batch, Receipt] = {}
    for found in receipts:
        if isinstance(found, Altered):
            proof.problems.append(f"line {found.line} of the spool's {RECEIPTS} {found.text}")
        elif not found.parts:  # nothing of the batch could be sent
            continue
        elif found.url == store.url or not here.isdisjoint(part.table for part in found.parts):
            newest[found.writer, found.batch] = found
        else:
            proof.elsewhere += 1
    claims = [_Claim(batch, part) for batch, each in newest.items() for part in each.parts]
    misread = _count(store, claims, files, advance, values=values)
    proof.misread, proof.problems = list(misread), [*proof.problems, *misread.values()]
    retained = _retained(store, {claim.part.location for claim in claims}, proof.problems)
    wrong = set()
    for claim in claims:
        proof.seen += claim.rows
        problem = _problem(claim, retained[claim.part.location], values=values)
        if claim.part.location in unknown:
            wrong.add(claim.batch)
        elif problem:
            wrong.add(claim.batch)
            if claim.rows < claim.part.rows:
                proof.lacking.add(claim.batch)
                proof.missing.append((claim.batch, claim.part, claim.part.rows - claim.rows))
            proof.problems.append(f"{store.url}/{claim.part.location}: {problem}")
        else:
            proof.rows += claim.rows
            proof.retained += claim.part.rows - claim.rows
            if claim.rows < claim.part.rows and _outlasts(claim.part, retained[claim.part.location]):
                proof.shortened.add(claim.batch)
    for batch in wrong:
        proof.wrong[batch] = tuple(_found(claim) for claim in claims if claim.batch == batch)
    proof.here, proof.batches = len(newest), len(newest) - len(wrong)
    return proof


def _here(store: Store) -> set[str]:
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


def _retained(store: Store, locations: Set[str], problems: list[str]) -> dict[str, datetime | None]:
    """Up to which time rows were removed; where nobody can say, none were, and it is told."""
    found: dict[str, datetime | None] = {}
    for location in sorted(locations):
        try:
            found[location] = upkeep.retained(store, location)
        except (StoreUnreachable, StoreRefused):
            raise
        except StoreError as error:
            found[location] = None
            problems.append(str(error))
    return found


def _count(
    store: Store, claims: Sequence[_Claim], files: Sequence[DataFile], advance: Advance, *, values: bool
) -> dict[DataFile, str]:
    """Count what is there of each claim; which files cannot be read, and why."""
    streams: dict[_Whose, list[_Claim]] = defaultdict(list)
    others: dict[str, dict[Batch, _Claim]] = defaultdict(dict)
    for claim in claims:
        part, whose = claim.part, claim.part.stream
        if whose is None:
            others[part.location][claim.batch] = claim
        else:
            streams[part.location, whose.robot, whose.session].append(claim)
    ordered = {whose: _Streams(mine) for whose, mine in streams.items()}

    def look(file: DataFile) -> Sequence["_Seen"] | str:
        mine = ordered.get((file.location, file.robot, file.session))
        theirs = others.get(file.location)
        try:
            if mine is not None:
                return _merged(mine.seen(batch, file, values) for batch in _rows(store, file, values, NAMING))
            if theirs:
                return _merged(_seen(theirs, batch, values) for batch in _rows(store, file, values, ORIGIN))
        except StoreError as error:
            return damage.proven(store, file, str(error))
        except (pa.ArrowException, LookupError, TypeError, ValueError) as error:
            told = error.args[0] if isinstance(error, KeyError) else error
            return f"{store.url}/{file.location}/{file.path} is not as it was written: {told}"
        finally:
            advance(1)
        return ()

    with ThreadPoolExecutor(AT_ONCE, "prove") as pool:
        problems: dict[DataFile, str] = {}
        for file, seen in zip(files, pool.map(look, files), strict=True):
            if isinstance(seen, str):
                problems[file] = seen
                continue
            for claim, rows, total in seen:
                claim.rows += rows
                claim.sum += total
    return problems


_Seen = tuple[_Claim, int, int]  # rows of it, their sum


def _merged(found: Iterable[Sequence[_Seen]]) -> Sequence[_Seen]:
    """All of a file, or nothing where it cannot be read to its end."""
    return [seen for batch in found for seen in batch]


def _rows(store: Store, file: DataFile, values: bool, naming: Sequence[str]) -> Iterator[pa.RecordBatch]:
    name = f"{file.location}/{file.path}"
    with translated(f"{store.url}/{name} cannot be read"), store.files.open_input_file(name) as opened:
        for batch in pq.ParquetFile(opened).iter_batches(columns=None if values else list(naming)):
            yield _plain(batch)


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
        connections, streams, seqs = (batch[name].to_numpy(zero_copy_only=False) for name in NAMING)
        found: list[_Seen] = []
        for connection in batch["connection"].unique().to_pylist():
            mine = connections == connection
            for stream in np.unique(streams[mine]).tolist():
                rows = np.flatnonzero(mine & (streams == stream))
                claims = self._claims.get((connection, stream))
                if claims:
                    same = {"robot": str(file.robot), "session": str(file.session), "connection": connection}
                    each = _sums(batch.take(pa.array(rows)), same) if values else None
                    found += _shared(claims, self._firsts[connection, stream], seqs[rows], each)
        return found


def _shared(
    claims: Sequence[_Claim],
    firsts: np.ndarray[tuple[int], np.dtype[np.int64]],
    seqs: np.ndarray[tuple[int], np.dtype[np.int64]],
    each: sums.Sums | None,
) -> Iterator[_Seen]:
    """Rows of one stream among the claims on it, each of which begins with one of `firsts`."""
    places = np.searchsorted(firsts, seqs, "right") - 1
    for place in np.unique(places[places >= 0]).tolist():
        claim = claims[place]
        stream = claim.part.stream
        rows = (places == place) & (seqs <= (stream.last if stream else 0))
        yield claim, int(rows.sum()), 0 if each is None else int(each[rows].sum(dtype=np.uint64))


def _sums(batch: pa.RecordBatch, same: Mapping[str, str]) -> sums.Sums:
    """Of rows of telemetry, whatever types somebody may have given them."""
    names = [name for name in batch.schema.names if name not in same]
    columns = [batch[name].cast(_OWN.get(name, pa.float64()), safe=False) for name in names]
    return sums.of_numbers(pa.record_batch(columns, names=names), same)


def _seen(claims: Mapping[Batch, _Claim], batch: pa.RecordBatch, values: bool) -> Sequence[_Seen]:
    """What these rows of another table are of each claim."""
    each = sums.of_rows(pa.Table.from_batches([batch])).tolist() if values else [0] * batch.num_rows
    names = zip(batch["spool"].to_pylist(), batch["batch"].to_pylist(), strict=True)
    found: dict[Batch, list[int]] = defaultdict(list)
    for name, total in zip(names, each, strict=True):
        if name in claims:
            found[name].append(total)
    return [(claims[name], len(mine), sum(mine)) for name, mine in found.items()]


def _found(claim: _Claim) -> Part:
    """What is there of a claim, as its receipt would say it."""
    return msgspec.structs.replace(claim.part, rows=claim.rows, sum=sums.told(claim.sum))


def _first(claim: _Claim) -> int:
    return claim.part.stream.first if claim.part.stream else 0


def _problem(claim: _Claim, retained: datetime | None, *, values: bool) -> str | None:
    """What is wrong with the rows of a claim, in words."""
    part, (writer, batch) = claim.part, claim.batch
    whole = claim.rows == part.rows and (not values or sums.told(claim.sum) == part.sum)
    old = retained is not None and part.begin_us is not None and _time(part.begin_us) < retained
    if whole or (old and claim.rows < part.rows):
        return None
    whose = f"batch {batch} of {writer}"
    if part.stream is not None:
        whose += f", {part.stream.robot}, session {part.stream.session}, stream {part.stream.stream}"
    if claim.rows < part.rows:
        return f"{part.rows - claim.rows} of {part.rows} rows are missing ({whose})"
    if claim.rows > part.rows:
        return f"{claim.rows - part.rows} rows more than the {part.rows} that were sent: doubled ({whose})"
    return f"the {part.rows} rows are not as they were sent: altered ({whose})"


def _outlasts(part: Part, retained: datetime | None) -> bool:
    """Whether some of its rows are newer than what was removed."""
    return retained is not None and part.end_us is not None and _time(part.end_us) >= retained


def _time(us: int) -> datetime:
    return _EPOCH + timedelta(microseconds=us)
