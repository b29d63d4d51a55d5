"""A table made readable again of which files are gone or damaged: these are taken out of it, and noted.

First it is noted what goes (`mended/` in the store), then what is still there of a damaged file is moved to
`mended/` too, then the table's log lets go of the files. Interrupted anywhere, it is simply called again.
"""

import time
import uuid
from collections.abc import Callable, Iterable, Sequence, Set
from datetime import datetime
from typing import Final

import msgspec
from deltalake import CommitProperties, DeltaTable, Transaction
from deltalake.exceptions import CommitFailedError
from deltalake.transaction import RemoveAction

from ml.store import durable
from ml.store.errors import StoreError
from ml.store.fragments import DataFile, data_files
from ml.store.store import NO_HOOKS, Store
from ml.store.translation import translated

_NOTED: Final = "mended"
ATTEMPTS: Final = 10  # while others write to the table


class TakenOut(msgspec.Struct, frozen=True):
    """A file that a table has no more, and what it held; `path` is below the table's location."""

    location: str
    path: str
    rows: int
    robot: str | None
    session: str | None
    first: datetime | None
    last: datetime | None


def take_out(store: Store, files: Sequence[DataFile], advance: Callable[[int], object]) -> None:
    """Let the tables go on without these files, which are not there or cannot be read.

    Raises:
        StoreError: it is not done for all of them; call it again.

    """
    for location in sorted({file.location for file in files}):
        mine = [file for file in files if file.location == location]
        store.mend(location)
        _note(store, location, mine)
        for file in mine:
            _move(store, f"{location}/{file.path}")
        with translated(f"{store.url}/{location} cannot be mended"):
            _let_go(store, location, {file.path for file in mine})
        advance(len(mine))


def taken_out(store: Store) -> tuple[list[TakenOut], list[str]]:
    """Return every file that was taken out of a table, once; in words, which notes of that cannot be read."""
    found: dict[tuple[str, str], TakenOut] = {}
    problems = []
    for name in store.objects.names(_NOTED):
        if "/" not in name.removeprefix(f"{_NOTED}/") and name.endswith(".json"):
            try:
                told = msgspec.json.decode(store.objects.read(name) or b"[]", type=list[TakenOut])
                found |= {(each.location, each.path): each for each in told}
            except (msgspec.DecodeError, UnicodeDecodeError) as error:
                problems.append(
                    f"{store.url}/{name} is damaged ({error}): bring it back from a copy of the store, or "
                    "remove it; it says what gwrms cloud mend has taken out"
                )
    return list(found.values()), problems


def _note(store: Store, location: str, files: Iterable[DataFile]) -> None:
    told = [
        TakenOut(each.location, each.path, each.rows, each.robot, each.session, each.first, each.last)
        for each in files
    ]
    name = f"{_NOTED}/{location.replace('/', '-')}.{uuid.uuid4().hex}.json"
    store.objects.create(name, msgspec.json.encode(told))


def _move(store: Store, path: str) -> None:
    """Keep the remains of a damaged file for inspection."""
    found = store.objects.find(path)
    if found is None:
        return
    to = f"{_NOTED}/{path}"
    store.objects.write(to, store.objects.pieces(found))
    if store.folder is not None:
        durable.synchronise([store.folder / to])
    store.objects.remove(path)


def _let_go(store: Store, location: str, paths: Set[str]) -> None:
    """Remove these files from the log; other missing files stay in it."""
    there = [path for path in paths if store.objects.find(f"{location}/{path}") is not None]
    if there:
        raise StoreError(
            f"{store.url}/{location} has {len(there)} files that were damaged or gone a moment ago: "
            "nothing was taken out of it; try again later"
        )
    for _ in range(ATTEMPTS):
        delta = store.table(location)
        gone = sorted(paths & {file.path for file in data_files(delta, location)})
        if not gone:
            return
        with store.unfinished(location):
            try:
                _remove(delta, gone)
            except CommitFailedError:
                continue
            store.make_last(location, delta)
        return
    raise StoreError(f"{store.url}/{location} was changed meanwhile, {ATTEMPTS} times; try again later")


def _remove(delta: DeltaTable, paths: Iterable[str]) -> None:
    now_ms = time.time_ns() // 1_000_000
    named = Transaction(f"{_NOTED}/{uuid.uuid4().hex}", 1)  # by its end an entry is known to be whole
    delta.create_write_transaction(
        [RemoveAction(path, True, now_ms) for path in paths],
        "append",
        delta.schema(),
        delta.metadata().partition_columns,
        commit_properties=CommitProperties(app_transactions=[named]),
        post_commithook_properties=NO_HOOKS,
    )
    delta.update_incremental()
