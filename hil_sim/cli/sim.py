"""`gwrms sim`: the simulated robot as a process of its own."""

import argparse
import fnmatch
import time
from pathlib import Path

from eds.light_imports import import_canopen
from hil_sim import mounting, personality
from hil_sim.cli import running
from hil_sim.cli.arguments import add_wearer, seconds, speed
from hil_sim.exoskeleton import CONTROLLER, CONTROLLER_NODE, JOINTS, Scenario
from hil_sim.gait.walks import NAMES
from hil_sim.mistakes.registry import MISTAKES, NONE
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario.runner import schedule
from hil_sim.scenario.script import Script, load
from hil_sim.scenario.shipped import locate
from hil_sim.sensors.suite import IMUS, INSOLES, SensorChoice

_DESCRIPTION = """\
Simulate a whole lower-limb exoskeleton: six CiA 402 joint drives and a gait controller on a CANopen bus, two
plantar-pressure insoles and a trunk IMU. A gateway, or any other program, finds it where it would find a real
robot: on a CAN bus and on serial ports.
"""

_EPILOG = """\
what is in DIR
  robot.toml       the robot, described for a gateway, every line explained. Written once; edit it as you
                   like, delete it to have it written anew
  control          socket for faults while it runs: gwrms sim-fault --dir DIR …
  left_insole, right_insole, trunk
                   links to the sensors' pseudo-terminals; a reader at another baud rate than in robot.toml
                   reads what it would read from a wire. An IMU on the bus has none
  stored           what the drives have stored (1010h), for the next start
  hub.port         TCP port of the bus: python-can's "socketcand" interface at 127.0.0.1, channel "sim"
  The same DIR keeps the same port and paths from start to start, also after a crash. One simulator at a time.

the bus
  --bus hub        a hub for any number of programs on this machine, at the simulated bit rate of 1 Mbit/s
  --bus socketcan:NAME
                   a CAN interface of Linux, virtual or a real adapter, beside whatever else is there. Order
                   and time of the frames are then those of that bus, and error frames are not simulated. If
                   another device has a simulated node id, at the start or later, the simulator ends. If the
                   interface goes away, the simulator reports it, and waits until it is back.
  --unconfigured JOINTS
                   drives as their maker sends them: without a node id, silent, found and named by gwrms lss.
                   What LSS stores is in DIR/stored
  --without NODES  leaves nodes to other devices: real drives, another controller. The simulated controller
                   enables drives, but only simulated ones: leave out gait, too, if you leave out a joint

scenarios
  walk             stands up straight, then walks; three seconds after the start it walks evenly
  stand            stands
  sit              sits down from standing, and stays seated
  sit_to_stand     sits down and gets up, again and again
  stairs_up, stairs_down, ramp_up, ramp_down, turn_left, turn_right
                   the same for these
  stumble          walks, and stumbles every ten seconds
  fall             walks, falls, lies, gets up, again and again
  day              rounds of everything, each in another order; the seed says which
  The gait follows the controller's objects while it runs: 2001h step length (mm), 2002h cycle time (ms),
  2003h toe height (mm), 2004h trunk angle (0.001 rad), 2005h activity (0 stand, 1 walk, 2 sit, 3 stairs up,
  4 stairs down, 5 ramp up, 6 ramp down, 7 turn left, 8 turn right, 9 stumble, 10 fall).

the wearer
  --subject N is a person with a body and habits of their own, always the same for the same N; 0 is nominal,
  and one in four has an impaired leg. --truth writes the ground truth, as JSON lines: simulated and real
  time, label, phase of each leg, events, joints, forces under the feet, trunk. The first line names columns
  and units.
  --walks NAME is how they walk; the affected leg is the left one of even N, the right one of odd N, and each
  wearer has a severity of their own. gwrms docs bench describes them:
    {walks}
  --assists left, or right, is a robot on one leg alone: its three drives, both insoles and the IMU. The other
  leg walks by itself. No PDO or SDO of the gait controller goes to the other three node ids.

the drives
  Nodes 1–6: left hip, knee, ankle, right hip, knee, ankle; node 16 is the gait controller and master of the
  bus. It keeps commanding "enable operation" until a drive leaves that state, a heartbeat goes missing or 0
  is written to its object 2000h. Then it stops all drives and waits for 1 in that object.
  --drive gives them the objects, defaults, limits and PDOs of any vendor's EDS or DCF, and robot.toml names
  it. The joint behind it stays the same (4096 counts, gear 100); the controller sets such a drive up by SDO.

sensors
  --imu and --insole choose their data formats, after the makers' manuals. `gwrms sensor DIR/trunk`
  identifies the format.

mistakes
  --mistake NAME makes a typical mistake, for gwrms doctor to find; repeat it for more than one; none makes a
  healthy robot. The folder then has a robot.toml of its own, and `computer`, the files of /sys and /proc of
  the robot's computer, for gwrms doctor --computer DIR/computer.
{mistakes}

scenario files
  gwrms sim run FILE        runs it against a gateway and checks what it expects (--help says more)
  gwrms sim --script FILE   only plays its events, for a gateway of your own
  Shipped ones are found by their names, as in gwrms sim run node_lost.

recordings
  gwrms sim --dir DIR --replay FILE …
                            plays CAN logs and serial captures as a robot (--replay --help says more)

output
  One line when the robot can be used: {"ready": true, "config": "DIR/robot.toml"}
  It runs until Ctrl-C, SIGTERM or N seconds. Exit status 0; 1 when it cannot run; 2 for wrong usage.

example
  gwrms sim --dir /tmp/robot &
  gwrms gateway /tmp/robot/robot.toml
"""


def _interface(text: str) -> str | None:
    kind, _, name = text.partition(":")
    if text != "hub" and not (kind == "socketcan" and name):
        raise argparse.ArgumentTypeError(
            f"{text} is no bus: give hub, or socketcan:NAME as in socketcan:can0"
        )
    return name or None


def _joints(text: str) -> list[str]:
    return _named(text, tuple(JOINTS))


def _nodes(text: str) -> list[str]:
    return _named(text, (*JOINTS, CONTROLLER))


def _named(text: str, nodes: tuple[str, ...]) -> list[str]:
    left_out = [name for pattern in text.split(",") for name in fnmatch.filter(nodes, pattern.strip())]
    for pattern in text.split(","):
        if not fnmatch.filter(nodes, pattern.strip()):
            raise argparse.ArgumentTypeError(f"there is no {pattern.strip()!r}: {', '.join(nodes)}")
    return left_out


def _mistakes() -> str:
    width = max(map(len, MISTAKES))
    return "\n".join(f"    {name:<{width}}  {one.what}" for name, one in MISTAKES.items())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim",
        description=_DESCRIPTION,
        epilog=_EPILOG.replace("{mistakes}", _mistakes()).replace("{walks}", ", ".join(NAMES)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--dir", required=True, type=Path, metavar="DIR", help="folder of this robot; created if necessary"
    )
    parser.add_argument(
        "--bus",
        type=_interface,
        metavar="BUS",
        help="hub (default), or socketcan:NAME for the CAN interface NAME of this computer",
    )
    parser.add_argument(
        "--without",
        type=_nodes,
        default=[],
        metavar="NODES",
        help="joints, and gait, not to simulate; comma-separated, * for any letters",
    )
    parser.add_argument(
        "--unconfigured",
        type=_joints,
        default=[],
        metavar="JOINTS",
        help="joints whose drives have no node id: they are silent until LSS assigns one (gwrms lss)",
    )
    parser.add_argument(
        "--scenario", choices=[str(scenario) for scenario in Scenario], default="walk", help="default: walk"
    )
    parser.add_argument("--imu", choices=IMUS, default=SensorChoice().imu, help="default: %(default)s")
    parser.add_argument(
        "--insole", choices=INSOLES, default=SensorChoice().insole, help="default: %(default)s"
    )
    parser.add_argument(
        "--script",
        type=Path,
        metavar="FILE",
        help="a scenario file, or the name of a shipped one",
    )
    parser.add_argument("--seconds", type=seconds, metavar="N", help="end after N seconds (default: run on)")
    parser.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="N",
        help="speed relative to real time; max for as fast as possible (default: 1)",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="S",
        help="seed of noise, losses and strides; same seed, same bytes (default: 0)",
    )
    parser.add_argument(
        "--subject", type=int, default=0, metavar="N", help="number of the wearer (default: 0, nominal)"
    )
    add_wearer(parser)
    parser.add_argument(
        "--drive",
        action="append",
        default=[],
        metavar="[JOINT=]FILE",
        help="the EDS or DCF of the drives, or of one joint's drive (repeatable)",
    )
    parser.add_argument(
        "--mount",
        action="append",
        default=[],
        metavar="JOINT=NODE[,DIRECTION[,ZERO]]",
        help="a drive's node id, 1 or -1 (its motor built in the other way round), counts at zero",
    )
    parser.add_argument(
        "--mistake",
        action="append",
        choices=(NONE, *MISTAKES),
        metavar="NAME",
        help="simulate a mistake for gwrms doctor to find (repeatable); none: a healthy robot",
    )
    parser.add_argument("--truth", type=Path, metavar="FILE", help="write the ground truth to this file")
    return parser


def _parse(argv: list[str]) -> tuple[argparse.Namespace, Script]:
    """Parse the command line.

    Where a script is named, its `[robot]` stands for the options that are not given.
    """
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.script is None:
        return arguments, Script()
    script = load(locate(arguments.script))
    parser.set_defaults(
        scenario=script.scenario,
        seed=script.seed,
        subject=script.subject,
        walks=script.walks,
        imu=script.sensors.imu,
        insole=script.sensors.insole,
    )
    return parser.parse_args(argv), script


def _drives(words: list[str]) -> dict[str, Path]:
    """Return the files of `--drive`, looked for in the working folder and among those that ship."""
    return personality.choose(words, JOINTS, Path.cwd() / "here")


def main(argv: list[str]) -> int:
    """Run the simulator; returns the exit status."""
    if argv[:1] == ["run"]:
        from hil_sim.cli import run

        return run.main(argv[1:])
    if any(word.startswith("--replay") for word in argv):
        from hil_sim.cli import replay  # with python-can

        return replay.main(argv)
    try:
        arguments, script = _parse(argv)
    except SystemExit as leave:
        return 2 if leave.code else 0
    import_canopen()
    robot = SimulatedRobot(
        arguments.dir,
        Scenario(arguments.scenario),
        arguments.seed,
        speed=arguments.speed,
        epoch_s=time.time(),
        sensors=SensorChoice(arguments.imu, arguments.insole),
        person=arguments.subject,
        truth=arguments.truth,
        drives=_drives(arguments.drive) or script.drives,
        interface=arguments.bus,
        say=running.say,
        without=arguments.without,
        unconfigured=arguments.unconfigured,
        guard=script.guard,
        mountings=mounting.choose(arguments.mount, JOINTS, [CONTROLLER_NODE]),
        mistakes=arguments.mistake,
        walk=arguments.walks,
        assists=arguments.assists,
    )

    return running.run(robot, arguments.seconds, lambda: schedule(script.lines, robot))
