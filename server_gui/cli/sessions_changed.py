"""`gwrms sessions changed`: what changed from one session to another, and what moved with it."""

from collections.abc import Iterator, Sequence

import msgspec

from gateway.amounts import counted
from gateway.cli.text import say, say_json, table
from ml.store.sessions import Session
from server_gui.cli.cloud_options import add_url, parser, progress, recordings
from server_gui.cli.edits import COLUMNS, metric_row
from server_gui.core.cloud.configuration_changes import (
    Changes,
    Difference,
    SessionConfiguration,
    changes,
    not_known,
)
from server_gui.core.cloud.metric_changes import moved, walk
from server_gui.core.evidence.comparison import Evidence, Word

EPILOG = """First, what differed when the session AFTER began: wearer, parameters, calibration, firmware,
EDS files, models, limits, guard, robot.toml, software. Facts that one of the sessions lacks are in a list of
their own: not recorded is not unchanged. Then, what changed in the walk, in the words of gwrms edits: two
sessions differ in more than anybody has noted, so nothing here names a cause.

example
  gwrms sessions changed 20261119T09 20261121T14

exit status
  0 shown, 1 failed, 2 wrong usage"""
HEADER = ("WHAT CHANGED", "", "BEFORE", "AFTER")


def changed(argv: list[str]) -> int:
    """Run `gwrms sessions changed`."""
    made = parser(
        "sessions changed", "Show what changed between two sessions, and what moved with it.", EPILOG
    )
    made.add_argument(
        "before", metavar="BEFORE", help="the session in which it worked; its name, which may be abbreviated"
    )
    made.add_argument("after", metavar="AFTER", help="the other one")
    made.add_argument("--facts", action="store_true", help="show only what changed; reads no telemetry")
    add_url(made)
    arguments = made.parse_args(argv)
    known = recordings("sessions", arguments)
    sides = [known.find(name) for name in (arguments.before, arguments.after)]
    found = changes(*(SessionConfiguration.of(known, session) for session in sides))
    evidence = None
    if not arguments.facts:
        rows = sum(known.counted(session).rows for session in sides)
        with progress("rows", rows) as advance:
            evidence = moved(*(walk(known, session, advance) for session in sides))
    if arguments.json:
        say_json(
            {
                "before": sides[0].session,
                "after": sides[1].session,
                "changed": msgspec.to_builtins(found),
                "moved": msgspec.to_builtins(evidence),
            }
        )
    else:
        say("\n".join(_told(sides, found, evidence)) + "\n")
    return 0


def _told(sides: Sequence[Session], found: Changes, evidence: Evidence | None) -> Iterator[str]:
    yield f"from {sides[0].session} of {sides[0].robot} to {sides[1].session} of {sides[1].robot}"
    yield ""
    if found.differences:
        yield table(HEADER, map(_row, found.differences)).rstrip()
    else:
        yield "nothing that both tell was otherwise"
    yield f"{counted(found.same, 'thing', 'things')} that both tell, and alike"
    if found.unrecorded:
        yield from not_known(found)
    if evidence is not None:
        yield ""
        yield from _moved(evidence)


def _row(one: Difference) -> tuple[str, ...]:
    return (str(one.kind), one.what if one.what != str(one.kind) else "", one.before, one.after)


def _moved(evidence: Evidence) -> Iterator[str]:
    before, after = evidence.cycles_before, evidence.cycles_after
    yield f"What moved with it: {evidence.word} ({counted(before, 'gait cycle')} before, {after} after)"
    yield from (f"  {note}" for note in evidence.notes)
    rows = [one for one in evidence.metrics if one.word in (Word.BETTER, Word.WORSE, Word.CHANGED)]
    if rows:
        rows.sort(key=lambda one: -abs(one.size or 0.0))
        yield table(COLUMNS, map(metric_row, rows), right=(2, 3, 4, 6)).rstrip()
    for word in (Word.SAME, Word.FEW, Word.NO_DATA):
        count = sum(one.word is word for one in evidence.metrics)
        if count:
            yield f"{word}: {counted(count, 'metric')}"
