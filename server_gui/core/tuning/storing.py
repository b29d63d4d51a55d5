"""What can be stored to flash: devices, what they would keep, and why it cannot be now."""

from dataclasses import dataclass
from typing import Final

from gateway.wire.robot import Description
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.flash import devices
from server_gui.core.tuning.writing import Trial

# States in which a drive's motor is under power (CiA 402-2).
ENERGISED: Final = ("operation enabled", "quick stop active", "fault reaction active")


@dataclass(frozen=True, slots=True)
class Storable:
    """One device that says it can store; the axes of one device store together."""

    components: tuple[str, ...]
    parameters: tuple[str, ...]  # that can be changed here; the device keeps all that it has

    @property
    def title(self) -> str:
        return " + ".join(self.components).replace("_", " ")


def storable(description: Description) -> list[Storable]:
    """Return the devices whose EDS has the command, in the robot's order."""
    device_of = devices(description)
    told = [info for info in description.parameters if info.store]
    found = dict.fromkeys(device_of.get(info.component) for info in told)
    return [
        Storable(
            tuple(name for name, place in device_of.items() if place == device),
            tuple(
                info.name
                for info in description.parameters
                if device_of.get(info.component) == device and info.read_only is None
            ),
        )
        for device in found
        if device is not None
    ]


def objection(device: Storable, robot: Robot, trial: Trial | None) -> str | None:
    """Why the robot would refuse to store it now, as far as that is known here."""
    if trial is not None:
        return f"{', '.join(trial.values)} is on trial: keep it or take it back first"
    joints = robot.names("joint")
    moved = [name for name in device.components if name in joints] or joints
    powered = [name for name in moved if robot.word(f"{name}.state") in ENERGISED]
    if powered:
        return f"{', '.join(powered)} under power: a device may not answer while it stores, so stop it first"
    return None
