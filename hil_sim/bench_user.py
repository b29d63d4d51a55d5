"""A person at the robot on the bench: moves joints without power, leans the trunk, stamps a foot."""

import math
from dataclasses import replace

from hil_sim.drive.drive import JointDrive
from hil_sim.errors import SimulatorError
from hil_sim.gait.wearer import Foot, Trunk
from hil_sim.mounting import Mounting

STAMP_HZ = 1.5
STAMP_N = 400.0
FEET = ("left", "right")


class BenchUser:
    """Present actions of the user; the same until the next request."""

    def __init__(self) -> None:
        self.stamping: str | None = None
        self.lean: tuple[float, float] | None = None  # forward, and to the left (rad)

    def move(self, drive: JointDrive, mounting: Mounting, angle: float) -> None:
        """Bring a joint to an angle (rad), as far as its stops; raises `SimulatorError` under power."""
        if drive.power.energised:
            raise SimulatorError(f"{drive.name} is under power: nobody takes hold of it")
        joint, constants = drive.joint, drive.joint.constants
        joint.position = min(max(mounting.seen(angle), constants.low_stop), constants.high_stop)
        joint.velocity = 0.0

    def upon(self, feet: tuple[Foot, Foot], trunk: Trunk, now_s: float) -> tuple[tuple[Foot, Foot], Trunk]:
        """Return feet and trunk as changed by the user at the bench."""
        if self.lean is not None:
            forward, left = self.lean
            trunk = replace(trunk, pitch=forward, roll=-left)
        if self.stamping is not None:
            force = STAMP_N * max(0.0, math.sin(math.tau * STAMP_HZ * now_s))
            left_foot, right_foot = feet
            if self.stamping == "left":
                return (replace(left_foot, force=force), right_foot), trunk
            return (left_foot, replace(right_foot, force=force)), trunk
        return feet, trunk
