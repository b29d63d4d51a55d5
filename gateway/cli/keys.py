"""`gwrms keys`: who is let in on this robot, and as what. Run on the robot itself, but `push` anywhere."""

import argparse
import contextlib
import socket
import sys
from pathlib import Path

from gateway import config
from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.access.known_clients import known_in
from gateway.access.pairing import Candidate, Pairing, PairingEnded
from gateway.certificates import NAME, KeyProblem, grouped
from gateway.cli import keys_push, qr_code
from gateway.cli.connect import NobodyToAsk, choose
from gateway.cli.text import say, say_json, table, warn
from gateway.client.address import DEFAULT_PORT
from gateway.connections.listener_kind import is_loopback
from gateway.connections.listeners import listen
from gateway.private import forbid_core_dumps
from gateway.wire.pairing import PAIRING_PORT, TRIES, VALID_S, Reply, link, new_code
from gateway.wire.role import Role

CONFIG = Path("/etc/gwrms/robot.toml")
USAGE = """usage: gwrms keys COMMAND …

  pair [CONFIG]          admit another desk: shows a code to type there
  list [CONFIG]          list the admitted clients, with their roles
  push HOST… --role ROLE admit this desk, or another key, on further robots, by ssh
  add [CONFIG] NAME      admit the key whose certificate comes on standard input
  revoke [CONFIG] NAME   revoke a client; connections with its key are closed at once

CONFIG is the robot's file (default /etc/gwrms/robot.toml); keys and clients are beside it.
gwrms keys COMMAND --help says more.
"""
_PAIR = """\
Show HOST:PORT and a code. On the desk, `gwrms pair HOST:PORT` asks for the code and proves that it knows it;
then you enter here the desk's name and its role. With its first desk the robot gets a key of its own: from
the next start of its gateway on, every TCP connection uses TLS. Until a desk is admitted nothing changes,
even if you cancel.
"""


def main(argv: list[str]) -> int:
    """Run `gwrms keys`."""
    return choose(argv, COMMANDS, USAGE)


def pair(argv: list[str]) -> int:
    """Exit code: 0 paired, 1 nobody was, 2 usage."""
    made = _parser("pair", _PAIR)
    made.add_argument("--host", help="address to listen on for the desk (default: [gateway] host)")
    made.add_argument("--port", type=int, default=PAIRING_PORT, help="its port (default %(default)s)")
    made.add_argument("--name", type=keys_push.name_of, help="name of the desk, instead of asking")
    made.add_argument("--role", type=Role, choices=list(Role), help="its role, instead of asking")
    made.add_argument(
        "--yes", action="store_true", help="with --name and --role: ask nothing, accept the first desk"
    )
    arguments = made.parse_args(argv)
    if arguments.yes and not (arguments.name and arguments.role):
        made.error("--yes needs --name and --role for the desk")
    if not arguments.yes and not sys.stdin.isatty():
        raise NobodyToAsk("there is no terminal to ask on; give --name, --role and --yes")
    forbid_core_dumps()
    robot, folder = _robot(arguments)
    if arguments.name:
        changes.check_free(folder, arguments.name)
    host = arguments.host or robot.gateway.host
    with listen(host, arguments.port, "--host and --port") as listener:
        _warn_of_loopback(listener, arguments)
        keys = changes.ensure_keys(folder, robot.robot.name)
        code, own = new_code(), changes.own_fingerprint(keys)
        pairing = Pairing(keys, listener, code, own)
        _show(listener, code, own)
        candidate = pairing.wait()
    try:
        name, role = _confirmed(candidate, arguments, folder)
        candidate.check_waits()
        is_first = changes.admit(keys, own, name, candidate.der, role)
    except KeyProblem as error:
        candidate.answer(Reply(problem=str(error)))
        raise
    except (PairingEnded, KeyboardInterrupt):
        candidate.answer(Reply(problem="it was not confirmed on the robot"))
        raise
    candidate.answer(
        Reply(
            pairing.proof(candidate), robot.robot.name, robot.gateway.port or DEFAULT_PORT, name, role.value
        )
    )
    say(f"{name} is let in from now on, as {role.value}.\n")
    if is_first:
        say(f"The robot's key is in {folder.keys} now.\n")
        say(f"Start its gateway again: {name} reaches it only then.\n")
    return 0


def _warn_of_loopback(listener: socket.socket, arguments: argparse.Namespace) -> None:
    """Warn before a code is shown that no other desk could use."""
    if is_loopback(listener.getsockname()):
        warn(
            "keys",
            "only a desk on this computer can use the address below: it is this computer's own. "
            'For other desks press Ctrl-C, set host = "0.0.0.0" under [gateway] in '
            f"{arguments.config}, and begin again",
        )


def _show(listener: socket.socket, code: str, own: str) -> None:
    host, port = listener.getsockname()[:2]
    shown = _address() if host in ("0.0.0.0", "::") else host
    where = f"[{shown}]:{port}" if ":" in shown else f"{shown}:{port}"
    say(f"\nOn the desk, within {VALID_S / 60:.0f} minutes ({TRIES} tries):\n\n")
    say(f"  gwrms pair {where}\n\nIt asks for this code:\n\n  {code}\n\n")
    say("".join(f"{one}\n" for one in _drawn(link(where, code))))
    say(f"This robot's key: {grouped(own)}\n")


def _drawn(text: str) -> list[str]:
    """Return the same for a camera, where this is a terminal that can show it."""
    try:
        "█▀▄".encode(sys.stdout.encoding or "ascii")
        return [*qr_code.lines(text), ""] if sys.stdout.isatty() else []
    except (UnicodeEncodeError, qr_code.TooLong):
        return []


def _address() -> str:
    """Return the address by which others reach this computer, as far as it knows it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, contextlib.suppress(OSError):
        probe.connect(("192.0.2.1", 9))  # nothing is sent (RFC 5737)
        return str(probe.getsockname()[0])
    return socket.gethostname()


def _confirmed(candidate: Candidate, arguments: argparse.Namespace, folder: AccessFolder) -> tuple[str, Role]:
    """Return name and role as the person here confirms them; raises `PairingEnded` if they refuse."""
    if arguments.yes:
        return arguments.name, arguments.role
    wished = arguments.name or (candidate.name if NAME.fullmatch(candidate.name) else "")
    say(f"\nA desk has proved the code. It calls itself {candidate.name!r}, its key is\n")
    say(f"{grouped(candidate.fingerprint)}\n\n")
    return arguments.name or _name(folder, wished), arguments.role or _role()


def _name(folder: AccessFolder, wished: str) -> str:
    """Asked for until it is one that a new desk can have."""
    while True:
        name = _asked(f"Its name [{wished}]: ") or wished
        try:
            changes.check_free(folder, name)
        except KeyProblem as error:
            warn("keys", str(error))
        else:
            return name


def _role() -> Role:
    """Asked for until it is one, or nothing."""
    while said := _asked(f"Its role ({', '.join(Role)}; leave empty to refuse): "):
        if said in list(Role):
            return Role(said)
        warn("keys", f"{said!r} is no role")
    raise PairingEnded("nobody was paired")


def _asked(question: str) -> str:
    """Ask a question; raises `PairingEnded` if the terminal has closed."""
    say(question)
    line = sys.stdin.buffer.readline()
    if not line:
        raise PairingEnded("nobody was paired: nothing was typed")
    return line.decode("utf-8", "replace").strip()


def list_(argv: list[str]) -> int:
    """Exit code: 0 all is well, 1 something in it is not."""
    made = _parser("list", "List the clients of this robot, with their roles.")
    made.add_argument("--json", action="store_true", help="print one JSON object per line, for programs")
    arguments = made.parse_args(argv)
    _, folder = _robot(arguments)
    known = known_in(folder)
    if arguments.json:
        for who in known.by_key.values():
            say_json({"name": who.name, "role": who.role, "fingerprint": who.fingerprint})
    else:
        say(f"robot  {grouped(changes.own_fingerprint(folder))}\n" if folder.has_keys else "no keys yet\n")
        rows = [(who.name or "", who.role, grouped(who.fingerprint or "")) for who in known.by_key.values()]
        rows += [(f"user {name}", role, "") for name, role in known.table.users.items()]
        rows += [(f"group {name}", role, "") for name, role in known.table.groups.items()]
        say(table(("NAME", "ROLE", "KEY"), rows))
    for problem in known.problems:
        warn("keys", problem)
    return 1 if known.problems else 0


def revoke(argv: list[str]) -> int:
    """Exit code: 0 gone, 1 there is nobody of that name, or it could not be removed."""
    made = _parser("revoke", "Revoke a client. A running gateway closes its connections at once.")
    made.add_argument("name", metavar="NAME")
    arguments = made.parse_args(argv)
    _, folder = _robot(arguments)
    changes.remove(folder, arguments.name)
    say(f"{arguments.name} is no longer admitted; its trials are reverted.\n")
    return 0


def add(argv: list[str]) -> int:
    """Exit code: 0 let in, 1 not, 2 usage."""
    made = _parser("add", keys_push.ADD)
    made.add_argument("name", metavar="NAME", type=keys_push.name_of)
    made.add_argument("--role", type=Role, choices=list(Role), required=True, help="what it may")
    made.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    arguments = made.parse_args(argv)
    return keys_push.add(arguments, *_robot(arguments))


def _parser(command: str, what: str) -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog=f"gwrms keys {command}",
        description=what,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument(
        "config", metavar="CONFIG", nargs="?", type=Path, default=CONFIG, help="the robot's file"
    )
    return made


def _robot(arguments: argparse.Namespace) -> tuple[config.RobotConfig, AccessFolder]:
    """Return the robot of the file, and its folder on the disk, whoever runs this."""
    robot = config.load(arguments.config)
    return robot, AccessFolder(robot.access, {})


COMMANDS = {"pair": pair, "list": list_, "add": add, "push": keys_push.push, "revoke": revoke}
