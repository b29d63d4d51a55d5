"""Bytes as a file, for what reads files."""

import atexit
import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(tempfile.mkdtemp(prefix="gwrms-fuzz-"))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)


@contextlib.contextmanager
def as_file(name: str, data: bytes) -> Iterator[Path]:
    """One file at a time has this name."""
    path = FOLDER / name
    path.write_bytes(data)
    yield path
