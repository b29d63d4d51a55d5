"""`gwrms journal`: what was done to a robot, by whom, and whether the record of it is whole."""

import argparse
import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

from gateway import config
from gateway.cli.connect import choose, connect, parser
from gateway.cli.text import say, say_json, table, warn
from gateway.records.chain import Broken
from gateway.records.folder import RecordsFolder
from gateway.records.reading import verified

VERIFY_EPILOG = """Run it on the robot's own computer, or on a copy of journal.jsonl with journal.jsonl.head
and its older pieces (journal.jsonl.NUMBER) beside it."""

_SHOWN_APART = ("n", "utc_ns", "monotonic_ns", "boot_id", "who", "what", "previous", "hash")


USAGE = """usage: gwrms journal COMMAND …

  tail [-n N]    the robot's newest entries: who did what, when, and what came of it
  verify PATH    whether every entry of a journal's file is there and unaltered

gwrms journal COMMAND --help says more.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms journal`."""
    return choose(argv, COMMANDS, USAGE)


def tail(argv: list[str]) -> int:
    """Run `gwrms journal tail`."""
    made = parser(
        "journal tail",
        "The newest entries: who did what, when, and what came of it. WHO is the program, by the name that\n"
        "it gives itself, and its address; which person sat there is not known to the robot.",
    )
    made.add_argument("-n", type=int, default=20, metavar="N", help="how many, at most 1000 (default 20)")
    arguments = made.parse_args(argv)
    with connect(arguments, "journal") as robot:
        found = robot.journal(arguments.n)
    if arguments.json:
        for entry in found.entries:
            say_json(entry)
    else:
        say(table(("N", "TIME (UTC)", "WHO", "WHAT", ""), map(_row, found.entries), right=(0,)))
    if found.cut is not None:
        warn("journal", f"there is more: {found.cut}")
    return 0


def _row(entry: dict[str, Any]) -> tuple[str, ...]:
    instant = datetime.datetime.fromtimestamp(entry["utc_ns"] / 1e9, datetime.UTC)
    details = "  ".join(
        f"{name}={_plain(value)}" for name, value in entry.items() if name not in _SHOWN_APART and value
    )
    return str(entry["n"]), f"{instant:%Y-%m-%d %H:%M:%S.%f}"[:-3], entry["who"], entry["what"], details


def _plain(value: object) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name}: {one}" for name, one in value.items())
    return str(value)


def verify(argv: list[str]) -> int:
    """Run `gwrms journal verify`."""
    made = argparse.ArgumentParser(
        prog="gwrms journal verify",
        description="Check every entry of a journal's file. Exit status 0: intact; 1: not; 2: not there.",
        epilog=VERIFY_EPILOG,
    )
    made.add_argument("path", type=Path, help="robot.toml, a records folder, or a journal.jsonl")
    made.add_argument("--json", action="store_true", help="one JSON object, for machines")
    arguments = made.parse_args(argv)
    path = _journal(arguments.path)
    try:
        count, unseen = _count(path)
    except FileNotFoundError:
        warn("journal", f"there is no journal at {path}: name robot.toml, its records folder, or the file")
        return 2
    except Broken as error:
        if arguments.json:
            say_json({"path": str(path), "intact": False, "problem": str(error)})
        warn("journal", f"{path} is NOT intact: {error}")
        return 1
    if arguments.json:
        say_json({"path": str(path), "intact": True, "entries": count, "removed": unseen})
        return 0
    if count:
        say(f"{path} is intact: {count} entries, each in its place and unaltered\n")
    else:
        say(f"{path} is empty: nothing in it tells whether there ever was an entry\n")
    if unseen:
        say(f"entries 1 to {unseen} could not be seen: the journal says that it has removed them for room\n")
    return 0


def _count(path: Path) -> tuple[int, int]:
    """How many entries there are, and how many were before them."""
    count = unseen = 0
    for entry in verified(path):
        unseen = entry["n"] - 1 if count == 0 else unseen
        count += 1
    return count, unseen


def _journal(path: Path) -> Path:
    if path.is_dir():
        return RecordsFolder(path).journal
    return RecordsFolder(config.load(path).records).journal if path.suffix == ".toml" else path


COMMANDS: dict[str, Callable[[list[str]], int]] = {"tail": tail, "verify": verify}
