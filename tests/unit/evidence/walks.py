"""A simulated walk during which parameters are edited, as a gateway would stream it and keep its journal."""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from gateway.client import Batch
from hil_sim.channels import UNITS, reported
from hil_sim.clock import SECOND_NS
from hil_sim.controller.objects import ControllerState
from hil_sim.drive import objects
from hil_sim.drive.drive import JointDrive
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.timetable import Entry
from server_gui.core.follow.events import Telemetry

ROWS: Final = 10  # of a batch: 0.1 s, as a gateway sends them
QUANTITIES: Final = ("following_error", "torque", "current", "temperature", "state")
ENABLED: Final = 4.0  # of the state words
GAIN, CYCLE_TIME = "position_gain", "gait.cycle_time"
FIRST_GAIN, FIRST_CYCLE_S = 3000.0, 1.6

Row = list[float | None]


@dataclass(frozen=True, slots=True)
class Written:
    """One parameter written at a time (s) of the walk, and what it was until then."""

    at_s: float
    name: str
    value: float
    before: float

    @property
    def entries(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """What the robot's journal says of it: asked, and done 40 ms later."""
        at_ns, write = round(self.at_s * SECOND_NS), round(self.at_s)
        common = {"who": "anna", "write": write, "boot_id": "sim", "after": {self.name: self.value}}
        asked = {"what": "write", "before": {self.name: self.before}, "trial_s": None}
        return (
            {**common, **asked, "monotonic_ns": at_ns, "utc_ns": at_ns, "n": 2 * write, "hash": f"{write}a"},
            {
                **common,
                "what": "write done",
                "monotonic_ns": at_ns + 40_000_000,
                "utc_ns": at_ns,
                "n": 2 * write + 1,
                "hash": f"{write}b",
            },
        )


def walk(
    seconds: float,
    *,
    seed: int,
    person: int,
    writes: Sequence[Written] = (),
    entries: Sequence[Entry] | None = None,
    each_s: Callable[[Exoskeleton, float], None] | None = None,
) -> Iterator[Telemetry]:
    """Yield what is streamed of a walk of so long; `each_s` may do something to the robot once a second."""
    robot = Exoskeleton(Scenario.WALK, seed, person=person)
    rows: list[tuple[int, Row]] = []

    def listen() -> None:
        if robot.controller.controller_state is ControllerState.RUNNING:
            rows.append((robot.clock.now_ns, [*reported(robot), *_of_drives(robot)]))

    robot.measured.append(listen)
    robot.power_on()
    if entries is not None:
        robot.follow(entries)
    for one in writes:
        robot.clock.at(round(one.at_s * SECOND_NS), lambda one=one: write(robot, one.name, one.value))
    names = [*UNITS, *(f"{joint}.{quantity}" for joint in robot.drives for quantity in QUANTITIES)]
    for second in range(round(seconds)):
        if each_s is not None:
            each_s(robot, float(second))
        robot.clock.run_until((second + 1) * SECOND_NS)
        for begin in range(0, len(rows), ROWS):
            yield telemetry(names, rows[begin : begin + ROWS])
        rows.clear()


def telemetry(names: Sequence[str], rows: Sequence[tuple[int, Row]]) -> Telemetry:
    """Return rows as a batch."""
    columns = zip(names, zip(*(row for _, row in rows), strict=True), strict=True)
    stamps_ns = [stamp_ns for stamp_ns, _ in rows]
    columns_of = {name: list(column) for name, column in columns}
    return Telemetry(1, Batch(stamps_ns, columns_of, 0, 0, 0, 1, stamps_ns[-1]), None, 100.0)


def write(robot: Exoskeleton, name: str, value: float) -> None:
    """As an SDO download does it."""
    component, _, parameter = name.partition(".")
    if name == CYCLE_TIME:
        robot.controller.dictionary.write(0x2002, 0, struct.pack("<H", round(value * 1000)))
    elif parameter == GAIN:
        robot.drives[component].dictionary.write(*objects.POSITION_GAIN, struct.pack("<H", round(value)))
    else:
        raise ValueError(name)


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


def tiring(robot: Exoskeleton, now_s: float) -> None:
    """A bearing that warms up: friction grows by a fifth within a minute."""
    for drive in robot.drives.values():
        drive.joint.friction_factor = 1.0 + 0.2 * now_s / 60.0


def ceil_s(seconds: float) -> int:
    """Return whole seconds that are not fewer."""
    return math.ceil(seconds)
