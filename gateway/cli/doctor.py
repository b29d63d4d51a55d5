"""`gwrms doctor`: what is wrong with a robot, with evidence and fixes."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from drivers.errors import DriverError
from gateway.amounts import counted
from gateway.cli.connect import address, ask
from gateway.cli.text import say, say_json, warn
from gateway.client import Address, ClientError, LinkSettings, Robot
from gateway.config.reading import examine
from gateway.config.robot import RobotConfig
from gateway.doctor.file_edit import NotMended
from gateway.doctor.fixing import Mender
from gateway.doctor.gathering.computer import ROOT
from gateway.doctor.gathering.gather import How, gather
from gateway.doctor.report import as_json, as_text, findings, status
from gateway.doctor.table import RULES, judged
from gateway.doctor.verdicts import Finding
from gateway.tables.finding import lines, mistakes

DESCRIPTION = """\
Find mistakes of a robot: in its file, on its buses, of its sensors and its computer, through its gateway if
one runs. Each finding has its figures and its remedies, the likeliest first; checks without data are listed,
with the reason. Nothing is ever enabled or moved.
"""
EPILOG = """\
If the robot walks for the 20 s, joints and insoles are judged too: one leg is compared with the other, and
both with normal gait. Standing still, only devices, bus and computer are judged.

If no gateway answers, the command only listens to buses and sensors, and sends no frame. With --active, it
also queries by SDO the devices that no other client uses; nothing is written.

exit status: 0 nothing wrong was found; 1 findings, fixed or not (run it again); 2 nothing could be judged, or
wrong usage

examples
  gwrms doctor /etc/gwrms/robot.toml                   through its gateway; without one, only listen
  gwrms doctor robot.toml --seconds 40 --json
  gwrms doctor robot.toml --active                     no gateway runs: query the devices too
  gwrms doctor robot.toml --robot exo:7420             from a desk: without its buses and its computer
  gwrms doctor robot.toml --fix                        apply safe fixes, asking for each
"""
NOTHING = 2
LOOPBACK = ("127.0.0.1", "::1", "localhost")
LEAST_S, MOST_S = 1.0, 600.0


def main(argv: Sequence[str]) -> int:
    """Run `gwrms doctor`."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.rules:
        say("".join(f"{rule.name:<18} {rule.meaning}; {rule.looks}\n" for rule in RULES))
        return 0
    if options.file is None:
        parser.error("name the robot's file: gwrms doctor /etc/gwrms/robot.toml")
    if options.fix and options.json:
        parser.error("--fix asks people, --json is for machines: say one of both")
    if options.yes and not options.fix:
        parser.error("--yes is for --fix")
    if options.fix and not options.yes and not sys.stdin.isatty():
        parser.error("--fix asks, and there is no terminal to ask on: say --yes too")
    if not LEAST_S <= options.seconds <= MOST_S:
        parser.error(f"--seconds {options.seconds:g} is outside {LEAST_S:g} to {MOST_S:g}")
    try:
        return _asked(options)
    except (ClientError, DriverError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            raise
        warn("doctor", str(error))
        return NOTHING


def _asked(options: argparse.Namespace) -> int:
    found = examine(options.file)
    if found.config is None:
        warn(
            "doctor",
            f"correct the file first (gwrms check):\n{lines(options.file, mistakes(found.findings))}",
        )
        return NOTHING
    return _examined(found.config, options)


def _examined(config: RobotConfig, options: argparse.Namespace) -> int:
    gateway = _gateway(config, options)
    seen = gather(
        config,
        How(
            seconds=options.seconds,
            gateway=gateway,
            active=options.active,
            here=_is_here(options),
            root=options.computer,
            folders=tuple(options.eds),
            say=(lambda text: warn("doctor", text.rstrip())) if not options.json else lambda _: None,
        ),
    )
    verdicts = list(judged(seen))
    if options.json:
        say_json(as_json(verdicts))
    else:
        say("\n".join(as_text(verdicts)) + "\n")
    if options.fix:
        _mend(config, gateway, findings(verdicts), options)
    return status(verdicts)


def _is_here(options: argparse.Namespace) -> bool:
    """Return whether this is the robot's computer."""
    return options.robot is None or options.robot.host in LOOPBACK


def _gateway(config: RobotConfig, options: argparse.Namespace) -> Address | None:
    """Return the gateway to ask: the one that is named, else the file's own."""
    if options.silent:
        return None
    return options.robot or Address("127.0.0.1", config.gateway.port)


def _mend(
    config: RobotConfig, gateway: Address | None, found: Sequence[Finding], options: argparse.Namespace
) -> None:
    """Ask for each finding's likeliest fix, where it is ours to do, and do it."""
    fixed = 0
    with ExitStack() as ending:
        mender = Mender(config, _robot(gateway, ending), here=_is_here(options))
        for finding in found:
            fixed += _fixed(mender, finding, found, yes=options.yes)
    if found:
        say(f"{fixed} of {counted(len(found), 'finding')} fixed\n")


def _fixed(mender: Mender, finding: Finding, others: Sequence[Finding], *, yes: bool) -> bool:
    fix = finding.fixes[0]
    if not mender.can(fix):
        return False
    why_not = mender.objection(finding, fix, [one for one in others if one is not finding])
    if why_not is not None:
        warn("doctor", f"not fixed: {finding.about}: {finding.words}: {why_not}")
        return False
    if not ask(f"{finding.about}: {finding.words}\n{fix.words}\napply this fix?", yes=yes):
        return False
    try:
        say(f"{mender.mend(finding, fix)}\n")
    except NotMended as error:
        warn("doctor", f"not fixed: {finding.about}: {error}")
        return False
    return True


def _robot(gateway: Address | None, ending: ExitStack) -> Robot | None:
    try:
        return (
            None
            if gateway is None
            else ending.enter_context(Robot(gateway, LinkSettings(client="gwrms doctor")))
        )
    except ClientError:
        return None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms doctor",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="the robot's file")
    parser.add_argument(
        "--robot",
        metavar="HOST:PORT",
        type=address,
        help="query this gateway instead of the one in the file",
    )
    parser.add_argument("--seconds", type=float, default=20.0, help="duration (default 20)")
    parser.add_argument("--silent", action="store_true", help="query no gateway")
    parser.add_argument("--active", action="store_true", help="query devices by SDO if no gateway runs")
    parser.add_argument(
        "--eds", type=Path, action="append", default=[], metavar="DIR", help="folder of EDS files"
    )
    parser.add_argument(
        "--computer",
        type=Path,
        default=ROOT,
        metavar="DIR",
        help="a copy of /sys, /proc and /run (default /)",
    )
    parser.add_argument("--fix", action="store_true", help="apply safe fixes, asking for each")
    parser.add_argument("--yes", action="store_true", help="with --fix: do not ask")
    parser.add_argument("--rules", action="store_true", help="list all findings, and their sources")
    parser.add_argument("--json", action="store_true", help="print one JSON object, for programs")
    return parser
