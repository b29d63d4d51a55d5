"""`gwrms commission`: a robot's file from an interface's name, in a dialogue, the joints moved by hand."""

import argparse
import datetime
import getpass
import signal
from pathlib import Path
from typing import NoReturn

import msgspec

from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.errors import SettingsError
from drivers.scan.products import Library, files
from gateway.cli.commission_faces import JsonFace, Terminal
from gateway.cli.text import warn
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import Talk, agree, run
from gateway.commission.draft import Draft, alone
from gateway.commission.homing import NotStopped
from gateway.commission.keeping import journal, put
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.writing import text, unfinished

_EPILOG = """\
example
  gwrms commission exo-01.toml can0 --eds ~/eds --serial /dev/serial/by-id/usb-left --serial …

The joints are moved by hand, without power. What is to be written to a drive is asked for, and read back.
Only homing, where it is wanted, puts one drive under power: it is told in words before, begins when its
phrase is typed, and Enter, Ctrl-C or the end of the input stop and disable it. Ctrl-C interrupts; the same
command goes on where it was, and what is known is kept in FILE.commission until FILE is written.

With --json, {"moving": …} says that a joint is under power: any line is a STOP then. {"moving": null} comes
when that is over.

exit status
  0 written, 1 not (interrupted, or something failed), 2 usage
"""

_LOSSES = (signal.SIGTERM, signal.SIGHUP)  # of whoever started it, or of the terminal
NOT_FINISHED = "is not in it, because it was not finished: the same command goes on there."


def main(argv: list[str]) -> int:
    """Run `gwrms commission`."""
    parser = _parser()
    options = parser.parse_args(argv)
    missing = [str(folder) for folder in options.eds if not folder.is_dir()]
    if missing:
        parser.error(f"--eds {', '.join(missing)}: there is no such folder")
    name, settings = _the_bus(options.bus, options.bitrate)
    with alone(options.file):
        draft = Draft(options.file)
        return _lead(draft, name, settings, options)


def _lead(draft: Draft, name: str, settings: CanSettings, options: argparse.Namespace) -> int:
    """Through all of it; returns the exit status."""
    face: JsonFace | Terminal = JsonFace() if options.json else Terminal()
    bench = CanBench(name, settings)
    before = {number: signal.signal(number, _interrupt) for number in _LOSSES}
    try:
        _keep_bus(draft, settings)
        run(_all(draft, bench, options, face), face)
    except EOFError:
        warn(
            "commission",
            f"nobody answers any more; {draft.path} has what was found, go on with the same command",
        )
        return 1
    except KeyboardInterrupt:
        warn("commission", f"interrupted; {draft.path} has what was found, go on with the same command")
        return 130
    except OSError as error:
        warn("commission", f"{error}; {draft.path} has what was found until then")
        return 1
    except NotStopped as error:
        warn("commission", f"NOT STOPPED: {error}")
        return 1
    finally:
        bench.close()
        for number, handler in before.items():
            signal.signal(number, handler)
    return 0 if not draft.path.exists() else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms commission",
        description="Finds out, one joint at a time, what a robot's file has to say, and writes it.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="the robot's file that is to be written")
    parser.add_argument(
        "bus", metavar="BUS", help="can0, INTERFACE:CHANNEL, or a file that has only its [can.…]"
    )
    parser.add_argument("--bitrate", type=int, help="bit/s, for interfaces that are opened with one")
    parser.add_argument(
        "--eds", type=Path, action="append", default=[], metavar="DIR", help="folder of EDS files"
    )
    parser.add_argument(
        "--serial", action="append", default=[], metavar="PORT", help="an insole's or IMU's port"
    )
    parser.add_argument(
        "--who", default=getpass.getuser(), help="who does it, for the record (default: your user name)"
    )
    parser.add_argument(
        "--json", action="store_true", help="questions and answers as JSON lines, for other faces"
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
) -> Talk[None]:
    library = Library(files(options.eds))
    yield from commission(draft, bench, library, SerialPorts(), options.serial)
    when = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    made = text(draft, options.who, when)
    face.say(made)
    if (yield from agree(f"Write this to {draft.file}?")):
        face.say(_write(draft, made, options.who))
    else:
        face.say(f"Nothing is written; {draft.path} has what was found.")


def _write(draft: Draft, made: str, who: str) -> str:
    """What became of it, in words."""
    found = put(draft.file, made)
    said = "".join(f"  {finding.severity}: {finding.words}\n" for finding in found.findings)
    if found.config is None:
        return f"{draft.file} is written and cannot be used yet:\n{said}"
    findings = {table: msgspec.to_builtins(keys) for table, keys in draft.tables.items()}
    journaled = journal(found.config, who, "commission", found=findings)
    left = unfinished(draft)
    if left:
        said += f"  {', '.join(left)} {NOT_FINISHED}\n"
    else:
        draft.end()
    return f"{draft.file} is written.\n{said}{journaled}Next: gwrms gateway {draft.file}"


def _interrupt(_number: int, _frame: object) -> NoReturn:
    """As Ctrl-C: what was begun is ended in order."""
    raise KeyboardInterrupt
