"""Brings what a joint's channels need into TPDOs, where `configure_pdos = true` allows it.

Only a TPDO that is disabled, or enabled and empty, is taken: another master may live on the others. Position
and statusword come first; what else there is room for follows, in further frames that come more seldom. What
is written is read back, and nothing is stored. A device that refuses has that TPDO as it was before.
"""

import contextlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

from drivers.bus.pdo import NOT_VALID, TPDO_MAPPING, TPDO_PARAMETER, Tpdo, read_tpdo
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DeviceTimeout, Mismatch
from drivers.joint.plan import MIN_BITS
from drivers.joint.quantities import Quantity
from eds import Description
from eds.datatypes import DATA_TYPES

_NO_REMOTE = 0x4000_0000
_EVENT = 255
EVENT_TIMER_MS, SELDOM_MS = 10, 50
_SYNC_MS = 10  # of a master whose period nobody knows: every SYNC, every fifth one
_BASES = (0x180, 0x280, 0x380, 0x480)  # COB-IDs of TPDO1–4 in the predefined connection set
FRAME_BITS = 64
_MAX_ENTRIES = 64
FRAMES = 3  # that are taken at most


@dataclass(frozen=True, slots=True)
class Entry:
    """An object that is to be mapped."""

    name: str
    index: int
    subindex: int
    bits: int

    @property
    def raw(self) -> int:
        return self.index << 16 | self.subindex << 8 | self.bits


def mappable(description: Description, wanted: Iterable[Quantity]) -> Iterator[Entry]:
    """Yield those that may come by themselves, as the EDS says."""
    for one in wanted:
        variable = description.variable(one.index, one.subindex)
        data_type = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
        bits = None if data_type is None else data_type.bits
        if variable is not None and variable.pdo_mappable and bits is not None and bits >= MIN_BITS:
            yield Entry(one.name, one.index, one.subindex, bits)


Free = tuple[Tpdo, int]  # and the identifier that it can have
_Write = tuple[int, int, bytes]  # index, sub-index, data


def needed(axis_offset: int) -> tuple[Entry, ...]:
    """Without these a joint is not known."""
    return (
        Entry("statusword", 0x6041 + axis_offset, 0, 16),
        Entry("position", 0x6064 + axis_offset, 0, 32),
    )


def free_tpdos(tpdos: Collection[Tpdo], node_id: int, taken: Collection[int]) -> Iterator[Free]:
    """TPDOs that bring nothing and are surely nobody's; a disabled one rather than an empty one."""
    used = {one.cob_id for one in tpdos if one.enabled and not one.empty} | set(taken)
    for tpdo in sorted((one for one in tpdos if not one.enabled or one.empty), key=lambda one: one.enabled):
        others = {one.cob_id for one in tpdos if one.enabled and one is not tpdo}
        usual = _BASES[tpdo.number - 1] + node_id if tpdo.number <= len(_BASES) else 0
        cob_id = tpdo.cob_id or usual
        if not tpdo.extended and cob_id and cob_id not in others | used:
            used.add(cob_id)
            yield tpdo, cob_id


def frames(first: Sequence[Entry], more: Sequence[Entry]) -> Iterator[tuple[Entry, ...]]:
    """Yield the objects of each frame: `first` with all that fits beside it, then the rest, in its order."""
    left, frame = list(more), list(first)
    while frame:
        for one in list(left):
            if sum(entry.bits for entry in (*frame, one)) <= FRAME_BITS:
                frame.append(one)
                left.remove(one)
        yield tuple(frame)
        frame = left[:1]
        left = left[1:]


def remap(
    sdo: SdoChannel, description: Description, free: Sequence[Free], axis_offset: int, more: Sequence[Entry]
) -> str:
    """Map position and statusword, and what of `more` there is room for; returns what was done, in words.

    Raises `DeviceAbort` where the device refuses the first two, `Mismatch` where it then holds something
    else, and `DeviceTimeout` or `Unavailable` where it is silent.
    """
    first = needed(axis_offset)
    whole = list(frames(first, more))[:FRAMES]
    try:
        done = [_map(sdo, description, free[0], whole[0], EVENT_TIMER_MS)]
    except (DeviceAbort, Mismatch):
        done = [_map(sdo, description, free[0], first, EVENT_TIMER_MS)]
    for one, entries in zip(free[1:], whole[1:], strict=False):
        try:
            done.append(_map(sdo, description, one, entries, SELDOM_MS))
        except (DeviceAbort, Mismatch) as error:
            done.append(f"TPDO{one[0].number} is as it was: {error}")
    return "; ".join(done)


def _map(sdo: SdoChannel, description: Description, free: Free, entries: Sequence[Entry], ms: int) -> str:
    """One TPDO; where that fails it is as it was."""
    tpdo, cob_id = free
    before = _as_it_is(sdo, description, tpdo)
    try:
        how = _write_all(sdo, description, tpdo, cob_id, entries, ms)
        _verify(sdo, description, tpdo, cob_id, entries)
    except (DeviceAbort, Mismatch, DeviceTimeout):
        for step in before:
            with contextlib.suppress(DeviceAbort):
                sdo.download(*step)
        raise
    *names, last = (entry.name for entry in entries)
    given = f"{', '.join(names)} and {last}" if names else last
    return f"TPDO{tpdo.number} (0x{cob_id:03X}) was given {given}, sent {how}"


def _as_it_is(sdo: SdoChannel, description: Description, tpdo: Tpdo) -> list[_Write]:
    """Return the writes that restore the TPDO, in their order (CiA 301 §7.5.2.36)."""
    parameter, mapping = TPDO_PARAMETER + tpdo.number - 1, TPDO_MAPPING + tpdo.number - 1
    cob_id = sdo.upload(parameter, 1)
    count = sdo.upload(mapping, 0)[:1]
    entries = range(1, count[0] + 1) if count[0] <= _MAX_ENTRIES else ()
    held = [(mapping, number, _upload(sdo, mapping, number)) for number in entries]
    timer = _upload(sdo, parameter, 5) if description.has(parameter, 5) else None
    steps: list[tuple[int, int, bytes | None]] = [
        (parameter, 1, (unsigned(cob_id) | NOT_VALID).to_bytes(4, "little")),
        (mapping, 0, b"\0"),
        *held,
        (mapping, 0, count),
        (parameter, 2, sdo.upload(parameter, 2)[:1]),
        (parameter, 5, None if timer is None else timer[:2]),
        (parameter, 1, cob_id[:4]),
    ]
    return [(index, subindex, data) for index, subindex, data in steps if data is not None]


def _upload(sdo: SdoChannel, index: int, subindex: int) -> bytes | None:
    try:
        return sdo.upload(index, subindex)
    except DeviceAbort:
        return None


def _write_all(
    sdo: SdoChannel, description: Description, tpdo: Tpdo, cob_id: int, entries: Sequence[Entry], ms: int
) -> str:
    """Write the mapping; return the trigger of the TPDO in words."""
    parameter, mapping = TPDO_PARAMETER + tpdo.number - 1, TPDO_MAPPING + tpdo.number - 1
    _write(sdo, parameter, 1, cob_id | NOT_VALID | _NO_REMOTE, 4)
    _write(sdo, mapping, 0, 0, 1)
    for subindex, entry in enumerate(entries, start=1):
        _write(sdo, mapping, subindex, entry.raw, 4)
    _write(sdo, mapping, 0, len(entries), 1)
    timed = description.has(parameter, 5) and _takes_timer(sdo, parameter, ms)
    syncs = ms // _SYNC_MS
    _write(sdo, parameter, 2, _EVENT if timed else syncs, 1)
    _write(sdo, parameter, 1, cob_id | _NO_REMOTE, 4)
    if timed:
        return f"every {ms} ms"
    return "on SYNC" if syncs == 1 else f"on every {syncs}th SYNC"


def _write(sdo: SdoChannel, index: int, subindex: int, value: int, size: int) -> None:
    sdo.download(index, subindex, value.to_bytes(size, "little"))


def _takes_timer(sdo: SdoChannel, parameter: int, ms: int) -> bool:
    """Return whether the device sends by a timer; many know the object from their EDS only."""
    try:
        _write(sdo, parameter, 5, ms, 2)
    except DeviceAbort:
        return False
    return True


def _verify(
    sdo: SdoChannel, description: Description, tpdo: Tpdo, cob_id: int, entries: Sequence[Entry]
) -> None:
    number = tpdo.number - 1
    found = read_tpdo(sdo, description, number)
    wanted = [(entry.index, entry.subindex, entry.bits) for entry in entries]
    if found is None or not found.enabled or found.cob_id != cob_id:
        raise Mismatch(
            f"{sdo.label}: 0x{TPDO_PARAMETER + number:04X}:01 was written and is not what it holds"
        )
    if [(mapped.index, mapped.subindex, mapped.bits) for mapped in found.objects] != wanted:
        raise Mismatch(f"{sdo.label}: 0x{TPDO_MAPPING + number:04X} was written and is not what it holds")
