"""Comparison of receipts with the store: each batch's rows once, and as they were sent."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Final

import msgspec

from ml.store import checksums, upkeep
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable
from ml.store.fragments import DataFile
from ml.store.store import Store
from ml.store.tables import TABLES
from server_gui.core.cloud.row_counting import Advance, Batch, Claim, count
from server_gui.core.recording.receipts import (
    RECEIPTS,
    Altered,
    Mark,
    Receipt,
    ReceiptPart,
    canonical,
    is_of_batch,
    units_told,
    went_to,
)
from server_gui.core.recording.tally import Units

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_US: Final = timedelta(microseconds=1)
_MINUTE: Final = timedelta(minutes=1)  # what marks are apart, if they are not less


@dataclass(slots=True)
class Proof:
    """Result of the proof; `problems` are its failures, in words."""

    here: int = 0  # batches with a receipt of this store
    batches: int = 0  # of them, those that were found as they were sent
    rows: int = 0  # of them
    seen: int = 0  # rows that receipts speak of, as they were sent or not
    retained: int = 0  # rows of them that were removed because they were old
    elsewhere: int = 0  # batches that went to other stores
    problems: list[str] = field(default_factory=list)
    lacking: set[Batch] = field(default_factory=set)  # of which rows are missing
    missing: list[tuple[Batch, ReceiptPart, int]] = field(
        default_factory=list
    )  # how many rows of which parts
    vague: list[tuple[Batch, ReceiptPart]] = field(
        default_factory=list
    )  # how many retention has left nobody knows
    misread: Sequence[DataFile] = ()  # files that have not the columns that they should have
    wrong: dict[Batch, tuple[ReceiptPart, ...]] = field(
        default_factory=dict
    )  # what of these is there instead


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
    proof = Proof()
    all_here = _here(store, list(receipts), proof)
    newest = {(each.writer, each.batch): each for each in all_here}
    parts = [(batch, part) for batch, each in newest.items() for part in each.parts]
    retained = _retained(store, {part.location for _, part in parts}, proof.problems)
    claims = [_claim(batch, part, retained[part.location]) for batch, part in parts]
    told = units_told(all_here)
    units = {location: store.units(location) for location in retained if location not in unknown}
    problems, proof.misread = count(store, claims, files, units, advance, values=values)
    proof.problems += problems
    wrong = _units_wrong(store, claims, told, units, proof)
    wrong |= {claim.batch for claim in claims if claim.part.location in unknown}
    known = (claim for claim in claims if claim.part.location not in unknown)
    wrong |= {claim.batch for claim in known if not _judge(store, claim, proof, values=values)}
    proof.seen = sum(claim.found.rows for claim in claims)
    mine = defaultdict(list)
    for claim in claims:
        mine[claim.batch].append(claim)
    proof.problems += _columns_gone(store, (claim for claim in claims if claim.batch in wrong), told, units)
    proof.wrong = {batch: tuple(_found(claim, told, units) for claim in mine[batch]) for batch in wrong}
    proof.here, proof.batches = len(newest), len(newest) - len(wrong)
    return proof


def _here(store: Store, receipts: Sequence[Receipt | Altered], proof: Proof) -> list[Receipt]:
    """Return those of what went to this store, by its URL or by what its tables are called."""
    here = tables(store)
    sent_here = went_to((each for each in receipts if isinstance(each, Receipt)), store.url)
    here |= {part.table for each in sent_here for part in each.parts}
    found = []
    for each in receipts:
        if isinstance(each, Altered):
            proof.problems.append(f"line {each.line} of the spool's {RECEIPTS} {each.text}")
        elif not each.parts:  # nothing of the batch could be sent
            continue
        elif canonical(each.url) == canonical(store.url) or any(part.table in here for part in each.parts):
            found.append(each)
        else:
            proof.elsewhere += 1
    return found


def _judge(store: Store, claim: Claim, proof: Proof, *, values: bool) -> bool:
    """Judge whether its rows are as they were sent, as far as retention has left them."""
    problem = _problem(claim, values=values)
    missing = max(claim.expected[0] - claim.there[0], 0)
    if not problem:
        proof.rows += claim.found.rows
        proof.retained += claim.part.rows - claim.found.rows
    else:
        proof.problems.append(f"{store.url}/{claim.part.location}: {problem}")
    if is_of_batch(claim.batch[0]):  # all else no second copy brings
        if problem and (missing or (not values and _is_renamed(claim))):
            proof.lacking.add(claim.batch)
            proof.missing.append((claim.batch, claim.part, missing))
        if claim.went and not claim.is_all:
            proof.vague.append((claim.batch, claim.part))
    return not problem


def tables(store: Store) -> set[str]:
    """Return the permanent identities of the store's tables."""
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
    """Return up to which time rows were removed; if nobody can say, none were, and it is told."""
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


def _units_wrong(
    store: Store,
    claims: Sequence[Claim],
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
    store: Store, wrong: Iterable[Claim], told: Mapping[str, Units], units: Mapping[str, Units]
) -> Iterator[str]:
    """Yield the columns that these claims' tables lack."""
    for location, table in {claim.part.location: claim.part.table for claim in wrong}.items():
        if gone := [name for name in told.get(table, {}) if name not in units.get(location, told[table])]:
            yield (
                f"{store.url}/{location} has no column {', '.join(gone)} any more: bring the table's log "
                "back from a copy"
            )


def _found(claim: Claim, told: Mapping[str, Units], units: Mapping[str, Units]) -> ReceiptPart:
    """Return the rows of a claim that were found, in the form of its receipt."""
    part, there = claim.part, units.get(claim.part.location, {})
    return msgspec.structs.replace(
        part,
        rows=claim.found.rows,
        sum=checksums.told(claim.found.sum),
        names="",
        marks=(),
        units={name: there[name] for name in told.get(part.table, {}) if name in there},
    )


def _claim(batch: Batch, part: ReceiptPart, retained: datetime | None) -> Claim:
    if retained is None or part.begin_us is None or _time(part.begin_us) >= retained:
        return Claim(batch, part)
    from_us = (retained - _EPOCH) // _US
    if part.end_us is not None and part.end_us < from_us:
        return Claim(batch, part, is_old=True, rest=Mark(from_us, 0, checksums.told(0)))
    rest = next((mark for mark in part.marks if mark.from_us >= from_us), None)
    exact = rest is not None and (rest.from_us == from_us or not (retained - _EPOCH) % _MINUTE)
    return Claim(batch, part, is_old=True, rest=rest, is_all=exact)


def _problem(claim: Claim, *, values: bool) -> str | None:
    """Return the problem of a claim's rows, in words."""
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
    if not values and _is_renamed(claim):
        return f"of the {sent} rows some are missing and as many others doubled or renamed ({whose})"
    return None


def _is_renamed(claim: Claim) -> bool:
    """Return whether there are as many rows as were sent, but others; if values are not looked at."""
    part, found = claim.part, claim.found
    return bool(part.names) and found.rows == part.rows and checksums.told(found.names) != part.names


def _time(us: int) -> datetime:
    return _EPOCH + us * _US
