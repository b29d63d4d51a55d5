"""A CiA 410 inclinometer's slopes, and their conversion to the direction of up."""

import math
from dataclasses import dataclass

from drivers.bus.pdo import MappedObject, Tpdo, read_tpdos
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError
from drivers.imu.frame import ImuFrame
from drivers.imu.rotation import Vector
from eds import Description

RESOLUTION = 0x6000  # of every slope: counts of this many times 0.001°
MILLIDEGREE = math.radians(0.001)
INVERTED, SHIFTED = 0x01, 0x02  # operating parameter
SHORT_RANGE = math.radians(45.0)  # slopes that end before this are too short for a trunk


@dataclass(frozen=True, slots=True)
class SlopePair:
    """Longitudinal and lateral slope in one width."""

    objects: tuple[int, int]
    bits: int

    @property
    def parameters(self) -> tuple[int, int]:
        """Their operating parameters."""
        return self.objects[0] + 1, self.objects[1] + 1


PAIRS = (SlopePair((0x6110, 0x6120), 32), SlopePair((0x6010, 0x6020), 16))  # the wider range first
AXES = ("longitudinal", "lateral")


@dataclass(frozen=True, slots=True)
class MappedSlope:
    """Place of a slope in a TPDO."""

    axis: int  # 0 longitudinal, 1 lateral
    place: MappedObject

    def counts(self, data: bytes) -> int:
        raw = int.from_bytes(data, "little") >> self.place.at & (1 << self.place.bits) - 1
        return raw - (1 << self.place.bits) if raw >> (self.place.bits - 1) else raw


@dataclass(frozen=True, slots=True)
class SlopePlan:
    """Sources of the slopes, and notes for the integrator."""

    pair: SlopePair
    radians_per_count: float
    tpdos: tuple[tuple[Tpdo, tuple[MappedSlope, ...]], ...]
    polled: bool  # no TPDO keeps both slopes fresh
    notes: tuple[str, ...]


def has_two_axes(description: Description) -> bool:
    """Return whether the device's file knows both slopes in one width."""
    return any(all(description.has(index, 0) for index in pair.objects) for pair in PAIRS)


def make_plan(sdo: SdoChannel, description: Description, poll_hz: float) -> SlopePlan:
    """Ask the device; raises `DriverError` where it stays silent or is no two-axis inclinometer."""
    resolution = unsigned(sdo.upload(RESOLUTION, 0)[:2])
    if not resolution:
        raise DriverError(f"{sdo.label}: its resolution (6000h) is 0: set it to 1, 10, 100 or 1000")
    enabled = [tpdo for tpdo in read_tpdos(sdo, description) if tpdo.enabled]
    pair, fresh = _chosen(sdo, enabled)
    mapped = tuple((tpdo, places) for tpdo in enabled if (places := _slopes_in(tpdo, pair)))
    notes = [*_range_notes(pair, resolution), *_parameter_notes(sdo, description, pair)]
    if not fresh:
        how = f"asked by SDO at {poll_hz:g} Hz" if poll_hz else "not asked for (poll_hz is 0)"
        why = "what brings them comes only when they change" if mapped else "no enabled TPDO carries them"
        notes.append(f"its slopes are {how}, because {why}")
    return SlopePlan(pair, resolution * MILLIDEGREE, mapped, not fresh, tuple(notes))


def up(longitudinal: float, lateral: float, directions: tuple[int, int]) -> Vector:
    """Return up in the sensor's axes, from the angles of its x and y axis to the horizon."""
    x = -directions[0] * math.sin(longitudinal)
    y = -directions[1] * math.sin(lateral)
    z = math.sqrt(max(0.0, 1.0 - x * x - y * y))
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


def frame(longitudinal: float, lateral: float, directions: tuple[int, int]) -> ImuFrame:
    """Return the frame of two slopes (rad)."""
    return ImuFrame("slopes", up=up(longitudinal, lateral, directions))


def _chosen(sdo: SdoChannel, enabled: list[Tpdo]) -> tuple[SlopePair, bool]:
    """Return the pair to read, and whether TPDOs keep it fresh.

    Else one that they bring, else one that answers.
    """
    for tpdos, fresh in (([one for one in enabled if one.cyclic], True), (enabled, False)):
        for pair in PAIRS:
            if set(pair.objects) <= {place.index for tpdo in tpdos for place in tpdo.objects}:
                return pair, fresh
    for pair in PAIRS[:-1]:
        try:
            for index in pair.objects:
                sdo.upload(index, 0)
        except DeviceAbort:
            continue
        return pair, False
    return PAIRS[-1], False


def _slopes_in(tpdo: Tpdo, pair: SlopePair) -> tuple[MappedSlope, ...]:
    return tuple(
        MappedSlope(pair.objects.index(place.index), place)
        for place in tpdo.objects
        if place.index in pair.objects and place.bits == pair.bits
    )


def _range_notes(pair: SlopePair, resolution: int) -> list[str]:
    end = (1 << pair.bits - 1) * resolution * MILLIDEGREE
    if end > SHORT_RANGE:
        return []
    return [f"its 16-bit slopes end at {math.degrees(end):.1f}°: set its resolution (6000h) to 10"]


def _parameter_notes(sdo: SdoChannel, description: Description, pair: SlopePair) -> list[str]:
    notes = []
    for axis, index in zip(AXES, pair.parameters, strict=True):
        try:
            parameter = unsigned(sdo.upload(index, 0)[:1]) if description.has(index, 0) else 0
        except DeviceAbort:
            continue
        if parameter & INVERTED:
            notes.append(f"the device inverts its {axis} slope ({index:04X}h)")
        if parameter & SHIFTED:
            notes.append(f"the device adds an offset of its own to its {axis} slope ({index:04X}h)")
    return notes
