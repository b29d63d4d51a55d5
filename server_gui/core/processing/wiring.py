"""Inputs of the processing, found by the channels' names, once for each set of columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from server_gui.core.processing.gait_events import Leg

FORCE, PITCH_RATE, POSITION, TILT = "force", "angular_velocity_y", "position", "tilt_forward"
FOLLOWING_ERROR, TARGET, STATE = "following_error", "target_position", "state"
ANGLES = tuple(f"{leg}_{joint}.{POSITION}" for leg in Leg for joint in ("hip", "knee"))
TRUNK = len(ANGLES)  # the place of the trunk's forward tilt


class Fed(NamedTuple):
    """A channel, and the component that it belongs to."""

    channel: str
    component: str


@dataclass(frozen=True, slots=True)
class Wiring:
    """Inputs in a batch with these columns."""

    forces: tuple[tuple[Leg, Fed], ...]  # of the insoles
    pitch_rates: tuple[tuple[Leg, Fed], ...]  # of the feet's IMUs
    angles: tuple[tuple[int, str], ...]  # channels of what `ANGLES` names, each with its place there
    positions: tuple[Fed, ...]  # of every joint
    errors: tuple[Fed, ...]
    targets: tuple[Fed, ...]  # of joints that tell no following error
    states: tuple[Fed, ...]  # of the drives of those that tell an error or a target

    @classmethod
    def of(cls, channels: Sequence[str]) -> "Wiring":
        """Return the wiring of these channels, each named `component.quantity`."""
        fed = [(Fed(channel, component), quantity) for channel, component, quantity in map(_split, channels)]
        told = {name.component for name, quantity in fed if quantity == FOLLOWING_ERROR}
        followers = {name.component for name, quantity in fed if quantity in (FOLLOWING_ERROR, TARGET)}

        def all_with(quantity: str) -> tuple[Fed, ...]:
            return tuple(name for name, found in fed if found == quantity)

        return cls(
            forces=_legs(all_with(FORCE)),
            pitch_rates=_legs(tuple(name for name in all_with(PITCH_RATE) if "foot" in name.component)),
            angles=tuple(
                (place, name.channel)
                for name, quantity in fed
                if (place := _place(name.channel, quantity)) >= 0
            ),
            positions=all_with(POSITION),
            errors=all_with(FOLLOWING_ERROR),
            targets=tuple(name for name in all_with(TARGET) if name.component not in told),
            states=tuple(name for name in all_with(STATE) if name.component in followers),
        )

    @property
    def channels(self) -> set[str]:
        """Every channel that something is derived from."""
        of_joints = (*self.positions, *self.errors, *self.targets, *self.states)
        told = (*(name for _, name in self.forces + self.pitch_rates), *of_joints)
        return {name.channel for name in told} | {channel for _, channel in self.angles}


def leg_of(component: str) -> Leg | None:
    """Return the leg that a component is on, None where its name does not say."""
    side = component.partition("_")[0]
    return Leg(side) if side in tuple(Leg) else None


def _legs(found: tuple[Fed, ...]) -> tuple[tuple[Leg, Fed], ...]:
    return tuple((leg, name) for name in found if (leg := leg_of(name.component)) is not None)


def _split(channel: str) -> tuple[str, str, str]:
    component, _, quantity = channel.rpartition(".")
    return channel, component, quantity


def _place(channel: str, quantity: str) -> int:
    """Return the place of an angle that gait is seen by; −1 for everything else."""
    if quantity == TILT:
        return TRUNK
    return ANGLES.index(channel) if channel in ANGLES else -1
