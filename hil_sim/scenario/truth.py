"""The robot's own truth, as scenarios name it."""

from hil_sim.exoskeleton import Exoskeleton
from hil_sim.scenario.expectation import Seen


def truth(robot: Exoskeleton) -> dict[str, Seen]:
    """Where each joint really is (rad, rad/s, N·m, °C), what each foot carries (N), and states in words."""
    found: dict[str, Seen] = {
        "wearer.activity": str(robot.controller.generator.label),
        "gait.state": robot.controller.controller_state.name.lower(),
    }
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
