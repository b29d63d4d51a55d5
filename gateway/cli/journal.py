"""`gwrms journal`: what was done to a robot, by whom, and whether the record of it is whole."""

import argparse
import dataclasses
import datetime
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from gateway import config
from gateway.access.changes import own_fingerprint
from gateway.access.folder import AccessFolder
from gateway.certificates import KeyProblem
from gateway.cli.connect import choose, connect, parser
from gateway.cli.text import say, say_json, table, warn
from gateway.client.keys import checked_pin, pins, server_file
from gateway.records.folder import RecordsFolder
from gateway.records.witness import NOBODY, Judgement, WitnessVerdict, judge, objection
from gateway.wire.control import SignedHead

VERIFY_EPILOG = """Run it on the robot's own computer, or on a copy of journal.jsonl with journal.jsonl.head
and its older pieces (journal.jsonl.NUMBER) beside it. The result is one of

  intact     every entry is the one that a desk has seen, signed by the robot
  broken     and at which entry: altered, moved, cut, or different from what a desk has seen
  unproven   from which entry on: consistent in itself, but no desk has seen those entries

Root on the robot can forge any entries that no desk has collected yet.

exit status: 0 intact; 1 broken; 2 not there, or usage; 3 unproven"""

STATUS = {WitnessVerdict.INTACT: 0, WitnessVerdict.BROKEN: 1, WitnessVerdict.UNPROVEN: 3}
_SHOWN_APART = ("n", "utc_ns", "monotonic_ns", "boot_id", "who", "what", "previous", "hash")


USAGE = """usage: gwrms journal COMMAND …

  tail [-n N]    show the robot's newest entries: who did what, when, and the outcome
  verify PATH    check that every entry of a journal's file is there and unaltered, as desks have seen it

gwrms journal COMMAND --help says more.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms journal`."""
    return choose(argv, COMMANDS, USAGE)


def tail(argv: list[str]) -> int:
    """Run `gwrms journal tail`."""
    made = parser(
        "journal tail",
        "Show the newest entries: who did what, when, and the outcome. WHO is identified by key or account\n"
        "[in brackets]; after that come the name that the program gives itself, and its address.",
    )
    made.add_argument(
        "-n", type=int, default=20, metavar="N", help="number of entries, at most 1000 (default 20)"
    )
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
    arguments = _verify_parser().parse_args(argv)
    path = _journal(arguments.path)
    try:
        witnesses, problems = _witnesses(arguments)
        found = judge(path, witnesses, "; ".join(problems) or NOBODY)
    except FileNotFoundError as error:
        missing = error.filename if arguments.witness and error.filename else path
        warn("journal", f"there is no journal at {missing}: name robot.toml, its records folder, or the file")
        return 2
    except KeyProblem as error:
        warn("journal", str(error))
        return 2
    if arguments.json:
        say_json({"path": str(path), "problems": problems, **dataclasses.asdict(found)})
    else:
        _tell(path, found)
        for problem in problems if found.verdict is not WitnessVerdict.UNPROVEN else ():
            warn("journal", problem)
    return STATUS[found.verdict]


def _tell(path: Path, found: Judgement) -> None:
    at = "" if found.at is None else f" at {found.at}"
    match found.verdict:
        case WitnessVerdict.INTACT:
            say(f"{path} is intact: {found.entries} entries, {found.text}\n")
        case WitnessVerdict.BROKEN:
            warn("journal", f"{path} is BROKEN{at}: {found.text}")
        case WitnessVerdict.UNPROVEN if not found.entries:
            say(f"{path} is empty, and unproven: nothing in it tells whether there ever was an entry\n")
        case WitnessVerdict.UNPROVEN:
            say(
                f"{path} is unproven{at}: its {found.entries} entries follow each other unaltered, but who "
                f"may write that file can make such a chain; {found.text}\n"
            )
    if found.removed:
        said = "could not be seen: the journal says that it has removed them for room"
        say(f"entries 1 to {found.removed} {said}\n")


def _witnesses(arguments: argparse.Namespace) -> tuple[list[SignedHead], list[str]]:
    """Return those that count, and why others do not."""
    key, why = _key(arguments)
    heads: list[SignedHead] = []
    problems = list(why)
    for file in arguments.witness:
        for number, line in enumerate(file.read_bytes().splitlines(), 1):
            try:
                head = msgspec.json.decode(line, type=SignedHead)
            except (ValueError, RecursionError) as error:
                problems.append(f"{file}, line {number}: {error}")
                continue
            said = objection(head, key)
            if said is None:
                heads.append(head)
            else:
                problems.append(f"{file}, line {number}: {said}")
    return heads, problems


def _key(arguments: argparse.Namespace) -> tuple[str | None, list[str]]:
    """Return the fingerprint of the robot's key.

    As given, the robot's own, or that of the only paired robot.
    """
    if arguments.key is not None or not arguments.witness:
        return arguments.key, []
    if arguments.path.suffix == ".toml":
        return own_fingerprint(AccessFolder(config.load(arguments.path).access, {})), []
    try:
        known = pins()
    except (OSError, ValueError) as error:
        return None, [f"{server_file()} cannot be read: {error}"]
    return (known.pop(), []) if len(known) == 1 else (None, [])


def _verify_parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="gwrms journal verify",
        description="Check every entry of a journal, and compare it with the witnesses of desks.",
        epilog=VERIFY_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("path", type=Path, help="robot.toml, a records folder, or a journal.jsonl")
    made.add_argument(
        "--witness",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="a desk's witnesses: gwrms cloud witnesses ROBOT > FILE; repeatable",
    )
    made.add_argument(
        "--key",
        type=_fingerprint,
        metavar="SHA256",
        help="of the robot, as pairing showed it (default: of robot.toml, or of the only paired robot)",
    )
    made.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    return made


def _fingerprint(text: str) -> str:
    try:
        return checked_pin("".join(text.split()))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _journal(path: Path) -> Path:
    if path.is_dir():
        return RecordsFolder(path).journal
    return RecordsFolder(config.load(path).records).journal if path.suffix == ".toml" else path


COMMANDS: dict[str, Callable[[list[str]], int]] = {"tail": tail, "verify": verify}
