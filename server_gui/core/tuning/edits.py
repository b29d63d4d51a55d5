"""Edits that are staged and not sent: the difference to the robot, exactly as it would be written."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from gateway.coding import Limit, broken_limit, coding_of
from gateway.units import Unit, Units, with_minus
from gateway.wire.method import Number
from gateway.wire.parameter import ParameterInfo, ParameterValue

Values = Mapping[str, ParameterValue]
_BROKEN: Mapping[Limit, str] = {
    Limit.MIN: "below the smallest allowed, {}",
    Limit.MAX: "above the largest allowed, {}",
    Limit.MAX_STEP: "further than one write may go, {}: take two steps",
}


@dataclass(frozen=True, slots=True)
class Staged:
    """A value to be written, and what the robot held when it was typed; both SI, every digit kept."""

    value: float
    base: Number | None


@dataclass(frozen=True, slots=True)
class ReviewedEdit:
    """One line of a review: what is there now, and what would be written."""

    name: str
    unit: Unit
    old: Number | None
    new: float
    elsewhere: bool  # somebody else has changed it since this edit was begun
    problem: str | None = None  # why the robot would refuse it
    allowed: tuple[Number | None, Number | None] = None, None  # the least and the most

    @property
    def by(self) -> str:
        """Size of the change, in its unit and as a share of the present value: `+30 (+7.5 %)`."""
        if self.old is None:
            return ""
        step = float(f"{self.new - self.old:.6g}")
        share = f" ({100 * step / abs(self.old):+.3g} %)" if self.old else ""
        return f"{'-' if step < 0 else '+'}{self.unit.editable(abs(step))}{share}"


@dataclass(slots=True)
class Edits:
    """The staged edits of one robot; `revision` rises with every change."""

    staged: dict[str, Staged] = field(default_factory=dict)
    revision: int = 0

    def stage(self, name: str, value: float, held: ParameterValue | None) -> None:
        """Stage a value; what the robot holds anyway is no edit."""
        self.revision += 1
        current = None if held is None else held.value
        if current is not None and value == current:
            self.staged.pop(name, None)
            return
        known = self.staged.get(name)
        self.staged[name] = Staged(value, current if known is None else known.base)

    def drop(self, *names: str) -> None:
        """Forget edits; without names, all of them."""
        self.revision += 1
        for name in names or tuple(self.staged):
            self.staged.pop(name, None)

    def vanished(self, known: Mapping[str, ParameterInfo]) -> list[str]:
        """Drop edits of parameters that the robot no longer has, or no longer lets write; their names."""
        gone = [name for name in self.staged if name not in known or known[name].read_only is not None]
        if gone:
            self.drop(*gone)
        return gone

    def difference(
        self, held: Values, known: Mapping[str, ParameterInfo], units: Units
    ) -> tuple[ReviewedEdit, ...]:
        """Return the values that would be written, in the robot's order of parameters."""
        order = {name: place for place, name in enumerate(known)}
        names = sorted(self.staged, key=lambda name: order.get(name, len(order)))
        changes = (self._change(name, held.get(name), known.get(name), units) for name in names)
        return tuple(change for change in changes if change.old is None or change.old != change.new)

    def _change(
        self, name: str, held: ParameterValue | None, info: ParameterInfo | None, units: Units
    ) -> ReviewedEdit:
        staged = self.staged[name]
        old = None if held is None else held.value
        unit = unit_of(name, "" if info is None else info.unit, units)
        return ReviewedEdit(
            name=name,
            unit=unit,
            old=old,
            new=staged.value,
            elsewhere=old != staged.base,
            problem=refusal(staged.value, old, info, unit),
            allowed=(None, None) if info is None else (info.min, info.max),
        )


def unit_of(name: str, si: str, units: Units) -> Unit:
    """Return the unit that a parameter `component.quantity` is shown in."""
    return units.unit(name.partition(".")[2], si)


def spoken(name: str) -> str:
    """Return a parameter's name for people, where it stands alone: `step length (gait)`."""
    component, _, quantity = name.replace("_", " ").partition(".")
    return f"{quantity} ({component})" if quantity else component


def brief(unit: Unit, value: float) -> str:
    """Return four digits, and a decimal place more than its unit is read with, where they are not zeros.

    Editing and tooltips have them all.
    """
    shown = value * unit.scale
    if shown == 0.0 or not math.isfinite(shown):
        return f"{abs(shown):g}"
    places = max(unit.digits + 1, 3 - math.floor(math.log10(abs(shown))))
    text = f"{shown:.{places}f}"
    return with_minus(text.rstrip("0").rstrip(".") if "." in text else text)


def refusal(value: float, old: Number | None, info: ParameterInfo | None, unit: Unit) -> str | None:
    """Return why a robot would refuse this value (SI), in words and `unit`; None if nothing is against it."""
    if info is None:
        return "the robot has no such parameter any more"
    broken = broken_limit(info, coding_of(info.type, info.scale), value, old)
    if broken is None:
        return None
    return _BROKEN[broken].format(f"{unit.editable(getattr(info, broken))} {unit.symbol}")
