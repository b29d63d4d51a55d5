"""Offers for several joints at once: the new values, the present ones, and obstacles."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from gateway.several_joints import all_joints, mirrored, spread
from gateway.units import Units
from gateway.wire.method import Number
from gateway.wire.parameter import ParameterValue
from gateway.wire.robot import Description
from server_gui.core.tuning.edits import unit_of

Held = Mapping[str, ParameterValue]


@dataclass(frozen=True, slots=True)
class Offer:
    """One way to edit several at once. With a `problem` nothing is staged, and it says why."""

    title: str
    changes: Mapping[str, Number]
    held: str  # what they hold now, in words
    problem: str = ""


def offers(
    name: str, value: Number | None, description: Description, held: Held, units: Units
) -> list[Offer]:
    """Return the offers to set a parameter's staged or held value (SI) on other joints."""
    return [] if value is None else list(_offers(name, value, description, held, units))


def _offers(name: str, value: Number, description: Description, held: Held, units: Units) -> Iterator[Offer]:
    component = name.partition(".")[0]
    si = next((one.unit for one in description.parameters if one.name == name), "")
    unit = unit_of(name, si, units)
    said = f"{unit.editable(value)} {unit.symbol}".rstrip()
    pair = mirrored(component, description)
    for whom, joints in (
        (pair[-1].replace("_", " "), pair),
        ("all joints", all_joints(description)),
    ):
        if len(joints) < 2 or component not in joints:
            continue
        found = spread(name, value, joints, description, held)
        now = _held(found.changes, description, held, units)
        if not found.refused:
            yield Offer(
                f"{said} for {whom}, too" if joints is pair else f"{said} for {whom}", found.changes, now
            )
            continue
        yield Offer(f"{said} for {whom} …", {}, now, f"Nothing was staged. {found.problem}")
        if component in found.refused or len(found.changes) < 2:
            continue
        left = ", ".join(found.refused)
        yield Offer(f"{said} for {whom} without {left}", found.changes, now)


def _held(names: Mapping[str, Number], description: Description, held: Held, units: Units) -> str:
    """Return each with its value now, so that nobody levels out what was meant to differ."""
    si = {one.name: one.unit for one in description.parameters}
    said = []
    for name in names:
        unit, now = unit_of(name, si.get(name, ""), units), held.get(name)
        value = (
            "not known" if now is None or now.value is None else f"{unit.editable(now.value)} {unit.symbol}"
        )
        said.append(f"{name}: {value.rstrip()}")
    return "\n".join(said)
