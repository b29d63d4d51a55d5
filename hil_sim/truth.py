"""Ground truth of the simulated robot: a file of JSON lines for learning and tests.

The first line is an object: its `columns` and `units` say what each following line, an array, holds. A line
is taken whenever the serial sensors measure, 100 times a second. `simulated_ns` counts from switching on,
`monotonic_ns` is this computer's monotonic clock when the line was written, the clock of a gateway's stamps.
What is not there is null: the phase of a leg that does not step, the centre of pressure of an unloaded foot,
a joint that is not simulated.
"""

import json
import time
from dataclasses import asdict
from pathlib import Path

from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.gait.activity import Label
from hil_sim.gait.gaits import LEFT, RIGHT
from hil_sim.gait.generator import Generator
from hil_sim.gait.stumble_and_fall import FallState
from hil_sim.gait.wearer import Foot
from hil_sim.sensors.suite import PERIOD_NS

CONTACT_N = 20.0  # a foot with less is in the air

_FEET = ("left_foot", "right_foot")
_LOAD = {"force": "N", "cop_x": "m", "cop_y": "m"}
COLUMNS = {
    "simulated_ns": "ns",
    "monotonic_ns": "ns",
    "label": "",
    "transition": "",  # whether the wearer is between two activities
    "events": "",  # since the line before: left_heel_strike, right_toe_off, stumble, fall, impact, …
    "left_phase": "stride",
    "right_phase": "stride",
    "step_length": "m",
    "cycle_time": "s",
    **{f"{joint}.position": "rad" for joint in JOINTS},
    **{f"{joint}.velocity": "rad/s" for joint in JOINTS},
    **{f"{foot}.{name}": unit for foot in _FEET for name, unit in _LOAD.items()},
    "support.force": "N",  # of a seat, of crutches, or of the ground under a fallen body
    **{f"trunk.{name}": "rad" for name in ("roll", "pitch", "yaw")},
    **{f"trunk.acceleration_{axis}": "m/s²" for axis in "xyz"},  # of the world
}

_DIGITS = 6
_BEGUN = {Label.STUMBLE: "stumble", Label.FALL: "fall", Label.LYING: "impact"}


class TruthFile:
    """Writes a line of `robot`'s truth after each cycle of its sensors; each line is there at once.

    Raises `SimulatorError` where the file cannot be written.
    """

    def __init__(self, path: Path, robot: Exoskeleton) -> None:
        self._robot = robot
        self._label = Label.STAND
        self._contacts = [True, True]
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise SimulatorError(f"the truth cannot be written to {path}: {error.strerror}") from error
        self._write(
            {
                "columns": list(COLUMNS),
                "units": list(COLUMNS.values()),
                "period_s": PERIOD_NS / 1e9,
                "seed": robot.seed,
                "wearer": asdict(robot.controller.generator.wearer),
            }
        )
        robot.measured.append(self._record)

    def close(self) -> None:
        """End the file; idempotent."""
        if not self._file.closed:
            self._robot.measured.remove(self._record)
            self._file.close()

    def _write(self, content: object) -> None:
        self._file.write(json.dumps(content, separators=(",", ":"), ensure_ascii=False).encode() + b"\n")

    def _record(self) -> None:
        robot, generator = self._robot, self._robot.controller.generator
        now_s = robot.clock.now_s
        feet, trunk = robot.wearer.feet(now_s), robot.wearer.trunk(now_s)
        joints = [
            (None if name in robot.without else robot.drives[name].joint, mounting)
            for name, mounting in robot.mountings.items()
        ]
        numbers = [
            *phases(generator),
            generator.shape.step_length,
            generator.shape.cycle_time,
            *(None if joint is None else mounting.seen(joint.position) for joint, mounting in joints),
            *(None if joint is None else mounting.seen(joint.velocity) for joint, mounting in joints),
            *(value for foot in feet for value in _loaded(foot)),
            robot.wearer.support(),
            *(trunk.roll, trunk.pitch, trunk.yaw),
            *trunk.acceleration,
        ]
        head = [robot.clock.now_ns, time.monotonic_ns(), generator.label, generator.in_transition]
        rounded = (None if number is None else round(number, _DIGITS) for number in numbers)
        self._write([*head, self._events(feet), *rounded])

    def _events(self, feet: tuple[Foot, Foot]) -> list[str]:
        """Return the events since the last line."""
        generator = self._robot.controller.generator
        before, self._label = self._label, generator.label
        events = [_BEGUN[self._label]] if self._label is not before and self._label in _BEGUN else []
        stepping = generator.walking > 0.0 and generator.fall.state is FallState.UPRIGHT
        for side, foot in zip((LEFT, RIGHT), feet, strict=True):
            contact = foot.force >= CONTACT_N
            if stepping and contact is not self._contacts[side]:
                events.append(f"{('left', 'right')[side]}_{'heel_strike' if contact else 'toe_off'}")
            self._contacts[side] = contact
        return events


def phases(generator: Generator) -> tuple[float | None, float | None]:
    """Return the phases of the left and the right stride; None without steps."""
    if generator.walking == 0.0:
        return None, None
    return generator.leg_phase(LEFT), generator.leg_phase(RIGHT)


def _loaded(foot: Foot) -> tuple[float | None, ...]:
    return (foot.force, foot.cop_x, foot.cop_y) if foot.force >= CONTACT_N else (foot.force, None, None)
