"""`gwrms commission`: a robot's file from an interface's name, in a dialogue, the joints moved by hand."""

import argparse
import datetime
import getpass
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType

import msgspec

from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.errors import DriverError, SettingsError
from drivers.scan.products import Library, files
from gateway.cli.commission_lines import JsonFace, Lines, stdin
from gateway.cli.text import say, say_json, warn
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import Ask, At, Talk, agree, run
from gateway.commission.draft import Draft, alone
from gateway.commission.progress import Progress, Step
from gateway.commission.serial_bench import SerialPorts
from gateway.commission.steps import commission
from gateway.commission.stopping import Stopped, stop
from gateway.commission.writing import Written, text, unfinished
from gateway.config.reading import examine
from gateway.config.robot import RobotConfig
from gateway.records import durable
from gateway.records.records import Records

_EPILOG = """\
example
  gwrms commission exo-01.toml can0 --eds ~/eds --serial /dev/serial/by-id/usb-left --serial …

The joints are moved by hand, without power: nothing here moves, enables or stops anything. What is to be
written to a drive is asked for, and read back. Ctrl-C interrupts; the same command goes on where it was, and
what is known is kept in FILE.commission until FILE is written.

exit status
  0 written, 1 not (interrupted, or something failed), 2 usage
"""

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def main(argv: list[str]) -> int:
    """Run `gwrms commission`."""
    parser = _parser()
    options = parser.parse_args(argv)
    missing = [str(folder) for folder in options.eds if not folder.is_dir()]
    if missing:
        parser.error(f"--eds {', '.join(missing)}: there is no such folder")
    name, settings = _the_bus(options.bus, options.bitrate)
    if options.stop:
        return _stop(Draft(options.file), CanBench(name, settings), as_json=options.json)
    with alone(options.file), _ending(), ExitStack() as ends:
        draft = Draft(options.file)
        bench = CanBench(name, settings)
        ends.callback(bench.close)
        if not options.json:
            return _lead(draft, bench, settings, options, _Terminal(), None)
        lines = ends.enter_context(Lines(stdin()))
        return _lead(draft, bench, settings, options, JsonFace(lines), lines)


def _lead(
    draft: Draft,
    bench: CanBench,
    settings: CanSettings,
    options: argparse.Namespace,
    face: "_Terminal | JsonFace",
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
    except Ended as end:
        if lines is not None and lines.stop_asked:
            return _stop(draft, bench, as_json=True)
        return _left(draft, "interrupted", end.status)
    except OSError as error:
        warn("commission", f"{error}; {draft.path} has what was found until then")
        return 1
    return 0 if not draft.path.exists() else 1


def _left(draft: Draft, why: str, status: int) -> int:
    warn("commission", f"{why}; {draft.path} has what was found, go on with the same command")
    return status


def _stop(draft: Draft, bench: CanBench, *, as_json: bool) -> int:
    """Quick stop to every drive that is known; nothing but SIGKILL keeps it from its end."""
    for number in ENDS:
        signal.signal(number, signal.SIG_IGN)
    try:
        stopped = stop(bench, draft)
    except DriverError as error:
        stopped = Stopped({}, str(error))
    finally:
        bench.close()
    if as_json:
        told = {"confirmed": stopped.confirmed, "drives": stopped.drives, "words": stopped.words}
        say_json({"stopped": told})
    else:
        say(stopped.words + "\n")
    return 0 if stopped.confirmed else 1


class Ended(KeyboardInterrupt):
    """Ctrl-C, SIGTERM or a terminal that is gone: the dialogue is closed, which ends what it has begun."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.status = 128 + number


@contextmanager
def _ending() -> Iterator[None]:
    """While inside, `ENDS` raise `Ended` in whatever the dialogue does."""
    before = {number: signal.signal(number, _end) for number in ENDS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    raise Ended(number)


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
    draft: Draft, bench: CanBench, options: argparse.Namespace, face: "_Terminal | JsonFace"
) -> Talk[bool]:
    """Whether the file is written."""
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
    if draft.file.exists():
        shutil.copyfile(draft.file, draft.file.with_name(draft.file.name + ".before"))
    durable.write(draft.file, made.encode())
    found = examine(draft.file)
    findings = tuple((str(one.severity), one.words) for one in found.findings)
    if found.config is None:
        return Written(str(draft.file), made, findings, usable=False)
    journaled = _journal(found.config, draft, who)
    left = unfinished(draft)
    if not left:
        draft.end()
    return Written(str(draft.file), made, findings, usable=True, unfinished=left, not_journaled=journaled)


def _journal(config: RobotConfig, draft: Draft, who: str) -> str:
    """Put what was found into the robot's journal; what is in the way of that is told, no more."""
    records = Records(config.records)
    try:
        findings = {table: msgspec.to_builtins(keys) for table, keys in draft.tables.items()}
        records.journal.append(who, "commission", file=str(draft.file), found=findings).result()
    except OSError as error:
        return error.strerror or str(error)
    finally:
        records.close()
    return ""


class _Terminal:
    def say(self, text: str) -> None:
        say(text + "\n")

    def propose(self, made: str, _file: str) -> None:
        self.say(made)

    def written(self, written: Written) -> None:
        self.say(written.words)

    def steps(self, steps: tuple[Step, ...]) -> None:
        """Questions say it themselves."""

    def ask(self, question: Ask) -> str:
        choices = f" [{'/'.join(question.choices)}]" if question.choices else ""
        default = f" (Enter: {question.default})" if question.default else ""
        say(f"\n{question.text}{choices}{default}\n> ")
        typed = sys.stdin.readline()
        if not typed:
            raise EOFError
        return typed
