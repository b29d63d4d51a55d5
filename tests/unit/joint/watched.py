"""The simulated robot in simulated time, each joint judged by its drive's objects 20 times a second."""

import math
from pathlib import Path

from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.plausibility import JointCheck, Motion
from hil_sim.clock import MILLISECOND_NS, SECOND_NS
from hil_sim.drive import objects as od
from hil_sim.drive.drive import JointDrive
from hil_sim.exoskeleton import JOINTS, Exoskeleton, Scenario
from hil_sim.faults.injector import Faults
from hil_sim.without_bus import BareExoskeleton

COUNTS = 4096 * 100 / math.tau  # per rad at the joint
RATED = 40.0  # N·m
LOOK_MS = 50


class WatchedRobot:
    """`said` is what was said of any joint, by its name, in the order in which it was first said.

    Without `whole` there is no bus, and no controller that stops the others when a drive fails.
    """

    def __init__(
        self,
        folder: Path,
        scenario: Scenario,
        seed: int = 0,
        mirrored: str | None = None,
        *,
        whole: bool = False,
    ) -> None:
        self.robot = (Exoskeleton if whole else BareExoskeleton)(scenario, seed)
        self.faults = Faults(self.robot, folder, seed)
        self.checks = {name: JointCheck(name) for name in JOINTS}
        self.said: dict[str, str] = {}
        self._mirrored = mirrored
        for name, check in self.checks.items():
            check.loaded.rated = RATED
            check.compare_with(_other(name))
        vars(self.robot.sensors)["measure"] = _nothing  # soles and trunk are none of this, and cost a sixth
        self.robot.power_on()
        self.robot.clock.every(LOOK_MS * MILLISECOND_NS, self._look)

    def run(self, seconds: float) -> dict[str, str]:
        self.robot.clock.run_until(self.robot.clock.now_ns + round(seconds * SECOND_NS))
        return self.said

    def words(self, name: str) -> str:
        """What is said of a joint now."""
        return "; ".join(finding.text(self.robot.clock.now_ns) for finding in self.checks[name].findings)

    def _look(self) -> None:
        for name, drive in self.robot.drives.items():
            self.checks[name].update(
                self._motion(name, drive),
                lambda name=name: self._position(_other(name)),  # type: ignore[misc]
            )
            for finding in self.checks[name].findings:
                self.said.setdefault(name, finding.words)

    def _motion(self, name: str, drive: JointDrive) -> Motion:
        number = drive.dictionary.number
        return Motion(
            self.robot.clock.now_ns,
            self._position(name),
            self._sign(name) * number(od.VELOCITY_ACTUAL) / COUNTS,
            self._sign(name) * number(od.TORQUE_ACTUAL) * RATED / 1000,
            self._sign(name) * number(od.FOLLOWING_ERROR_ACTUAL) / COUNTS,
            number(od.MODE_DISPLAY),
            drive_state(number(od.STATUSWORD)) is DriveState.OPERATION_ENABLED,
        )

    def _position(self, name: str) -> float:
        return self._sign(name) * self.robot.drives[name].dictionary.number(od.POSITION_ACTUAL) / COUNTS

    def _sign(self, name: str) -> float:
        return -1.0 if name == self._mirrored else 1.0


def _nothing(*_felt: object) -> None:
    """What a robot without sensors measures."""


def _other(name: str) -> str:
    side, _, joint = name.partition("_")
    return f"{'right' if side == 'left' else 'left'}_{joint}"
