"""The common part of commands that query a robot: arguments and connection."""

import argparse
import fnmatch
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from gateway.cli.text import YES_OR_NO, did_you_mean, warn
from gateway.client import (
    Address,
    BadAddress,
    ClientError,
    ConnectionState,
    LinkSettings,
    Robot,
    Unreachable,
    WrongRobot,
)
from gateway.client.address import DEFAULT_HOST, DEFAULT_PORT
from gateway.client.keys import named, robot_names, server_file
from gateway.plain_text import followed, plain
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Description
from gateway.wire.stream import ModuleName

_WORD: Final = re.compile(r"[A-Za-z][\w-]*")  # a name, or a computer of this network
_OBJECT: Final = re.compile(r"([\w-]+)\.0[xX]([0-9A-Fa-f]{4})(?::(\w+))?")
USUAL: Final = Address()  # who is asked where nobody says whom


class UnknownName(ClientError):
    """A channel or parameter that the robot does not have."""


YES: Final = "say --yes to go on"


class NobodyToAsk(Exception):
    """A question before a change, and no terminal."""


def parser(command: str, what: str, epilog: str = "") -> argparse.ArgumentParser:
    """Return the arguments that all asking commands have: `--robot` and `--json`."""
    made = argparse.ArgumentParser(
        prog=f"gwrms {command}",
        description=what,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_robot(made)
    made.add_argument("--json", action="store_true", help="print one JSON object per line, for programs")
    return made


def add_robot(made: argparse.ArgumentParser) -> None:
    """Add the argument `--robot`, which names the gateway."""
    made.add_argument(
        "--robot",
        metavar="HOST:PORT",
        type=address,
        default=USUAL,
        help="the gateway to ask; or the path of its Unix socket, or a robot's name in server.toml "
        f"(default {DEFAULT_HOST}:{DEFAULT_PORT})",
    )


def again(arguments: argparse.Namespace, command: str) -> str:
    """Return how to give another command to the same robot."""
    robot: Address = arguments.robot
    if robot == USUAL and not robot.called:
        return f"gwrms {command}"
    return f"gwrms {command} --robot {shlex.quote(robot.called or str(robot))}"


def spoken(arguments: argparse.Namespace) -> str:
    """Return what the asked robot is called: its name, where it was asked for by that."""
    robot: Address = arguments.robot
    return robot.called or "the robot"


def connect(arguments: argparse.Namespace, command: str) -> Robot:
    """Return the robot that `--robot` names, connected.

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

    try:
        return Robot(address, LinkSettings(client=f"gwrms {command}"), report)
    except Unreachable as error:
        if (unknown := _unknown_name(address)) and not isinstance(error, WrongRobot):
            is_clear = _in_other_case(address.host)
            raise Unreachable(unknown if is_clear else f"{unknown} If it is a computer: {error}") from error
        if address != USUAL:
            raise
        raise Unreachable(followed(str(error), "Another robot: --robot HOST:PORT")) from error


def _unknown_name(address: Address) -> str:
    """Return that no robot is called so, of a word alone that is no name in the server's file."""
    word = address.host
    if address.called or address.path or word == "localhost" or not _WORD.fullmatch(word):
        return ""
    known = robot_names()
    if alike := _in_other_case(word):
        return f"no robot is called {word!r}; did you mean {' or '.join(alike)}?"
    listed = f" (it has {', '.join(known)})." if known else "."
    return f"no robot is called {word!r} in {server_file()}{did_you_mean(word, known) or listed}"


def _in_other_case(word: str) -> list[str]:
    """Return the robots in the server's file whose names differ from a word by capitals alone."""
    return [name for name in robot_names() if name.casefold() == word.casefold()]


def widened(asked: Iterable[str], description: Description) -> list[str]:
    """Return names with a component's name alone as a glob: `left_knee` is `left_knee.*`."""
    components = {each.name for each in description.components}
    components |= {
        each.component for each in description.channels
    }  # the computer is none of the robot's parts
    return [f"{name}.*" if name in components else name for name in asked]


def meant(globs: Sequence[str], description: Description) -> list[ChannelInfo]:
    """Return the channels that any of these globs names, in the robot's order."""
    return [each for each in description.channels if any(fnmatch.fnmatchcase(each.name, g) for g in globs)]


def check_names(
    what: str, asked: Iterable[str], known: Sequence[str], absent: Mapping[str, str] = MappingProxyType({})
) -> None:
    """Refuse a name or glob that nothing on the robot has; `absent` are components that cannot be built.

    Raises:
        UnknownName: names it, and those that come close, or why the component that it is of is not there.

    """
    for glob in asked:
        if not any(fnmatch.fnmatchcase(name, glob) for name in known):
            component = glob.partition(".")[0]
            for name in fnmatch.filter(absent, component):
                raise UnknownName(f"{name} has no {what}: {absent[name]}")
            if found := _OBJECT.fullmatch(glob):
                raise UnknownName(_not_released(*found.groups("0")))
            raise UnknownName(
                f"the robot has no {what} {glob!r}{did_you_mean(glob, known)} (gwrms describe lists them)"
            )


def _not_released(component: str, index: str, subindex: str) -> str:
    """Return why an object cannot be used as a parameter; another one's address is never proposed for it."""
    table = f'[parameter."{component}.object_{index.lower()}"]'
    return (
        f"the robot's file releases no object 0x{index}:{subindex} of {component}: add {table} and below it "
        f'object = "0x{index}:{subindex}" to the file, and start the gateway again '
        f"(gwrms od {component} 0x{index} says what it is)"
    )


def modules_of(channels: Iterable[ChannelInfo]) -> list[ModuleName]:
    """Return the modules that give the channels: the computer's own are the resource module's."""
    modules: set[ModuleName] = {
        "resource" if channel.component == "resource" else "component" for channel in channels
    }
    return sorted(modules)


def choose(argv: list[str], commands: Mapping[str, Callable[[list[str]], int]], usage: str) -> int:
    """Run one of several commands under one name; without one, say which there are."""
    command = commands.get(argv[0]) if argv else None
    if command is None:
        asked = argv[:1] in (["-h"], ["--help"])
        (sys.stdout if asked else sys.stderr).write(usage)
        if argv and not asked:
            missing = f"there is no command {argv[0]!r}{did_you_mean(argv[0], commands)}"
            sys.stderr.write(
                f"\n{'options come behind the COMMAND' if argv[0].startswith('-') else missing}\n"
            )
        return 0 if asked else 2
    return command(argv[1:])


def ask(question: str, *, yes: bool) -> bool:
    """Return whether a person says yes; `yes` if `--yes` said it already.

    Raises:
        NobodyToAsk: there is no terminal.

    """
    if yes:
        return True
    if not sys.stdin.isatty():
        raise NobodyToAsk(f"{plain(question)} There is no terminal to ask on, and nothing was sent; {YES}")
    sys.stderr.write(plain(question, "\n") + YES_OR_NO)  # a program's answer is on the standard output
    sys.stderr.flush()
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def absent_components(description: Description) -> dict[str, str]:
    """Return those that have no channel because something is wrong with them, and what."""
    there = {channel.component for channel in description.channels}
    return {one.name: one.problem for one in description.components if one.problem and one.name not in there}


def channel_names(description: Description) -> list[str]:
    return [channel.name for channel in description.channels]


def parameter_names(description: Description) -> list[str]:
    """Return every name and address, as in `left_knee.0x6072:0`, that means a parameter."""
    parameters = description.parameters
    return [one.name for one in parameters] + [f"{one.component}.{one.object}" for one in parameters]


def address(text: str) -> Address:
    try:
        return named(text) or Address.parse(text)
    except BadAddress as error:
        raise argparse.ArgumentTypeError(str(error)) from error
