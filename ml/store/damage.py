"""Proof of damage of a table's file: two independent ways of reading must agree.

Arrow reads the store in a way of its own, all else by the store's objects. Where one of them finds a file
damaged, a network or a permission may be the reason; only what both find is damage.
"""

import tempfile
import textwrap
from typing import Final

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow.fs import FileType

from ml.store.errors import StoreError
from ml.store.fragments import DataFile
from ml.store.objects import Object
from ml.store.sessions import footer
from ml.store.store import Store
from ml.store.translation import translated

_LONGEST: Final = 300  # of what a library says
_UNREADABLE: Final = (pa.ArrowException, OSError, ValueError)  # what pyarrow raises, of whatever bytes


def damage(store: Store, file: DataFile, size_bytes: int | None, *, deep: bool) -> str | None:
    """Return the damage of a file with this listed size, in words; None if it is intact.

    Its footer is read, and with `deep` every value.

    Raises:
        StoreError: nobody can say; it cannot be reached, may not be read, or is read once so and once so.

    """
    name = f"{store.url}/{file.location}/{file.path}"
    if size_bytes != file.size_bytes:
        return proven(store, file, f"{name} was not listed as it should be")
    try:
        rows = _decoded(store, file) if deep else footer(store, file).num_rows
    except (StoreError, pa.ArrowException) as error:
        return proven(store, file, str(error))
    return None if rows == file.rows else proven(store, file, f"{name} had {rows} rows")


def proven(store: Store, file: DataFile, why: str) -> str:
    """Return the damage of a suspicious file, in words; `why` is the suspicion, in words too.

    Raises:
        StoreError: it is not proven.

    """
    name = f"{store.url}/{file.location}/{file.path}"
    found = store.objects.find(f"{file.location}/{file.path}")
    size_bytes = found and found.size_bytes
    if size_bytes == _size_bytes(store, file):
        if found is None:
            return f"{name} is not there, with {file.rows} rows"
        if size_bytes != file.size_bytes:
            return f"{name} has {size_bytes} bytes instead of {file.size_bytes}"
        if problem := _problem(store, file, found):
            return f"{name} {problem}"
    raise StoreError(f"{why}; read again it is whole, so nobody can say: try again later")


def _size_bytes(store: Store, file: DataFile) -> int | None:
    """Return it as Arrow sees it; None where it is not there."""
    with translated(f"{store.url}/{file.location}/{file.path} cannot be read"):
        found = store.files.get_file_info(f"{file.location}/{file.path}")
        return None if found.type == FileType.NotFound else int(found.size or 0)


def _decoded(store: Store, file: DataFile) -> int:
    """Read every row of a file, and return their number."""
    name = f"{file.location}/{file.path}"
    with translated(f"{store.url}/{name} cannot be read"), store.files.open_input_file(name) as opened:
        return sum(batch.num_rows for batch in pq.ParquetFile(opened).iter_batches())


def _problem(store: Store, file: DataFile, found: Object) -> str | None:
    """Return the problem of its content; a copy is made first, so that no network error interferes."""
    with tempfile.NamedTemporaryFile(prefix="gwrms-") as copy:
        for piece in store.objects.pieces(found):
            copy.write(piece)
        copy.flush()
        try:
            rows = sum(batch.num_rows for batch in pq.ParquetFile(copy.name).iter_batches())
        except pa.ArrowMemoryError as error:
            raise StoreError(f"{file.path} cannot be judged: not enough memory") from error
        except _UNREADABLE as error:
            if getattr(error, "errno", None) is not None:  # this computer's disk
                raise StoreError(f"{file.path} cannot be judged: {error}") from error
            told = textwrap.shorten(str(error), _LONGEST, placeholder=" …")
            return f"cannot be read: {told}; bring it back from a copy, or let gwrms cloud mend take it out"
    return None if rows == file.rows else f"has {rows} rows instead of {file.rows}"
