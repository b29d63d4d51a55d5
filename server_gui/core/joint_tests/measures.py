"""A number that was measured, or why it was not: unknown is never shown as good, nor as zero."""

from collections.abc import Mapping

from msgspec import Struct


class Measure(Struct, frozen=True):
    """One result; `spread` is a standard deviation. `value` is `None` where nobody can tell it: `why`."""

    name: str
    value: float | None
    unit: str
    spread: float | None = None
    why: str = ""


class Curve(Struct, frozen=True):
    """A line to be drawn; `x` and `y` have the same length."""

    name: str
    x: list[float]
    y: list[float]
    x_unit: str
    y_unit: str


class Proposal(Struct, frozen=True):
    """Gains that somebody may try. Nothing writes them."""

    gains: Mapping[str, float]  # by name with unit
    reason: str
    source: str


class JointTestResult(Struct, frozen=True):
    """Result of one test."""

    measures: list[Measure]
    curves: list[Curve]
    proposals: list[Proposal] = []
    notes: list[str] = []

    def value(self, name: str) -> float | None:
        """Return the value of the measure of that name."""
        return next((one.value for one in self.measures if one.name == name), None)


def unknown(name: str, unit: str, why: str) -> Measure:
    """Return a measure that could not be taken."""
    return Measure(name, None, unit, why=why)
