"""Recorded sessions: what is known of each, what happened in it, and its telemetry in time's order."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import Any, Final, NamedTuple

import msgspec
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet as pq

from ml.store import reading
from ml.store.errors import StoreError
from ml.store.fragments import DataFile, Extent
from ml.store.labels import holding
from ml.store.precedence import last, recorded_order
from ml.store.store import Store
from ml.store.tables import EVENTS, LABELS, SESSIONS, TELEMETRY, Table
from ml.store.translation import translated

OBJECT: Final = "object/"  # begins the keys of a session's set-up that tell each parameter's object and unit
ROWS_AT_ONCE: Final = 100_000  # of telemetry, about
SHORTEST_NS: Final = 1_000_000_000  # that is read at once
KEYS: Final = ("utc", "stamp_ns")  # columns before the channels
# A session is of one boot of the robot, so its clock goes on in it, whatever was done to others meanwhile.
ORDER: Final = [(name, "ascending") for name in ("stamp_ns", "connection", "stream", "seq", "row")]
_NAMING: Final = pa.schema([TELEMETRY.schema.field(name) for name in ("utc", *(name for name, _ in ORDER))])
UNTOLD: Final = "what was known of this session is lost; its rows are here"  # notes of one
UNREAD: Final = "the rest of it is in the store, which is not reached"  # where nobody has looked there
_UNKNOWN: Final = datetime(1970, 1, 1, tzinfo=UTC)  # when it began
_WHOLE: Final = (-(1 << 63), (1 << 63) - 2)  # stamps, where nobody knows which
_AT_ONCE: Final = 8  # footers that are read at a time


class SessionPiece(NamedTuple):
    """A part of a session's telemetry: from when to when, and which stamps, as far as that is known."""

    first: datetime | None
    last: datetime | None
    first_ns: int | None
    last_ns: int | None
    rows: int


class TelemetrySource(NamedTuple):
    """A place with telemetry of a session: what is there, and what may have rows with such stamps."""

    pieces: Sequence[SessionPiece]
    rows: Callable[[int, int], pyarrow.dataset.Dataset]


class NoSuchSession(StoreError):
    """No session, or more than one, has a name that begins so."""


class Session(msgspec.Struct, frozen=True):
    """Facts about a session. `ended` is None while it runs, and if its server died.

    Its telemetry is from `first` to before `last`, None where it has none. `parameters` are the values at
    its start, `units` each channel's unit as the robot described it, `versions` software by name. `setup` is
    what else was so then, by section and name (`firmware/left_knee`); empty where that was not recorded.
    """

    robot: str
    session: str
    began: datetime | None = None
    ended: datetime | None = None
    first: datetime | None = None
    last: datetime | None = None
    rows: int = 0
    size_bytes: int = 0
    uploaded: bool = True
    configuration_hash: str = ""
    operator: str = ""
    wearer: str = ""
    consent: str = ""
    notes: str = ""
    parameters: dict[str, Any] = {}
    units: dict[str, Any] = {}
    versions: dict[str, Any] = {}
    setup: dict[str, Any] = {}

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI unit of each parameter ("" has none), as far as the robot has told it."""
        return {
            key.removeprefix(OBJECT): str(said).partition(" ")[2]
            for key, said in self.setup.items()
            if key.startswith(OBJECT)
        }

    @property
    def length(self) -> timedelta:
        """From its first row to its last."""
        return self.last - self.first if self.first and self.last else timedelta(0)


class Channel(msgspec.Struct, frozen=True):
    """A channel of a session; `samples` are its values that are not null."""

    name: str
    unit: str | None
    samples: int


def sessions(
    store: Store, robot: str | None = None, waiting: Iterable[Mapping[str, Any]] = ()
) -> list[Session]:
    """Return every session, or one robot's, oldest first. `waiting`: rows that are not there yet."""
    extents: dict[tuple[str, str], list[DataFile]] = {}
    for file in reading.files(store, TELEMETRY, robot):
        extents.setdefault((file.robot or "", file.session or ""), []).append(file)
    stored, waiting = _rows(store, SESSIONS, robot), list(waiting)
    uploaded = {_name(fields) for fields in stored} | extents.keys()
    found = [
        made(fields, Extent(extents.get(_name(fields), ())), _name(fields) in uploaded)
        for fields in newest([*stored, *waiting])
    ]
    told = {_name(fields) for fields in (*stored, *waiting)}
    found += [
        untold(*name, Extent(files))
        for name, files in extents.items()
        if name not in told and robot in (None, name[0])
    ]
    return in_order(found)


def untold(robot: str, session: str, extent: Extent, uploaded: bool = True) -> Session:
    """Return a session of which there is telemetry, and no row that says anything of it."""
    return made({"robot": robot, "session": session, "notes": UNTOLD}, extent, uploaded)


def _name(fields: Mapping[str, Any]) -> tuple[str, str]:
    return fields["robot"], fields["session"]


def in_order(found: Iterable[Session]) -> list[Session]:
    """Oldest first."""
    return sorted(found, key=lambda each: (each.began or each.first or _UNKNOWN, each.session))


def find(store: Store, name: str, robot: str | None = None) -> Session:
    """Return the session whose name is this, or alone begins so.

    Raises:
        NoSuchSession: none, or several do.

    """
    return among(sessions(store, robot), name, store.url)


def among(known: Sequence[Session], name: str, where: str) -> Session:
    """Return the one of these whose name is this, or alone begins so; raises as `find`."""
    exactly = [session for session in known if session.session == name]
    found = exactly or [session for session in known if session.session.startswith(name)]
    if not found:
        raise NoSuchSession(f"{where} has no session {name!r} (gwrms sessions ls lists them)")
    if len(found) > 1:
        names = ", ".join(f"{session.session} of {session.robot}" for session in found[:5])
        raise NoSuchSession(f"{len(found)} sessions begin with {name!r}: {names}; give more of the name")
    return found[0]


def newest(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the valid row of each session: the last."""
    return last(rows, _name, lambda row: row["utc"])


def unstored(rows: Iterable[Mapping[str, Any]]) -> list[Session]:
    """Return those that are told of in rows which are in no store; their telemetry is not counted."""
    return [made(row, Extent(()), uploaded=False) for row in newest(rows)]


def made(fields: Mapping[str, Any], extent: Extent, uploaded: bool = True) -> Session:
    """Return a session from its row in the table, and its telemetry's extent."""
    known = {name: value for name, value in fields.items() if value is not None}
    tables = {
        name: msgspec.json.decode(known.pop(name, "{}"))
        for name in ("parameters", "units", "versions", "setup")
    }
    found = {
        "first": extent.first,
        "last": extent.last,
        "rows": extent.rows,
        "size_bytes": extent.size_bytes,
        "uploaded": uploaded,
    }
    return msgspec.convert(known | tables | found, Session)


def channels(store: Store, session: Session) -> list[Channel]:
    """Return the channels that have values in this session, from its files' footers."""
    known = reading.units(store, TELEMETRY, session.robot)
    samples: dict[str, int] = {}
    with ThreadPoolExecutor(_AT_ONCE, "footers") as pool:
        for found in pool.map(lambda file: footer(store, file), _files(store, session)):
            for name, count in _samples(found).items():
                samples[name] = samples.get(name, 0) + count
    own = set(TELEMETRY.schema.names)
    return [
        Channel(name, known.get(name), count)
        for name, count in sorted(samples.items())
        if count and name not in own
    ]


def footer(store: Store, file: DataFile) -> pq.FileMetaData:
    """Return the footer of a file; raises `StoreError` if it is missing or damaged."""
    with (
        translated(f"{store.url}/{file.location}/{file.path} cannot be read"),
        store.files.open_input_file(f"{file.location}/{file.path}") as opened,
    ):
        return pq.read_metadata(opened)


def rows_of(store: Store, session: Session, table: Table = EVENTS) -> list[dict[str, Any]]:
    """Return the session's rows of `events`, or of `labels`, in the order in which they were recorded."""
    named = pyarrow.dataset.field("session") == session.session
    return recorded_order(_rows(store, table, session.robot, named))


def labels(store: Store, session: Session) -> list[dict[str, Any]]:
    """Return the valid labels of a session."""
    return holding(rows_of(store, session, LABELS))


def telemetry(
    store: Store,
    session: Session,
    names: Sequence[str],
    begin: datetime | None = None,
    end: datetime | None = None,
) -> Iterator[pa.Table]:
    """Yield the rows from `begin` up to before `end`, in the order of the robot's clock, some at a time.

    The columns are `utc`, `stamp_ns` and these channels; rows in which all of them are null are left out.
    """
    if session.rows and names:
        with translated(f"the telemetry of {session.session} in {store.url} cannot be read"):
            yield from merged([stored(store, session)], names, begin, end)


def stored(store: Store, session: Session) -> TelemetrySource:
    """Return the session's telemetry in the store, for `merged`."""
    files = _files(store, session)
    rows = _of_session(store, session)
    pieces = [SessionPiece(each.first, each.last, each.first_ns, each.last_ns, each.rows) for each in files]
    return TelemetrySource(pieces, lambda _begin, _end: rows)


def merged(
    sources: Sequence[TelemetrySource],
    names: Sequence[str],
    begin: datetime | None = None,
    end: datetime | None = None,
) -> Iterator[pa.Table]:
    """Yield it as `telemetry`, from several places with no row in common."""
    wanted = [
        piece for source in sources for piece in source.pieces if piece.rows and _within(piece, begin, end)
    ]
    if not wanted or not names:
        return
    when, stamp = _between(begin, end), pyarrow.dataset.field("stamp_ns")
    nothing = pa.schema([*_NAMING, *(pa.field(name, pa.float64()) for name in names)]).empty_table()
    for first_ns, until_ns in _steps(wanted):
        stamps = (stamp >= first_ns) & (stamp < until_ns)
        found = [_part(source.rows(first_ns, until_ns), names, stamps & when) for source in sources]
        rows = pa.concat_tables([nothing, *found], promote_options="default")
        yield rows.sort_by(ORDER).select([*KEYS, *names])


def _within(piece: SessionPiece, begin: datetime | None, end: datetime | None) -> bool:
    before = end is not None and piece.first is not None and piece.first >= end
    after = begin is not None and piece.last is not None and piece.last <= begin
    return not (before or after)


def _steps(wanted: Sequence[SessionPiece]) -> Iterator[tuple[int, int]]:
    """Spans of stamps, each with about as many rows as are read at once."""
    first_ns = min(_WHOLE[0] if piece.first_ns is None else piece.first_ns for piece in wanted)
    end_ns = 1 + max(_WHOLE[1] if piece.last_ns is None else piece.last_ns for piece in wanted)
    rows = sum(piece.rows for piece in wanted)
    step_ns = max((end_ns - first_ns) * ROWS_AT_ONCE // rows, SHORTEST_NS)
    while first_ns < end_ns:
        yield first_ns, min(first_ns + step_ns, end_ns)
        first_ns += step_ns


def _part(rows: pyarrow.dataset.Dataset, names: Sequence[str], when: pyarrow.dataset.Expression) -> pa.Table:
    known = [name for name in names if name in rows.schema.names]
    if not known:
        return _NAMING.empty_table()
    return rows.to_table(columns=[*_NAMING.names, *known], filter=when & _any(known))


def _of_session(store: Store, session: Session) -> pyarrow.dataset.Dataset:
    whole = reading.dataset(store, TELEMETRY, session.robot)
    column = pyarrow.dataset.field
    fragments = whole.get_fragments(
        (column("robot") == session.robot) & (column("session") == session.session)
    )
    files = pyarrow.dataset.ParquetFileFormat()
    return pyarrow.dataset.FileSystemDataset(list(fragments), whole.schema, files)


def _between(begin: datetime | None, end: datetime | None) -> pyarrow.dataset.Expression:
    utc, wanted = pyarrow.dataset.field("utc"), pyarrow.dataset.scalar(True)
    if begin is not None:
        wanted = wanted & (utc >= begin)
    return wanted if end is None else wanted & (utc < end)


def _any(names: Sequence[str]) -> pyarrow.dataset.Expression:
    first, *others = (pyarrow.dataset.field(name).is_valid() for name in names)
    for other in others:
        first = first | other
    return first


def _rows(
    store: Store, table: Table, robot: str | None, where: pyarrow.dataset.Expression | None = None
) -> list[dict[str, Any]]:
    if robot is not None:
        named = pyarrow.dataset.field("robot") == robot
        where = named if where is None else where & named
    with translated(f"{store.url}/{table.name} cannot be read"):
        found: list[dict[str, Any]] = reading.dataset(store, table).to_table(filter=where).to_pylist()
    return found


def _files(store: Store, session: Session) -> list[DataFile]:
    files = reading.files(store, TELEMETRY, session.robot)
    return [file for file in files if (file.robot, file.session) == (session.robot, session.session)]


def _samples(metadata: pq.FileMetaData) -> dict[str, int]:
    """Return the number of values of each column that are not null."""
    found: dict[str, int] = {}
    for group in range(metadata.num_row_groups):
        for number in range(metadata.num_columns):
            column = metadata.row_group(group).column(number)
            nulls = column.statistics.null_count if column.is_stats_set else 0
            found[column.path_in_schema] = found.get(column.path_in_schema, 0) + column.num_values - nulls
    return found
