"""Keeps out of memory what libraries import by the way and a robot has no use for."""

import contextlib
import importlib
import sys
from collections.abc import Iterator
from types import ModuleType


@contextlib.contextmanager
def without(*names: str) -> Iterator[None]:
    """Forbid importing these modules within the block, unless they are there already.

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


@contextlib.contextmanager
def standing_in(name: str) -> Iterator[None]:
    """Let importing `name` within the block give a module of empty classes, unless it is there already.

    For what a library needs for a part of it that nobody uses: canopen reads an EDS without python-can.
    Afterwards it can be imported itself.
    """
    if name in sys.modules:
        yield
        return
    sys.modules[name] = _StandIn(name)
    try:
        yield
    finally:
        del sys.modules[name]


def import_canopen() -> None:
    """Import canopen without python-can, which a process without a bus does not need: 10 MB, 0.2 s."""
    with standing_in("can"):
        importlib.import_module("canopen")


class _StandIn(ModuleType):
    def __getattr__(self, name: str) -> type:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {})
