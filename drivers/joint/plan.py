"""Where each of a joint's values comes from: a TPDO, a poll by SDO, or nowhere."""

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.bus.pdo import Tpdo
from drivers.joint.decoder import Decoder, Field, make_decoder
from drivers.joint.quantities import POSITION, STATUSWORD, Quantity
from drivers.joint.reading import DriveReading
from drivers.joint.scaling import Linear, contradictions, scalings
from drivers.joint.settings import JointSettings

MIN_BITS = 8


@dataclass(frozen=True, slots=True)
class Polled:
    """A quantity that no TPDO brings."""

    quantity: Quantity
    channel: int
    linear: Linear


@dataclass(frozen=True, slots=True)
class Plan:
    """How a joint is read, and what an integrator should know about it."""

    decoders: tuple[tuple[Tpdo, Decoder], ...]
    polled: tuple[Polled, ...]
    notes: tuple[str, ...]
    position_from: Tpdo | None

    def polled_at(self, *, fast: bool) -> tuple[Polled, ...]:
        """What is polled often, and what is not."""
        return tuple(polled for polled in self.polled if polled.quantity.fast is fast)


def make_plan(settings: JointSettings, found: tuple[Quantity, ...], reading: DriveReading) -> Plan:
    """Prefer the first enabled TPDO that carries a quantity; poll the rest."""
    linears = scalings(settings, reading.scaling)
    wanted = {
        (q.index, q.subindex): (channel, q, linear)
        for channel, q in enumerate(found)
        if (linear := _linear(q, linears)) is not None
    }
    names = [quantity.name for quantity in found]
    decoders = []
    position_from = None
    for tpdo in reading.tpdos:
        fields = _take_fields(tpdo, wanted)
        if fields:
            decoder = make_decoder(tpdo, fields, statusword=names.index(STATUSWORD), state=len(names))
            decoders.append((tpdo, decoder))
            if names.index(POSITION) in decoder.channels:
                position_from = tpdo
    polled = tuple(Polled(quantity, channel, linear) for channel, quantity, linear in wanted.values())
    notes = (
        *contradictions(settings, reading.scaling),
        *_unscaled_notes(found, linears),
        *_polling_notes(settings, polled, reading.tpdos),
    )
    return Plan(tuple(decoders), polled, notes, position_from)


Wanted = dict[tuple[int, int], tuple[int, Quantity, Linear]]


def _take_fields(tpdo: Tpdo, wanted: Wanted) -> list[Field]:
    """What this TPDO carries of what is still wanted; it is not wanted any more."""
    fields = []
    for mapped in tpdo.objects:
        key = (mapped.index, mapped.subindex)
        if mapped.bits >= MIN_BITS and key in wanted:
            channel, quantity, linear = wanted.pop(key)
            fields.append(Field(channel, mapped.at, mapped.bits, quantity.signed, linear))
    return fields


def _linear(quantity: Quantity, linears: Mapping[str, Linear | None]) -> Linear | None:
    return Linear(quantity.scale) if quantity.scale is not None else linears.get(quantity.name)


def _unscaled_notes(found: tuple[Quantity, ...], linears: Mapping[str, Linear | None]) -> list[str]:
    return [
        f"{quantity.name} has no value: set rated_{quantity.name}, the drive does not tell it"
        for quantity in found
        if _linear(quantity, linears) is None
    ]


def _polling_notes(settings: JointSettings, polled: tuple[Polled, ...], tpdos: tuple[Tpdo, ...]) -> list[str]:
    names = [one.quantity.name for one in polled if one.quantity.fast]
    if not names:
        return []
    enabled = [tpdo for tpdo in tpdos if tpdo.enabled and tpdo.objects]
    why = f"none of its {len(enabled)} enabled TPDOs carries it" if enabled else "no TPDO is enabled"
    how = f"asked by SDO at {settings.poll_hz:g} Hz" if settings.poll_hz else "not asked for (poll_hz is 0)"
    return [f"{' and '.join(names)}: {how}, because {why}"]
