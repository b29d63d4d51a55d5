"""`gwrms pair`: pair this desk with a robot."""

import argparse
import sys
import time
from collections.abc import Callable
from typing import Final

from gateway.cli.connect import NobodyToAsk
from gateway.cli.keys_push import name_of
from gateway.cli.text import say, say_json, warn
from gateway.client import Address, pairing
from gateway.client.keys import keys_folder, server_file
from gateway.private import forbid_core_dumps
from gateway.wire.pairing import is_link, normal

_DESCRIPTION = """\
Pair this desk with the robot on which `gwrms keys pair` shows a code. The command asks for the code, so
that it appears in no list of processes and no shell history; without a terminal, it reads the code as a
line from standard input. It creates a key for this desk if there is none, and pins the robot's key in
server.toml; a person at the robot decides what this desk may do. From then on every command, the window
and scripts reach the robot by its address, as before.
"""
_MOST: Final = 1024  # letters of a line that is typed
_REFUSED_S: Final = 1.0  # a wrong code is refused at once; for a right one a person is waited for


def main(argv: list[str]) -> int:
    """Exit code: 0 paired, 1 not, 2 usage."""
    made = argparse.ArgumentParser(
        prog="gwrms pair",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument(
        "robot",
        metavar="HOST:PORT",
        nargs="?",
        default="",
        help="as the robot shows it (default: ask)",
    )
    made.add_argument(
        "code",
        metavar="CODE",
        nargs="?",
        default="",
        help="the code, instead of asking for it; others on this computer may see it",
    )
    made.add_argument(
        "--name", type=name_of, help="this desk's name on the robot (default: your user and computer)"
    )
    made.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    arguments = made.parse_args(argv)
    forbid_core_dumps()
    try:
        where, code = _typed(arguments)
    except ValueError as error:
        made.error(str(error))
    if arguments.json:
        paired = pairing.pair(where, code, arguments.name)
    else:
        paired = pairing.pair(where, code, arguments.name, _waiting(where))
    name = pairing.pin(paired.robot, paired.address)
    if arguments.json:
        say_json(
            {
                "robot": name,
                "address": str(paired.address),
                "pin": paired.address.pin,
                "name": paired.name,
                "role": paired.role,
            }
        )
        return 0
    say(f"Paired with {paired.robot}: it calls this desk {paired.name}, as {paired.role}.\n")
    say(f"Its key is pinned in {server_file()}, yours is in {keys_folder()}.\n")
    say("If it had no keys before, start its gateway again there first. Then, here:\n")
    say(f"\n  gwrms describe --robot {paired.address}\n")
    return 0


def _waiting(where: Address) -> Callable[[], bool]:
    """Say once that a person is waited for; returned to be asked whether the pairing is given up: never."""
    begun_s, said = time.monotonic(), False

    def look() -> bool:
        nonlocal said
        if not said and time.monotonic() - begun_s > _REFUSED_S:
            said = True
            say(f"Waiting until somebody confirms it on the robot at {where} …\n")
        return False

    return look


def _typed(arguments: argparse.Namespace) -> tuple[Address, str]:
    """Address and code, each asked for where it was not given.

    Raises:
        ValueError: one is none.
        NobodyToAsk: nobody has typed it.
        Unreachable: a person would type a code for nobody.

    """
    robot = arguments.robot or _asked("HOST:PORT, or the robot's link: ", arguments)
    if arguments.code or is_link(robot):
        return pairing.typed(robot, arguments.code)
    where = pairing.place(robot)
    if sys.stdin.isatty():
        pairing.check_waits(where)
    while True:
        try:
            return where, normal(_asked("The code that the robot shows: ", arguments))
        except ValueError as error:
            if not sys.stdin.isatty():
                raise
            warn("pair", str(error))


def _asked(question: str, arguments: argparse.Namespace) -> str:
    """Return a line of the standard input; where a person types it, they are asked.

    Raises:
        NobodyToAsk: the input has ended.

    """
    if sys.stdin.isatty():
        asking = sys.stderr if arguments.json else sys.stdout
        asking.write(question)
        asking.flush()
    line = sys.stdin.buffer.readline(_MOST)
    if not line:
        raise NobodyToAsk(f"nothing was typed; it was asked for: {question.rstrip(': ')}")
    return line.decode("utf-8", "replace").strip()
