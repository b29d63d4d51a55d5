"""One compaction of a table at a time: of two at once the table format's library lets both be.

Each then replaces the same files by its own, and every row is there twice. In a folder a lock keeps the
second away, which ends with its process; elsewhere an object that is created once, and counts for some hours.
"""

import contextlib
import fcntl
import os
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import msgspec

from ml.store.errors import StoreError
from ml.store.store import Store

PLACE: Final = "_compacting"
COUNTS: Final = timedelta(hours=2)  # after that what a killed compaction has left is in nobody's way


class Claim(msgspec.Struct, frozen=True):
    """Who compacts, until when."""

    who: str
    until: datetime


@contextlib.contextmanager
def alone(store: Store, location: str) -> Iterator[None]:
    """While nobody else compacts this table.

    Raises:
        StoreError: somebody does.

    """
    with _claimed(store, location) if store.folder is None else _locked(store.folder / location):
        yield


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StoreError(f"{folder} is being compacted by another process") from None
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def _claimed(store: Store, location: str) -> Iterator[None]:
    path = f"{PLACE}/{location.replace('/', '-')}.json"
    now = datetime.now(UTC)
    known = _claim(store, path)
    if known is not None and not timedelta(0) < known.until - now <= COUNTS:
        store.objects.remove(path)
    mine = Claim(uuid.uuid4().hex, now + COUNTS)
    if not store.objects.create(path, msgspec.json.encode(mine)):
        raise StoreError(
            f"{store.url}/{location} is being compacted by another; where that has died, remove the object "
            f"{path}, or wait {COUNTS / timedelta(hours=1):g} h"
        )
    try:
        yield
    finally:
        if _claim(store, path) == mine:
            store.objects.remove(path)


def _claim(store: Store, path: str) -> Claim | None:
    data = store.objects.read(path)
    try:
        return None if data is None else msgspec.json.decode(data, type=Claim)
    except msgspec.DecodeError:
        return None
