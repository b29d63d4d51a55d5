"""Keeps out of memory what libraries import by the way and a robot has no use for."""

import contextlib
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def without(*names: str) -> Iterator[None]:
    """While inside, these modules cannot be imported, where they are not there already.

    For what is imported only if it is there: asyncio goes without ssl, hashlib has its own digests.
    Afterwards they can be imported again.
    """
    absent = [name for name in names if name not in sys.modules]
    sys.modules.update(dict.fromkeys(absent))  # type: ignore[arg-type]  # None there means: not to be found
    try:
        yield
    finally:
        for name in absent:
            sys.modules.pop(name, None)
