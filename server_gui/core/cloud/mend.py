"""A store mended: files that are gone or damaged taken out of its tables, and batches brought again.

What is brought is what the receipts say was there and is not, and what went to a store and has no receipt
(any more); both from the spool's second copies. Interrupted anywhere, it is simply called again.
"""

import contextlib
import uuid
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from ml.store import durable, mending
from ml.store.fragments import DataFile
from ml.store.private import FILE
from ml.store.store import Batches, Store
from ml.store.tables import Table
from server_gui.core.cloud import verify
from server_gui.core.cloud.proving import Advance, prove
from server_gui.core.recording.errors import Damaged, SpoolUnusable
from server_gui.core.recording.receipts import RECEIPTS, Receipt, Receipts
from server_gui.core.recording.segment import Segment
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import upload


class Again(Store):
    """A store to which what completes a batch may be brought, also where that was brought before and lost."""

    def append(
        self, table: Table, location: str, schema: pa.Schema, batches: Batches, writer: str, sequence: int
    ) -> bool:
        """As `Store.append`; what completes a batch is asked for only where it is known to be missing."""
        if super().append(table, location, schema, batches, writer, sequence):
            return True
        completes = "." in writer.rpartition("/")[2]
        named = f"{writer}.{uuid.uuid4().hex[:12]}"
        return completes and super().append(table, location, schema, batches, named, sequence)


@dataclass(frozen=True, slots=True)
class Plan:
    """What is to be done: files to take out, second copies to bring again, what nobody can bring."""

    files: Sequence[DataFile]
    batches: Sequence[int]
    lost: Sequence[str]


def plan(store: Store, spool: Spool, expect: Callable[[int], AbstractContextManager[Advance]]) -> Plan:
    """Look what there is to mend; nothing is changed.

    Raises:
        StoreError: it could not be looked, or a table's log is damaged.

    """
    receipts = verify.receipts_of(spool.folder)
    found = verify.files(store)
    with expect(2 * len(found)) as advance:
        broken = verify.broken(store, found, advance, deep=True)
        gone = {(file.location, file.path) for file in broken}
        sound = [file for file in found if (file.location, file.path) not in gone]
        proof = prove(store, receipts, sound, advance, values=False)
    copies = verify.second_copies(spool.folder)
    unproven = {batch.number for batch in verify.copies(spool.folder, _known(receipts))[0]}
    again = {number for number, batch in copies.items() if batch in proof.lacking} | unproven
    waiting = spool.waiting()  # the next upload brings these
    nowhere = sorted(number for _, number in proof.lacking - set(copies.values()) if number not in waiting)
    lost = (
        [f"the spool has no second copy of {verify.told_batches(nowhere)}: bring one back"] if nowhere else []
    )
    return Plan(broken, sorted(again), lost)


def mend(store: Again, spool: Spool, plan: Plan, advance: Callable[[int], object]) -> list[str]:
    """Do it; in words, what could not be done.

    Raises:
        StoreError: it is not known what was done; call it again.

    """
    mending.take_out(store, plan.files, advance)
    problems = list(plan.lost)
    for number in plan.batches:
        try:
            _bring(store, spool, number)
        except (Damaged, SpoolUnusable) as error:
            problems.append(f"batch {number}: {error}")
        advance(1)
    return problems


def accept(store: Store, spool: Spool, expect: Callable[[int], AbstractContextManager[Advance]]) -> None:
    """From now on what is there counts as what was sent; what was said before is kept beside.

    Raises:
        StoreError: a table's log is damaged, so nobody can say what is there.

    """
    receipts = verify.receipts_of(spool.folder)
    found = verify.files(store)
    with expect(2 * len(found)) as advance:
        broken = verify.broken(store, found, advance, deep=False)
        gone = {(file.location, file.path) for file in broken}
        sound = [file for file in found if (file.location, file.path) not in gone]
        proof = prove(store, receipts, sound, advance)
    whole = verify.own_receipts(receipts, spool.folder)
    if len(whole) < len(receipts):
        _rewrite(spool.folder / RECEIPTS, whole)
    for (writer, number), parts in sorted(proof.wrong.items()):
        spool.receipts.add(
            Receipt(writer, number, store.url, parts, ("what was missing of it was accepted",))
        )
    for number in verify.nowhere(spool.folder, whole):
        spool.receipts.add(Receipt(spool.id, number, store.url, (), ("that it is nowhere was accepted",)))


def _rewrite(file: Path, receipts: Sequence[Receipt]) -> None:
    """The file with these alone; as it was it stays beside."""
    draft = file.with_name(f"{file.name}.draft")
    draft.unlink(missing_ok=True)
    draft.touch(FILE)
    anew = Receipts(draft)
    for each in receipts:
        anew.add(each)
    file.with_name(f"{file.name}.{uuid.uuid4().hex[:8]}.damaged").hardlink_to(file)
    draft.replace(file)
    durable.synchronise([file])


def _bring(store: Again, spool: Spool, number: int) -> None:
    """What the store lacks of a second copy, and its receipt where there is none."""
    file = spool.folder / f"{number:08}.uploaded.db"
    with contextlib.closing(Segment(file, number)) as segment:
        sent = upload(segment, spool.id, store)
    if sent.is_damaged and (sent.writer, number) in _known(verify.receipts_of(spool.folder)):
        raise Damaged("; ".join(sent.lost))  # what its receipt says of the whole batch still counts
    spool.receipts.add(Receipt(sent.writer, number, store.url, sent.parts, sent.lost))


def _known(receipts: Sequence[object]) -> set[tuple[str, int]]:
    return {(each.writer, each.batch) for each in receipts if isinstance(each, Receipt)}
