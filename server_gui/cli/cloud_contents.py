"""`gwrms cloud ls | du | verify`: what is in the store, and whether all of it is."""

import argparse
import functools
from collections.abc import Iterable, Sequence
from typing import Final

from gateway.amounts import NONE, size
from gateway.cli.text import say, say_json, table, warn
from ml.store.errors import NoSuchTable, StoreError
from ml.store.objects import Object
from ml.store.snapshot import Snapshot
from server_gui.cli.cloud_options import add_url, parser, progress, reach, spool, url, when
from server_gui.core.cloud import usage
from server_gui.core.cloud import verify as checks
from server_gui.core.cloud.usage import Usage
from server_gui.core.cloud.verdict import Verdict
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.settings.server_file import SettingsError

VERIFY: Final = (
    "Check every file of every table, and that each row sent by this computer's spool is there once,\n"
    "unaltered."
)
VERIFY_EPILOG: Final = """Exit status 0: whole. 1: not whole; each line names what is missing, duplicate or
altered. 2: it could not check: no store there, or unreachable. The spool's receipts show what was sent;
without receipts only files are checked, and the output says so. All data with a receipt is read."""
NOT_WHOLE: Final = 1
NOT_LOOKED: Final = 2
COLUMNS = ("FILES", "ROWS", "SIZE", "FROM (UTC)", "TO")


def ls(argv: list[str]) -> int:
    """Run `gwrms cloud ls`."""
    made = parser("cloud ls", "List the store's tables, or with --path the files below one.")
    add_url(made, "url")
    made.add_argument("--path", metavar="PATH", help="as in telemetry/000/robot=exo-01")
    arguments = made.parse_args(argv)
    store = reach(arguments)
    if arguments.path is not None:
        objects = usage.below(store, arguments.path)
        return _show(arguments.json, objects, ("FILE", "SIZE", "WRITTEN (UTC)"), map(_object, objects), (1,))
    found = usage.by_table(store)
    rows = ((each.table, *_sizes(each)) for each in found)
    return _show(arguments.json, found, ("TABLE", *COLUMNS), rows, (1, 2, 3))


def du(argv: list[str]) -> int:
    """Run `gwrms cloud du`."""
    made = parser("cloud du", "Show the space used in the store, by tables and robots.")
    add_url(made, "url")
    arguments = made.parse_args(argv)
    store = reach(arguments)
    found = list(usage.by_robot(store))
    everything = sum(each.size_bytes for each in store.objects.listing())
    if arguments.json:
        say_json({"size_bytes": everything, "tables": found})
        return 0
    rows = [(each.table, each.robot or NONE, *_sizes(each)) for each in found]
    say(table(("TABLE", "ROBOT", *COLUMNS), rows, right=(2, 3, 4)))
    older = everything - sum(each.size_bytes for each in found)
    say(f"{size(everything)} in all; {size(older)} of that are logs, models, files of old versions\n")
    return 0


def verify(argv: list[str]) -> int:
    """Run `gwrms cloud verify`."""
    made = parser("cloud verify", VERIFY, VERIFY_EPILOG)
    add_url(made, "url")
    how = made.add_mutually_exclusive_group()
    how.add_argument("--quick", action="store_true", help="count the rows only, without comparing values")
    how.add_argument("--deep", action="store_true", help="read every value, even without a receipt here")
    made.add_argument("--quiet", action="store_true", help="print nothing if the store is whole, as for cron")
    arguments = made.parse_args(argv)
    try:
        return _verify(arguments)
    except (StoreError, SpoolUnusable, SettingsError, OSError) as error:
        if arguments.json:
            say_json({"files": 0, "problems": [str(error)], "looked": False})
        warn("cloud", str(error))
        return NOT_LOOKED


def _verify(arguments: argparse.Namespace) -> int:
    mine = spool(arguments)
    if arguments.url is None and not mine.exists():
        raise SpoolUnusable(
            f"there is no spool at {mine}, so nobody can say here whether rows are missing: bring it back "
            "from a copy; where nothing was ever recorded on this computer, gwrms cloud verify "
            f"{url(arguments)} looks at the files alone"
        )
    try:
        store = Snapshot.existing(url(arguments))  # each table is opened once
    except NoSuchTable:
        if not checks.sent_to(url(arguments), mine):
            raise
        return _verdict(arguments, [checks.no_store(url(arguments), mine)])
    found = checks.whole(
        store,
        mine,
        functools.partial(progress, "steps"),
        values=not arguments.quick,
        deep=arguments.deep,
    )
    return _verdict(arguments, found.problems, found, f"{store.url} is whole: {found.text}\n")


def _verdict(
    arguments: argparse.Namespace,
    problems: Sequence[str],
    found: Verdict | None = None,
    whole: str = "",
) -> int:
    if arguments.json:
        say_json({"problems": problems, "looked": True} | _counts(found))
    elif problems or not arguments.quiet:
        more = () if found is None else filter(None, (*found.notes, found.unproven))
        say("".join(f"{each}\n" for each in problems) or whole)
        say("".join(f"{each}\n" for each in more))
    return NOT_WHOLE if problems else 0


def _counts(found: Verdict | None) -> dict[str, object]:
    """Return the numbers of checks, and of proofs."""
    if found is None:
        return {"files": 0, "rows": 0, "rows_proven": 0, "batches": 0, "receipts": 0, "notes": ()}
    return {
        "files": len(found.files),
        "rows": found.rows,
        "rows_proven": found.proof.rows,
        "batches": found.proof.batches,
        "receipts": found.proof.here,
        "notes": found.notes,
    }


def _show(
    as_json: bool, found: object, header: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int]
) -> int:
    if as_json:
        say_json(found)
    else:
        say(table(header, rows, right))
    return 0


def _sizes(found: Usage) -> tuple[str, ...]:
    return str(found.files), str(found.rows), size(found.size_bytes), when(found.first), when(found.last)


def _object(found: Object) -> tuple[str, ...]:
    return found.path, size(found.size_bytes), when(found.changed)
