"""A file that is there whole or not at all."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from ml.store import StoreError
from ml.store.private import opener


@contextlib.contextmanager
def draft(file: Path) -> Iterator[Path]:
    """Give another name to write to within the block; it becomes `file` if that ends well, else it goes.

    It is its owner's alone.
    """
    if not file.parent.is_dir():
        raise FileNotFoundError(f"{file} cannot be written: there is no folder {file.parent}")
    written = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        written.unlink(missing_ok=True)
        os.close(opener(str(written), os.O_CREAT | os.O_EXCL | os.O_WRONLY))
        yield written
        written.replace(file)
    except OSError as error:
        if error.errno is None or isinstance(error, StoreError):  # of what is read
            raise
        raise OSError(f"{file} cannot be written: {os.strerror(error.errno)}") from error
    finally:
        written.unlink(missing_ok=True)
