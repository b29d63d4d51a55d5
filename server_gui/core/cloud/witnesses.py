"""Signed journal entries in store and spool: this desk's witnesses."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pyarrow.dataset

from gateway.wire.control import SignedHead
from ml.store import Store, reading
from ml.store.tables import JOURNAL
from ml.store.translation import translated
from server_gui.core.cloud import spool_reader


def witnesses(store: Store | None, spool: Path, robot: str) -> list[SignedHead]:
    """Return those of a robot, oldest first, each once."""
    found = {*_stored(store, robot), *_waiting(spool, robot)}
    return sorted(
        (msgspec.json.decode(each, type=SignedHead) for each in found), key=lambda head: (head.utc_ns, head.n)
    )


def _stored(store: Store | None, robot: str) -> Iterator[str]:
    if store is None:
        return
    with translated(f"{store.url}/{JOURNAL.name} cannot be read"):
        table = reading.dataset(store, JOURNAL)
        if "witness" not in table.schema.names:  # of a store from before there were any
            return
        column = pyarrow.dataset.field
        mine = (column("robot") == robot) & column("witness").is_valid()
        yield from table.to_table(columns=["witness"], filter=mine)["witness"].to_pylist()


def _waiting(spool: Path, robot: str) -> Iterator[str]:
    for row in spool_reader.rows(spool, JOURNAL):
        if row["robot"] == robot and row["witness"] is not None:
            yield row["witness"]
