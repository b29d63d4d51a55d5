"""Values that are wrong whatever the robot does, where no rule of its guard watches them.

A trunk that leans as nobody does who walks, sits or stands up; a joint beyond the ends that its drive holds
(607Dh); heat that harms a drive and whoever touches it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from gateway.units import with_minus
from gateway.wire.robot import GuardRuleInfo
from server_gui.core.alarms.texts import Kind
from server_gui.core.follow.frame_time import now_ns
from server_gui.core.follow.position_ends import position_ends
from server_gui.core.follow.robot import Robot

LEANS: Final = math.radians(60.0)  # who stands up from a chair leans by some 45°
LEANING: Final = {"tilt_forward": ("forward", "backward"), "tilt_side": ("to a side", "to a side")}
TRUNK: Final = "trunk"
HOT: Final = 85.0  # °C: few drives are rated for more, and their electronics age fast
SLACK: Final = math.radians(2.0)  # by which a joint may overshoot an end
SEES: Final = ("watching", "cleared")  # states of a rule that can trip
LEFT_S: Final = 10.0  # that a value beyond its limit is left to a rule that does not trip
HELD_S: Final = 5.0  # what swings about its limit is one alarm, not one a stride


@dataclass(frozen=True, slots=True)
class FoundBeyond:
    """One value that is, or was just now, beyond its limit; `is_now` is false while it is not known."""

    kind: Kind
    component: str
    quantity: str
    what: str
    is_now: bool = True
    grade: int = 0  # how bad it is
    is_watched: bool = False  # by a rule of the guard, which has not tripped


@dataclass(frozen=True, slots=True)
class Left:
    """One that is left to the guard, since when, and when it was seen last (s)."""

    one: FoundBeyond
    since_s: float
    seen_s: float


Key = tuple[Kind, str, str]
Seen = tuple[FoundBeyond, float | None]  # and since when (s) its value is within again


class Beyond:
    """Finds them in a robot's newest values; one is over once its value was known and within for `HELD_S`."""

    def __init__(self) -> None:
        self._seen: dict[Key, Seen] = {}
        self._left: dict[Key, Left] = {}  # to the guard

    def look(self, robot: Robot, *, is_off: bool = False) -> tuple[FoundBeyond, ...]:
        """Return what is beyond its limit now; what was last known so stays while nothing is known.

        A robot with every drive off (`is_off`) may be laid down; one that has fallen before has still.
        """
        if robot.is_stale() and robot.is_recording:
            return ()
        if robot.is_stale():  # whether the guard says so still nobody knows either
            for key, left in self._left.items():
                self._seen.setdefault(key, (replace(left.one, is_now=False), None))
            return self._of(robot)
        now_s = now_ns() / 1e9
        beyond = {(one.kind, one.component, one.quantity): one for one in _found(robot)}
        found: dict[Key, Seen] = {
            key: (one, None)
            for key, one in beyond.items()
            if key in self._seen
            or not ((is_off and one.kind is Kind.FALLEN) or self._is_left(robot, key, one, now_s))
        }
        self._left = {key: left for key, left in self._left.items() if now_s - left.seen_s < HELD_S}
        if not robot.is_recording:  # whose instant goes to and fro
            kept = {key: _fading(robot, now_s, *seen) for key, seen in self._seen.items()}
            found = {key: seen for key, seen in kept.items() if seen is not None} | found
        self._seen = found
        return self._of(robot)

    def _is_left(self, robot: Robot, key: Key, one: FoundBeyond, now_s: float) -> bool:
        """Return whether its rule is to say so, and still may: some wait for long, or for ever."""
        if not one.is_watched:
            return False
        since_s = self._left[key].since_s if key in self._left else now_s
        self._left[key] = Left(one, since_s, now_s)
        return robot.is_recording or now_s - since_s < LEFT_S

    def _of(self, robot: Robot) -> tuple[FoundBeyond, ...]:
        """Return one of each kind and component: what is known to be so goes before."""
        seen = sorted((one for one, _ in self._seen.values()), key=lambda one: one.is_now)
        one_each = {(one.kind, one.component): one for one in seen if one.component in robot.parts}
        return tuple(one_each.values())


def _fading(robot: Robot, now_s: float, one: FoundBeyond, within_s: float | None) -> Seen | None:
    """Return one that is not seen now, and since when; None once it is over."""
    channel = f"{one.component}.{one.quantity}"
    described = () if robot.description is None else robot.description.channels
    if not any(info.name == channel for info in described):
        return None
    value = robot.values.get(channel)
    is_bounded = one.kind is not Kind.BEYOND or position_ends(robot, one.component, robot.parameters)
    if value is None or not math.isfinite(value) or not is_bounded:
        return replace(one, is_now=False), None
    began_s = now_s if within_s is None or now_s < within_s else within_s
    return None if now_s - began_s >= HELD_S else (replace(one, is_now=True), began_s)


def is_hot(temperature: float | None) -> bool:
    """Return whether a drive or motor is so hot (°C) that it is an alarm."""
    return temperature is not None and temperature >= HOT


def _found(robot: Robot) -> Iterator[FoundBeyond]:
    if TRUNK in robot.names("imu"):  # a thigh leans as far in everybody who sits
        yield from _leaning(robot, TRUNK)
    for name in robot.names("joint"):
        yield from _beyond_an_end(robot, name)
        yield from _hot(robot, name)


def _leaning(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    for quantity, (forward, backward) in LEANING.items():
        tilt = _value(robot, name, quantity)
        watch = None if tilt is None else _watch(robot, name, quantity, tilt, LEANS)
        if tilt is not None and abs(tilt) > LEANS and watch is not Watch.TRIPPED:
            way = forward if tilt > 0 else backward
            what = f"leans {abs(math.degrees(tilt)):.0f}° {way}, further than who walks or stands up"
            yield FoundBeyond(Kind.FALLEN, name, quantity, what, is_watched=watch is Watch.WATCHES)


def _beyond_an_end(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    position, ends = _value(robot, name, "position"), position_ends(robot, name, robot.parameters)
    if position is None or ends is None or ends[0] - SLACK <= position <= ends[1] + SLACK:
        return
    way = position - sum(ends) / 2
    watch = _watch(robot, name, "position", way, (ends[1] if way > 0 else -ends[0]) + SLACK)
    if watch is Watch.TRIPPED:
        return
    at, low, high = (with_minus(f"{math.degrees(angle):.0f}") for angle in (position, *ends))
    what = f"it is at {at}°, its drive's range is {low}° to {high}°"
    yield FoundBeyond(Kind.BEYOND, name, "position", what, is_watched=watch is Watch.WATCHES)


def _hot(robot: Robot, name: str) -> Iterator[FoundBeyond]:
    temperature = _value(robot, name, "temperature")
    if temperature is not None and is_hot(temperature):
        if _watch(robot, name, "temperature", temperature, math.inf) is not Watch.NONE:
            return  # who wrote it knows the drive
        what = f"{temperature:.1f} °C, hot from {HOT:.0f} °C on"
        yield FoundBeyond(Kind.HOT, name, "temperature", what, grade=round(temperature))


def _value(robot: Robot, name: str, quantity: str) -> float | None:
    """Return a value that is known."""
    value = robot.values.get(f"{name}.{quantity}")
    return value if value is not None and math.isfinite(value) else None


class Watch(Enum):
    """What the guard does about a value."""

    NONE = "nothing, as far as is known"
    WATCHES = "a rule of it has a limit there"
    TRIPPED = "that rule has said so"


def _watch(robot: Robot, name: str, quantity: str, way: float, within: float) -> Watch:
    """Return it for a limit on this side (up: `way` above 0), no further out than `within`.

    One that does not run, or a rule that is blind or whose state nobody knows, watches nothing.
    """
    guard = None if robot.description is None else robot.description.guard
    if guard is None or not guard.configured or guard.problem is not None:
        return Watch.NONE
    found = Watch.NONE
    for rule in guard.rules:
        limit = rule.high if way > 0 else None if rule.low is None else -rule.low
        if name not in rule.on or quantity not in rule.quantities or limit is None or limit > within:
            continue
        state = _state(robot, rule)
        if state == "tripped":
            return Watch.TRIPPED
        found = Watch.WATCHES if state in SEES else found
    return found


def _state(robot: Robot, rule: GuardRuleInfo) -> str | None:
    """Return how a rule is now; of a guard without channels, how it was as the link came."""
    channel = f"guard.{rule.name}"
    known = () if robot.description is None else robot.description.channels
    return robot.word(channel) if any(one.name == channel for one in known) else rule.state
