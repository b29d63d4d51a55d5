"""Test of a store for several writers: of many that create one object, exactly one may succeed."""

import functools
import uuid
from concurrent.futures import ThreadPoolExecutor
from typing import Final

from ml.store.errors import UnsafeStore
from ml.store.objects import Objects

RACERS: Final = 4
ROUNDS: Final = 3


def probe(objects: Objects) -> None:
    """Create one object several times, at once and one after another; leave nothing behind.

    Raises:
        UnsafeStore: more than one succeeded; two servers would silently lose each other's data there.

    """
    for _ in range(ROUNDS):
        if not _one_wins(objects, f"_probe/{uuid.uuid4()}"):
            raise UnsafeStore(
                f"the store {objects.url} does not do conditional writes (If-None-Match: *): several servers "
                "would overwrite each other there. Use another service, or let one server alone write to it "
                "and say so when it is first used"
            )


def _one_wins(objects: Objects, path: str) -> bool:
    bodies = [uuid.uuid4().bytes for _ in range(RACERS)]
    with ThreadPoolExecutor(RACERS) as racers:
        created = list(racers.map(functools.partial(objects.create, path), bodies))
    late = objects.create(path, b"late")
    content = objects.read(path)
    objects.remove(path)
    winners = [body for body, won in zip(bodies, created, strict=True) if won]
    return winners == [content] and not late
