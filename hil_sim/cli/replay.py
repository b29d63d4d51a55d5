"""`gwrms sim --replay`: recordings of a bus and of serial ports as a robot."""

import argparse
import time
from pathlib import Path

from hil_sim.cli import running
from hil_sim.cli.arguments import seconds, speed
from hil_sim.replay.robot import ReplayedRobot

_DESCRIPTION = """\
Play recordings as a robot: a gateway, or any other program, finds the recorded frames and bytes where it
would find a robot, on a CAN bus and on serial ports, as far apart in time as they were recorded.
"""

_EPILOG = """\
recordings
  --replay FILE    CAN: candump -l (.log), Vector ASC with absolute stamps (.asc), BLF (.blf). Stamps that are
                   up to 1 s out of order are put in order; a jump of more than an hour is refused
  --replay-serial NAME=FILE
                   raw bytes as `gwrms sensor record` keeps them, with FILE.json beside them; the port is
                   DIR/NAME. They begin with the first frame, or where FILE.json has it at its `began_s`
  Everything begins with the earliest stamp of all. A log that is broken is refused with file and line.

the devices
  A robot.toml in DIR is used: put the recorded robot's own there, with this bus (DIR/hub.port) and these
  ports. Without one, a beginning of one is written. A recorded node that has an `eds` there answers SDO
  with what the recording shows of it, and with what its EDS or DCF says; a measured value that was not yet
  seen is refused with 0800 0024h. Every write is refused with 0800 0022h: a recording cannot be changed,
  and a stop is not confirmed. Other nodes answer nothing. They answer also where the node was lost.

output
  One line when the robot can be used: {"ready": true, "config": "DIR/robot.toml"}
  It ends with the recording (but see --loop), Ctrl-C, SIGTERM or after N seconds. Exit status as gwrms sim.

example
  candump -l can0 &  gwrms sensor record /dev/ttyUSB0 left.bin
  gwrms sim --dir /tmp/robot --replay candump-2026-11-21_101500.log --replay-serial left_insole=left.bin
"""


def _capture(text: str) -> tuple[str, Path]:
    name, equals, file = text.partition("=")
    if not (name and equals and file) or Path(name).name != name:
        raise argparse.ArgumentTypeError(f"{text} is not NAME=FILE, as in left_insole=left.bin")
    return name, Path(file)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim",
        usage="gwrms sim --dir DIR [--replay FILE …] [--replay-serial NAME=FILE …] [options]",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--dir", required=True, type=Path, metavar="DIR", help="folder of this robot")
    parser.add_argument(
        "--replay", nargs="+", action="extend", default=[], type=Path, metavar="FILE", help="CAN logs"
    )
    parser.add_argument(
        "--replay-serial",
        nargs="+",
        action="extend",
        default=[],
        type=_capture,
        metavar="NAME=FILE",
        help="recordings of serial ports",
    )
    parser.add_argument("--channel", metavar="NAME", help="the channel to play, if the logs have several")
    parser.add_argument("--loop", action="store_true", help="begin again at the end")
    parser.add_argument("--seconds", type=seconds, metavar="N", help="end after N seconds")
    parser.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="N",
        help="speed relative to the recording; max for as fast as possible (default: 1)",
    )
    return parser


def main(argv: list[str]) -> int:
    """Play; returns the exit status."""
    parser = _parser()
    if {"-h", "--help"} & set(argv):  # also behind --replay, which wants a file
        parser.print_help()
        return 0
    try:
        arguments = parser.parse_args(argv)
    except SystemExit as leave:
        return 2 if leave.code else 0
    robot = ReplayedRobot(
        arguments.dir,
        arguments.replay,
        dict(arguments.replay_serial),
        arguments.channel,
        arguments.loop,
        speed=arguments.speed,
        epoch_s=time.time(),
    )

    def name_the_silent() -> None:
        silent = ", ".join(str(node) for node in sorted(robot.recorded_nodes - set(robot.nodes)))
        if silent:
            running.say(f"{robot.config} gives no eds for node {silent}: SDO requests to it stay unanswered")

    return running.run(robot, arguments.seconds, name_the_silent)
