"""Locks of files and folders, which end with the process that has them, however it ends."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType


class NoLocks(OSError):
    """The system has none; the message says what that means."""


def check() -> ModuleType:
    """Return the module for locks; raises `NoLocks` on systems without, such as Windows."""
    try:
        import fcntl
    except ModuleNotFoundError:
        raise NoLocks(
            f"files cannot be locked on {sys.platform}, so nothing can be kept safely in a folder there: "
            "record on Linux or macOS"
        ) from None
    return fcntl


def hold(descriptor: int) -> None:
    """Lock an open file as long as it is open; raises `BlockingIOError` where somebody else has locked it."""
    fcntl = check()
    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextlib.contextmanager
def of_folder(folder: Path, *, shared: bool = False) -> Iterator[None]:
    """Lock a folder within the block; shared waits, else `BlockingIOError` where somebody has locked it."""
    fcntl = check()
    with _locked(folder, fcntl.LOCK_SH if shared else fcntl.LOCK_EX | fcntl.LOCK_NB):
        yield


@contextlib.contextmanager
def turn(folder: Path) -> Iterator[None]:
    """Lock a folder within the block, for one writer after another: waits, so what is done there is short."""
    with _locked(folder, check().LOCK_EX):
        yield


@contextlib.contextmanager
def _locked(folder: Path, how: int) -> Iterator[None]:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        check().flock(descriptor, how)
        yield
    finally:
        os.close(descriptor)
