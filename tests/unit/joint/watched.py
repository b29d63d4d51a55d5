"""The simulated robot in simulated time, each joint judged by what its PDOs say 20 times a second."""

import math
import struct
from pathlib import Path

from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.plausibility import JointCheck, Motion
from hil_sim.bus.can_bus import Frame
from hil_sim.clock import MILLISECOND_NS, SECOND_NS
from hil_sim.exoskeleton import JOINTS, Exoskeleton, Scenario
from hil_sim.faults.injector import Faults

COUNTS = 4096 * 100 / math.tau  # per rad at the joint
RATED = 40.0  # N·m
LOOK_MS = 50


class WatchedRobot:
    """`said` is what was said of any joint, by its name, in the order in which it was first said."""

    def __init__(self, folder: Path, scenario: Scenario, seed: int = 0, mirrored: str | None = None) -> None:
        self.robot = Exoskeleton(scenario, seed)
        self.faults = Faults(self.robot, folder, seed)
        self.checks = {name: JointCheck(name) for name in JOINTS}
        self.said: dict[str, str] = {}
        self._mirrored = mirrored
        self._names = {node_id: name for name, node_id in JOINTS.items()}
        self._newest: dict[str, dict[str, float]] = {name: {} for name in JOINTS}
        for name, check in self.checks.items():
            check.loaded.rated = RATED
            check.compare_with(_other(name))
        self.robot.bus.attach(self, self._receive)
        vars(self.robot.sensors)["measure"] = _nothing  # soles and trunk are none of this, and cost a sixth
        self.robot.power_on()
        self.robot.clock.every(LOOK_MS * MILLISECOND_NS, self._look)

    def run(self, seconds: float) -> dict[str, str]:
        self.robot.clock.run_until(self.robot.clock.now_ns + round(seconds * SECOND_NS))
        return self.said

    def words(self, name: str) -> str:
        """What is said of a joint now."""
        return "; ".join(finding.text(self.robot.clock.now_ns) for finding in self.checks[name].findings)

    def _receive(self, frame: Frame, _sender: object) -> None:
        name = self._names.get(frame.cob_id & 0x7F)
        if name is None:
            return
        found, sign = self._newest[name], -1.0 if name == self._mirrored else 1.0
        match frame.cob_id & 0x780:
            case 0x180:
                word, counts = struct.unpack("<Hi", frame.data)
                found |= {"word": word, "position": sign * counts / COUNTS, "stamp": self.robot.clock.now_ns}
            case 0x280:
                velocity, torque, _current = struct.unpack("<ihh", frame.data)
                found |= {"velocity": sign * velocity / COUNTS, "torque": sign * torque * RATED / 1000}
            case 0x380:
                error, _temperature, mode = struct.unpack("<ihb", frame.data)
                found |= {"error": sign * error / COUNTS, "mode": mode}

    def _look(self) -> None:
        for name, found in self._newest.items():
            if "stamp" not in found:
                continue
            mode = found.get("mode")
            now = Motion(
                round(found["stamp"]),
                found["position"],
                found.get("velocity"),
                found.get("torque"),
                found.get("error"),
                None if mode is None else round(mode),
                drive_state(round(found["word"])) is DriveState.OPERATION_ENABLED,
            )
            self.checks[name].update(now, lambda name=name: self._newest[_other(name)].get("position"))  # type: ignore[misc]
            for finding in self.checks[name].findings:
                self.said.setdefault(name, finding.words)


def _nothing(*_felt: object) -> None:
    """What a robot without sensors measures."""


def _other(name: str) -> str:
    side, _, joint = name.partition("_")
    return f"{'right' if side == 'left' else 'left'}_{joint}"
