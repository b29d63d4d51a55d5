"""A small file that is always whole: either as it was, or as it is to be, also after a power cut."""

import contextlib
import os
import stat
from pathlib import Path


def write(path: Path, data: bytes, like: os.stat_result | None = None) -> None:
    """Replace the file's content; with the owner and mode of `like`, where that is given.

    Raises:
        OSError: it is as it was before; where only its folder could not be synced, perhaps as it is to be.

    """
    draft = path.with_name(f"{path.name}.draft")
    try:
        with draft.open("wb") as file:
            if like is not None:
                os.fchown(file.fileno(), like.st_uid, like.st_gid)
                os.fchmod(file.fileno(), stat.S_IMODE(like.st_mode))
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            draft.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def remove(path: Path) -> None:
    """Remove the file, if it is there; raises `OSError` where that cannot be done."""
    if path.exists():
        path.unlink()
        sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Make new, renamed and removed names in a folder last."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
