"""List of exports and copies of this desk, so that they are found when a wearer is forgotten.

A file of the list for each place, in the user's own data; whatever is made is noted before it is there.
"""

import contextlib
import hashlib
import stat
from collections.abc import Collection, Iterator, Sequence, Set
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from urllib.parse import unquote, urlsplit

import msgspec

from ml.store import Store, StoreError, durable, erasure
from ml.store.erasure import Name
from ml.store.private import private_folder
from server_gui.core.atomic_files import draft
from server_gui.core.settings.server_file import exports_folder


class ExportState(Enum):
    """State of an exported file or a copy, at the next check."""

    AS_MADE = "as it was made"
    CHANGED = "has changed since, or was not ended"
    LINKED = "has another name too (a hard link), under which it would stay"
    CLOSED = "cannot be looked at or removed"
    GONE = "has gone from there: moved, or removed"
    HAS_ROWS = "a copy that has rows of theirs"
    UNKNOWN = "a copy that cannot be looked into"
    UNREADABLE = "an entry of the list of exports that cannot be read"


class _Note(msgspec.Struct, frozen=True):
    place: str  # of a file its path, of a store its URL
    sessions: list[Name] | None = None  # None: whatever the store had
    sha256: str = ""  # of a file that is whole
    is_store: bool = False


@dataclass(frozen=True, slots=True)
class Exported:
    """A place with something of somebody."""

    place: str
    state: ExportState
    why: str = ""


@contextlib.contextmanager
def noted(file: Path, session: Name) -> Iterator[None]:
    """Export a session to a file within the block.

    Raises:
        OSError: it cannot be noted, so that nobody would find it again; then nothing is made.

    """
    place = _text(file.parent.resolve() / file.name)
    known = _known(place)
    before = known.sessions or [] if known is not None else []
    _write(_Note(place, sorted({*before, session})))  # where this is interrupted, what was there is there
    yield
    _write(_Note(place, [session], _sha256(Path(place))))


def note_copy(url: str, sessions: Collection[Name] | None = None) -> None:
    """Note that a store gets these sessions, or all that another one has; raises `OSError`."""
    known = _known(url)
    if known is not None and (known.sessions is None or sessions is None):
        sessions = None
    elif known is not None and sessions is not None:
        sessions = {*sessions, *(known.sessions or ())}
    _write(_Note(url, None if sessions is None else sorted(sessions), is_store=True))


def found(sessions: Collection[Name], but: str) -> list[Exported]:
    """Return every place that may have some of these, and how it is there now; without the store `but`."""
    looked = (_in(file, set(sessions), but) for file in sorted(exports_folder().glob("*.json")))
    return [each for each in looked if each is not None]


def _in(file: Path, wanted: Set[Name], but: str) -> Exported | None:
    """Return an entry of the list, if it is of the wanted sessions."""
    try:
        note = _read(file)
    except (OSError, msgspec.MsgspecError) as error:
        return Exported(str(file), ExportState.UNREADABLE, _why(error))
    is_theirs = note.sessions is None or not wanted.isdisjoint(note.sessions)
    return _looked(note, sorted(wanted)) if is_theirs and note.place != but else None


def remove(sessions: Collection[Name], but: str) -> list[str]:
    """Look again, and remove the files that are as they were made; of all others, say what is left, in words.

    Whatever was found before somebody was asked may be somebody else's by now.
    """
    tried = [_removed(each) if each.state is ExportState.AS_MADE else each for each in found(sessions, but)]
    return [_told(each) for each in tried if each.state is not ExportState.GONE]


def _removed(each: Exported) -> Exported:
    try:
        Path(each.place).unlink(missing_ok=True)
        _note_of(each.place).unlink(missing_ok=True)
    except OSError as error:
        return Exported(each.place, ExportState.CLOSED, _why(error))
    return Exported(each.place, ExportState.GONE)


def _told(each: Exported) -> str:
    why = f" ({each.why})" if each.why else ""
    if each.state in (ExportState.CHANGED, ExportState.LINKED, ExportState.CLOSED):
        return (
            f"{each.place} was exported with rows of theirs, and {each.state.value}{why}: look, and remove it"
        )
    if each.state is ExportState.UNREADABLE:
        return f"{each.place} is {each.state.value}{why}: what was exported there is unknown"
    return f"{each.place} is {each.state.value}{why}: gwrms cloud forget --url {each.place}, or remove it"


def _looked(note: _Note, wanted: Sequence[Name]) -> Exported | None:
    if note.is_store:
        return _store(note, wanted)
    try:
        return Exported(note.place, _state(Path(note.place), note.sha256))
    except (FileNotFoundError, NotADirectoryError):
        return Exported(note.place, ExportState.GONE)
    except OSError as error:
        return Exported(note.place, ExportState.CLOSED, _why(error))


def _state(file: Path, sha256: str) -> ExportState:
    """Return the state of a file; a link in its place is none. Raises `OSError`."""
    found = file.lstat()
    if not (sha256 and stat.S_ISREG(found.st_mode) and _sha256(file) == sha256):
        return ExportState.CHANGED
    return ExportState.AS_MADE if found.st_nlink == 1 else ExportState.LINKED


def _store(note: _Note, wanted: Sequence[Name]) -> Exported | None:
    """Nothing where the copy has none of it."""
    try:
        store = Store.existing(note.place)
        has_some = erasure.counted(store, wanted) or erasure.left(store, wanted)
    except StoreError as error:
        parts = urlsplit(note.place)
        is_gone = parts.scheme == "file" and not Path(unquote(parts.path)).exists()
        return Exported(note.place, ExportState.GONE if is_gone else ExportState.UNKNOWN, str(error))
    return Exported(note.place, ExportState.HAS_ROWS) if has_some else None


def _why(error: Exception) -> str:
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def _text(file: Path) -> str:
    """Return a name that can be written down."""
    name = str(file)
    try:
        name.encode()
    except UnicodeEncodeError as error:
        raise OSError(f"{name!r} is no name that can be noted: name it otherwise") from error
    return name


def _sha256(file: Path) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def _note_of(place: str) -> Path:
    return exports_folder() / f"{hashlib.sha256(place.encode()).hexdigest()[:32]}.json"


def _read(file: Path) -> _Note:
    return msgspec.json.decode(file.read_bytes(), type=_Note)


def _known(place: str) -> _Note | None:
    """Return the earlier note of a place; an unreadable one is rewritten."""
    try:
        return _read(_note_of(place))
    except (FileNotFoundError, msgspec.MsgspecError):
        return None


def _write(note: _Note) -> None:
    private_folder(exports_folder())
    file = _note_of(note.place)
    with draft(file) as written:
        written.write_bytes(msgspec.json.encode(note))
        durable.sync(written)
    durable.sync(file.parent)
