"""Checks of transfers: MD5 against the entity tag of an S3 service."""

import hashlib
import re
from collections.abc import Iterable, Iterator
from typing import Final

from ml.store.errors import StoreError
from ml.store.objects import Object, Objects

_PLAIN: Final = re.compile(r"[0-9a-f]{32}")


class Altered(StoreError):
    """The received data differs from the sent data."""


class Digest:
    """Digest of an object's pieces, as a service computes it for one part, or for these parts."""

    def __init__(self) -> None:
        self._whole = hashlib.md5(usedforsecurity=False)
        self._pieces = hashlib.md5(usedforsecurity=False)
        self._count = 0

    def of(self, pieces: Iterable[bytes]) -> Iterator[bytes]:
        """Yield the same pieces, counted in."""
        for piece in pieces:
            self._whole.update(piece)
            self._pieces.update(hashlib.md5(piece, usedforsecurity=False).digest())
            self._count += 1
            yield piece

    @property
    def tags(self) -> tuple[str, str]:
        """Entity tags as S3 makes them."""
        return self._whole.hexdigest(), f"{self._pieces.hexdigest()}-{self._count}"


def proven(objects: Objects, found: Object, digest: Digest, *, ours: bool) -> bool:
    """Return whether the object's content is proven to be what was read or written; False: its size alone is.

    `ours` are tags of what we have written ourselves, which we know to make; what others have written in
    pieces cannot be told by its tag. Where a service that encrypts makes tags of its own, the object is read
    again.

    Raises:
        Altered: it is not the same.

    """
    if found.tag in digest.tags:
        return True
    if not ours and not _PLAIN.fullmatch(found.tag):
        return False
    again = Digest()
    for _ in again.of(objects.pieces(found)):
        pass
    if again.tags != digest.tags:
        raise Altered(f"{objects.url}/{found.path} was altered on its way; try again")
    return True
