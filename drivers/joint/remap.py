"""Brings position and statusword into a TPDO, where `configure_pdos = true` allows it.

Only a TPDO that is disabled, or enabled and empty, is taken: another master may live on the others. What is
written is read back; nothing is stored in the device, and a device that refuses keeps that TPDO as it was.
"""

import contextlib
from collections.abc import Collection

from drivers.bus.pdo import TPDO_MAPPING, TPDO_PARAMETER, Tpdo, read_tpdo
from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import DeviceAbort, Mismatch
from eds import Description

_NOT_VALID, _NO_REMOTE = 0x8000_0000, 0x4000_0000
_EVENT, _ON_SYNC = 255, 1
EVENT_TIMER_MS = 10
_BASES = (0x180, 0x280, 0x380, 0x480)  # COB-IDs of TPDO1–4 in the predefined connection set

ENTRIES = ((0x6041, 16), (0x6064, 32))  # statusword, position


def free_tpdo(tpdos: Collection[Tpdo], node_id: int, taken: Collection[int]) -> tuple[Tpdo, int] | None:
    """A TPDO that brings nothing, and the identifier it can have; a disabled one rather than an empty one.

    `None` where there is none that is surely nobody's.
    """
    for tpdo in sorted((one for one in tpdos if not one.enabled or one.empty), key=lambda one: one.enabled):
        others = {one.cob_id for one in tpdos if one.enabled and one is not tpdo}
        usual = _BASES[tpdo.number - 1] + node_id if tpdo.number <= len(_BASES) else 0
        cob_id = tpdo.cob_id or usual
        if not tpdo.extended and cob_id and cob_id not in others | set(taken):
            return tpdo, cob_id
    return None


def remap(sdo: SdoChannel, description: Description, tpdo: Tpdo, cob_id: int, axis_offset: int) -> str:
    """Map statusword and position into `tpdo`; returns what was done, in words.

    Raises `DeviceAbort` where the device refuses, `Mismatch` where it then holds something else, and
    `DeviceTimeout` or `Unavailable` where it is silent.
    """
    number = tpdo.number - 1
    parameter, mapping = TPDO_PARAMETER + number, TPDO_MAPPING + number
    _write(sdo, parameter, 1, cob_id | _NOT_VALID | _NO_REMOTE, 4)
    _write(sdo, mapping, 0, 0, 1)
    for subindex, (index, bits) in enumerate(ENTRIES, start=1):
        _write(sdo, mapping, subindex, (index + axis_offset) << 16 | bits, 4)
    _write(sdo, mapping, 0, len(ENTRIES), 1)
    timed = description.has(parameter, 5) and _takes_timer(sdo, parameter)
    _write(sdo, parameter, 2, _EVENT if timed else _ON_SYNC, 1)
    _write(sdo, parameter, 1, cob_id | _NO_REMOTE, 4)
    _verify(sdo, description, number, cob_id, axis_offset)
    how = f"every {EVENT_TIMER_MS} ms" if timed else "on SYNC"
    return f"TPDO{tpdo.number} (0x{cob_id:03X}) was given statusword and position, sent {how}"


def _write(sdo: SdoChannel, index: int, subindex: int, value: int, size: int) -> None:
    sdo.download(index, subindex, value.to_bytes(size, "little"))


def _takes_timer(sdo: SdoChannel, parameter: int) -> bool:
    """Whether the device sends by a timer; many know the object from their EDS only."""
    try:
        _write(sdo, parameter, 5, EVENT_TIMER_MS, 2)
    except DeviceAbort:
        return False
    return True


def _verify(sdo: SdoChannel, description: Description, number: int, cob_id: int, axis_offset: int) -> None:
    found = read_tpdo(sdo, description, number)
    wanted = [(index + axis_offset, 0, bits) for index, bits in ENTRIES]
    if found is None or not found.enabled or found.cob_id != cob_id:
        raise Mismatch(
            f"{sdo.label}: 0x{TPDO_PARAMETER + number:04X}:01 was written and is not what it holds"
        )
    if [(mapped.index, mapped.subindex, mapped.bits) for mapped in found.objects] != wanted:
        raise Mismatch(f"{sdo.label}: 0x{TPDO_MAPPING + number:04X} was written and is not what it holds")


def put_back(sdo: SdoChannel, description: Description, tpdo: Tpdo, cob_id: int) -> None:
    """Leave a TPDO that could not be mapped as it was; one that refuses that too keeps what it has."""
    number = tpdo.number - 1
    parameter, mapping = TPDO_PARAMETER + number, TPDO_MAPPING + number
    steps = [(parameter, 1, cob_id | _NOT_VALID | _NO_REMOTE, 4)]
    if tpdo.empty:
        timer = [(parameter, 5, round(tpdo.event_timer_s * 1000), 2)] if description.has(parameter, 5) else []
        steps += [(mapping, 0, 0, 1), (parameter, 2, tpdo.transmission_type, 1), *timer]
        steps += [(parameter, 1, cob_id | _NO_REMOTE, 4)]
    for step in steps:
        with contextlib.suppress(DeviceAbort):
            _write(sdo, *step)
