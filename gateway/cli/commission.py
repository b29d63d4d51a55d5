"""`gwrms commission`: a robot's file from an interface's name, in a dialogue, the joints moved by hand."""

import argparse
import datetime
from contextlib import ExitStack
from pathlib import Path

import msgspec

from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.errors import SettingsError
from drivers.scan.products import Library, files
from gateway.cli.commission_faces import Terminal
from gateway.cli.commission_lines import JsonFace, Lines, stdin
from gateway.cli.motion_ends import MotionEnded, ending, stop_drives
from gateway.cli.text import warn
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import At, Talk, agree, run
from gateway.commission.draft import Draft, alone
from gateway.commission.powered_run import NotStopped
from gateway.commission.progress import Progress
from gateway.commission.robot_file import journal, write
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.writing import Written, text, unfinished
from gateway.user_name import user_name

_EPILOG = """\
example
  gwrms commission exo-01.toml can0 --eds ~/eds --serial /dev/serial/by-id/usb-left --serial …

You move the joints by hand, without power. Every write to a drive is confirmed by you, and read back. Only
homing, if you want it, powers a drive: its plan is shown first, it begins with a typed phrase, and Enter,
Ctrl-C or the end of the input stop and disable it. Ctrl-C interrupts; the same command continues, from
FILE.commission, which is kept until FILE is written.

With --json, {"moving": …} means that a joint is under power: any line is then a STOP. {"moving": null} marks
the end.

exit status
  0 written, 1 not (interrupted, or something failed), 2 usage
"""


def main(argv: list[str]) -> int:
    """Run `gwrms commission`."""
    parser = _parser()
    options = parser.parse_args(argv)
    name, settings = _the_bus(options.bus, options.bitrate)
    if options.stop:
        return stop_drives(_known_to(options.file), CanBench(name, settings), as_json=options.json)
    missing = [str(folder) for folder in options.eds if not folder.is_dir()]
    if missing:
        parser.error(f"--eds {', '.join(missing)}: there is no such folder")
    with alone(options.file), ending(), ExitStack() as ends:
        bench = CanBench(name, settings)
        ends.callback(bench.close)
        bench.check_opens()
        draft = Draft(options.file)
        if not options.json:
            return _lead(draft, bench, settings, options, Terminal(), None)
        lines = Lines(stdin())
        try:
            ends.enter_context(lines)
            return _lead(draft, bench, settings, options, JsonFace(lines), lines)
        except MotionEnded:  # before `_lead` was led by anything: the stop stood in the pipe already
            if not lines.stop_asked:
                raise
            return stop_drives(draft, bench, as_json=True)


def _lead(
    draft: Draft,
    bench: CanBench,
    settings: CanSettings,
    options: argparse.Namespace,
    face: "Terminal | JsonFace",
    lines: Lines | None,
) -> int:
    """Through all of it; returns the exit status."""
    progress = Progress(draft)

    def at(where: At) -> None:
        progress.at(where)
        face.steps(progress.steps())

    try:
        _keep_bus(draft, settings)
        if run(_all(draft, bench, options, face), face, at):
            progress.end()
            face.steps(progress.steps())
    except EOFError:
        return _left(draft, "nobody answers any more", 1)
    except MotionEnded as end:
        if face.stop_asked:
            return stop_drives(draft, bench, as_json=lines is not None)
        return _left(draft, "interrupted", end.status)
    except OSError as error:
        warn("commission", f"{error}; {draft.path} has what was found until then")
        return 1
    except NotStopped as error:
        return _not_stopped(draft, bench, str(error), lines)
    return 0 if not draft.path.exists() else 1


def _known_to(file: Path) -> Draft:
    """Return the draft that was found; if it cannot be read, an empty one, so that a stop asks all drives."""
    try:
        return Draft(file)
    except SettingsError as error:
        warn("commission", str(error))
        return Draft(file, go_on=False)


def _not_stopped(draft: Draft, bench: CanBench, why: str, lines: Lines | None) -> int:
    """Return a drive that was under power has not confirmed that it is off: it is asked once more."""
    warn("commission", f"NOT STOPPED: {why}")
    return stop_drives(draft, bench, as_json=lines is not None) or 1


def _left(draft: Draft, why: str, status: int) -> int:
    warn("commission", f"{why}; {draft.path} has what was found, go on with the same command")
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms commission",
        description="Determine the contents of a robot's file, one joint at a time, and write it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="the robot's file to write")
    parser.add_argument("bus", metavar="BUS", help="can0, INTERFACE:CHANNEL, or a file with only its [can.…]")
    parser.add_argument("--bitrate", type=int, help="bit/s, for interfaces that need one")
    parser.add_argument(
        "--eds", type=Path, action="append", default=[], metavar="DIR", help="folder of EDS files"
    )
    parser.add_argument(
        "--serial", action="append", default=[], metavar="PORT", help="an insole's or IMU's port"
    )
    parser.add_argument("--who", default=user_name(), help="name for the journal (default: your user name)")
    parser.add_argument(
        "--json",
        action="store_true",
        help="exchange questions and answers as JSON lines, for other front ends",
    )
    parser.add_argument(
        "--stop",
        action="store_true",
        help="ask nothing: quick stop to every drive that was found until now, and what each confirms "
        "(software, not a safety-rated emergency stop)",
    )
    return parser


def _the_bus(bus: str, bitrate: int | None) -> tuple[str, CanSettings]:
    found = list(named([bus], bitrate))
    if len(found) != 1:
        raise SettingsError(
            f"{bus} has {len(found)} buses: commission one at a time, each from a file of its own"
        )
    return found[0]


def _keep_bus(draft: Draft, settings: CanSettings) -> None:
    kept = tuple(draft.value("can.main", key) for key in ("interface", "channel"))
    if draft.has("can.main", "channel") and kept != (settings.interface, settings.channel):
        raise SettingsError(
            f"{draft.path} is of the bus {kept[0]}:{kept[1]}, not {settings.interface}:{settings.channel}: "
            "go on at that one, or remove the file to begin anew"
        )
    draft.forget("can.main")
    told = {**msgspec.to_builtins(settings), **settings.more}
    usual = msgspec.to_builtins(CanSettings(interface="", channel=""))
    for key, value in told.items():
        if key != "more" and value != usual.get(key, not value):
            draft.put("can.main", key, value)


def _all(
    draft: Draft, bench: CanBench, options: argparse.Namespace, face: "Terminal | JsonFace"
) -> Talk[bool]:
    """Ask for all of it; return whether the file is written."""
    library = Library(files(options.eds))
    yield from commission(draft, bench, library, SerialPorts(), options.serial)
    when = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    made = text(draft, options.who, when)
    face.propose(made, str(draft.file))
    agreed = yield from agree(f"Write this to {draft.file}?")
    if agreed:
        face.written(_write(draft, made, options.who))
    else:
        face.say(f"Nothing is written; {draft.path} has what was found.")
    return agreed


def _write(draft: Draft, made: str, who: str) -> Written:
    found = write(draft.file, made)
    told = tuple((str(one.severity), one.words) for one in found.findings)
    if found.config is None:
        return Written(str(draft.file), made, told, usable=False)
    findings = {table: msgspec.to_builtins(keys) for table, keys in draft.tables.items()}
    journaled = journal(found.config, who, "commission", found=findings).strip()
    left = unfinished(draft)
    if not left:
        draft.end()
    return Written(str(draft.file), made, told, usable=True, unfinished=left, not_journaled=journaled)
