"""A store mended: files that are gone or damaged taken out of its tables, and batches brought again.

What is brought is what the receipts say was there and is not, and what went to a store and has no receipt
(any more); both from the spool's second copies. A file goes only where all that it held comes back so.
Interrupted anywhere, it is simply called again.
"""

import contextlib
import uuid
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import pyarrow.compute as pc

from ml.store import durable, mending, reading
from ml.store.errors import StoreError
from ml.store.fragments import DataFile
from ml.store.private import FILE
from ml.store.snapshot import Snapshot
from ml.store.store import Store
from ml.store.tables import EVENTS
from ml.store.translation import translated
from server_gui.core.cloud import verify
from server_gui.core.cloud.receipt_check import Proof, prove
from server_gui.core.cloud.repeated_upload import Again, Untouched, Whose, whose
from server_gui.core.cloud.row_counting import Advance, Batch
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.errors import Damaged, SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS, Altered, Receipt, ReceiptPart, Receipts
from server_gui.core.recording.segment import Segment
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import Sent, upload


@dataclass(frozen=True, slots=True)
class RepairPlan:
    """Plan of a repair: files to take out, second copies to restore, and rows that are lost."""

    files: Sequence[DataFile]
    batches: Sequence[int]
    lost: Sequence[str]
    kept: Sequence[DataFile] = ()  # damaged, and they stay: rows of them are in no second copy
    behind: Sequence[int] = ()  # second copies that cannot be brought as a whole while these are there

    @property
    def accepted(self) -> "RepairPlan":
        """The same, where somebody accepts that such rows are lost."""
        batches = sorted({*self.batches, *self.behind})
        return RepairPlan([*self.files, *self.kept], batches, self.lost)


@dataclass(frozen=True, slots=True)
class Mended:
    """Result of a repair, with its failures in words."""

    files: Sequence[DataFile]
    batches: Sequence[int]
    problems: Sequence[str]


def plan(store: Store, spool: Spool, expect: Callable[[int], AbstractContextManager[Advance]]) -> RepairPlan:
    """Look what there is to mend; nothing is changed.

    Raises:
        StoreError: it could not be looked, or a table's log is damaged.

    """
    receipts = verify.receipts_of(spool.folder)
    copies = verify.second_copies(spool.folder)
    unproven = {batch.number for batch in verify.copies(spool.folder, _known(receipts))[0]}
    held = _held(store, spool, unproven)
    said = [Receipt(*batch, store.url, parts) for batch, parts in held.items()]
    broken, proof = _look(store, [*receipts, *said], expect, values=False)
    broken = [*broken, *proof.misread]
    lacking = set(proof.lacking)
    if broken or mending.taken_out(store)[0]:  # nobody can count what files held of these
        lacking |= {batch for batch, _ in proof.vague}
    again = {number for number, batch in copies.items() if batch in lacking} | unproven
    if broken:
        held |= _held(store, spool, {number for _, number in lacking} - unproven)
    kept = _kept(broken, proof, held)
    waiting = spool.waiting()  # the next upload brings these
    nowhere = sorted(number for _, number in proof.lacking - set(copies.values()) if number not in waiting)
    lost = [_nowhere(store, nowhere)] if nowhere else []
    staying = [file for file in broken if whose(file) in kept]
    going = [file for file in broken if whose(file) not in kept]
    open_ = {batch for batch, part, _ in proof.missing if whose(part) not in kept}
    missing = [*((batch, part) for batch, part, _ in proof.missing), *proof.vague]
    behind = {batch for batch, part in missing if whose(part) in kept}
    now = {number for number in again if copies[number] in open_ or copies[number] not in behind}
    lost += [_told(store, file) for file in staying]
    later = sorted(number for number in again if copies[number] in behind)
    return RepairPlan(going, sorted(now), lost, staying, later)


def _nowhere(store: Store, batches: Sequence[int]) -> str:
    """Return in words that this computer cannot restore them, and other explanations."""
    words = f"the spool has no second copy of {verify.told_batches(batches)}: bring one back"
    wanted = pc.field("kind") == EventKind.FORGOTTEN.value
    times: list[datetime] = []
    with contextlib.suppress(StoreError), translated(f"{store.url}/{EVENTS.name} cannot be read"):
        times = reading.dataset(store, EVENTS).to_table(columns=["utc"], filter=wanted)["utc"].to_pylist()
    if not times:
        return words
    return (
        f"{words}. A wearer was forgotten here on {max(times):%Y-%m-%d %H:%M} UTC (gwrms cloud forget): "
        "where these were their rows nothing is lost, and --accept-loss counts what is there as what was sent"
    )


def _told(store: Store, file: DataFile) -> str:
    return (
        f"{store.url}/{file.location}/{file.path} is damaged or gone, and stays in its table: not all of its "
        f"{file.rows} rows are in second copies here. Bring it back from a copy of the store; with "
        "--accept-loss it is taken out, and what can be brought is brought"
    )


def _held(store: Store, spool: Spool, numbers: Collection[int]) -> dict[Batch, tuple[ReceiptPart, ...]]:
    """Return the rows that second copies and pending batches could restore; unreadable ones are left out."""
    found = {}
    untouched = Untouched.existing(store.url) if numbers else store
    for number in numbers:
        with contextlib.suppress(SpoolUnusable):
            sent = _sent(untouched, spool, number)
            found[sent.writer, number] = sent.parts
    return found


def _kept(
    broken: Iterable[DataFile], proof: Proof, held: Mapping[Batch, Iterable[ReceiptPart]]
) -> set[Whose]:
    """Return whose damaged files hold more than comes back when they go."""
    rows: Counter[tuple[Batch, Whose, object]] = Counter()
    for batch, parts in held.items():
        rows.update({_name(batch, part): part.rows for part in parts})
    comes: Counter[Whose] = Counter()
    nowhere = set()
    for batch, part, missing in proof.missing:
        if rows[_name(batch, part)] < part.rows:
            nowhere.add(whose(part))
        comes[whose(part)] += missing
    goes: Counter[Whose] = Counter()
    for file in broken:
        goes[whose(file)] += file.rows
    return {each for each in goes if each in nowhere or comes[each] < goes[each]}


def _name(batch: Batch, part: ReceiptPart) -> tuple[Batch, Whose, object]:
    """By what a receipt's part is found again in a second copy, of which some may be damaged."""
    return batch, whose(part), part.stream and (part.stream.connection, part.stream.stream)


def mend(store: Again, spool: Spool, plan: RepairPlan, advance: Callable[[int], object]) -> Mended:
    """Do it.

    Raises:
        StoreError: it is not known what was done; call it again.

    """
    mending.take_out(store, plan.files, advance)
    store.closed = frozenset(whose(file) for file in plan.kept)
    brought, problems = [], list(plan.lost)
    for number in plan.batches:
        try:
            _bring(store, spool, number, is_behind=number in plan.behind)
            brought.append(number)
        except (Damaged, SpoolUnusable) as error:
            problems.append(f"batch {number}: {error}")
        advance(1)
    return Mended(plan.files, brought, problems)


def accept(
    store: Store,
    spool: Spool,
    expect: Callable[[int], AbstractContextManager[Advance]],
    why: str = "what was missing of it was accepted",
) -> None:
    """Count what is there as what was sent; what was said before is kept beside.

    Raises:
        StoreError: something is damaged, so nobody can say what is there.

    """
    receipts = verify.receipts_of(spool.folder)
    broken, proof = _look(store, receipts, expect, values=True)
    for file in (*broken, *proof.misread):
        raise StoreError(
            f"nothing was accepted: {store.url}/{file.location}/{file.path} is damaged or gone; bring it "
            "back from a copy, or run gwrms cloud mend again"
        )
    whole = verify.own_receipts(receipts, spool.folder)
    if len(whole) < len(receipts):
        _rewrite(spool.folder / RECEIPTS, whole)
    for (writer, number), parts in sorted(proof.wrong.items()):
        spool.receipts.add(Receipt(writer, number, store.url, parts, (why,)))
    for number in verify.nowhere(spool.folder, whole):
        spool.receipts.add(Receipt(spool.id, number, store.url, (), ("that it is nowhere was accepted",)))


def _look(
    store: Store,
    receipts: Sequence[Receipt | Altered],
    expect: Callable[[int], AbstractContextManager[Advance]],
    *,
    values: bool,
) -> tuple[list[DataFile], Proof]:
    """Return damaged and missing files, and the proof of the others; with `values` every value."""
    store = Snapshot.existing(store.url)  # each table is opened once
    found = verify.files(store)
    with expect(2 * len(found)) as advance:
        broken = verify.broken(store, found, advance, deep=True)
        gone = {(file.location, file.path) for file in broken}
        sound = [file for file in found if (file.location, file.path) not in gone]
        return broken, prove(store, receipts, sound, advance, values=values)


def _rewrite(file: Path, receipts: Sequence[Receipt]) -> None:
    """Rewrite the file with these only; the old one stays beside it."""
    draft = file.with_name(f"{file.name}.draft")
    draft.unlink(missing_ok=True)
    draft.touch(FILE)
    anew = Receipts(draft)
    for each in receipts:
        anew.add(each)
    file.with_name(f"{file.name}.{uuid.uuid4().hex[:8]}.damaged").hardlink_to(file)
    draft.replace(file)
    durable.synchronise([file])


def _bring(store: Again, spool: Spool, number: int, *, is_behind: bool) -> None:
    """Restore the missing rows of a second copy, and its receipt if there is none."""
    store.left.clear()
    store.passed.clear()
    sent = _sent(store, spool, number)
    left = list(store.left)
    if is_behind:
        left += (f"{store.url}/{each} waits for its damaged files" for each in sorted(store.passed))
    if left:
        raise Damaged(f"{'; '.join(left)}; all else of it is in the store")
    if sent.is_damaged and (sent.writer, number) in _known(verify.receipts_of(spool.folder)):
        raise Damaged("; ".join(sent.lost))  # what its receipt says of the whole batch still counts
    spool.receipts.add(Receipt(sent.writer, number, store.url, sent.parts, sent.lost))


def _sent(store: Store, spool: Spool, number: int) -> Sent:
    copy, waits = (spool.folder / f"{number:08}{suffix}" for suffix in (".uploaded.db", ".db"))
    with contextlib.closing(Segment(copy if copy.exists() else waits, number, written=True)) as segment:
        return upload(segment, spool.id, store)


def _known(receipts: Sequence[object]) -> set[tuple[str, int]]:
    return {(each.writer, each.batch) for each in receipts if isinstance(each, Receipt)}
