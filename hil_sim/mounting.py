"""Mounting of a joint's drive: its node id, the direction of its motor, its counts at the joint's zero."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from hil_sim.drive.mechanics import JointConstants
from hil_sim.errors import SimulatorError

NODES = range(1, 128)


@dataclass(frozen=True, slots=True)
class Mounting:
    """Counts of the drive are `direction` times those of the joint's flexion, plus `zero`."""

    node_id: int
    direction: int = 1
    zero: int = 0

    def seen(self, angle: float) -> float:
        """Return the joint's angle, rate or torque as the motor has it; and back."""
        return self.direction * angle

    def counts(self, angle: float, counts_per_radian: float) -> int:
        """Return the drive's count at an angle of the joint (rad)."""
        return round(self.direction * angle * counts_per_radian) + self.zero

    def angle(self, counts: float, counts_per_radian: float) -> float:
        """Return the joint's angle (rad) at these counts of the drive."""
        return self.direction * (counts - self.zero) / counts_per_radian

    def constants(self, joint: JointConstants) -> JointConstants:
        """Return the joint's as the motor sees them."""
        if self.direction > 0:
            return joint
        return replace(joint, low_stop=-joint.high_stop, high_stop=-joint.low_stop)


def choose(
    words: Iterable[str], usual: Mapping[str, int], taken: Collection[int] = ()
) -> dict[str, Mounting]:
    """Return each joint's mounting, from `JOINT=NODE[,DIRECTION[,ZERO]]`; `taken` are other ids.

    Raises `SimulatorError`.
    """
    chosen = {joint: Mounting(node) for joint, node in usual.items()}
    for word in words:
        joint, _, text = word.partition("=")
        if joint not in chosen:
            raise SimulatorError(f"mount {word!r}: there is no joint {joint!r}; there are {', '.join(usual)}")
        chosen[joint] = _mounting(word, text)
    nodes = [*(one.node_id for one in chosen.values()), *taken]
    twice = {str(node) for node in nodes if nodes.count(node) > 1}
    if twice:
        raise SimulatorError(f"two nodes would have the id {', '.join(sorted(twice))}")
    return chosen


def _mounting(word: str, text: str) -> Mounting:
    try:
        found = Mounting(*(int(part) for part in text.split(",")))
    except (ValueError, TypeError) as error:
        raise SimulatorError(
            f"mount {word!r} is not JOINT=NODE[,DIRECTION[,ZERO]], as left_knee=9,-1,51200"
        ) from error
    if found.node_id not in NODES or found.direction not in (1, -1):
        raise SimulatorError(f"mount {word!r}: the node id is 1 to 127, the direction 1 or -1")
    return found
