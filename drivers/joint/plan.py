"""The source of each of a joint's values: a TPDO, a poll by SDO, or none."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from drivers.bus.fields import Field, Linear
from drivers.bus.pdo import MappedObject, Tpdo
from drivers.joint.decoder import Decoder, make_decoder
from drivers.joint.quantities import POSITION, STATUSWORD, Quantity
from drivers.joint.reading import DriveReading
from drivers.joint.scaling import contradictions, scalings
from drivers.joint.settings import JointSettings

MIN_BITS = 8


@dataclass(frozen=True, slots=True)
class QuantitySource:
    """A quantity with the channel and the scaling that are its own."""

    quantity: Quantity
    channel: int
    linear: Linear


@dataclass(frozen=True, slots=True)
class ReadPlan:
    """Sources of a joint's values, and notes for the integrator."""

    decoders: tuple[tuple[Tpdo, Decoder], ...]
    polled_often: tuple[QuantitySource, ...]  # position and statusword that no TPDO brings
    polled_seldom: tuple[QuantitySource, ...]  # all else, and what TPDOs bring only when it changes
    contradictions: tuple[str, ...]  # of the file and the drive
    notes: tuple[str, ...]
    position_from: Tpdo | None


def make_plan(settings: JointSettings, found: tuple[Quantity, ...], reading: DriveReading) -> ReadPlan:
    """Decode every enabled TPDO; poll what none of them brings, or keeps fresh."""
    linears = scalings(settings, reading.scaling)
    wanted = {
        (q.index, q.subindex): QuantitySource(q, channel, linear)
        for channel, q in enumerate(found)
        if (linear := _linear(q, linears)) is not None
    }
    names = [quantity.name for quantity in found]
    mapped = [(tpdo, fields) for tpdo in reading.tpdos if (fields := _fields(tpdo, wanted))]
    brought = {field.channel for _, fields in mapped for field in fields}
    fresh = {field.channel for tpdo, fields in mapped if tpdo.cyclic for field in fields}
    absent = [one for one in wanted.values() if one.channel not in brought]
    often = tuple(one for one in absent if one.quantity.fast)
    seldom = tuple(one for one in wanted.values() if one.channel not in fresh and one not in often)
    return ReadPlan(
        decoders=tuple(
            (tpdo, make_decoder(tpdo, fields, statusword=names.index(STATUSWORD), state=len(names)))
            for tpdo, fields in mapped
        ),
        polled_often=often,
        polled_seldom=seldom,
        contradictions=contradictions(settings, reading.scaling),
        notes=(
            *_unscaled_notes(found, linears),
            *_width_notes(reading, wanted),
            *_polling_notes(settings, often, reading.tpdos),
        ),
        position_from=_bringer(names.index(POSITION), mapped),
    )


def _fields(tpdo: Tpdo, wanted: Mapping[tuple[int, int], QuantitySource]) -> list[Field]:
    """Return the wanted objects that this TPDO carries in full width.

    A part of it would be another number.
    """
    return [
        Field(one.channel, mapped.at, mapped.bits, one.quantity.kind, one.linear)
        for mapped in tpdo.objects
        if (one := wanted.get((mapped.index, mapped.subindex))) is not None and _fits(mapped, one.quantity)
    ]


def _fits(mapped: MappedObject, quantity: Quantity) -> bool:
    return mapped.bits == quantity.bits or (quantity.bits is None and mapped.bits >= MIN_BITS)


def _width_notes(reading: DriveReading, wanted: Mapping[tuple[int, int], QuantitySource]) -> Iterator[str]:
    for tpdo in reading.tpdos:
        for mapped in tpdo.objects:
            one = wanted.get((mapped.index, mapped.subindex))
            if one is not None and not _fits(mapped, one.quantity):
                yield (
                    f"TPDO{tpdo.number} maps {mapped.bits} bits of {one.quantity.name}, which has "
                    f"{one.quantity.bits} in its EDS: it is not taken from there"
                )


def _bringer(channel: int, mapped: Sequence[tuple[Tpdo, list[Field]]]) -> Tpdo | None:
    """Return the TPDO that brings a channel; one that comes cyclically rather than one that does not."""
    bringers = [tpdo for tpdo, fields in mapped if any(field.channel == channel for field in fields)]
    return next((tpdo for tpdo in bringers if tpdo.cyclic), bringers[0] if bringers else None)


def _linear(quantity: Quantity, linears: Mapping[str, Linear | None]) -> Linear | None:
    return Linear(quantity.scale) if quantity.scale is not None else linears.get(quantity.name)


def _unscaled_notes(found: tuple[Quantity, ...], linears: Mapping[str, Linear | None]) -> list[str]:
    return [
        f"{quantity.name} has no value: set rated_{quantity.name}, the drive does not tell it"
        for quantity in found
        if _linear(quantity, linears) is None
    ]


def _polling_notes(
    settings: JointSettings, polled: tuple[QuantitySource, ...], tpdos: tuple[Tpdo, ...]
) -> list[str]:
    if not polled:
        return []
    names = [one.quantity.name for one in polled]
    why = "; ".join(_lacks(tpdos)) or "no TPDO is enabled"
    how = f"asked by SDO at {settings.poll_hz:g} Hz" if settings.poll_hz else "not asked for (poll_hz is 0)"
    return [f"{' and '.join(names)}: {how}, because {why}"]


def _lacks(tpdos: tuple[Tpdo, ...]) -> Iterator[str]:
    """Yield why no enabled TPDO brings what is wanted."""
    full = sum(bool(tpdo.enabled and tpdo.objects) for tpdo in tpdos)
    if full:
        yield f"none of its {full} enabled TPDOs carries it"
    empty = [f"TPDO{tpdo.number}" for tpdo in tpdos if tpdo.empty]
    if empty:
        yield f"{' and '.join(empty)} {'is' if len(empty) == 1 else 'are'} enabled and empty"
    multiplexed = [f"TPDO{tpdo.number}" for tpdo in tpdos if tpdo.multiplexed]
    if multiplexed:
        yield f"{' and '.join(multiplexed)}, multiplexed (MPDO), cannot be read here"
