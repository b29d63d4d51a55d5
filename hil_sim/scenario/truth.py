"""The robot's own truth, as scenarios name it."""

from hil_sim.controller import objects
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.scenario.expectation import Seen

_SHAPE = {
    "step_length": objects.STEP_LENGTH,
    "cycle_time": objects.CYCLE_TIME,
    "toe_height": objects.TOE_HEIGHT,
    "trunk_angle": objects.TRUNK_ANGLE,
}


def truth(robot: Exoskeleton) -> dict[str, Seen]:
    """Joints (rad, rad/s, N·m, °C), feet (N), the shape of the gait (m, s, rad), and states in words."""
    found: dict[str, Seen] = {
        "wearer.activity": str(robot.controller.generator.label),
        "gait.state": robot.controller.controller_state.name.lower(),
    }
    for name, key in _SHAPE.items():
        found[f"gait.{name}"] = robot.controller.dictionary[key].number() / 1000.0
    for side, foot in zip(("left", "right"), robot.wearer.feet(robot.clock.now_s), strict=True):
        found[f"{side}_foot.force"] = foot.force
    for name, drive in robot.drives.items():
        found[f"{name}.position"] = drive.joint.position
        found[f"{name}.velocity"] = drive.joint.velocity
        found[f"{name}.torque"] = drive.servo.torque
        found[f"{name}.temperature"] = drive.temperature_c
        found[f"{name}.state"] = drive.power_state.name.lower().replace("_", " ")
        found[f"{name}.nmt"] = drive.state.name.lower().replace("_", "-") if drive.powered else "off"
    return found
