"""One parameter of several joints: the same value for all, or what mirrors one side on the other.

Angles of joints count the same way on both sides (flexion is positive), but a drive's own counts may not:
they fall on one side where they rise on the other. So what a parameter is decides how it is carried over:

- What has no sign (a gain, a largest torque, a speed) is copied.
- Limits of position, which a drive has in its counts, are carried over as the joint's angle. Where counts run
  the other way the lower limit of one side is the upper one of the other.
- Limits of torque in the drive's positive and its negative direction change places there likewise.
- All else that can be negative is copied only where the counts of both run the same way.
- What a drive takes in counts (a profile's speed, a following error) is copied only where a count is as much.
- What a maker has put in objects of its own (2000h to 5FFFh) is copied only between devices of one kind.
- What makes a joint's counts what they are (polarity, gear, homing) belongs to that joint alone.

What cannot be carried over is refused with a reason, joint by joint.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from msgspec import UNSET

from gateway.coding import Limit, Number, broken_limit, coding_of, text
from gateway.wire.component import AngleInfo
from gateway.wire.parameter import ParameterInfo, ParameterValue
from gateway.wire.robot import Description

Held = Mapping[str, ParameterValue]
Object = tuple[int, int]

SIDES: Final = ("left", "right")
JOINT: Final = "joint"
UNSURE: Final = ("device_timeout", "mismatch")  # refusals of a store after which nobody knows
FIRST_OF_PROFILE, AXIS, LAST_OF_PROFILE = 0x6000, 0x800, 0x9FFF  # CiA 402: axes of a drive lie so far apart
OF_MAKER: Final = range(0x2000, 0x6000)  # CiA 301: what each maker fills as it likes

# Pairs that change places where counts run the other way (CiA 402-2).
_POSITIONS: Final[Mapping[Object, Object]] = {
    (0x607D, 1): (0x607D, 2),  # software position limit
    (0x607D, 2): (0x607D, 1),
    (0x607B, 1): (0x607B, 2),  # position range limit
    (0x607B, 2): (0x607B, 1),
}
_TORQUES: Final[Mapping[Object, Object]] = {
    (0x60E0, 0): (0x60E1, 0),  # positive, negative torque limit
    (0x60E1, 0): (0x60E0, 0),
}
_OWN: Final[Mapping[int, str]] = {
    0x607C: "a home offset belongs to where that joint's own encoder counts from",
    0x6064: "a position is no setting",
    0x607A: "a target is no setting",
    0x6071: "a target is no setting",
    0x60FF: "a target is no setting",
    0x607E: "the polarity is what turns that drive's own counts",
    0x6098: "a homing method names the end of that drive's own counts",
    0x608F: "it says what a count of that drive is",
    0x6090: "it says what a count of that drive is",
    0x6091: "it says what a count of that drive is",
    0x6092: "it says what a count of that drive is",
}
# In counts of position, or in counts a second or a second², unless the robot's file gives them a unit.
_IN_COUNTS: Final = frozenset((
    0x6065, 0x6067, 0x606D, 0x606F, 0x607F, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6099, 0x609A, 0x60A4,
    0x60B0, 0x60B1, 0x60C5, 0x60C6,
))  # fmt: skip
_BROKEN: Final[Mapping[Limit, str]] = {
    Limit.MIN: "{value} is below the smallest allowed there, {limit}",
    Limit.MAX: "{value} is above the largest allowed there, {limit}",
    Limit.MAX_STEP: "{value} is further from {held} than one write may go there, {limit}: take two steps",
}


@dataclass(frozen=True, slots=True)
class Spread:
    """The values to write, by parameter; and by joint the reason, if it is left out."""

    changes: Mapping[str, Number]
    refused: Mapping[str, str]

    def without(self, left_out: Collection[str]) -> "Spread":
        """Return the same for those who leave these joints out, by word."""
        return Spread(
            {name: value for name, value in self.changes.items() if name.partition(".")[0] not in left_out},
            {joint: why for joint, why in self.refused.items() if joint not in left_out},
        )

    @property
    def problem(self) -> str:
        """Why nothing is to be written; empty where nothing speaks against it."""
        return "; ".join(f"{joint}: {why}" for joint, why in self.refused.items())


def other_side(component: str) -> str | None:
    """Return the name of the counterpart on the other side of the body."""
    side, _, rest = component.partition("_")
    return f"{SIDES[1 - SIDES.index(side)]}_{rest}" if side in SIDES and rest else None


def all_joints(description: Description) -> list[str]:
    """Return every joint of the robot, in its order, whether its drive is there or not."""
    return [one.name for one in description.components if one.kind == JOINT]


def mirrored(source: str, description: Description) -> list[str]:
    """Return the joint and its counterpart; itself alone where there is none."""
    known = {one.name for one in description.components}
    return [source, *([other] if (other := other_side(source)) in known else [])]


def spread(name: str, value: Number, joints: Iterable[str], description: Description, held: Held) -> Spread:
    """Return how these joints come to what `name` is to be: `value`, in its own unit.

    `held` is what the robot holds now, as far as it is known: how far one write may go follows from it.
    """
    work = _Spreading(description, held)
    changes: dict[str, Number] = {}
    refused: dict[str, str] = {}
    source = work.known.get(name)
    for joint in joints:
        if source is None:
            refused[joint] = f"the robot has no parameter {name} that can be changed"
            continue
        try:
            target, wanted = work.carried(source, value, joint)
        except _Refused as error:
            refused[joint] = str(error)
            continue
        changes[target.name] = wanted
    return Spread(changes, refused)


class _Refused(Exception):
    """A joint that the value cannot be carried over to; says why."""


class _Spreading:
    def __init__(self, description: Description, held: Held) -> None:
        self.known = {one.name: one for one in description.parameters if one.read_only is None}
        self._read_only = {one.name: one.read_only for one in description.parameters}
        self._parts = {one.name: one for one in description.components}
        self._held = held

    def carried(self, source: ParameterInfo, value: Number, joint: str) -> tuple[ParameterInfo, Number]:
        """Return the joint's parameter and its value; raises `_Refused`."""
        if joint == source.component:
            self._check(source, value)
            return source, value
        place = _place(source.object)
        if place[0] in _OWN:
            raise _Refused(_OWN[place[0]])
        if place in _POSITIONS:
            return self._angle(source, value, joint, place)
        turned = self._is_turned(source.component, joint)
        if place in _TORQUES:
            if turned is None:
                raise _Refused(_UNKNOWN_WAY)
            target = self._target(source, joint, _TORQUES[place] if turned else place)
        else:
            target = self._target(source, joint, place)
            if not _has_no_sign(source, target):
                self._check_way(source, target, turned)
        if target.unit != source.unit:
            raise _Refused(f"{target.name} is in {target.unit or 'counts'}, {source.name} is not")
        if not source.unit and place[0] in _IN_COUNTS:
            self._check_counts(source.component, joint)
        self._check(target, value)
        return target, value

    def _check_counts(self, source: str, joint: str) -> None:
        """Check that a count is as much of an angle at both."""
        here, there = self._angle_of(source), self._angle_of(joint)
        if here is None or there is None:
            raise _Refused("it is in counts, and the robot does not tell how much a count is at both")
        if not math.isclose(abs(here.rad_per_count), abs(there.rad_per_count), rel_tol=1e-6):
            raise _Refused("it is in counts, and a count is another angle there")

    @staticmethod
    def _check_way(source: ParameterInfo, target: ParameterInfo, turned: bool | None) -> None:
        """Check that a sign means the same there; a negative scale turns it back."""
        if turned is None:
            raise _Refused(_UNKNOWN_WAY)
        if turned != (source.scale * target.scale < 0.0):
            raise _Refused(_TURNED)

    def _angle(
        self, source: ParameterInfo, value: Number, joint: str, place: Object
    ) -> tuple[ParameterInfo, Number]:
        """Return a limit of position, as the same angle of the joint."""
        here, there = self._angle_of(source.component), self._angle_of(joint)
        if here is None or there is None:
            raise _Refused(_UNKNOWN_WAY)
        turned = here.rad_per_count * there.rad_per_count < 0.0
        target = self._target(source, joint, _POSITIONS[place] if turned else place)
        angle = here.rad_per_count * (value / source.scale) + here.zero_offset
        counts = round((angle - there.zero_offset) / there.rad_per_count)
        wanted = counts if target.scale == 1 else float(f"{counts * target.scale:.15g}")
        self._check(target, wanted)
        return target, wanted

    def _target(self, source: ParameterInfo, joint: str, place: Object) -> ParameterInfo:
        if joint not in self._parts:
            raise _Refused("the robot has no such joint")
        quantity = source.name.partition(".")[2]
        named = self.known.get(f"{joint}.{quantity}")
        means_the_same = place[0] not in OF_MAKER or self._are_of_a_kind(source.component, joint)
        if named is not None and (
            (means_the_same and _place(named.object) == place) or _is_same_by_name(source, named)
        ):
            return named
        for one in self.known.values() if means_the_same else ():
            if one.component == joint and _place(one.object) == place:
                return one
        if self._read_only.get(f"{joint}.{quantity}") is not None:
            raise _Refused(f"{joint}.{quantity} cannot be changed: {self._read_only[f'{joint}.{quantity}']}")
        if not means_the_same:
            raise _Refused(
                f"{source.object} is its maker's own object, nothing tells that it means the same there, "
                "and both have no unit and name in common"
            )
        if named is not None:
            raise _Refused(
                f"{named.name} is another object there ({named.object}, not {source.object}), without a unit"
            )
        why = self._parts[joint].problem
        raise _Refused(f"it has no {quantity} (object {source.object})" + (f": {why}" if why else ""))

    def _check(self, target: ParameterInfo, value: Number) -> None:
        if target.problem is not None:
            raise _Refused(target.problem)
        now = self._held.get(target.name)
        before = None if now is None else now.value
        broken = broken_limit(target, coding_of(target.type, target.scale), value, before)
        if broken is not None:
            unit = f" {target.unit}".rstrip()
            said = _BROKEN[broken].format(
                value=text(value) + unit,
                limit=text(getattr(target, broken)) + unit,
                held=None if before is None else text(before) + unit,
            )
            raise _Refused(said)

    def _is_turned(self, one: str, other: str) -> bool | None:
        """Return whether the counts of two joints run opposite ways; None if nobody says."""
        here, there = self._angle_of(one), self._angle_of(other)
        return None if here is None or there is None else here.rad_per_count * there.rad_per_count < 0.0

    def _are_of_a_kind(self, *joints: str) -> bool:
        """Return whether maker-specific objects are the same: one EDS, or one product."""
        parts = (self._parts.get(joint) for joint in joints)
        one, other = (
            part.device if part is not None and isinstance(part.device, dict) else {} for part in parts
        )
        same = [bool(one.get(key)) and one.get(key) == other.get(key) for key in _KIND]
        return same[0] or all(same[1:])

    def _angle_of(self, joint: str) -> AngleInfo | None:
        part = self._parts.get(joint)
        return None if part is None or part.angle is UNSET or not part.angle.rad_per_count else part.angle


_KIND: Final = ("eds_digest", "vendor", "product")
_UNKNOWN_WAY: Final = "it may be negative, and the robot does not tell which way that joint's counts run"
_TURNED: Final = (
    "it may be negative, its counts run the other way, and nothing says whether its sign turns with them"
)


def _place(address: str) -> Object:
    """Return index and subindex, as of the first axis of a drive."""
    index, _, subindex = address.partition(":")
    number = int(index, 16)
    if FIRST_OF_PROFILE <= number <= LAST_OF_PROFILE:
        number = FIRST_OF_PROFILE + (number - FIRST_OF_PROFILE) % AXIS
    return number, int(subindex or "0")


def _has_no_sign(*infos: ParameterInfo) -> bool:
    """Return whether no value of these can be negative."""
    return all(_is_unsigned(one) or (one.min is not None and one.min >= 0) for one in infos)


def _is_same_by_name(one: ParameterInfo, other: ParameterInfo) -> bool:
    """Return whether the robot's file names two drives' objects alike, in one unit: then they are."""
    swapped = {**_POSITIONS, **_TORQUES}
    return (
        bool(one.unit)
        and one.unit == other.unit
        and not {_place(one.object), _place(other.object)} & {*swapped}
    )


def _is_unsigned(info: ParameterInfo) -> bool:
    return info.type.startswith("UNSIGNED") or info.type == "BOOLEAN"


def devices(description: Description) -> dict[str, tuple[object, object]]:
    """Return the device of each component, by bus and node: axes of one node store together."""
    found: dict[str, tuple[object, object]] = {}
    for part in description.components:
        about = part.device if isinstance(part.device, dict) else {}
        known = "bus" in about and "node_id" in about
        found[part.name] = (about["bus"], about["node_id"]) if known else (None, part.name)
    return found


class StoreOutcome(StrEnum):
    """Result of a device that was asked to store."""

    STORED = "stored"
    REFUSED = "refused"
    UNKNOWN = "NOT CONFIRMED"  # nobody knows what its flash holds now
    UNASKED = "not asked"  # the link was lost before


def refused_or_unknown(kind: str | None) -> StoreOutcome:
    """Return the state of a device's flash after a refusal of this kind."""
    return StoreOutcome.UNKNOWN if kind in UNSURE else StoreOutcome.REFUSED


def storing(description: Description) -> Iterator[tuple[str, ...]]:
    """Yield the components of each device whose EDS has the command to store, in the robot's order."""
    device_of = devices(description)
    can = dict.fromkeys(device_of.get(info.component) for info in description.parameters if info.store)
    for device in can:
        if device is not None:
            yield tuple(name for name, place in device_of.items() if place == device)
