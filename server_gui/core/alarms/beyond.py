"""Values that are wrong whatever the robot does, where no rule of its guard watches them.

A trunk that leans as nobody does who walks, sits or stands up; a joint beyond the ends that its drive holds
(607Dh); heat that harms a drive and whoever touches it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from gateway.wire.robot import GuardRuleInfo
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.robot import Robot

LEANS: Final = math.radians(60.0)  # who stands up from a chair leans by some 45°
LEANING: Final = {"tilt_forward": ("forward", "backward"), "tilt_side": ("to a side", "to a side")}
HOT: Final = 85.0  # °C: few drives are rated for more, and their electronics age fast
SLACK: Final = math.radians(2.0)  # by which a joint may overshoot an end
ENDS: Final = "0x607d"
HELD_S: Final = 5.0  # what swings about its limit is one alarm, not one a stride


@dataclass(frozen=True, slots=True)
class FoundBeyond:
    """One value that is, or was just now, beyond its limit."""

    kind: Kind
    component: str
    quantity: str
    what: str


class Beyond:
    """Finds them in a robot's newest values; one is over once it was not seen for `HELD_S`."""

    def __init__(self) -> None:
        self._seen: dict[tuple[Kind, str], tuple[float, FoundBeyond]] = {}
        self._told: frozenset[tuple[Kind, str]] = frozenset()

    def look(self, robot: Robot) -> tuple[FoundBeyond, ...]:
        """Return what is beyond its limit now; what was last known so stays while nothing comes."""
        now_s = robot.now_s()
        if robot.is_recording:
            self._seen.clear()  # its instant goes to and fro
        elif not robot.is_stale():
            self._seen = {key: one for key, one in self._seen.items() if 0 <= now_s - one[0] < HELD_S}
        if not robot.is_stale():
            self._seen |= {(one.kind, one.component): (now_s, one) for one in _found(robot)}
        return tuple(one for _, one in self._seen.values() if one.component in robot.parts)

    def news(self, robot: Robot) -> list[FoundBeyond]:
        """Return what was not so when this was asked last."""
        found = {(one.kind, one.component): one for one in self.look(robot)}
        told, self._told = self._told, frozenset(found)
        return [one for key, one in found.items() if key not in told]


def is_hot(temperature: float | None) -> bool:
    """Return whether a drive or motor is so hot (°C) that it is an alarm."""
    return temperature is not None and temperature >= HOT


def _found(robot: Robot) -> Iterator[FoundBeyond]:
    for name in robot.names("imu"):
        yield from _leaning(robot, name)
    for name in robot.names("joint"):
        yield from _beyond_an_end(robot, name)
        yield from _hot(robot, name)


def _leaning(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    for quantity, (forward, backward) in LEANING.items():
        tilt = _value(robot, name, quantity)
        if tilt is not None and abs(tilt) > LEANS:
            way = forward if tilt > 0 else backward
            what = f"leans {abs(math.degrees(tilt)):.0f}° {way}, further than who walks or stands up"
            yield FoundBeyond(Kind.FALLEN, name, quantity, what)
            return


def _beyond_an_end(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    position, ends = _value(robot, name, "position"), _ends(robot, name)
    if position is None or ends is None or ends[0] - SLACK <= position <= ends[1] + SLACK:
        return
    low, high = (f"{math.degrees(end):.0f}".replace("-", "−") for end in ends)
    at = f"{math.degrees(position):.0f}".replace("-", "−")
    yield FoundBeyond(
        Kind.BEYOND, name, "position", f"it is at {at}°, its drive's range is {low}° to {high}°"
    )


def _hot(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    temperature = _value(robot, name, "temperature")
    if temperature is not None and is_hot(temperature):
        yield FoundBeyond(Kind.HOT, name, "temperature", f"{temperature:.1f} °C, hot from {HOT:.0f} °C on")


def _value(robot: Robot, name: str, quantity: str) -> float | None:
    """Return a value that is known and that no rule of a guard judges."""
    value = robot.values.get(f"{name}.{quantity}")
    is_known = value is not None and math.isfinite(value)
    return value if is_known and not any(_watches(rule, name, quantity) for rule in _rules(robot)) else None


def _rules(robot: Robot) -> list[GuardRuleInfo]:
    guard = None if robot.description is None else robot.description.guard
    return [] if guard is None or not guard.configured or guard.problem is not None else guard.rules


def _watches(rule: GuardRuleInfo, name: str, quantity: str) -> bool:
    has_limit = rule.low is not None or rule.high is not None
    return has_limit and name in rule.on and quantity in rule.quantities


def _ends(robot: Robot, name: str) -> tuple[float, float] | None:
    """Return the least and the greatest angle that the drive holds; None where these are not both known.

    Equal ends, or 0 for both, are what a drive holds that has none.
    """
    known = () if robot.description is None else robot.description.parameters
    held = [
        value.value
        for info in known
        if info.component == name and info.unit == "rad" and info.object.lower().startswith(ENDS)
        if (value := robot.parameters.get(info.name)) is not None and value.value is not None
    ]
    if len(held) != 2 or held[0] == held[1]:
        return None
    return float(min(held)), float(max(held))
