"""A table made readable again of which files are gone or damaged: these are taken out of it, and noted.

First it is noted what goes (`mended/` in the store), then what is still there of a damaged file is moved to
`mended/` too, then the table's log lets go of the files. Interrupted anywhere, it is simply called again.
"""

import uuid
from collections.abc import Callable, Iterable, Sequence
from datetime import datetime
from typing import Final
from urllib.parse import unquote

import msgspec
from deltalake.exceptions import CommitFailedError

from ml.store import durable
from ml.store.errors import StoreError, translated
from ml.store.fragments import DataFile
from ml.store.store import NO_HOOKS, Store

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


def taken_out(store: Store) -> list[TakenOut]:
    """Every file that was taken out of a table, once."""
    names = [name for name in store.objects.names(_NOTED) if name.endswith(".json")]
    notes = (store.objects.read(name) for name in names)
    try:
        found = [each for data in notes if data for each in msgspec.json.decode(data, type=list[TakenOut])]
    except msgspec.DecodeError as error:
        raise StoreError(f"a note in {store.url}/{_NOTED} is damaged: {error}") from error
    return list({(each.location, each.path): each for each in found}.values())


def _note(store: Store, location: str, files: Iterable[DataFile]) -> None:
    told = [
        TakenOut(each.location, each.path, each.rows, each.robot, each.session, each.first, each.last)
        for each in files
    ]
    name = f"{_NOTED}/{location.replace('/', '-')}.{uuid.uuid4().hex}.json"
    store.objects.create(name, msgspec.json.encode(told))


def _move(store: Store, path: str) -> None:
    """Keep what is there of a damaged file, for somebody to look at."""
    found = store.objects.find(path)
    if found is None:
        return
    to = f"{_NOTED}/{path}"
    store.objects.write(to, store.objects.pieces(found))
    if store.folder is not None:
        durable.synchronise([store.folder / to])
    store.objects.remove(path)


def _let_go(store: Store, location: str, paths: set[str]) -> None:
    for _ in range(ATTEMPTS):
        delta = store.table(location)
        gone = {unquote(path) for path in delta.repair(dry_run=True)["files_removed"]}
        there = [path for path in gone if store.objects.find(f"{location}/{path}") is not None]
        if there or gone - paths:
            raise StoreError(
                f"{store.url}/{location} is listed without {len(there) or len(gone - paths)} files that are "
                "there, or were a moment ago: nothing was taken out of it; try again later"
            )
        if not gone:
            return
        with store.unfinished(location):
            try:
                delta.repair(post_commithook_properties=NO_HOOKS)
            except CommitFailedError:
                continue
            store.make_last(location, delta)
        return
    raise StoreError(f"{store.url}/{location} was changed meanwhile, {ATTEMPTS} times; try again later")
