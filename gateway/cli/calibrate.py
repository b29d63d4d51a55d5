"""`gwrms calibrate`: sensors, by the drivers' own command, and a joint's zero, in the robot's file."""

import argparse
import threading
from collections.abc import Callable
from pathlib import Path

from drivers.bus.settings import CanSettings
from drivers.cli import calibrate as sensors
from drivers.errors import DriverError, SettingsError
from drivers.scan.scan import scan
from gateway.cli.commission_faces import Terminal
from gateway.cli.text import warn
from gateway.commission.bench import CanBench
from gateway.commission.dialogue import run
from gateway.commission.draft import DraftValue, alone
from gateway.commission.edit import NotEdited, comment_of, with_value
from gateway.commission.robot_file import journal, write
from gateway.commission.zero import PLAUSIBLE, NotRepeated, Zero, posture, repeated
from gateway.config.reading import load
from gateway.config.robot import JointTable, RobotConfig
from gateway.user_name import user_name

LISTEN_S = 1.0
KEY = "zero_offset"


def main(argv: list[str]) -> int:
    """Run `gwrms calibrate`."""
    if argv[:1] != ["joint"]:
        return sensors.main(argv)
    options = _parser().parse_args(argv[1:])
    file, joint = named_joint(options.joint)
    with alone(file):
        config = load(file)
        if joint not in config.joint:
            known = ", ".join(config.joint) or "none"
            raise SettingsError(f"{file} has no [joint.{joint}]: here are {known}")
        return _lead(config, joint, options)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms calibrate joint",
        description=(
            "Find a joint's zero again: hold it, without power, as the comment of its zero_offset says, or "
            "at --angle. Old and new zero are shown; once you confirm, the new one is written into the "
            "robot's file, with a comment and a journal entry. Nothing is moved. End this robot's gateway "
            "first."
        ),
        allow_abbrev=False,
    )
    parser.add_argument("joint", metavar="ROBOT.toml:NAME", help="the joint of a robot's file")
    parser.add_argument(
        "--angle",
        type=_degrees(-180, 360),
        metavar="DEGREES",
        help="the angle at which it is held (flexion positive)",
    )
    parser.add_argument(
        "--max-change",
        type=_degrees(0, 540),
        default=PLAUSIBLE,
        metavar="DEGREES",
        help="refuse a larger change (default: %(default)g)",
    )
    parser.add_argument("--who", default=user_name(), help="name for the journal (default: your user name)")
    return parser


def _degrees(low: float, high: float) -> Callable[[str], float]:
    def degrees(typed: str) -> float:
        if not low <= (found := float(typed)) <= high:
            raise argparse.ArgumentTypeError(f"{typed} is no number of {low:g} to {high:g}")
        return found

    return degrees


def named_joint(where: str) -> tuple[Path, str]:
    file, colon, joint = where.rpartition(":")
    if not (colon and file.endswith(".toml")):
        raise SettingsError(f"{where!r} names no joint of a robot's file: ROBOT.toml:left_knee")
    return Path(file), joint


def _lead(config: RobotConfig, joint: str, options: argparse.Namespace) -> int:
    settings, text = config.joint[joint], _text(config.path)
    face, bench = Terminal(), CanBench(settings.bus, config.can[settings.bus])
    degrees = options.angle if options.angle is not None else posture(comment_of(text, f"joint.{joint}", KEY))
    try:
        alone_on(config.can[settings.bus], settings)
        zero = run(repeated(bench, joint, settings, degrees, options.max_change), face)
        if zero is None:
            face.say("Nothing is written.")
            return 1
        return _write(config, joint, text, zero, options.who, face.say)
    except (NotRepeated, NotEdited, DriverError, OSError) as error:
        warn("calibrate", f"{joint}: {error}; nothing is written")
        return 1
    except EOFError:
        warn("calibrate", "nobody answers any more; nothing is written")
        return 1
    except KeyboardInterrupt:
        if not face.stop_asked:
            raise
        warn("calibrate", "ended; this command powers nothing, and has stopped nothing: gwrms stop does")
        return 130
    finally:
        bench.close()


def _text(file: Path) -> str:
    """Return the file's text with its own ends of lines."""
    return file.read_bytes().decode()


def alone_on(bus: CanSettings, settings: JointTable) -> None:
    """Two who ask one node by SDO take each other's answers. Raises `DriverError`."""
    if settings.sdo_cob_ids is not None:
        raise SettingsError("it is asked by an SDO channel of its own (sdo_cob_ids), which this does not use")
    traffic = scan(bus, LISTEN_S, threading.Event().wait, active=False).traffic
    if settings.node_id in traffic.asked():
        raise SettingsError(
            f"node {settings.node_id} is asked by somebody else: end that, or the gateway, first"
        )


def _write(
    config: RobotConfig, joint: str, text: str, zero: Zero, who: str, say: Callable[[str], None]
) -> int:
    table = f"joint.{joint}"
    made = with_value(text, table, KEY, DraftValue(zero.offset, zero.how))
    if _text(config.path) != text:
        raise NotEdited(f"{config.path} was changed meanwhile: begin again")
    found = write(config.path, made)
    if found.config is None:
        say(f"{config.path} is written and cannot be used: {'; '.join(one.words for one in found.findings)}")
        return 1
    values = {"before": config.joint[joint].zero_offset, "after": zero.offset, "how": zero.how}
    told = journal(found.config, who, "calibrate", joint=joint, **values)
    say(f"{config.path}: [{table}] {KEY} = {zero.offset:.5f}, the file before is beside it.\n{told}".rstrip())
    return 0
