"""TPDO mappings, read from the device itself (CiA 301 §7.5.2.35, §7.5.2.37)."""

from collections.abc import Iterable
from dataclasses import dataclass

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError
from eds import Description

TPDO_PARAMETER, TPDO_MAPPING = 0x1800, 0x1A00
MAX_TPDOS = 512
USUAL_TPDOS = 4  # tried where the EDS names none
NOT_VALID = 0x8000_0000  # in a COB-ID
EXTENDED_ID = 0x2000_0000
_MAX_ENTRIES = 64
_MULTIPLEXED = (0xFE, 0xFF)  # MPDO: the number of entries says so


@dataclass(frozen=True, slots=True)
class MappedObject:
    """One entry of a mapping: `bits` long, beginning at bit `at` of the frame."""

    index: int
    subindex: int
    bits: int
    at: int


@dataclass(frozen=True, slots=True)
class Tpdo:
    """One transmit PDO of a device, as it is configured now."""

    number: int  # 1 … 512
    cob_id: int  # 11 or 29 bits
    extended: bool
    enabled: bool
    transmission_type: int  # 0–240 on SYNC, 252/253 on request, 254/255 on event
    event_timer_s: float  # 0: only when something changes
    objects: tuple[MappedObject, ...]
    multiplexed: bool = False  # an MPDO: each frame says what it brings

    @property
    def empty(self) -> bool:
        """Whether it is enabled and brings nothing."""
        return self.enabled and not self.objects and not self.multiplexed

    @property
    def size(self) -> int:
        """Bytes that a frame has at least."""
        return (sum(mapped.bits for mapped in self.objects) + 7) // 8

    @property
    def trigger(self) -> str:
        """The trigger of its sending, in words."""
        if self.transmission_type <= 240:
            return "on SYNC"
        if self.transmission_type in (252, 253):
            return "on request"
        return f"every {self.event_timer_s:g} s" if self.event_timer_s else "when it changes"

    @property
    def cyclic(self) -> bool:
        """Whether it comes also while nothing changes."""
        return 1 <= self.transmission_type <= 240 or (
            self.transmission_type >= 254 and self.event_timer_s > 0
        )


def read_tpdos(sdo: SdoChannel, description: Description) -> tuple[Tpdo, ...]:
    """Return every TPDO that the device has, enabled or not; raises `DriverError`."""
    return tuple(
        tpdo for number in _numbers(description) if (tpdo := read_tpdo(sdo, description, number)) is not None
    )


def _numbers(description: Description) -> Iterable[int]:
    known = [n for n in range(MAX_TPDOS) if TPDO_PARAMETER + n in description.object_dictionary]
    return known or range(USUAL_TPDOS)


def read_tpdo(sdo: SdoChannel, description: Description | None, number: int) -> Tpdo | None:
    """Return the TPDO at 1800h + `number`; `None` where the device has none. Raises `DriverError`.

    Without a description the device itself says what it has.
    """
    parameter, mapping = TPDO_PARAMETER + number, TPDO_MAPPING + number
    try:
        cob_id = unsigned(sdo.upload(parameter, 1))
    except DeviceAbort:
        return None  # the EDS knows it, this device does not
    enabled = not cob_id & NOT_VALID and cob_id & 0x1FFF_FFFF != 0  # 0 is NMT's: nobody has set it
    transmission_type = unsigned(sdo.upload(parameter, 2)[:1])
    extended = bool(cob_id & EXTENDED_ID)
    mapped = _read_entries(sdo, mapping) if enabled else ()
    return Tpdo(
        number=number + 1,
        cob_id=cob_id & (0x1FFF_FFFF if extended else 0x7FF),
        extended=extended,
        enabled=enabled,
        transmission_type=transmission_type,
        event_timer_s=_event_timer_s(sdo, description, parameter) if transmission_type >= 254 else 0,
        objects=mapped or (),
        multiplexed=mapped is None,
    )


def _event_timer_s(sdo: SdoChannel, description: Description | None, parameter: int) -> float:
    if description is not None and not description.has(parameter, 5):
        return 0
    try:
        return unsigned(sdo.upload(parameter, 5)[:2]) / 1000
    except DeviceAbort:
        return 0


def read_mapping(sdo: SdoChannel, mapping: int) -> tuple[MappedObject, ...]:
    """Return the objects of a PDO, by the index of its mapping parameter; raises `DriverError`."""
    return _read_entries(sdo, mapping) or ()


def _read_entries(sdo: SdoChannel, mapping: int) -> tuple[MappedObject, ...] | None:
    """Return the same; `None` for an MPDO, which has no mapping of its own."""
    count = unsigned(sdo.upload(mapping, 0)[:1])
    if count in _MULTIPLEXED:
        return None
    objects: list[MappedObject] = []
    at = 0
    for subindex in range(1, min(count, _MAX_ENTRIES) + 1):
        entry = unsigned(sdo.upload(mapping, subindex))
        objects.append(MappedObject(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF, at))
        at += entry & 0xFF
    if at > 64:
        raise DriverError(
            f"{sdo.label}: 0x{mapping:04X} maps {at} bits, more than a frame holds: "
            "correct the device's mapping"
        )
    return tuple(objects)
