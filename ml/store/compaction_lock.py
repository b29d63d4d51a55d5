"""One compaction of a table at a time: of two at once the table format's library lets both be.

Each then replaces the same files by its own, and every row is there twice. In a folder a lock keeps the
second away, which ends with its process; elsewhere an object that is created once, and counts for some hours.

An object whose owner has died is not removed by who finds it: two may, and the later one would remove what
the earlier has put in its place. Who takes over creates another object, which is named after the dead one,
so that only one can; and removes both, the older first, when it has done its work.
"""

import contextlib
import hashlib
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import msgspec

from ml.store import locks
from ml.store.errors import StoreError
from ml.store.store import Store

PLACE: Final = "_compacting"
COUNTS: Final = timedelta(hours=2)  # after that what a killed compaction has left is in nobody's way


class Claim(msgspec.Struct, frozen=True):
    """Claim of a compaction, until its end."""

    who: str
    until: datetime


@contextlib.contextmanager
def alone(store: Store, location: str) -> Iterator[None]:
    """Keep others from compacting this table within the block.

    Raises:
        StoreError: somebody does.

    """
    with _claimed(store, location) if store.folder is None else _locked(store.folder / location):
        yield


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    with contextlib.ExitStack() as held:
        try:
            held.enter_context(locks.of_folder(folder))
        except BlockingIOError:
            raise StoreError(f"{folder} is being compacted by another process") from None
        yield


@contextlib.contextmanager
def _claimed(store: Store, location: str) -> Iterator[None]:
    base = f"{PLACE}/{location.replace('/', '-')}"
    path, now = f"{base}.json", datetime.now(UTC)
    dead: list[tuple[str, Claim]] = []
    while (known := _claim(store, path)) is not None:
        if timedelta(0) < known.until - now <= 2 * COUNTS:  # further away than a clock may be ahead
            raise _busy(store, location, path)
        dead.append((path, known))
        path = f"{base}.{_digest(path, known.who)}.json"
    mine = Claim(uuid.uuid4().hex, now + COUNTS)
    if not store.objects.create(path, msgspec.json.encode(mine)):
        raise _busy(store, location, path)
    is_first = False
    try:
        is_first = all(_claim(store, each) == claim for each, claim in dead)
        if not is_first:  # whoever took it over has done so and gone since, and a third may have come
            raise _busy(store, location, f"{base}.json")
        yield
    finally:
        if datetime.now(UTC) < mine.until:  # else it may have been taken over
            for each in [*(dead if is_first else ()), (path, mine)]:
                store.objects.remove(each[0])


def _busy(store: Store, location: str, path: str) -> StoreError:
    return StoreError(
        f"{store.url}/{location} is being compacted by another; where that has died, remove the object "
        f"{path}, or wait {COUNTS / timedelta(hours=1):g} h"
    )


def _claim(store: Store, path: str) -> Claim | None:
    """Return an object's claim; an unreadable one counts from its writing time, as long as any."""
    data = store.objects.read(path)
    if data is None:
        return None
    try:
        return msgspec.json.decode(data, type=Claim)
    except msgspec.DecodeError:
        found = store.objects.find(path)
        return None if found is None else Claim(_digest(path, data.hex()), found.changed + COUNTS)


def _digest(*words: str) -> str:
    return hashlib.blake2b("/".join(words).encode(), digest_size=8).hexdigest()
