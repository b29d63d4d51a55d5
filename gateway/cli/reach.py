"""What every asking command shares: its arguments, and a robot to ask."""

import argparse
import fnmatch
from collections.abc import Iterable, Sequence

from gateway.cli.text import did_you_mean, warn
from gateway.client import Address, BadAddress, ClientError, ConnectionState, LinkSettings, Robot
from gateway.client.address import DEFAULT_HOST, DEFAULT_PORT
from gateway.messages import Description


class UnknownName(ClientError):
    """A channel or parameter that the robot does not have."""


def parser(command: str, what: str, epilog: str = "") -> argparse.ArgumentParser:
    """The arguments that all asking commands have: `--robot` and `--json`."""
    made = argparse.ArgumentParser(
        prog=f"gwrms {command}",
        description=what,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument(
        "--robot",
        metavar="HOST:PORT",
        type=_address,
        default=Address(),
        help=f"the gateway to ask (default {DEFAULT_HOST}:{DEFAULT_PORT})",
    )
    made.add_argument("--json", action="store_true", help="one JSON object a line, for machines")
    return made


def reach(arguments: argparse.Namespace, command: str) -> Robot:
    """The robot that `--robot` names, connected.

    Raises:
        ClientError: it cannot be reached.

    """
    address: Address = arguments.robot
    linked = False

    def report(state: ConnectionState) -> None:
        nonlocal linked
        if state is ConnectionState.CONNECTED:
            linked = True
        elif state is ConnectionState.WAITING and linked:
            linked = False
            warn(command, f"the link to {address} dropped; trying again")

    return Robot(address, LinkSettings(client=f"gwrms {command}"), report)


def check_names(what: str, asked: Iterable[str], known: Sequence[str]) -> None:
    """Refuse a name or glob that nothing on the robot has.

    Raises:
        UnknownName: names it, and those that come close.

    """
    for glob in asked:
        if not any(fnmatch.fnmatchcase(name, glob) for name in known):
            raise UnknownName(
                f"the robot has no {what} {glob!r}{did_you_mean(glob, known)} (gwrms describe lists them)"
            )


def channel_names(description: Description) -> list[str]:
    return [channel.name for channel in description.channels]


def parameter_names(description: Description) -> list[str]:
    return [parameter.name for parameter in description.parameters]


def _address(text: str) -> Address:
    try:
        return Address.parse(text)
    except BadAddress as error:
        raise argparse.ArgumentTypeError(str(error)) from error
