"""`gwrms joint-test step`, `chirp`, `friction`, `relay`: one joint is moved on a bench, and recorded."""

import argparse
import datetime
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import MappingProxyType

from drivers.errors import DriverError, SettingsError
from gateway.cli.calibrate import alone_on, named_joint
from gateway.cli.commission_faces import Terminal
from gateway.cli.commission_lines import JsonFace, Lines, stdin
from gateway.cli.motion_ends import MotionEnded, ending, stop_robot
from gateway.cli.text import say_json, warn
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import run
from gateway.commission.draft import alone
from gateway.commission.powered_run import NotStopped, PoweredRunResult
from gateway.config.reading import load
from gateway.config.robot import RobotConfig
from gateway.joint_test import undo_file
from gateway.joint_test.dialogue import Test, tested
from gateway.joint_test.limits import LATE_S, AskedLimits, NotAllowed
from gateway.joint_test.motion import JointTestKind, Wish
from gateway.records.folder import RecordsFolder
from gateway.records.records import Records
from gateway.user_name import user_name

FOLDER = "joint-tests"
LEFT = "this command has left no drive under power"  # of others it says nothing: who ends it early saw none
_EPILOG = """\
example
  gwrms joint-test step bench.toml:left_knee --amplitude 1
  gwrms joint-test show bench.left_knee.step.20261123T101500Z.jsonl

The joint is free on a bench, everybody is off the robot, the hardware emergency stop in your hand. It gets
power when its phrase is typed, and not before. Enter, Ctrl-C, SIGTERM, a closed terminal, and in another
terminal gwrms joint-test stop ROBOT.toml:JOINT end the motion; every end disables the drive, as its
statusword confirms. It is software, not a safety-rated emergency stop.

exit status
  0 recorded to its end, 1 not, 2 usage
"""
_WHAT: Mapping[str, str] = MappingProxyType(
    {
        "step": "there and back some times: rise, overshoot, settling",
        "chirp": "a sine that gets faster: bandwidth, phase margin",
        "friction": "at constant speeds both ways: Coulomb and viscous friction, load, cogging",
        "relay": "torque against where it is: ultimate gain and period",
        "stop": "ask nothing: quick stop to every drive of the robot's file",
    }
)


def main(argv: list[str]) -> int:
    """Run `gwrms joint-test`, but for `show`."""
    parser = _parser(argv[0])
    options = parser.parse_args(argv[1:])
    file, joint = named_joint(options.joint)
    if argv[0] == "stop":
        return _stop(file, joint, as_json=options.json)
    with alone(file), ending(), ExitStack() as ends:
        config = _load(file, joint)
        records = ends.enter_context(_records(config))
        if not options.json:
            return _lead(config, joint, argv[0], options, Terminal(), None, records)
        lines = Lines(stdin())
        try:
            ends.enter_context(lines)
            return _lead(config, joint, argv[0], options, JsonFace(lines), lines, records)
        except MotionEnded:  # before anything was begun: the stop stood in the pipe already
            if not lines.stop_asked:
                raise
            return stop_robot(config, _benches(config), as_json=True) or 1


def _parser(test: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"gwrms joint-test {test}",
        description=f"{test}: {_WHAT[test]}.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("joint", metavar="ROBOT.toml:JOINT", help="the joint of a robot's file")
    parser.add_argument(
        "--json",
        action="store_true",
        help="exchange questions and answers as JSON lines, like gwrms commission",
    )
    if test == "stop":
        return parser
    _motion(parser, JointTestKind(test))
    parser.add_argument(
        "--max-speed", type=_number(0.1, 360), metavar="°/S", help="cut the power beyond it (default: 180)"
    )
    parser.add_argument(
        "--max-torque",
        type=_number(0.01, 1000),
        metavar="N·m",
        help="cut the power beyond it (default: its rated torque)",
    )
    parser.add_argument(
        "--late",
        type=_number(20, 200),
        default=LATE_S * 1000,
        metavar="MS",
        help="cut the power if a cycle is so late (default: %(default)g)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help=f"of the recording (default: {FOLDER} beside the file)"
    )
    parser.add_argument("--who", default=user_name(), help="name for the journal (default: your user name)")
    return parser


def _motion(parser: argparse.ArgumentParser, kind: JointTestKind) -> None:
    """Add the arguments of the motion; the defaults are gentle ones."""
    usual = {
        JointTestKind.STEP: (1.0, 10.0),
        JointTestKind.CHIRP: (1.0, 15.0),
        JointTestKind.FRICTION: (10.0, 20.0),
        JointTestKind.RELAY: (5.0, 90.0),
    }
    wide, fast = usual[kind]
    parser.add_argument(
        "--amplitude",
        type=_number(0.05, 30),
        default=wide,
        metavar="°",
        help="how far it moves (default: %(default)g)"
        if kind is not JointTestKind.RELAY
        else "how far it may swing (default: %(default)g)",
    )
    if kind is not JointTestKind.RELAY:
        parser.add_argument(
            "--speed",
            type=_number(0.1, 180),
            default=fast,
            metavar="°/S",
            help="of its target, at most (default: %(default)g)",
        )
    if kind in (JointTestKind.STEP, JointTestKind.RELAY):
        parser.add_argument(
            "--repeat",
            type=_count,
            default=3 if kind is JointTestKind.STEP else 8,
            help="times (default: %(default)d)",
        )
    if kind is JointTestKind.CHIRP:
        for name, low, high, default, what in (
            ("--from", 0.05, 50.0, 0.2, "Hz, where it begins"),
            ("--to", 0.1, 50.0, 15.0, "Hz, where it ends"),
            ("--seconds", 2.0, 300.0, 30.0, "how long it takes"),
        ):
            parser.add_argument(
                name,
                type=_number(low, high),
                default=default,
                metavar="N",
                help=f"{what} (default: %(default)g)",
            )
    if kind is JointTestKind.RELAY:
        parser.add_argument(
            "--torque", type=_number(0.01, 500), required=True, metavar="N·m", help="of the relay"
        )
        parser.add_argument(
            "--hysteresis",
            type=_number(0.0, 5),
            default=0.0,
            metavar="°",
            help="of the relay, against noise (default: %(default)g)",
        )


def _number(low: float, high: float) -> Callable[[str], float]:
    def number(typed: str) -> float:
        if not low <= (found := float(typed)) <= high:
            raise argparse.ArgumentTypeError(f"{typed} is no number of {low:g} to {high:g}")
        return found

    return number


def _count(typed: str) -> int:
    if not 1 <= (found := int(typed)) <= 50:
        raise argparse.ArgumentTypeError(f"{typed} is no whole number of 1 to 50")
    return found


def _wish(kind: JointTestKind, options: argparse.Namespace) -> Wish:
    told = vars(options)
    if kind is JointTestKind.CHIRP and told["from"] >= told["to"]:
        raise SettingsError("--from must be less than --to")
    return Wish(
        kind,
        amplitude=math.radians(options.amplitude),
        speed=math.radians(told.get("speed", 0.0)),
        repeat=told.get("repeat", 1),
        low_hz=told.get("from", 0.0),
        high_hz=told.get("to", 0.0),
        seconds=told.get("seconds", 0.0),
        torque=told.get("torque", 0.0),
        hysteresis=math.radians(told.get("hysteresis", 0.0)),
    )


def _load(file: Path, joint: str) -> RobotConfig:
    config = load(file)
    if joint not in config.joint:
        known = ", ".join(config.joint) or "none"
        raise SettingsError(f"{file} has no [joint.{joint}]: here are {known}")
    return config


@contextmanager
def _records(config: RobotConfig) -> Iterator[Records]:
    """Return the robot's records, for this command alone.

    No gateway runs meanwhile, and none has left something.
    """
    records = Records(config.records)
    try:
        if records.unusable is not None:
            raise SettingsError(f"{records.unusable}; a test is nothing that goes without a record")
        if records.folder.unfinished:
            raise SettingsError(
                "a stop is held, or a write is to be taken back: start the gateway, and gwrms reset, first"
            )
        yield records
    finally:
        records.close()


def _folder(folder: Path) -> Path:
    """Make the folder before anything is asked; raises `SettingsError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(f"{folder} is no folder to record into: {error.strerror}; give --out") from error
    return folder


def _lead(
    config: RobotConfig,
    joint: str,
    kind: str,
    options: argparse.Namespace,
    face: "Terminal | JsonFace",
    lines: Lines | None,
    records: Records,
) -> int:
    began = datetime.datetime.now(datetime.UTC).strftime("%Y%m%dT%H%M%SZ")
    folder = _folder(options.out or config.path.parent / FOLDER)
    test = Test(
        config,
        joint,
        _wish(JointTestKind(kind), options),
        AskedLimits(
            None if options.max_speed is None else math.radians(options.max_speed),
            options.max_torque,
            options.late / 1000,
        ),
        folder / f"{config.robot.name}.{joint}.{kind}.{began}.jsonl",
        options.who,
        records,
    )
    result = "nothing got power"
    benches = _benches(config)
    bench = benches[test.settings.bus]
    try:
        alone_on(config.can[test.settings.bus], test.settings)
        records.journal.append(
            options.who, "joint test begun", joint=joint, test=kind, file=str(test.file)
        ).result()
        outcome = run(tested(bench, benches, test), face)
        if outcome is None:
            return 1
        result = outcome.problem or "recorded"
        return _told(test, outcome, as_json=options.json)
    except NotStopped as error:
        warn("joint-test", f"NOT STOPPED: {error}")
        result = f"NOT STOPPED: {error}"
        return stop_robot(config, benches, as_json=options.json) or 1
    except MotionEnded as end:
        result = "interrupted"
        if face.stop_asked:
            return stop_robot(config, benches, as_json=lines is not None) or 1
        warn("joint-test", f"interrupted; {LEFT}")
        return end.status
    except EOFError:
        result = "nobody answered any more"
        warn("joint-test", f"nobody answers any more; {LEFT}")
        return 1
    except (NotAllowed, DriverError, OSError) as error:
        result = str(error)
        warn("joint-test", f"{joint}: {error}")
        return 1
    finally:
        for one in benches.values():
            one.close()
        records.journal.append(
            test.who, "joint test ended", joint=test.joint, test=str(test.wish.kind), result=result
        )


def _benches(config: RobotConfig) -> dict[str, CanBench]:
    return {name: CanBench(name, settings) for name, settings in config.can.items()}


def _told(test: Test, outcome: PoweredRunResult, *, as_json: bool) -> int:
    if as_json:
        say_json({"tested": {"file": str(test.file), "problem": outcome.problem, "off": outcome.off}})
    return 0 if outcome.problem is None else 1


def _stop(file: Path, joint: str, *, as_json: bool) -> int:
    config = _load(file, joint)
    status = stop_robot(config, _benches(config), as_json=as_json)
    if (words := _cut_off(config)) is not None:
        warn("joint-test", f"{words}. The next gwrms joint-test puts it back before it asks for its phrase")
    return status


def _cut_off(config: RobotConfig) -> str | None:
    """Return the changes, in words, that a test whose program has ended left in a drive."""
    folder = RecordsFolder(config.records)
    try:
        folder.open()
    except OSError:
        return None  # it is under way, or nobody can tell
    try:
        found = undo_file.read(folder.joint_test)
    except NotAllowed as error:
        return str(error)
    finally:
        folder.close()
    return None if found is None else found.words
