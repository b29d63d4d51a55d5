"""A wearer forgotten: their sessions out of spool and store, with a proof that nothing of them is left.

What waits is uploaded first, so that all of it is in one place. Interrupted anywhere, it is called again.
"""

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec

from ml.store import Store, durable, erasure, upkeep
from ml.store.erasure import Name, Worn
from ml.store.labels import person
from ml.store.snapshot import Snapshot
from ml.store.tables import EVENTS, LABELS, SESSIONS
from ml.store.upkeep import Pin
from server_gui.core.cloud import exports, mend, spool_reader
from server_gui.core.cloud.exports import Exported
from server_gui.core.cloud.repeated_upload import Again
from server_gui.core.cloud.row_counting import Advance
from server_gui.core.evidence import file as evidence
from server_gui.core.recording.batching import EventKind
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.spool_files import identity
from server_gui.core.recording.upload import send

Expect = Callable[[int], AbstractContextManager[Advance]]
_BEGUN: Final = "forgetting.json"  # in the spool, while it goes on
MADE: Final = "removed with a wearer who is forgotten"  # what new receipts say of these rows


class CannotForget(Exception):
    """Nothing was removed; says why, and what to do."""


@dataclass(frozen=True, slots=True)
class ErasurePlan:
    """Data of a wearer: sessions, rows in the store by location, and other places with some of them."""

    sessions: Sequence[Name]
    rows: Mapping[str, int]
    waiting: int  # batches of the spool that are uploaded first
    copies: Sequence[int]  # second copies of the spool with rows of theirs
    aside: Sequence[Path]  # files of the spool that were set aside, which nobody can look into
    pins: Sequence[Pin]  # versions that models name, with rows of theirs
    learned: Sequence[str]  # models
    exported: Sequence[Exported]  # files and copies that were made on this desk
    others: Sequence[str]  # spools of other computers that have written to this store


def plan(
    store: Store, spool: Path, name: str, learned: Callable[[Sequence[Name]], Sequence[str]]
) -> ErasurePlan:
    """Look; nothing is changed. `learned` says which models have learned from sessions.

    Raises:
        CannotForget: the name is none, or a session is somebody else's, too.
        StoreError, SpoolUnusable: it could not be looked.

    """
    if not person(name):
        raise CannotForget(f"{name!r} is nobody's name")
    store = Snapshot.existing(store.url)  # each table is opened once
    found = _worn(store, spool, name)
    if found.shared:
        shared = ", ".join(f"{session} of {robot}" for robot, session in found.shared)
        raise CannotForget(
            f"somebody else is said to have worn the robot in {shared}, too: take the wrong label back first "
            "(gwrms label --ls)"
        )
    names = sorted({*found.sessions, *_begun(spool, name)})
    return ErasurePlan(
        names,
        erasure.counted(store, names),
        sum(not spool_reader.is_empty(spool, number) for number in spool_reader.waiting(spool)),
        [
            number
            for number in spool_reader.uploaded(spool)
            if not spool_reader.named(spool, number).isdisjoint(names)
        ],
        [file for _, file in spool_reader.damaged(spool)],
        erasure.pinned(store, names),
        learned(names),
        exports.found(names, store.url),
        sorted(erasure.writers(store) - {identity(spool)}),
    )


def _worn(store: Store, spool: Path, name: str) -> Worn:
    """Also by second copies of the spool: another computer may have removed the store's rows already."""
    stored = (erasure.told(store, table) for table in (SESSIONS, LABELS))
    kept = spool_reader.kept(spool)
    here = (spool_reader.rows(spool, table, kept) for table in (SESSIONS, LABELS))
    sessions, labels = ([*there, *mine] for there, mine in zip(stored, here, strict=True))
    return erasure.worn(sessions, labels, name)


def upload(store: Store, spool: Spool, known: ErasurePlan, name: str, expect: Expect) -> None:
    """Bring what waits into the store, and see that it is whole: what is missing later is known to be theirs.

    Where it was begun before, that was seen then.

    Raises:
        CannotForget: it is not.
        StoreError, Damaged: it could not be brought.

    """
    for number in spool.waiting():
        send(spool, number, store)
    if _begun(spool.folder, name):
        return
    found = mend.plan(store, spool, expect)
    if _are_theirs(found, spool.folder, known):
        mend.mend(Again.existing(store.url), spool, found, lambda _: None)
        found = mend.plan(store, spool, expect)
    if found.files or found.batches or found.lost:
        raise CannotForget(
            "rows are missing in the store already, and whether they are theirs is not known: gwrms cloud "
            "mend comes first"
        )


def _are_theirs(found: mend.RepairPlan, spool: Path, known: ErasurePlan) -> bool:
    """Return whether only batches with rows of theirs are missing: another computer has forgotten them.

    It comes back whole, with what is missing of others, and then goes with all else of theirs.
    """
    if found.files or found.lost:
        return False
    return all(not spool_reader.named(spool, one).isdisjoint(known.sessions) for one in found.batches)


def forget(store: Store, spool: Spool, known: ErasurePlan, name: str, expect: Expect) -> list[str]:
    """Remove everything of the plan, tell it in the recording, and prove it; what is left, in words.

    Raises:
        StoreError: it is not known what was removed; call it again.

    """
    _begin(spool.folder, known, name)
    for named in known.pins:
        upkeep.unpin(store, named.location, named.version, named.by)
    for number in known.copies:
        spool.drop(number)
    erasure.delete(store, known.sessions)
    mend.accept(store, spool, expect, MADE)
    _tell(store, spool, known, name)
    left = [*proof(store, spool.folder, known), *exports.remove(known.sessions, store.url)]
    left += evidence.forget(evidence.folder_beside(spool.folder), known.sessions)
    (spool.folder / _BEGUN).unlink()
    return left


def proof(store: Store, spool: Path, known: ErasurePlan) -> list[str]:
    """Look again, into every file of store and spool; what is left of it, in words."""
    wanted = set(known.sessions)
    found = [f"{store.url}/{path} has rows of theirs" for path in erasure.left(store, known.sessions)]
    found += (
        f"batch {number} of the spool {spool} has rows of theirs"
        for number in spool_reader.kept(spool)
        if wanted & spool_reader.named(spool, number)
    )
    unknown = "was set aside, and whether it has rows of theirs is unknown: look, or remove it"
    found += (f"{file} {unknown}" for file in known.aside)
    return found


class _Begun(msgspec.Struct, frozen=True):
    """A removal in progress, for its continuation: the tables may not show it any more."""

    wearer_sha256: str
    sessions: list[Name]


def _begin(folder: Path, known: ErasurePlan, name: str) -> None:
    data = msgspec.json.encode(_Begun(digest(name), list(known.sessions)))
    (folder / _BEGUN).unlink(missing_ok=True)
    durable.create(folder / _BEGUN, data)


def _begun(folder: Path, name: str) -> list[Name]:
    """Return the sessions of somebody whom an interrupted command was to forget."""
    try:
        found = msgspec.json.decode((folder / _BEGUN).read_bytes(), type=_Begun)
    except (OSError, msgspec.MsgspecError):
        return []
    return found.sessions if found.wearer_sha256 == digest(name) else []


def digest(name: str) -> str:
    """Return what the event names somebody by: whoever knows the name can see that it was them."""
    return hashlib.sha256(f"gwrms wearer {person(name)}".encode()).hexdigest()


def _tell(store: Store, spool: Spool, known: ErasurePlan, name: str) -> None:
    """Record an event for each robot."""
    if not known.sessions:
        return
    spool.append([], [_event(robot, known, name) for robot in sorted({robot for robot, _ in known.sessions})])
    spool.freeze()
    for number in spool.waiting():
        send(spool, number, store)


def _event(robot: str, known: ErasurePlan, name: str) -> Record:
    count = sum(one == robot for one, _ in known.sessions)
    data = {"wearer_sha256": digest(name), "sessions": count, "rows": dict(known.rows)}
    fields = {
        "robot": robot,
        "session": "",
        "utc": time.time_ns(),
        "kind": EventKind.FORGOTTEN.value,
        "text": f"{count} sessions of a wearer were removed for good, with all that is known of them",
        "data": msgspec.json.encode(data).decode(),
    }
    return Record(EVENTS.name, fields)
