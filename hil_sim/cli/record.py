"""`gwrms sim-record`: what a gateway would report of simulated wearers, with the truth, to learn from."""

import argparse
import gzip
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from itertools import compress
from pathlib import Path
from typing import BinaryIO, Final

from hil_sim.channels import JOINT_UNITS, UNITS, joints_reported, reported
from hil_sim.cli.arguments import add_wearer, number
from hil_sim.clock import SECOND_NS
from hil_sim.controller.objects import ControllerState
from hil_sim.dangerous_course import Course
from hil_sim.dangers import DANGERS
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.walks import ORDINARY
from hil_sim.sensors.suite import PERIOD_NS
from hil_sim.training_walks import practice
from hil_sim.truth import phases
from hil_sim.without_bus import BareExoskeleton

_DESCRIPTION = """\
Write what a gateway would report of the simulated robot (with its channel names, SI units, and the noise and
resolution of drives, insoles and IMU), together with the ground truth. It needs no gateway and runs several
times as fast as real time. Models learn from it: see gwrms docs explanation/prediction.
"""

_EPILOG = """\
what is written
  JSON lines. For each wearer an object: `session`, `subject`, `seed`, `scenario`, `walks`, `period_s`,
  `columns`, `units` and `wearer`; then an array for each cycle of the sensors, 100 a second, with what its
  `columns` name: time since switching on, label, phase of each leg (null where it does not step), and the
  channels (null: no centre of pressure while a foot is in the air). Files can be joined by putting one behind
  the other. A FILE that ends in .gz is compressed. --assists leaves out the other leg's joints.

scenarios
  practice         rounds of everything, each in another order, at every step length, cycle time, toe height
                   and trunk angle that the controller allows; with stumbles and falls (default)
  dangers          healthy walking, a fifth of the time, then every danger of explanation/danger; the
                   robot has no bus, and torque, following error and temperature of each joint are written
                   too, and `danger`: 0 none, -1 one is over, else its number in `dangers`, and .5 more once
                   it has done harm
  healthy          the same robot and columns without a danger: walking, standing and turning on level ground,
                   to count false alarms on
  and those of `gwrms sim`.

exit status
  0 written, 1 it cannot be written, 2 wrong usage

examples
  gwrms sim-record --out sim.jsonl.gz --subjects 1-24 --minutes 6 --seed 1
  gwrms sim-record --out slow.jsonl.gz --walks slow --subjects 1-4 --minutes 2
"""

PRACTICE: Final = "practice"
DANGEROUS: Final = "dangers"
HEALTHY: Final = "healthy"
BARE: Final = (DANGEROUS, HEALTHY)  # of a robot without a bus, with what danger looks at
DANGER_COLUMNS: Final = {**JOINT_UNITS, "danger": ""}
HEALTHY_SHARE: Final = 0.2  # of a dangerous session's time, before the first danger
COLUMNS: Final = {"time": "ns", "label": "", "left_phase": "stride", "right_phase": "stride", **UNITS}
_DIGITS: Final = {
    "N": 2,
    "N·m": 2,
    "°C": 1,
    "m": 5,
    "rad": 6,
    "rad/s": 5,
    "m/s²": 5,
}  # finer than any sensor's resolution
_ROUNDED: Final = tuple(_DIGITS[unit] for unit in UNITS.values())


class SessionRecorder:
    """One wearer's session: writes a line to `file` after each cycle of the sensors, once the robot moves."""

    def __init__(
        self,
        file: BinaryIO,
        scenario: str,
        seed: int,
        person: int,
        walk: str = ORDINARY,
        assists: str | None = None,
    ) -> None:
        # Every wearer has strides, noise and an order of things of their own.
        own = seed * 1000 + person
        self._file = file
        self._bare = scenario in BARE
        self._dangers = list(DANGERS) if scenario == DANGEROUS else []
        self._seed = own
        self._robot = (BareExoskeleton if self._bare else Exoskeleton)(
            Scenario.STAND if scenario in (PRACTICE, *BARE) else Scenario(scenario),
            own,
            person=person,
            walk=walk,
            assists=assists,
        )
        self._course: Course | None = None
        columns = {**COLUMNS, **(DANGER_COLUMNS if self._bare else {})}
        self._kept = [name.partition(".")[0] not in self._robot.absent for name in columns]
        self._entries = practice(self._robot, own) if scenario == PRACTICE else None
        self._write(
            {
                "session": f"sim-{seed}-{person}" + (walk != ORDINARY) * f"-{walk}",
                "subject": person,
                "seed": seed,
                "scenario": scenario,
                "period_s": PERIOD_NS / SECOND_NS,
                "walks": walk,
                "columns": list(compress(columns, self._kept)),
                "units": list(compress(columns.values(), self._kept)),
                **({"dangers": self._dangers} if self._bare else {}),
                "wearer": asdict(self._robot.controller.generator.wearer),
            }
        )
        self._robot.measured.append(self._record)

    def run(self, seconds: float) -> None:
        """Let so much simulated time pass from switching on."""
        self._robot.power_on()
        if self._bare:
            self._course = Course(self._robot, self._seed, HEALTHY_SHARE * seconds, self._dangers)
        if self._entries is not None:
            self._robot.follow(self._entries)
        self._robot.clock.run_until(round(seconds * SECOND_NS))

    def _record(self) -> None:
        robot = self._robot
        if robot.controller.controller_state is not ControllerState.RUNNING and not self._bare:
            return
        values = zip(reported(robot), _ROUNDED, strict=True)
        rounded = (None if value is None else round(value, digits) for value, digits in values)
        generator = robot.controller.generator
        stepping = (None if phase is None else round(phase, 5) for phase in phases(generator))
        row = [robot.clock.now_ns, generator.label, *stepping, *rounded, *self._danger()]
        self._write(list(compress(row, self._kept)))

    def _danger(self) -> list[float]:
        """Return the values of dangers, in the order of `DANGER_COLUMNS`."""
        if self._course is None:
            return []
        units = zip(joints_reported(self._robot), JOINT_UNITS.values(), strict=True)
        values = [round(value, _DIGITS[unit]) for value, unit in units]
        return [*values, self._course.now + 0.5 * self._course.harmed]

    def _write(self, content: object) -> None:
        self._file.write(json.dumps(content, separators=(",", ":"), ensure_ascii=False).encode() + b"\n")


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("wb") as file:
            if path.suffix != ".gz":
                yield file
                return
            with gzip.GzipFile("", "wb", 4, file, mtime=0) as compressed:
                yield compressed  # type: ignore[misc]  # it writes bytes, whatever its type says
    except OSError as error:
        raise SimulatorError(f"the recording cannot be written to {path}: {error.strerror}") from error


def _subjects(text: str) -> list[int]:
    try:
        first, _, last = text.partition("-")
        subjects = list(range(int(first), int(last or first) + 1))
    except ValueError:
        subjects = []
    if not subjects or len(subjects) > 1000:
        raise argparse.ArgumentTypeError(f"{text} names no subjects: give a number, or a range as in 1-24")
    return subjects


def _minutes(text: str) -> float:
    value = number(text)
    if not 0.0 < value <= 600.0:
        raise argparse.ArgumentTypeError(f"{text} is no time: give minutes up to 600")
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms sim-record",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--out", required=True, type=Path, metavar="FILE", help="output file; replaced if it exists"
    )
    parser.add_argument(
        "--minutes",
        type=_minutes,
        default=6.0,
        metavar="M",
        help="duration for each wearer (default: %(default)g)",
    )
    parser.add_argument(
        "--subjects", type=_subjects, default=[0], metavar="N[-N]", help="number of the wearer (default: 0)"
    )
    parser.add_argument(
        "--scenario",
        choices=[PRACTICE, *BARE, *map(str, Scenario)],
        default=PRACTICE,
        help="default: %(default)s",
    )
    add_wearer(parser)
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="same seed, same recording (default: 0)"
    )
    return parser


def main(argv: list[str]) -> int:
    """Record; returns the exit status."""
    parser = _parser()
    try:
        arguments = parser.parse_args(argv)
        if arguments.scenario in BARE and arguments.assists is not None:
            parser.error(f"--scenario {arguments.scenario} is of robots on both legs: no --assists")
    except SystemExit as leave:
        return 2 if leave.code else 0
    with _opened(arguments.out) as file:
        for person in arguments.subjects:
            SessionRecorder(
                file, arguments.scenario, arguments.seed, person, arguments.walks, arguments.assists
            ).run(60.0 * arguments.minutes)
    return 0
