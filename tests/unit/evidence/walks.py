"""A simulated walk during which parameters are edited, as a gateway streams it and keeps its journal."""

import functools
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from gateway.client import Batch
from gateway.wire.control import JournalEntries
from hil_sim.channels import UNITS, reported
from hil_sim.clock import SECOND_NS
from hil_sim.drive import objects
from hil_sim.drive.drive import JointDrive
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.without_bus import BareExoskeleton
from server_gui.core.follow.events import Event, Journalled, Telemetry
from tests.support.desk import described

ROWS: Final = 10  # of a batch: 0.1 s, as a gateway sends them
QUANTITIES: Final = ("following_error", "torque", "current", "temperature", "state")
ENABLED: Final = 4.0  # of the state's words
GAIN, SPEED, CYCLE_TIME = "position_gain", "profile_velocity", "gait.cycle_time"
FIRST: Final = {GAIN: 3000.0, SPEED: 1.0, "cycle_time": 1.6}  # what the simulated devices begin with

Row = list[float | None]
Each = Callable[[Exoskeleton, float], None]


@dataclass(frozen=True, slots=True)
class Edit:
    """A parameter written at a time (s) of the walk; `end` is what the journal says of it then."""

    at_s: float
    name: str
    value: float
    end: str = "write done"

    @property
    def write(self) -> int:
        """Its number."""
        return round(self.at_s)

    def entries(self, first: int) -> list[dict[str, Any]]:
        """What the robot's journal says of it, from the entry with this number on: asked, then done."""
        at_ns = round(self.at_s * SECOND_NS)
        trial_s = 60.0 if self.end == "trial begun" else None
        before = FIRST[self.name.partition(".")[2]]
        return [
            entry(first, at_ns, "write", self.write, {self.name: self.value}, {self.name: before}, trial_s),
            entry(first + 1, at_ns + 40_000_000, self.end, self.write, {self.name: self.value}),
        ]


def entry(
    n: int,
    at_ns: int,
    what: str,
    write: int,
    after: dict[str, float] | None = None,
    before: dict[str, float] | None = None,
    trial_s: float | None = None,
) -> dict[str, Any]:
    """An entry of a journal."""
    found = {
        "who": "anna",
        "what": what,
        "write": write,
        "boot_id": "boot-1",
        "after": after,
        "before": before,
    }
    return found | {
        "monotonic_ns": at_ns,
        "utc_ns": at_ns,
        "n": n,
        "hash": f"{write:06}{n:06}",
        "trial_s": trial_s,
    }


def walk(
    seconds: float, *, seed: int, person: int, edits: Sequence[Edit] = (), each_s: Each | None = None
) -> Iterator[Event]:
    """Yield what a robot's feed tells of a walk of so long.

    `each_s` may do something to the robot once a second.
    """
    yield described()
    robot = BareExoskeleton(Scenario.WALK, seed, person=person)
    rows: list[tuple[int, Row]] = []

    def listen() -> None:
        rows.append((robot.clock.now_ns, [*reported(robot), *_of_drives(robot)]))

    robot.measured.append(listen)
    robot.power_on()
    for edit in edits:
        robot.clock.at(round(edit.at_s * SECOND_NS), functools.partial(write, robot, edit.name, edit.value))
    names = [*UNITS, *(f"{joint}.{quantity}" for joint in robot.drives for quantity in QUANTITIES)]
    journal: list[dict[str, Any]] = []
    for second in range(1, round(seconds) + 1):
        if each_s is not None:
            each_s(robot, float(second))
        robot.clock.run_until(second * SECOND_NS)
        for begin in range(0, len(rows), ROWS):
            yield telemetry(names, rows[begin : begin + ROWS])
        rows.clear()
        for edit in edits:
            if second - 1 <= edit.at_s < second:
                journal += edit.entries(len(journal) + 1)
                yield Journalled(JournalEntries(list(journal)))


def telemetry(names: Sequence[str], rows: Sequence[tuple[int, Row]]) -> Telemetry:
    """Return rows as a batch."""
    columns = zip(names, zip(*(row for _, row in rows), strict=True), strict=True)
    stamps_ns = [stamp_ns for stamp_ns, _ in rows]
    columns_of = {name: list(column) for name, column in columns}
    return Telemetry(1, Batch(stamps_ns, columns_of, 0, 0, 0, 1, stamps_ns[-1]), None, 100.0)


def write(robot: Exoskeleton, name: str, value: float) -> None:
    """As an SDO download does it; the speed of profile moves has no part in walking."""
    component, _, parameter = name.partition(".")
    if name == CYCLE_TIME:
        robot.controller.dictionary.write(0x2002, 0, struct.pack("<H", round(value * 1000)))
        return
    dictionary = robot.drives[component].dictionary
    if parameter == GAIN:
        dictionary.write(*objects.POSITION_GAIN, struct.pack("<H", round(value)))
    else:
        counts = round(value * robot.drives[component].counts_per_radian)
        dictionary.write(*objects.PROFILE_VELOCITY, struct.pack("<I", counts))


def warming(robot: Exoskeleton, now_s: float) -> None:
    """Make every bearing worse: friction grows by a fifth a minute."""
    for drive in robot.drives.values():
        drive.joint.friction_factor = 1.0 + 0.2 * now_s / 60.0


def _of_drives(robot: Exoskeleton) -> Row:
    return [value for drive in robot.drives.values() for value in _of_drive(drive)]


def _of_drive(drive: JointDrive) -> Row:
    """In the order of `QUANTITIES`, from the objects that a gateway maps, in its units."""
    entry = drive.dictionary
    return [
        entry[objects.FOLLOWING_ERROR_ACTUAL].number() / drive.counts_per_radian,
        entry[objects.TORQUE_ACTUAL].number() * 0.04,
        entry[objects.CURRENT_ACTUAL].number() * 0.005,
        entry[objects.MOTOR_TEMPERATURE].number() * 0.1,
        ENABLED if entry[objects.STATUSWORD].number() & 0x6F == 0x27 else 0.0,
    ]
