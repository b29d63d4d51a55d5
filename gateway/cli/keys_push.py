"""`gwrms keys push` and `add`: one key let in on many robots, over ssh, by who may change them already.

A gateway cannot let anybody in: its folder of clients is root's. So this goes past it, as its administrator.
"""

import argparse
import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.certificates import NAME, KeyProblem, der_of
from gateway.cli.text import say, say_json, warn
from gateway.client import pairing
from gateway.client.address import DEFAULT_PORT, Address
from gateway.client.errors import ClientError
from gateway.config.robot import RobotConfig
from gateway.wire.role import Role

REMOTE: Final = "sudo -n gwrms"
ADD: Final = (
    "Admit the key whose certificate (PEM) comes on standard input. gwrms keys push runs this by ssh."
)
PUSH: Final = """\
Admit a key on further robots: runs `gwrms keys add` on each by ssh, with an account that may log in there and
use sudo. Without --certificate it is this desk's own key, and each robot is pinned here as after pairing,
because ssh has authenticated it. A robot that fails is named, and the others are done.
"""


def add(arguments: argparse.Namespace, robot: RobotConfig, folder: AccessFolder) -> int:
    """Exit code: 0 let in. Raises `KeyProblem`: it is not."""
    if not folder.has_keys:
        raise KeyProblem(
            "this robot has no keys yet: gwrms keys pair here makes them, and lets the first desk in"
        )
    changes.add(folder, arguments.name, der_of(sys.stdin.buffer.read()), arguments.role)
    if arguments.json:
        port, own = robot.gateway.port or DEFAULT_PORT, changes.own_fingerprint(folder)
        say_json({"robot": robot.robot.name, "port": port, "fingerprint": own})
    else:
        say(f"{arguments.name} is let in from now on, as {arguments.role}.\n")
    return 0


def push(argv: list[str]) -> int:
    """Exit code: 0 on all of them, 1 not on some, 2 usage."""
    arguments = _arguments(argv)
    given: Path | None = arguments.certificate
    pem = pairing.own_certificate() if given is None else _read(given)
    der_of(pem)  # what is none is not sent anywhere
    name = arguments.name or (pairing.own_name() if given is None else given.stem)
    failed = 0
    for host in arguments.hosts:
        try:
            answer = _added(host, name, pem, arguments)
            if given is None:
                where = Address(host.rpartition("@")[2], int(answer["port"]), str(answer["fingerprint"]))
                pairing.pin(str(answer["robot"]), where)
            say(f"{host}: {answer['robot']} lets {name} in from now on, as {arguments.role}.\n")
        except (KeyProblem, ClientError) as error:
            failed += 1
            warn("keys push", f"{host}: {error}")
    return 1 if failed else 0


def _arguments(argv: list[str]) -> argparse.Namespace:
    made = argparse.ArgumentParser(
        prog="gwrms keys push",
        description=PUSH,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    made.add_argument("hosts", metavar="[USER@]HOST", nargs="+", type=_host, help="robots, as ssh names them")
    made.add_argument("--role", type=Role, choices=list(Role), required=True, help="its role there")
    made.add_argument(
        "--certificate", metavar="FILE", type=Path, help="another client's certificate, such as anna.crt"
    )
    made.add_argument(
        "--name", type=name_of, help="the client's name on the robots (default: that of its file)"
    )
    made.add_argument(
        "--config", metavar="PATH", help="the robots' file there (default: /etc/gwrms/robot.toml)"
    )
    made.add_argument(
        "--remote", metavar="COMMAND", default=REMOTE, help="the gwrms command there (default: %(default)s)"
    )
    return made.parse_args(argv)


def name_of(text: str) -> str:
    """Return a name that a client can have, for argparse."""
    if not NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} is no name: letters, digits, _, . and -, at most 64")
    return text


def _host(text: str) -> str:
    if not text or text.startswith("-"):
        raise argparse.ArgumentTypeError(f"{text!r} is no host")
    return text


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise KeyProblem(f"{file} cannot be read: {error.strerror}") from error


def _added(host: str, name: str, pem: bytes, arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the robot's answer; raises `KeyProblem` with its words if it refuses."""
    ssh = shutil.which("ssh")
    if ssh is None:
        raise KeyProblem("the program ssh is not here: apt install openssh-client")
    config = [] if arguments.config is None else [arguments.config]
    asked = ["keys", "add", *config, name, "--role", arguments.role.value, "--json"]
    command = [ssh, "-T", "--", host, f"{arguments.remote} {shlex.join(asked)}"]
    ran = subprocess.run(command, input=pem, capture_output=True, check=False)
    answer = _answer(ran.stdout)
    if ran.returncode or not {"robot", "port", "fingerprint"} <= answer.keys():
        said = ran.stderr.decode("utf-8", "replace").strip().splitlines()
        raise KeyProblem(said[-1] if said else f"it was not let in (exit code {ran.returncode})")
    return answer


def _answer(output: bytes) -> dict[str, Any]:
    """Return the last line, because a login may print others before."""
    lines = output.strip().splitlines()
    try:
        found = json.loads(lines[-1]) if lines else None
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
