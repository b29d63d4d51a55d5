"""Upload of a spool without a collector; a problem of one batch does not stop the others."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from ml.store import Store
from ml.store.errors import StoreError, StoreRefused, StoreUnreachable
from ml.store.objects import Objects
from ml.store.store import ABOUT
from server_gui.core.cloud import verify
from server_gui.core.cloud.row_counting import Advance
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import ahead, lost_batches, send


@dataclass(frozen=True, slots=True)
class Emptied:
    """Result of emptying a spool: losses, pending batches with reasons, and remarks, in words."""

    url: str
    uploaded: int
    problems: list[str]
    waits: list[str]
    notes: list[str]


def empty(
    folder: Path,
    url: str,
    connect: Callable[[], Store],
    expect: Callable[[int], AbstractContextManager[Advance]],
) -> Emptied:
    """Upload it here and now; `connect` is asked for the store once it is known to be there, or to be new.

    Raises:
        SpoolUnusable: it cannot be used, or somebody records into it.
        StoreError: batches went to this store and it is no more; or it cannot be reached or used.

    """
    if Objects(url).read(ABOUT) is None and verify.sent_to(url, folder):
        raise StoreError(verify.no_store(url, folder))
    store = connect()
    with Spool(folder) as spool:
        notes, problems = ahead(spool, store), lost_batches(spool, store)
        waiting, waits, uploaded = spool.waiting(), [], 0
        with expect(len(waiting)) as advance:
            for number in waiting:
                try:
                    send(spool, number, store)
                    uploaded += 1
                except Damaged as error:
                    problems.append(str(error))
                except (StoreUnreachable, StoreRefused):
                    raise
                except StoreError as error:  # as where a file of the table is gone that this one is in
                    waits.append(f"batch {number} waits: {error}")
                advance(1)
        return Emptied(store.url, uploaded, [*spool.notices, *problems], waits, notes)
