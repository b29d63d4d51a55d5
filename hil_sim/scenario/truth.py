"""The robot's own truth, as scenarios name it."""

from collections.abc import Callable, Mapping
from enum import Enum

from hil_sim.controller import objects
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.power_state import PowerState
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.gait.activity import Label
from hil_sim.node.nmt import NmtState
from hil_sim.scenario.expectation import Seen

_SHAPE = {
    "step_length": objects.STEP_LENGTH,
    "cycle_time": objects.CYCLE_TIME,
    "toe_height": objects.TOE_HEIGHT,
    "trunk_angle": objects.TRUNK_ANGLE,
}


_DRIVE: Mapping[str, Callable[[JointDrive], Seen]] = {
    "temperature": lambda drive: drive.temperature_c,
    "state": lambda drive: _spoken(drive.power_state, " "),
    "nmt": lambda drive: _spoken(drive.state, "-") if drive.powered else _OFF,
}
_MOVING = ("position", "velocity", "torque")  # as the joint has it, however its motor is built in
_OFF = "off"
_FEET = ("left", "right")


def names() -> tuple[str, ...]:
    """Return the names of all true values, for a robot with simulated drives only."""
    drives = [f"{joint}.{quantity}" for joint in JOINTS for quantity in (*_MOVING, *_DRIVE)]
    feet = [f"{side}_foot.force" for side in _FEET]
    return ("wearer.activity", "gait.state", *(f"gait.{name}" for name in _SHAPE), *feet, *drives)


def words(name: str) -> frozenset[str]:
    """Return all that one of them may say; none where it is a number."""
    return _WORDS.get(name) or _WORDS.get(name.partition(".")[2], frozenset())


def _spoken(state: Enum, space: str) -> str:
    return state.name.lower().replace("_", space)


_WORDS: Mapping[str, frozenset[str]] = {
    "wearer.activity": frozenset(map(str, Label)),
    "gait.state": frozenset(_spoken(state, " ") for state in objects.ControllerState),
    "state": frozenset(_spoken(state, " ") for state in PowerState),
    "nmt": frozenset([_OFF, *(_spoken(state, "-") for state in NmtState)]),
}


def truth(robot: Exoskeleton) -> dict[str, Seen]:
    """Joints (rad, rad/s, N·m, °C), feet (N), the shape of the gait (m, s, rad), and states in words."""
    found: dict[str, Seen] = {
        "wearer.activity": str(robot.controller.generator.label),
        "gait.state": _spoken(robot.controller.controller_state, " "),
    }
    for name, key in _SHAPE.items():
        found[f"gait.{name}"] = robot.controller.dictionary[key].number() / 1000.0
    for side, foot in zip(_FEET, robot.wearer.feet(robot.clock.now_s), strict=True):
        found[f"{side}_foot.force"] = foot.force
    for name, drive in robot.drives.items():
        found |= {f"{name}.{quantity}": of(drive) for quantity, of in _DRIVE.items()}
        seen = robot.mountings[name].seen
        moving = drive.joint.position, drive.joint.velocity, drive.servo.torque
        found |= {f"{name}.{quantity}": seen(value) for quantity, value in zip(_MOVING, moving, strict=True)}
    return found
