"""Check for completeness: every file of every table, every row of each batch that the spool has sent."""

import contextlib
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path

from gateway.amounts import counted
from ml.store import mending, reading
from ml.store.damage import damage
from ml.store.errors import NoSuchTable, StoreError, StoreRefused, StoreUnreachable
from ml.store.fragments import DataFile, data_files
from ml.store.store import Store
from ml.store.tables import TABLES, TELEMETRY
from ml.store.upkeep import Pin, pins
from server_gui.core.cloud import spool_reader
from server_gui.core.cloud.receipt_check import Proof, prove
from server_gui.core.cloud.row_counting import AT_ONCE, Advance, Batch
from server_gui.core.cloud.verdict import Verdict
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS, Altered, Receipt, Receipts, went_to
from server_gui.core.recording.spool_files import identity


def whole(
    store: Store,
    spool: Path,
    expect: Callable[[int], AbstractContextManager[Advance]],
    *,
    values: bool = True,
    deep: bool = False,
) -> Verdict:
    """Look at every file and every batch; `expect` hears how many steps that are.

    Without `values` rows are counted, and not compared with what was sent. With `deep` every value is read
    besides, also of rows that have no receipt.

    Raises:
        StoreError: it could not be looked.

    """
    receipts = receipts_of(spool)  # before the files: what is sent meanwhile counts
    found, unreadable = look(store)
    problems = [*_not_its_own(spool, receipts), *unreadable.values()]
    pinned, gone = _pinned(store, found)
    problems += gone
    with expect(2 * len(found) + len(pinned)) as advance:
        told = list(_each(store, found, advance, deep=deep))
        problems += filter(None, told)
        for named, files_ in pinned.items():
            problems += (f"{each} ({_needed(named)})" for each in damages(store, files_, advance, deep=deep))
        sound = [file for file, problem in zip(found, told, strict=True) if problem is None]
        advance(len(found) - len(sound))
        proof = prove(store, receipts, sound, advance, values=values, unknown=unreadable.keys())
    problems += proof.problems
    # Where all went to other stores, this one need not have its batches; another's receipts do not say that.
    if proof.here or not (proof.elsewhere and own_receipts(receipts, spool)):
        problems += batches_missing(store, spool)
    taken_out, unknown = mending.taken_out(store)
    problems += unknown
    notes = [*_notes(store, spool, proof, receipts, taken_out)]
    unproven = sum(file.rows for file in sound) - proof.seen
    return Verdict(found, proof, list(dict.fromkeys(problems)), notes, unproven)


def receipts_of(spool: Path) -> list[Receipt | Altered]:
    """Return the spool's receipts, oldest first.

    Raises:
        SpoolUnusable: they are there, and cannot be read.

    """
    file = spool / RECEIPTS
    try:
        return list(Receipts(file).all())
    except OSError as error:
        raise SpoolUnusable(
            f"the spool's receipts {file} cannot be read: {error.strerror or error}; run this as whom the "
            "spool belongs to"
        ) from error


def _not_its_own(spool: Path, receipts: Sequence[Receipt | Altered]) -> Iterator[str]:
    """Yield that the spool's name is damaged, or receipts are another's, which prove nothing here."""
    file, own = spool / "id", identity(spool)
    if not own and (file.exists() or receipts):
        yield (
            f"{file} is {'damaged' if file.exists() else 'gone'}: bring it back from a copy; else the next "
            "collector or gwrms cloud upload writes what its batches call it"
        )
    others = [each for each in receipts if isinstance(each, Receipt) and own and each.spool != own]
    if others:
        yield (
            f"{counted(len(others), 'receipt')} in {spool / RECEIPTS} are of another spool, "
            f"{others[0].spool}, and this one is {own}: bring its own {RECEIPTS}, or its id, back from a "
            "copy; without one, gwrms cloud mend --accept-loss goes on without them"
        )


def _known(spool: Path) -> list[Receipt]:
    return [each for each in receipts_of(spool) if isinstance(each, Receipt)]


def _notes(
    store: Store,
    spool: Path,
    proof: Proof,
    receipts: Sequence[Receipt | Altered],
    gone: Sequence[mending.TakenOut],
) -> Iterator[str]:
    """Yield remedies, notes on earlier repairs, and pending work."""
    if any(isinstance(each, Altered) for each in receipts):
        yield (
            f"bring {spool / RECEIPTS} back from a copy; without one, gwrms cloud mend --accept-loss goes on "
            "with the lines that are whole"
        )
    if waiting := [
        number for number in spool_reader.waiting(spool) if not spool_reader.is_empty(spool, number)
    ]:
        yield f"not uploaded yet, and not looked at: {told_batches(waiting)} of the spool {spool}"
    again = [number for number, batch in second_copies(spool).items() if batch in proof.lacking]
    if again:
        yield (
            f"the spool still has a second copy of {told_batches(again)}: end the collector and run gwrms "
            "cloud mend, which brings what is missing of it"
        )
    if gone:
        yield (
            f"{sum(each.rows for each in gone)} rows in {counted(len(gone), 'file')} were taken out "
            f"by gwrms cloud mend ({store.url}/mended says which); what receipts here prove is back"
        )


def second_copies(spool: Path) -> dict[int, Batch]:
    """By which name the spool's second copies went to the store; without those that cannot be read."""
    found = {}
    for number in spool_reader.uploaded(spool):
        with contextlib.suppress(SpoolUnusable):
            found[number] = (spool_reader.writer(spool, number), number)
    return found


def sent_to(url: str, spool: Path) -> int:
    """Return the number of the spool's batches that went to the store of this URL."""
    return len({(each.writer, each.batch) for each in went_to(_known(spool), url) if each.is_of_batch})


def no_store(url: str, spool: Path) -> str:
    """Return in words that a store with batches of the spool is gone."""
    sent = counted(sent_to(url, spool), "batch", "batches")
    return (
        f"there is no store at {url} any more, though {sent} of the spool {spool} "
        "went there: bring it back (its store.json too), or end the collector and run gwrms cloud mend: "
        "that makes it anew of the spool's second copies"
    )


def look(store: Store) -> tuple[list[DataFile], dict[str, str]]:
    """Return every file of the newest versions; which tables' logs cannot be read, and why."""
    found: list[DataFile] = []
    problems = {}
    for location in (each for table in TABLES.values() for each in table.locations(store.about.shards)):
        try:
            found += data_files(store.table(location), location)
        except (StoreUnreachable, StoreRefused):
            raise
        except NoSuchTable:
            continue
        except StoreError as error:
            problems[location] = str(error)
    return found, problems


def _pinned(store: Store, newest: Sequence[DataFile]) -> tuple[dict[Pin, list[DataFile]], list[str]]:
    """Return the files that only a pinned version needs, and which of these cannot be read."""
    known = {(file.location, file.path) for file in newest}
    found: dict[Pin, list[DataFile]] = {}
    problems = []
    try:
        all_pins = pins(store)
    except (StoreUnreachable, StoreRefused):
        raise
    except StoreError as error:
        return {}, [str(error)]
    for named in all_pins:
        try:
            delta = store.table(named.location, named.version)
            mine = [
                file for file in data_files(delta, named.location) if (file.location, file.path) not in known
            ]
        except (StoreUnreachable, StoreRefused):
            raise
        except StoreError as error:
            problems.append(f"{error} ({_needed(named)})")
            continue
        known |= {(file.location, file.path) for file in mine}
        found[named] = mine
    return found, problems


def _needed(named: Pin) -> str:
    return f"needed by version {named.version}, which {named.by} names"


def files(store: Store) -> list[DataFile]:
    """Return every file that the newest versions of the tables consist of."""
    return [file for table in TABLES.values() for file in reading.files(store, table)]


def damages(store: Store, wanted: Sequence[DataFile], advance: Advance, *, deep: bool) -> Iterator[str]:
    """Yield the damage of these files, in words: absent, of another size, unreadable, other rows.

    Each file's footer is read, and with `deep` every value.

    Raises:
        StoreError: of one of them nobody can say.

    """
    return filter(None, _each(store, wanted, advance, deep=deep))


def broken(store: Store, wanted: Sequence[DataFile], advance: Advance, *, deep: bool) -> list[DataFile]:
    """Return which of these files are absent, cut off or unreadable; raises as `damages` does."""
    told = _each(store, wanted, advance, deep=deep)
    return [file for file, problem in zip(wanted, told, strict=True) if problem]


def _each(store: Store, wanted: Sequence[DataFile], advance: Advance, *, deep: bool) -> Iterator[str | None]:
    sizes = {found.path: found.size_bytes for found in store.objects.listing()}

    def check(file: DataFile) -> str | None:
        problem = damage(store, file, sizes.get(f"{file.location}/{file.path}"), deep=deep)
        advance(1)
        return problem

    with ThreadPoolExecutor(AT_ONCE, "verify") as pool:
        yield from pool.map(check, wanted)


def batches_missing(store: Store, spool: Path) -> Iterator[str]:
    """Return the spool's batches that were set aside, are nowhere, or were uploaded and have no receipt.

    Of those with a receipt `prove` knows more. Receipts are read last: a batch has its own before its file
    has another name.
    """
    aside, before = spool_reader.damaged(spool), _there(spool)
    found, problems = _second_batches(spool)
    receipts = [each for each in own_receipts(receipts_of(spool), spool) if each.is_of_batch]
    yield from _set_aside(aside, receipts)
    yield from _nowhere(spool, receipts, before)
    yield from problems
    known = {(each.writer, each.batch) for each in receipts}
    unproven = [batch for batch in found if (batch.writer, batch.number) not in known]
    yield from _without_receipt(spool, unproven)
    yield from _unknown(store, spool, unproven)


def own_receipts(receipts: Iterable[Receipt | Altered], spool: Path) -> list[Receipt]:
    """Return those that the spool itself has written, as far as its name is known."""
    own = identity(spool)
    return [each for each in receipts if isinstance(each, Receipt) and (not own or each.spool == own)]


def _set_aside(aside: Iterable[tuple[int, Path]], receipts: Sequence[Receipt]) -> Iterator[str]:
    for number, file in aside:
        lost = [each.lost for each in receipts if each.batch == number]
        told = "; ".join(lost[-1]) if lost else f"what batch {number} held is not in the store as a whole"
        yield f"{file} was set aside: {told}"


def _nowhere(spool: Path, receipts: Sequence[Receipt], before: Set[int]) -> Iterator[str]:
    """Numbers are given one after another: one that is skipped was a batch."""
    if not receipts and before and min(before) > 1 and _has_name(spool, min(before)):
        yield (
            f"{spool / RECEIPTS} is not there, though the spool had {told_batches(range(1, min(before)))}: "
            "bring it back from a copy; without it nobody can say whether their rows are in the store"
        )
    for number in nowhere(spool, receipts, before):
        yield f"batch {number} of the spool {spool} is nowhere: no receipt says that it was uploaded"


def nowhere(spool: Path, receipts: Sequence[Receipt], before: Set[int] = frozenset()) -> list[int]:
    """Numbers of batches that neither a file has, now or `before` the receipts were read, nor a receipt."""
    there = _there(spool) | before
    batches = [each.batch for each in receipts if each.is_of_batch]
    known = there.union(batches)
    first = min(batches, default=min(there, default=1))
    return sorted(set(range(first, max(known, default=0))) - known)


def _there(spool: Path) -> set[int]:
    return {*spool_reader.kept(spool), *(number for number, _ in spool_reader.damaged(spool))}


def _has_name(spool: Path, number: int) -> bool:
    """Return whether a batch was made since there are receipts."""
    try:
        return spool_reader.writer(spool, number) != identity(spool)
    except SpoolUnusable:
        return False


def _second_batches(spool: Path) -> tuple[list[spool_reader.Batch], list[str]]:
    """Return the second copies, and which cannot be read; not those that go meanwhile, to make room."""
    found, problems = [], []
    for number in spool_reader.uploaded(spool):
        try:
            found.append(spool_reader.batch(spool, number))
        except SpoolUnusable as error:
            if number in spool_reader.uploaded(spool):
                problems.append(str(error))
    return found, problems


def copies(spool: Path, known: Set[tuple[str, int]]) -> tuple[list[spool_reader.Batch], list[str]]:
    """Return the second copies that have no receipt, and which cannot be read."""
    found, problems = _second_batches(spool)
    return [batch for batch in found if (batch.writer, batch.number) not in known], problems


def _without_receipt(spool: Path, unproven: Sequence[spool_reader.Batch]) -> Iterator[str]:
    """Each had one before it was called uploaded; but for those from before there were any."""
    own = identity(spool)
    numbers = [batch.number for batch in unproven if batch.writer != own]
    if numbers:
        yield (
            f"{spool / RECEIPTS} has no receipt of {told_batches(numbers)}, which went to a store: "
            "bring that file back from a copy, or end the collector and run gwrms cloud mend"
        )


def told_batches(numbers: Iterable[int]) -> str:
    """Return numbers of batches in words, those that follow each other together."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    told = ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
    return f"batch {told}" if len(runs) == 1 and len(runs[0]) == 1 else f"the batches {told}"


def _unknown(store: Store, spool: Path, unproven: Sequence[spool_reader.Batch]) -> Iterator[str]:
    known: dict[tuple[str, str], int] = {}
    for batch in unproven:
        for location in _locations(store, batch):
            if (location, batch.writer) not in known:
                known[location, batch.writer] = _newest(store, location, batch.writer)
            if known[location, batch.writer] < batch.number:
                yield f"batch {batch.number} of the spool {spool} is not in {store.url}/{location}"


def _locations(store: Store, batch: spool_reader.Batch) -> list[str]:
    telemetry = {TELEMETRY.location(robot, store.about.shards) for robot in batch.robots}
    return sorted(telemetry | batch.tables)


def _newest(store: Store, location: str, writer: str) -> int:
    """Return up to which of the writer's batches the table has everything."""
    try:
        return store.table(location).transaction_version(writer) or 0
    except NoSuchTable:
        return 0
    except (StoreUnreachable, StoreRefused):
        raise
    except StoreError:  # which `look` tells
        return sys.maxsize
