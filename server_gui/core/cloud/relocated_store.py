"""Receipts after a store was copied: batches of the old store are in the new one too."""

import msgspec

from ml.store.store import Store
from server_gui.core.cloud.receipt_check import tables
from server_gui.core.recording.receipts import Receipt, canonical
from server_gui.core.recording.spool import Spool


def note(spool: Spool, store: Store) -> None:
    """Write anew, of each table that came with the copy, the newest receipt: its batch is in this store too.

    Raises:
        SpoolUnusable: it could not be written.

    """
    receipts = [each for each in spool.receipts.whole() if each.is_of_batch]
    here = [each for each in receipts if canonical(each.url) == canonical(store.url)]
    known = {part.table for each in here for part in each.parts}
    left = tables(store) - known
    wanted: list[Receipt] = []
    for receipt in reversed(receipts):
        if mine := left.intersection(part.table for part in receipt.parts):
            left -= mine
            wanted.append(receipt)
    for receipt in reversed(wanted):
        spool.receipts.add(msgspec.structs.replace(receipt, url=store.url))
