"""`gwrms journal`: what was done to a robot, by whom, and whether the record of it is whole."""

import argparse
import datetime
from pathlib import Path
from typing import Any

from gateway import config
from gateway.cli.reach import parser, reach
from gateway.cli.text import say, say_json, table, warn
from gateway.records.chain import Broken
from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified

EPILOG = """examples:
  gwrms journal tail -n 50
  gwrms journal verify robot.toml           on the robot's own computer; also a records folder, or a copy of
                                            journal.jsonl with its journal.jsonl.head beside it"""

_SHOWN_APART = ("n", "utc_ns", "monotonic_ns", "boot_id", "who", "what", "previous", "hash")


def main(argv: list[str]) -> int:
    """Run `gwrms journal`."""
    made = parser("journal", "Who did what to the robot, when, and what came of it.", EPILOG)
    commands = made.add_subparsers(dest="command", required=True, metavar="tail | verify")
    tail = commands.add_parser("tail", help="the newest entries, asked of the gateway")
    tail.add_argument("-n", type=int, default=20, metavar="N", help="how many, at most 1000 (default 20)")
    verify = commands.add_parser("verify", help="check every entry of a journal's file")
    verify.add_argument("path", type=Path, help="robot.toml, a records folder, or a journal.jsonl")
    for one in (tail, verify):  # also behind the subcommand, where people write them
        one.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS)
    arguments = made.parse_args(argv)
    return _tail(arguments) if arguments.command == "tail" else _verify(arguments)


def _tail(arguments: argparse.Namespace) -> int:
    with reach(arguments, "journal") as robot:
        entries = robot.journal(arguments.n).entries
    if arguments.json:
        for entry in entries:
            say_json(entry)
    else:
        say(table(("N", "TIME (UTC)", "WHO", "WHAT", ""), map(_row, entries), right=(0,)))
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


def _verify(arguments: argparse.Namespace) -> int:
    path = _journal(arguments.path)
    try:
        entries = read_verified(path)
    except FileNotFoundError:
        warn("journal", f"there is no journal at {path}: name robot.toml, its records folder, or the file")
        return 2
    except Broken as error:
        if arguments.json:
            say_json({"path": str(path), "intact": False, "problem": str(error)})
        warn("journal", f"{path} is NOT intact: {error}")
        return 1
    if arguments.json:
        say_json({"path": str(path), "intact": True, "entries": len(entries)})
    else:
        say(f"{path} is intact: {len(entries)} entries, each in its place and unaltered\n")
    return 0


def _journal(path: Path) -> Path:
    if path.is_dir():
        return RecordsFolder(path).journal
    return RecordsFolder(config.load(path).records).journal if path.suffix == ".toml" else path
