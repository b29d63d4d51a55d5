"""`gwrms install-service`: write systemd units for a robot's file, written or shown."""

import argparse
import ipaddress
import re
import shlex
from collections.abc import Sequence
from pathlib import Path

from gateway import config
from gateway.cli.systemd_units import LEAST_LINGER_S, MARK, Service, folder
from gateway.cli.text import say

_DESCRIPTION = """\
Write systemd units for the gateway of CONFIG.

Without a [guard] in CONFIG, systemd itself listens, and starts the gateway for the first client;
linger_s after the last one the gateway ends, and no process remains. A held stop, or a write on
trial, also starts it, at boot and after a kill. With a [guard] it runs from boot on, under a
watchdog, and is restarted if it fails. Write the units again after changing host, port, records
or [guard].

Nothing is started; the commands that start it are printed.
"""
_NAME = re.compile(r"[A-Za-z0-9_-]+")
PRIVATE = (Path("/tmp"), Path("/var/tmp"))  # of the service (PrivateTmp=)
_KINDS = (".service", ".socket", "-classic.socket", ".path")


class NotInstalled(Exception):
    """The units cannot be written, or would not work."""


def main(arguments: Sequence[str]) -> int:
    """Exit status: 0 written or shown, 1 they would not work or cannot be written, 2 usage."""
    try:
        options = _parser().parse_args(list(arguments))
    except SystemExit as ended:  # argparse has said why
        return ended.code if isinstance(ended.code, int) else 2
    service = Service(config.load(options.config), options.name, options.user, options.run_as)
    _check(service)
    if options.print:
        for name, text in service.units.items():
            say(f"# {name}\n{text}")
        return 0
    _write(service, folder(of_user=options.user))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms install-service",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("config", metavar="CONFIG", type=Path, help="the robot's file")
    parser.add_argument("--print", action="store_true", help="show the units, write nothing")
    parser.add_argument("--user", action="store_true", help="for your own session instead of the computer")
    parser.add_argument("--run-as", metavar="NAME", help="the account (default: a dynamic user of systemd)")
    parser.add_argument(
        "--name", type=_name, default="gwrms", help="folder of the units (default: %(default)s)"
    )
    return parser


def _name(text: str) -> str:
    if not _NAME.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r} is no unit's name: letters, digits, _ and -")
    return text


def _check(service: Service) -> None:
    gateway, path = service.config.gateway, service.config.path.absolute()
    if gateway.port == 0 or gateway.classic_port == 0:
        raise NotInstalled(f"{path}: port 0 is another one at each start; give a number in [gateway]")
    if not service.at_boot and gateway.linger_s < LEAST_LINGER_S:
        raise NotInstalled(
            f"{path}: it would be started too often; give linger_s at least {LEAST_LINGER_S:g}"
        )
    if not service.at_boot and not _is_address(gateway.host):
        raise NotInstalled(f"{path}: systemd listens on addresses only; give host = {gateway.host!r} as one")
    if service.of_user and service.user is not None:
        raise NotInstalled("--run-as is for the computer's own units; with --user it is you")
    if service.of_user:
        return
    if any(path.is_relative_to(folder) for folder in PRIVATE):
        raise NotInstalled(f"{path}: a service has a /tmp of its own; put the file into /etc/gwrms")
    if gateway.records is not None and service.user is None:
        raise NotInstalled(
            f"{path}: records = {gateway.records!r} must belong to an account that stays: name it with "
            "--run-as, or leave records out, and they are kept under /var/lib/gwrms"
        )


def _is_address(host: str) -> bool:
    try:
        return bool(ipaddress.ip_address(host))
    except ValueError:
        return False


def _write(service: Service, into: Path) -> None:
    """Write the units; what is not ours is not touched."""
    ours = {f"{service.name}{kind}" for kind in _KINDS}
    for name in ours:
        file = into / name
        if file.exists() and not file.read_text(encoding="utf-8").startswith(MARK):
            raise NotInstalled(f"{file} was not written by gwrms; move it away, or give another --name")
    into.mkdir(parents=True, exist_ok=True)
    stale = sorted(name for name in ours - set(service.units) if (into / name).exists())
    for name, text in service.units.items():
        (into / name).write_text(text, encoding="utf-8")
        say(f"wrote {into / name}\n")
    _say_how(service, into, stale)


def _say_how(service: Service, into: Path, stale: Sequence[str]) -> None:
    """Print the next commands; `stale` are old units, for a file that has changed since."""
    sudo, systemctl = ("", "systemctl --user") if service.of_user else ("sudo ", "sudo systemctl")
    say("\nNow:\n")
    if stale:
        say(f"  {systemctl} disable --now {' '.join(stale)}\n")
        say(f"  {sudo}rm {' '.join(shlex.quote(str(into / name)) for name in stale)}\n")
    say(f"  {systemctl} daemon-reload\n  {systemctl} enable --now {' '.join(service.enabled)}\n")
    if service.of_user:
        say("  loginctl enable-linger    # to run while you are not logged in\n")
