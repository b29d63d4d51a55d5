"""`gwrms cloud forget`: everything of one wearer out of spool and store, for good, with a proof."""

import argparse
import functools
from collections.abc import Iterator, Sequence

from gateway.amounts import counted
from gateway.cli.connect import ask
from gateway.cli.text import say, say_json, warn
from ml.registry.registry import Registry
from ml.store import Store, StoreError, UnsafeStore
from ml.store.erasure import Name
from server_gui.cli.cloud_options import add_url, parser, progress, reach, spool
from server_gui.core.cloud import forget as forgetting
from server_gui.core.cloud.exports import ExportState
from server_gui.core.cloud.forget import CannotForget, ErasurePlan
from server_gui.core.recording.errors import RecordingError
from server_gui.core.recording.spool import Spool

WHAT = (
    "Remove a wearer's sessions: rows, labels, predictions, of every version; and prove that they are gone."
)
EPILOG = """A wearer's sessions are those recorded with --wearer, or labelled with one; P01, p01 and "P01 "
are the same. End every collector that writes to this store first. Pending data of the spool is uploaded; rows
are deleted from all tables except the robots' own journals (they name operators, and nothing of a wearer);
files that only older versions need are deleted at once, and so are second copies in the spool that have such
rows. An event in the recording reports this, and names the wearer by a hash only. Then every file is read
again.

Files that this user exported on this computer are removed if they are unchanged and in their place. Changed
ones, copies of the store (cloud download), and the spools of other computers that have written to this store
are named: run the same command there too.

Versions that models name keep their contents: then the command refuses, and --unpin releases these versions.
A model that learned from these sessions stays, and is named. Not known here, and yours to remove: what others
have exported, what was saved from a window's plots or a query, backups, and old versions that a bucket itself
keeps.

After an interruption, the same command continues. Exit status 0: gone, and proven; 1: something is left, or
was not removed, and is named; 2: not checked; 3: gone from store and spool, but exported files were moved,
and are yours to find."""
OUT_OF_REACH = 3


def forget(argv: list[str]) -> int:
    """Run `gwrms cloud forget`."""
    made = parser("cloud forget", WHAT, EPILOG)
    add_url(made)
    made.add_argument("--wearer", required=True, metavar="ID", help="the wearer to forget")
    made.add_argument("--dry-run", action="store_true", help="only show what would be removed")
    made.add_argument("--unpin", action="store_true", help="release versions that models name")
    made.add_argument(
        "--alone",
        action="store_true",
        help="confirm that no other server runs, for a store without conditional writes",
    )
    made.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    arguments = made.parse_args(argv)
    try:
        return _forget(arguments)
    except CannotForget as error:
        warn("cloud", str(error))
        return 1
    except (StoreError, RecordingError) as error:
        warn("cloud", str(error))
        return 2


def _forget(arguments: argparse.Namespace) -> int:
    store, folder = reach(arguments), spool(arguments)
    learned = functools.partial(_learned, store)
    if arguments.dry_run:
        return _tell(arguments, forgetting.plan(store, folder, arguments.wearer, learned), [])
    if not (store.about.several_writers or arguments.alone):
        raise UnsafeStore(f"{store.url} is for one writer alone: end that server, and say --alone")
    looking = functools.partial(progress, "looking")
    with Spool(folder) as opened:
        known = forgetting.plan(store, folder, arguments.wearer, learned)
        _check_pins(arguments, known)
        _say(arguments, known)
        if not known.sessions or not ask(_question(store, known), yes=arguments.yes):
            return 1
        forgetting.upload(store, opened, known, arguments.wearer, looking)
        known = forgetting.plan(store, folder, arguments.wearer, learned)
        left = forgetting.forget(store, opened, known, arguments.wearer, looking)
    return _tell(arguments, known, left)


def _check_pins(arguments: argparse.Namespace, known: ErasurePlan) -> None:
    if known.pins and not arguments.unpin:
        names = "; ".join(f"version {pin.version} of {pin.location} for {pin.by}" for pin in known.pins)
        raise CannotForget(
            f"nothing was removed: rows of theirs are kept in {names}. With --unpin these versions go, and "
            "the models cannot be learned again from the same rows"
        )


def _learned(store: Store, sessions: Sequence[Name]) -> Sequence[str]:
    """Return the models that have learned from, or were judged by, one of these."""
    names = {session for _, session in sessions}
    return [card.id for card in Registry(store.url).entries() if names & {*card.learned, *card.held_out}]


def _question(store: Store, known: ErasurePlan) -> str:
    sessions, rows = counted(len(known.sessions), "session"), counted(sum(known.rows.values()), "row")
    return f"remove {sessions} with {rows} of {store.url} for good?"


def _say(arguments: argparse.Namespace, known: ErasurePlan) -> None:
    """Print their data."""
    if arguments.json:
        return
    if not known.sessions:
        warn("cloud", f"nothing here says that {arguments.wearer!r} has worn a robot (gwrms label --wearer)")
    say("".join(f"{session} of {robot}\n" for robot, session in known.sessions))
    say("".join(f"{location}: {rows} rows\n" for location, rows in known.rows.items()))
    if known.waiting:
        batches = counted(known.waiting, "batch", "batches")
        say(f"{batches} of the spool may have more, and go to the store first\n")
    for pin in known.pins:
        say(f"kept for {pin.by}: {pin.location}, version {pin.version}\n")
    for model in known.learned:
        say(f"learned from these sessions, and stays: {model}\n")
    for each in known.exported:
        say(f"exported: {each.place} ({each.state.value})\n")


def _not_reached(known: ErasurePlan) -> Iterator[str]:
    """Yield the places that cannot be searched from here."""
    if known.others:
        yield (
            f"not looked into: the spools of other computers that write to this store "
            f"({', '.join(known.others)}): run the same command there, before they record or mend again"
        )
    for place in _moved(known):
        gone = ExportState.GONE.value
        yield f"not looked into: what was exported to {place}, which {gone}: find it, remove it"


def _tell(arguments: argparse.Namespace, known: ErasurePlan, left: Sequence[str]) -> int:
    if arguments.json:
        removed = not (arguments.dry_run or left)
        say_json(
            {
                "plan": known,
                "removed": removed,
                "left": left,
                "moved": _moved(known),
                "sha256": forgetting.digest(arguments.wearer),
            }
        )
    elif arguments.dry_run:
        _say(arguments, known)
    else:
        for problem in left:
            warn("cloud", problem)
        for note in _not_reached(known):
            warn("cloud", note)
        if not left and _moved(known):
            say("gone from this store and this spool; what was exported and moved has rows of theirs still\n")
        elif not left:
            say("gone: no file of this store, of this spool or of this desk's exports has a row of theirs\n")
    if left or not known.sessions:
        return 1
    return OUT_OF_REACH if not arguments.dry_run and _moved(known) else 0


def _moved(known: ErasurePlan) -> list[str]:
    """Return exports that are gone: removed, or moved with all their rows."""
    return [each.place for each in known.exported if each.state is ExportState.GONE]
