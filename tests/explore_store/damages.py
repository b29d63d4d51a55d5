"""What somebody may do to a store whose rows are all there: `gwrms cloud verify` must find each."""

from collections.abc import Callable, Sequence, Set
from pathlib import Path
from typing import Final

from deltalake import DeltaTable, write_deltalake

from ml.store import NoSuchTable, Store
from ml.store.tables import TELEMETRY
from ml.store.upkeep import pins
from server_gui.core.recording.receipts import RECEIPTS, Receipt, Receipts
from tests.explore_store.robots import COUNT


def _removed(table: DeltaTable, folder: Path, number: int) -> None:
    _files(table, folder)[0].unlink()


def _cut_off(table: DeltaTable, folder: Path, number: int) -> None:
    file = _files(table, folder)[-1]
    file.write_bytes(file.read_bytes()[:-10])


def _emptied(table: DeltaTable, folder: Path, number: int) -> None:
    _files(table, folder)[0].write_bytes(b"")


def _row_gone(table: DeltaTable, folder: Path, number: int) -> None:
    table.delete(f'"{COUNT}" = {number}')


def _row_altered(table: DeltaTable, folder: Path, number: int) -> None:
    table.update(updates={f'"{COUNT}"': f'"{COUNT}" + 0.5'}, predicate=f'"{COUNT}" = {number}')


def _row_renamed(table: DeltaTable, folder: Path, number: int) -> None:
    table.update(updates={"stamp_ns": "stamp_ns + 1"}, predicate=f'"{COUNT}" = {number}')


def _doubled(table: DeltaTable, folder: Path, number: int) -> None:
    rows = table.to_pyarrow_table()
    place = rows[COUNT].to_pylist().index(number)
    write_deltalake(table, rows.slice(place, 1), mode="append")


def _rolled_back(table: DeltaTable, folder: Path, number: int) -> None:
    newest = max((folder / "_delta_log").glob("*.json"))
    for left in (folder / "_delta_log").glob(f"{newest.stem}*"):
        left.unlink()
    (folder / "_delta_log" / "_last_checkpoint").unlink(missing_ok=True)


DAMAGES: Final[tuple[Callable[[DeltaTable, Path, int], None], ...]] = (
    _removed,
    _cut_off,
    _emptied,
    _row_gone,
    _row_altered,
    _row_renamed,
    _doubled,
    _rolled_back,
)


def _receipts_cut_off(spools: Sequence[Path]) -> bool:
    """The newest receipt goes, of a batch that has no other and is still beside it."""
    for spool in spools:
        known = [each for each in Receipts(spool / RECEIPTS).all() if isinstance(each, Receipt)]
        if not known or not known[-1].parts:
            continue
        names = [(each.writer, each.batch) for each in known]
        if (spool / f"{names[-1][1]:08}.uploaded.db").exists() and names.count(names[-1]) == 1:
            lines = (spool / RECEIPTS).read_bytes().splitlines(keepends=True)
            (spool / RECEIPTS).write_bytes(b"".join(lines[:-1]))
            return True
    return False


def _pinned_gone(store: Store) -> bool:
    """A file goes that a pinned version needs, and the newest one does not."""
    for pin in pins(store):
        folder = Path(store.folder or "") / pin.location
        needed = set(_files(store.table(pin.location, pin.version), folder))
        for file in sorted(needed - set(_files(store.table(pin.location), folder))):
            file.unlink()
            return True
    return False


NAMES: Final = (*(each.__name__ for each in DAMAGES), "_receipts_cut_off", "_pinned_gone")


def do(store: Store, which: int, spools: Sequence[Path], proven: Set[int], *, all_proven: bool) -> bool:
    """Damage its telemetry or what else proves it; False where there is nothing to do this to.

    Of rows only such as are `proven`: that they are there is known to a receipt.
    """
    assert store.folder is not None
    if which >= len(DAMAGES):
        return _receipts_cut_off(spools) if which == len(DAMAGES) else _pinned_gone(store)
    for location in TELEMETRY.locations(store.about.shards):
        try:
            table = store.table(location)
        except NoSuchTable:
            continue
        rows = table.to_pyarrow_table()
        numbers = rows[COUNT].to_pylist() if COUNT in rows.column_names else []
        number = next((int(each) for each in numbers if each in proven), None)
        if DAMAGES[which] is _rolled_back:
            number = next(iter(_newest(table, store.folder / location) & proven if all_proven else ()), None)
        if number is not None:
            DAMAGES[which](table, store.folder / location, number)
            return True
    return False


def _newest(table: DeltaTable, folder: Path) -> set[int]:
    """The rows of the table's newest commit, where it has added some."""
    if '"txn"' not in max((folder / "_delta_log").glob("*.json")).read_text():
        return set()
    before = DeltaTable(folder, version=table.version() - 1)
    return _numbers(table) - _numbers(before)


def _numbers(table: DeltaTable) -> set[int]:
    rows = table.to_pyarrow_table()
    return set(rows[COUNT].to_pylist()) if COUNT in rows.column_names else set()


def _files(table: DeltaTable, folder: Path) -> list[Path]:
    paths = table.get_add_actions(flatten=True).column("path").to_pylist()
    return sorted(folder / path for path in paths)
