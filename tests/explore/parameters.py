"""The robot's parameters: which object of which device, and what holds for it."""

from dataclasses import dataclass

from tests.explore.drive import MAX_TORQUE, RUN
from tests.explore.node import Address


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter, its numbers in counts."""

    device: str
    address: Address
    per_unit: float
    values: tuple[int, int, int]  # what is written to it: from, in steps of, to
    most_step: int | None = None
    rests: str | None = None  # the joint that must rest while it is written
    starts: bool = False  # whether it starts and stops the controller

    @property
    def toml(self) -> str:
        """What the robot's file says of it, but for its name."""
        index, subindex = self.address
        lines = [f'object = "0x{index:04X}:{subindex}"', f"scale = {1 / self.per_unit}"]
        if self.most_step is not None:
            lines.append(f"max_step = {self.most_step / self.per_unit}")
        if self.rests is None:
            lines.append("live = true")
        return "\n".join(lines)


PARAMETERS = {
    "gait.run": Parameter("gait", (RUN, 0), 1, (0, 1, 1), starts=True),
    "gait.step_length": Parameter("gait", (0x2001, 0), 1000, (300, 60, 540), most_step=100),
    "gait.cycle_time": Parameter("gait", (0x2002, 0), 1000, (1000, 100, 1400)),
    "knee.max_torque": Parameter("left", (MAX_TORQUE, 0), 1, (700, 100, 1000), rests="knee"),
    "ankle.max_torque": Parameter("right", (MAX_TORQUE + 0x800, 0), 1, (600, 120, 1080), most_step=200),
}
NAMES = {(one.device, one.address): name for name, one in PARAMETERS.items()}


def counts(name: str, value: float) -> int:
    """A value in the device's own numbers."""
    return round(value * PARAMETERS[name].per_unit)


def following(name: str, held: int) -> float:
    """Another value than the device holds, one step further on."""
    parameter = PARAMETERS[name]
    low, step, most = parameter.values
    up, down = held + step, held - step
    return (up if up <= most else low if held - low <= step else down) / parameter.per_unit
