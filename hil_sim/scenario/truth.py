"""The robot's own truth, as scenarios name it."""

from collections.abc import Callable, Mapping

from hil_sim.controller import objects
from hil_sim.drive.drive import JointDrive
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.scenario.expectation import Seen

_SHAPE = {
    "step_length": objects.STEP_LENGTH,
    "cycle_time": objects.CYCLE_TIME,
    "toe_height": objects.TOE_HEIGHT,
    "trunk_angle": objects.TRUNK_ANGLE,
}


_DRIVE: Mapping[str, Callable[[JointDrive], Seen]] = {
    "position": lambda drive: drive.joint.position,
    "velocity": lambda drive: drive.joint.velocity,
    "torque": lambda drive: drive.servo.torque,
    "temperature": lambda drive: drive.temperature_c,
    "state": lambda drive: drive.power_state.name.lower().replace("_", " "),
    "nmt": lambda drive: drive.state.name.lower().replace("_", "-") if drive.powered else "off",
}
_FEET = ("left", "right")


def names() -> tuple[str, ...]:
    """Of everything that is told, on a robot whose drives are all simulated."""
    drives = [f"{joint}.{quantity}" for joint in JOINTS for quantity in _DRIVE]
    feet = [f"{side}_foot.force" for side in _FEET]
    return ("wearer.activity", "gait.state", *(f"gait.{name}" for name in _SHAPE), *feet, *drives)


def truth(robot: Exoskeleton) -> dict[str, Seen]:
    """Joints (rad, rad/s, N·m, °C), feet (N), the shape of the gait (m, s, rad), and states in words."""
    found: dict[str, Seen] = {
        "wearer.activity": str(robot.controller.generator.label),
        "gait.state": robot.controller.controller_state.name.lower(),
    }
    for name, key in _SHAPE.items():
        found[f"gait.{name}"] = robot.controller.dictionary[key].number() / 1000.0
    for side, foot in zip(_FEET, robot.wearer.feet(robot.clock.now_s), strict=True):
        found[f"{side}_foot.force"] = foot.force
    for name, drive in robot.drives.items():
        found |= {f"{name}.{quantity}": seen(drive) for quantity, seen in _DRIVE.items()}
    return found
