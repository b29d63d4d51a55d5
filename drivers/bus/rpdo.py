"""RPDO mappings of a device, and frames for them (CiA 301 §7.5.2.33, §7.5.2.35)."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from drivers.bus.frames import EXTENDED
from drivers.bus.pdo import EXTENDED_ID, NOT_VALID, MappedObject, read_mapping
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort
from eds import Description

RPDO_PARAMETER, RPDO_MAPPING = 0x1400, 0x1600
MAX_RPDOS = 512
_SYNCHRONOUS = range(241)
_ASYNCHRONOUS = (254, 255)
_FIRST_REAL_OBJECT = 0x20  # below are dummy entries: data types that only take room


@dataclass(frozen=True, slots=True)
class Rpdo:
    """One receive PDO of a device, valid, as it is configured now."""

    can_id: int
    transmission_type: int  # 0–240: takes effect on SYNC; 254, 255: at once
    objects: tuple[MappedObject, ...]

    def takes_effect(self, *, our_sync: bool) -> bool:
        """Return whether a frame of ours is certain to act: at once, or at the next SYNC, which is ours."""
        return self.transmission_type in _ASYNCHRONOUS or (
            our_sync and self.transmission_type in _SYNCHRONOUS
        )

    def frame(self, values: Mapping[tuple[int, int], bytes]) -> bytes:
        """Return the data of a frame with these values of its objects."""
        packed = 0
        for mapped in self.objects:
            value = unsigned(values.get((mapped.index, mapped.subindex), b""))
            packed |= (value & (1 << mapped.bits) - 1) << mapped.at
        return packed.to_bytes((sum(mapped.bits for mapped in self.objects) + 7) // 8, "little")


def find_rpdo(sdo: SdoChannel, description: Description, index: int) -> tuple[Rpdo, ...]:
    """Return every valid RPDO that carries the object `index`; raises `DriverError`."""
    return tuple(
        rpdo for rpdo in _read_all(sdo, description) if any(one.index == index for one in rpdo.objects)
    )


def read_values(sdo: SdoChannel, rpdo: Rpdo) -> dict[tuple[int, int], bytes]:
    """Return the device's values of the objects in an RPDO; raises `DriverError`."""
    return {
        (one.index, one.subindex): sdo.upload(one.index, one.subindex)
        for one in rpdo.objects
        if one.index >= _FIRST_REAL_OBJECT
    }


def _read_all(sdo: SdoChannel, description: Description) -> Iterator[Rpdo]:
    for number in range(MAX_RPDOS):
        if RPDO_PARAMETER + number not in description.object_dictionary:
            continue
        try:
            cob_id = unsigned(sdo.upload(RPDO_PARAMETER + number, 1))
        except DeviceAbort:
            continue  # the EDS knows it, this device does not
        if not cob_id & NOT_VALID:
            kind = unsigned(sdo.upload(RPDO_PARAMETER + number, 2)[:1])
            yield Rpdo(identifier(cob_id), kind, read_mapping(sdo, RPDO_MAPPING + number))


def identifier(cob_id: int) -> int:
    """Return it as a frame has it, of a PDO's COB-ID (1400h:1, 1800h:1)."""
    return cob_id & 0x1FFF_FFFF | EXTENDED if cob_id & EXTENDED_ID else cob_id & 0x7FF
