"""`gwrms sessions`: which recordings there are, what is in one, and one as a file."""

import argparse
import dataclasses
import fnmatch
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

import msgspec
import pyarrow as pa

from gateway.amounts import NONE, size
from gateway.cli.connect import choose as choose_command
from gateway.cli.text import say, say_json, table, warn
from ml.store.private import private_files
from ml.store.sessions import Channel, Session
from server_gui.cli.cloud_options import (
    Advance,
    absolute,
    add_url,
    instant,
    instant_or_seconds,
    parser,
    progress,
    recordings,
    when,
)
from server_gui.cli.sessions_changed import changed
from server_gui.cli.sessions_gait import gait
from server_gui.cli.sessions_resources import compare, resources
from server_gui.core.cloud import exports
from server_gui.core.cloud.actions import FORMATS
from server_gui.core.cloud.configuration_changes import DIGITS
from server_gui.core.cloud.recordings import Recorded, Recordings
from server_gui.core.cloud.selection import Choice, choose

HEADER: Final = ("SESSION", "ROBOT", "BEGAN (UTC)", "LENGTH", "ROWS", "SIZE", "", "OPERATOR", "NOTES")
USAGE: Final = """usage: gwrms sessions COMMAND …

  ls                     list every recording: robot, when, how long, who recorded it and why
  show SESSION           show its metadata, channels and events
  gait SESSION           show cadence, step times, symmetry, ranges of motion
  export SESSION --out FILE
                         export it as CSV, Parquet or MCAP, whole or a part
  resources SESSION      show what each program on the robot's computer used, and memory leaks
  changed BEFORE AFTER   show what changed between them, and what of the walk moved with it
  compare BEFORE[,…] AFTER[,…]
                         find programs that use more resources than before

A session's name may be abbreviated as long as it is unique. gwrms sessions COMMAND --help says more.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms sessions`."""
    private_files()
    commands = {"ls": ls, "show": show, "export": export, "gait": gait}
    return choose_command(
        argv, commands | {"resources": resources, "compare": compare, "changed": changed}, USAGE
    )


# --- ls


def ls(argv: list[str]) -> int:
    """Run `gwrms sessions ls`."""
    made = parser("sessions ls", "List all sessions, oldest first.")
    made.add_argument("--robot", default="*", metavar="GLOB", help="only these robots")
    _add_times(made, instant, "as ISO 8601 writes it, UTC")
    add_url(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    every = known.sessions()
    found = [session for session in every if _wanted(session, arguments)]
    gone = known.gone()
    if gone is not None:
        warn("sessions", gone)
    elif every and all(session.uploaded and not session.rows for session in every):
        warn("sessions", "no session has telemetry: if some was uploaded, it has gone from the store")
    if known.unread is not None:
        warn("sessions", f"{known.unread}; sessions that it alone has are not listed")
    if arguments.json:
        say_json([_fields(session) for session in found])
    else:
        away = known.problem is not None
        say(table(HEADER, [_row(session, away=away) for session in found], right=(3, 4, 5)))
    return 0 if known.problem is None and known.unread is None and gone is None else 1


def _wanted(session: Session, arguments: argparse.Namespace) -> bool:
    begins = session.began or session.first
    ends = session.ended or session.last
    return (
        fnmatch.fnmatchcase(session.robot, arguments.robot)
        and (arguments.begin is None or ends is None or ends >= arguments.begin)
        and (arguments.end is None or begins is None or begins < arguments.end)
    )


def _row(session: Session, *, away: bool) -> tuple[str, ...]:
    return (
        session.session,
        session.robot,
        when(session.began),
        _length(session) if session.rows else NONE,
        str(session.rows) if session.rows else NONE,
        size(session.size_bytes) if session.rows else NONE,
        "store away" if away else _state(session),
        session.operator,
        session.notes,
    )


def _state(session: Session) -> str:
    if not session.uploaded:
        return "not uploaded"
    return "not ended" if session.ended is None else ""


def _length(session: Session) -> str:
    return str(timedelta(seconds=round(session.length.total_seconds())))


def _fields(session: Session) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.to_builtins(session)
    return fields | {"length_s": session.length.total_seconds()}


# --- show


def show(argv: list[str]) -> int:
    """Run `gwrms sessions show`."""
    made = parser("sessions show", "Show a session's metadata, channels and events.")
    _add_session(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    recorded = known.open(known.find(arguments.session))
    events, labels = known.rows_of(recorded.session), known.labels(recorded.session)
    if arguments.json:
        more = {"waiting": recorded.waiting, "channels": recorded.channels}
        happened = {"events": list(map(_bare, events)), "labels": list(map(_bare, labels))}
        say_json(_fields(recorded.session) | more | happened)
    else:
        alone = "not uploaded" if known.problem is None else "found here"
        say("\n".join(_told(recorded, alone, events, labels)))
    return 0


def _told(
    recorded: Recorded, alone: str, events: list[dict[str, Any]], labels: list[dict[str, Any]]
) -> Iterator[str]:
    """`alone` says what is so of rows that only this computer's spool has."""
    session = recorded.session
    facts = {
        "robot": session.robot,
        "began": f"{when(session.began)} UTC",
        "ended": f"{when(session.ended)} UTC"
        if session.ended
        else "not: it goes on, or its server was killed",
        "telemetry": f"{_length(session)}, {session.rows} rows{_stored(session)}",
        alone: f"{recorded.waiting} of these rows" if recorded.waiting else "",
        "operator": session.operator,
        "wearer": session.wearer,
        "consent": session.consent,
        "notes": session.notes,
        "configuration": session.configuration_hash,
        "software": ", ".join(f"{name} {version}" for name, version in session.versions.items()),
        "parameters": ", ".join(
            f"{name}={_value(value)}" for name, value in session.parameters.items() if value is not None
        ),
    }
    yield f"session {session.session}"
    yield from (f"  {name:<14} {value}" for name, value in facts.items() if value)
    yield ""
    yield table(("CHANNEL", "UNIT", "SAMPLES"), [_channel(each) for each in recorded.channels], right=(2,))
    if events:
        yield table(
            ("EVENT", "AT (UTC)", ""), [(row["kind"], when(row["utc"]), row["text"]) for row in events]
        )
    if labels:
        yield table(("LABEL", "FROM (UTC)", "TO", "BY"), map(_label, labels))


def _value(value: object) -> str:
    """Return a parameter's, as what changed between sessions is told; whole numbers keep all their digits."""
    rounds = isinstance(value, float) and not value.is_integer()
    return f"{value:.{DIGITS}g}" if rounds else str(value)


def _stored(session: Session) -> str:
    return f", {size(session.size_bytes)} in the store" if session.size_bytes else ""


def _channel(channel: Channel) -> tuple[str, ...]:
    return channel.name, channel.unit or "", str(channel.samples)


def _label(row: dict[str, Any]) -> tuple[str, ...]:
    return row["label"], when(row["utc"]), when(row["ended"]), row["author"] or ""


def _bare(row: dict[str, Any]) -> dict[str, Any]:
    """Without what names the row's origin."""
    return {
        name: value
        for name, value in row.items()
        if name not in ("spool", "batch", "number", "robot", "session")
    }


# --- export

EXPORT_EPILOG = """formats
  csv      a row a sample, columns like "left_knee.position [rad]"; a value that is missing is empty
  parquet  the same; each column's unit is in its metadata, the session in the file's
  mcap     ROS 2 messages (JointState, Imu, FluidPressure, Temperature, Float64, …) for Foxglove,
           PlotJuggler and rosbag2; events as /diagnostics, labels as text

examples
  gwrms sessions export 20261121T1530 --out walk.mcap
  gwrms sessions export 20261121T1530 --out knee.csv --channels 'left_knee.*' --from 10 --to 70"""


def export(argv: list[str]) -> int:
    """Run `gwrms sessions export`."""
    made = parser("sessions export", "Export a session, or a part of it, to a file.", EXPORT_EPILOG)
    _add_session(made)
    made.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="output file; replaced if it exists"
    )
    made.add_argument("--format", choices=FORMATS, help="default: by the ending of FILE")
    made.add_argument(
        "--channels", action="append", metavar="GLOB", help="only these; repeatable (default: all)"
    )
    _add_times(made, instant_or_seconds, "a time (UTC), or seconds since the session's first sample")
    arguments = made.parse_args(argv)
    kind = arguments.format or arguments.out.suffix.removeprefix(".")
    if kind not in FORMATS:
        made.error(f"--format is needed: {arguments.out.name} does not end with .{', .'.join(FORMATS)}")
    count = _export(recordings("sessions", arguments), kind, arguments)
    if arguments.json:
        say_json({"file": str(arguments.out), "format": kind, "count": count})
    else:
        warn("sessions", f"{arguments.out}: {count} {'messages' if kind == 'mcap' else 'rows'}")
    return 0


def _export(known: Recordings, kind: str, arguments: argparse.Namespace) -> int:
    recorded = known.open(known.find(arguments.session))
    session = recorded.session
    choice = Choice(
        arguments.channels or ("*",), absolute(session, arguments.begin), absolute(session, arguments.end)
    )
    chosen = choose(known, recorded, choice)
    with progress("rows", session.rows) as advance:
        counted = dataclasses.replace(chosen, tables=_counted(chosen.tables, advance))
        with exports.noted(arguments.out, (session.robot, session.session)):
            return FORMATS[kind](arguments.out, counted)


def _counted(tables: Iterable[pa.Table], advance: Advance) -> Iterator[pa.Table]:
    for each in tables:
        yield each
        advance(each.num_rows)


def _add_session(made: argparse.ArgumentParser) -> None:
    made.add_argument("session", metavar="SESSION", help="its name, which may be abbreviated")
    add_url(made)


def _add_times(made: argparse.ArgumentParser, kind: Callable[[str], datetime | float], meaning: str) -> None:
    made.add_argument("--from", dest="begin", type=kind, metavar="TIME", help=f"nothing before it; {meaning}")
    made.add_argument("--to", dest="end", type=kind, metavar="TIME", help="nothing from it on; likewise")
