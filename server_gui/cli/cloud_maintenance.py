"""`gwrms cloud compact | retain | vacuum`: fewer files; old rows and files gone, but what a model names."""

import argparse
import math
from datetime import UTC, datetime, timedelta

from gateway.amounts import counted
from gateway.cli.connect import ask
from gateway.cli.text import say, say_json, table
from ml.store import TABLES, TELEMETRY, Store, UnsafeStore, upkeep
from ml.store.tables import RESOURCES
from server_gui.cli.cloud_options import add_url, parser, reach, when

COMPACT_EPILOG = """An upload adds a file per robot; some thousands of small files make a table slow to open.
Once an hour or a day is enough. Writers and readers are not disturbed, and older versions stay as they
are."""
RETAIN_EPILOG = """Rows are removed from the newest version only: older versions, and those that models
learned from, keep them until gwrms cloud vacuum. By default telemetry and resources; sessions, events,
journals and labels are small."""
VACUUM_EPILOG = """Compaction and retention leave the files of older versions in place. This command deletes
them, except those of versions that are younger than --grace days, or that a model names."""

MOST_DAYS = 36_500


def compact(argv: list[str]) -> int:
    """Run `gwrms cloud compact`."""
    arguments = _parser("compact", "Merge small files.", COMPACT_EPILOG).parse_args(argv)
    done = upkeep.compact(_writable(arguments), dry_run=arguments.dry_run)
    if arguments.json:
        say_json(done)
    else:
        rows = [(each.location, str(each.files_before), str(each.files_after)) for each in done]
        after = "WOULD BE, ABOUT" if arguments.dry_run else "NOW"
        say(table(("TABLE", "FILES", after), rows, right=(1, 2)))
    return 0


def retain(argv: list[str]) -> int:
    """Run `gwrms cloud retain`."""
    made = _parser("retain", "Remove rows older than a number of days.", RETAIN_EPILOG)
    made.add_argument("--days", type=_days, required=True, metavar="N", help="the greatest age of rows")
    made.add_argument("--table", action="append", choices=TABLES, help="only this table; repeatable")
    made.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    arguments = made.parse_args(argv)
    store = _writable(arguments)
    tables = [TABLES[name] for name in arguments.table or (TELEMETRY.name, RESOURCES.name)]
    # Whole minutes: at these receipts tell how many rows of a batch are to be there still.
    before = datetime.now(UTC) - timedelta(days=arguments.days)
    before = before.replace(second=0, microsecond=0) if arguments.days else before
    old = upkeep.retain(store, tables, before, dry_run=True)
    total = sum(old.values())
    question = f"remove {total} rows from before {when(before)} UTC of {store.url}?"
    if not arguments.dry_run and total and ask(question, yes=arguments.yes):
        old = upkeep.retain(store, tables, before)
    elif not arguments.dry_run and total:
        return 1
    if arguments.json:
        say_json(old)
    else:
        went = "would go" if arguments.dry_run else "went"
        say("".join(f"{location}: {rows} rows {went}\n" for location, rows in old.items()))
    return 0


def vacuum(argv: list[str]) -> int:
    """Run `gwrms cloud vacuum`."""
    made = _parser("vacuum", "Delete files that no newer version needs.", VACUUM_EPILOG)
    made.add_argument(
        "--grace", type=_days, default=upkeep.GRACE.days, metavar="DAYS", help="(default: %(default)s)"
    )
    arguments = made.parse_args(argv)
    store = _writable(arguments)
    gone = upkeep.vacuum(store, grace=timedelta(days=arguments.grace), dry_run=arguments.dry_run)
    if arguments.json:
        say_json({"files": gone, "pins": upkeep.pins(store)})
    else:
        went = "would be deleted" if arguments.dry_run else "deleted"
        kept = "".join(
            f"kept for {pin.by}: {pin.location}, version {pin.version}\n" for pin in upkeep.pins(store)
        )
        say("".join(f"{name}\n" for name in gone) + f"{counted(len(gone), 'file')} {went}\n" + kept)
    return 0


def _parser(command: str, what: str, epilog: str) -> argparse.ArgumentParser:
    made = parser(f"cloud {command}", what, epilog)
    add_url(made, "url")
    made.add_argument("--dry-run", action="store_true", help="only show what would be done")
    made.add_argument(
        "--alone",
        action="store_true",
        help="confirm that no server runs, for a store without conditional writes",
    )
    return made


def _days(text: str) -> float:
    try:
        days = float(text)
    except ValueError:
        days = math.nan
    if not 0 <= days <= MOST_DAYS:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no number of days: write a number from 0 to {MOST_DAYS}"
        )
    return days


def _writable(arguments: argparse.Namespace) -> Store:
    store = reach(arguments)
    if not (store.about.several_writers or arguments.alone):
        raise UnsafeStore(
            f"{store.url} is for one writer alone, which is its server: end that, and say --alone"
        )
    return store
