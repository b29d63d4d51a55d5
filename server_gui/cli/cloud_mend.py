"""`gwrms cloud mend`: take missing files out of the store, and restore their rows."""

import argparse
import functools
from pathlib import Path

from gateway.amounts import counted
from gateway.cli.connect import ask
from gateway.cli.text import say, say_json, warn
from ml.store.errors import NoSuchTable, StoreError, UnsafeStore
from ml.store.objects import Objects
from ml.store.tables import TELEMETRY
from server_gui.cli.cloud_options import add_url, parser, progress, url
from server_gui.core.cloud import mend as mending
from server_gui.core.cloud import verify
from server_gui.core.cloud.repeated_upload import Again
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.spool import Spool
from server_gui.core.settings.server_file import load

WHAT = "Take missing or damaged files out of the store, and restore their rows from the spool."
EPILOG = """End the collector first. A missing or unreadable file is taken out of its table, which can then be
read, compacted and uploaded to; its remains go to mended/ in the store, with a note of its contents. Then
each batch with missing rows, or without a receipt, is restored from the spool's second copy; existing
rows stay, and rows removed by gwrms cloud retain do not return. If the whole store is gone, it is
rebuilt. After an interruption, the same command continues.

A file stays, and is named, if some of its rows have no second copy here: rows of another collector, or of
batches whose second copy was deleted to make room. Restore it from a copy of the store.

With --accept-loss such files are taken out, too, and missing, duplicate or altered rows are no longer
reported: new receipts describe the present contents. The old ones stay.

Exit status 0: done; gwrms cloud verify then checks whether the store is complete. 1: rows are still
missing, and their batches are listed. 2: it could not check or repair: no store, unreachable, unreadable,
or a collector runs; repairs of proven damage are done, and the same command continues."""
FAILED = 2


def mend(argv: list[str]) -> int:
    """Run `gwrms cloud mend`."""
    made = parser("cloud mend", WHAT, EPILOG)
    add_url(made, "url")
    made.add_argument("--dry-run", action="store_true", help="only show what would be done")
    made.add_argument(
        "--alone",
        action="store_true",
        help="confirm that no other server runs, for a store without conditional writes",
    )
    made.add_argument("--accept-loss", action="store_true", help="accept the present rows as complete")
    made.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    arguments = made.parse_args(argv)
    try:
        return _mend(arguments)
    except (StoreError, SpoolUnusable) as error:
        if arguments.json:
            say_json({"files": (), "batches": (), "problems": [str(error)]})
        warn("cloud", str(error))
        return FAILED


def _mend(arguments: argparse.Namespace) -> int:
    folder = load(arguments.config).recorder.spool
    if not folder.is_dir():
        raise SpoolUnusable(f"there is no spool at {folder}: nothing was recorded on this computer")
    looking = functools.partial(progress, "looking")
    with Spool(folder) as spool:
        store = _store(arguments, folder)
        plan = mending.plan(store, spool, looking)
        if arguments.dry_run:
            return _tell(arguments, mending.Mended(plan.files, plan.batches, plan.lost))
        accepted = arguments.accept_loss and ask(_question(plan), yes=arguments.yes)
        plan = plan.accepted if accepted else plan
        with progress("mending", len(plan.files) + len(plan.batches)) as advance:
            done = mending.mend(store, spool, plan, advance)
        if accepted:
            mending.accept(store, spool, looking)
            done = mending.Mended(done.files, done.batches, ())
    return _tell(arguments, done)


def _question(plan: mending.RepairPlan) -> str:
    going = "".join(f"{each}\n" for each in plan.lost)
    return (
        f"{going}count what then is there as what was sent, also where rows are missing, doubled or altered?"
    )


def _store(arguments: argparse.Namespace, folder: Path) -> Again:
    """Return the store to mend; made anew where batches went to one that is no more."""
    wanted, settings = url(arguments), load(arguments.config).store
    try:
        store = Again.existing(wanted)
    except NoSuchTable:
        if not (verify.sent_to(wanted, folder) or verify.second_copies(folder)):
            raise
        if arguments.dry_run:
            raise StoreError(verify.no_store(wanted, folder)) from None
        _check_shards(wanted, settings.shards)
        return Again(wanted, settings.shards, settings.several_writers)
    if not (store.about.several_writers or arguments.alone):
        raise UnsafeStore(
            f"{store.url} is for one writer alone, which is its server: end that, and say --alone"
        )
    return store


def _check_shards(wanted: str, shards: int) -> None:
    """Check that the number of shards is known before `store.json` is written again."""
    there = {name.split("/")[1] for name in Objects(wanted).names(TELEMETRY.name)}
    if len(there) > shards:
        raise StoreError(
            f"{wanted} has {len(there)} shards of telemetry and no store.json: write shards = {len(there)} "
            "in [store] of the server's file, and again"
        )


def _tell(arguments: argparse.Namespace, done: mending.Mended) -> int:
    if arguments.json:
        say_json({"files": done.files, "batches": done.batches, "problems": done.problems})
    else:
        would = "would be " if arguments.dry_run else ""
        rows = sum(file.rows for file in done.files)
        lines = [f"{file.location}/{file.path}: {file.rows} rows" for file in done.files]
        if done.files:
            files = counted(len(done.files), "file")
            lines.append(f"{files} with {counted(rows, 'row')} {would}taken out of the store")
        if done.batches:
            lines.append(f"{verify.told_batches(done.batches)} {would}brought again from the spool")
        if not (lines or done.problems):
            lines.append("nothing to mend")
        say("".join(f"{line}\n" for line in lines))
    for problem in done.problems:
        warn("cloud", problem)
    return 1 if done.problems else 0
