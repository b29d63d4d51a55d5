"""What somebody may do to a store whose rows are all there: `gwrms cloud verify` must find each."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from deltalake import DeltaTable, write_deltalake

from ml.store import NoSuchTable, Store
from ml.store.tables import TELEMETRY
from tests.explore_store.robots import COUNT


def _removed(table: DeltaTable, folder: Path) -> None:
    _files(table, folder)[0].unlink()


def _cut_off(table: DeltaTable, folder: Path) -> None:
    file = _files(table, folder)[-1]
    file.write_bytes(file.read_bytes()[:-10])


def _emptied(table: DeltaTable, folder: Path) -> None:
    _files(table, folder)[0].write_bytes(b"")


def _row_gone(table: DeltaTable, folder: Path) -> None:
    table.delete(f'"{COUNT}" = {_count(table)}')


def _row_altered(table: DeltaTable, folder: Path) -> None:
    table.update(updates={f'"{COUNT}"': f'"{COUNT}" + 0.5'}, predicate=f'"{COUNT}" = {_count(table)}')


def _row_renamed(table: DeltaTable, folder: Path) -> None:
    table.update(updates={"stamp_ns": "stamp_ns + 1"}, predicate=f'"{COUNT}" = {_count(table)}')


def _doubled(table: DeltaTable, folder: Path) -> None:
    write_deltalake(table, table.to_pyarrow_table().slice(0, 1), mode="append")


def _rolled_back(table: DeltaTable, folder: Path) -> None:
    newest = max((folder / "_delta_log").glob("*.json"))
    for left in (folder / "_delta_log").glob(f"{newest.stem}*"):
        left.unlink()
    (folder / "_delta_log" / "_last_checkpoint").unlink(missing_ok=True)


DAMAGES: Final[tuple[Callable[[DeltaTable, Path], None], ...]] = (
    _removed,
    _cut_off,
    _emptied,
    _row_gone,
    _row_altered,
    _row_renamed,
    _doubled,
    _rolled_back,
)


def do(store: Store, which: int) -> bool:
    """Damage its telemetry; False where there is none, or nothing that this could be done to."""
    assert store.folder is not None
    for location in TELEMETRY.locations(store.about.shards):
        try:
            table = store.table(location)
        except NoSuchTable:
            continue
        rows = table.to_pyarrow_table()
        added = '"txn"' in max((store.folder / location / "_delta_log").glob("*.json")).read_text()
        if rows.num_rows and COUNT in rows.column_names and (added or DAMAGES[which] is not _rolled_back):
            DAMAGES[which](table, store.folder / location)
            return True
    return False


def _files(table: DeltaTable, folder: Path) -> list[Path]:
    paths = table.get_add_actions(flatten=True).column("path").to_pylist()
    return sorted(folder / path for path in paths)


def _count(table: DeltaTable) -> float:
    """That of some row."""
    return float(table.to_pyarrow_table()[COUNT][0].as_py())
