"""The robot's own truth, as scenarios name it."""

from hil_sim.exoskeleton import Exoskeleton
from hil_sim.scenario.expectation import Seen


def truth(robot: Exoskeleton) -> dict[str, Seen]:
    """Where each joint really is (rad, rad/s, N·m, °C), each drive's state and the controller's in words."""
    found: dict[str, Seen] = {"gait.state": robot.controller.controller_state.name.lower()}
    for name, drive in robot.drives.items():
        found[f"{name}.position"] = drive.joint.position
        found[f"{name}.velocity"] = drive.joint.velocity
        found[f"{name}.torque"] = drive.servo.torque
        found[f"{name}.temperature"] = drive.temperature_c
        found[f"{name}.state"] = drive.power_state.name.lower().replace("_", " ")
        found[f"{name}.nmt"] = drive.state.name.lower().replace("_", "-") if drive.powered else "off"
    return found
