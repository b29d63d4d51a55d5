"""`gwrms pair`: let a robot know this desk, and this desk the robot."""

import argparse

from gateway.cli.connect import address
from gateway.cli.text import say, say_json
from gateway.client import pairing
from gateway.client.address import DEFAULT_PORT, Address
from gateway.client.keys import keys_folder, server_file
from gateway.wire.pairing import PAIRING_PORT, normal

_DESCRIPTION = """\
Pairs this desk with the robot on which `gwrms keys pair` shows CODE: this desk's key is made where it
has none, the robot's is pinned in server.toml, and a person on the robot says what this desk may do.
From then on every command, the window and scripts reach the robot by its address, as before.
"""


def main(argv: list[str]) -> int:
    """Exit code: 0 paired, 1 not, 2 usage."""
    made = argparse.ArgumentParser(
        prog="gwrms pair",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("robot", metavar="HOST:PORT", type=_where, help="as the robot shows it")
    made.add_argument("code", metavar="CODE", type=_code, help="as the robot shows it")
    made.add_argument("--name", help="that the robot is to call this desk (default: your user and computer)")
    made.add_argument("--json", action="store_true", help="one JSON object, for machines")
    arguments = made.parse_args(argv)
    if not arguments.json:
        say(f"Waiting until somebody confirms it on the robot at {arguments.robot} …\n")
    paired = pairing.pair(arguments.robot, arguments.code, arguments.name)
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
    say(f"\n  gwrms describe --robot {paired.address}\n")
    return 0


def _where(text: str) -> Address:
    found = address(text)
    return Address(found.host, PAIRING_PORT) if found.port == DEFAULT_PORT else found


def _code(text: str) -> str:
    try:
        return normal(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
