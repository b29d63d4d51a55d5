"""Units for people: inside everything is SI, and no digit is lost on the way out and back."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_HALF_EVEN, Context, Decimal
from types import MappingProxyType

# A float has 17 significant digits; with twice as many, going there and back ends at the very same float.
_EXACT = Context(prec=40, rounding=ROUND_HALF_EVEN)
_PI = Decimal("3.141592653589793238462643383279502884197")
_GRAVITY = Decimal("9.80665")
_SIGN = re.compile(r"(?<![\w)])-(?=[\d.])|(?<=\de)-(?=\d)")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: one of `si` is `factor` of these."""

    symbol: str
    si: str
    factor: Decimal = Decimal(1)
    digits: int = 2  # decimal places that are worth showing

    @property
    def scale(self) -> float:
        """The factor for curves and texts, where the last digit does not count."""
        return float(self.factor)

    def shown(self, value: float) -> Decimal:
        """Return an SI value in this unit, to more digits than a float has."""
        return _EXACT.multiply(Decimal(value), self.factor)

    def si_value(self, typed: Decimal | str) -> float:
        """Return a value typed in this unit, as the nearest SI float.

        Raises:
            ValueError: it is no number, or too large or too small for a float.

        """
        try:
            number = Decimal(typed.replace("−", "-") if isinstance(typed, str) else typed)
            value = self._nearest(number) if number.is_finite() else math.nan
        except ArithmeticError:
            number, value = Decimal("NaN"), math.nan
        if not math.isfinite(value) or (value == 0.0) != (number == 0):
            said = f"{typed!r} is not a number in {self.symbol or 'units'} that a robot could hold"
            raise ValueError(f"{said}: write one such as 12.5")
        return value

    def text(self, value: float | None) -> str:
        """Return it for reading: rounded, without the unit; a dash if there is none."""
        return "–" if value is None else rounded(value * self.scale, self.digits)

    def brief(self, value: float | None) -> str:
        """Return it for reading what somebody has set: as `text`, three digits at least, no final zeros."""
        if value is None or not math.isfinite(value):
            return "–"
        shown = value * self.scale
        leading = math.floor(math.log10(abs(shown))) if shown else 0
        if not -6 <= leading <= 9:
            return f"{shown:.3g}"
        text = f"{shown:.{max(self.digits, 2 - leading)}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text

    def editable(self, value: float) -> str:
        """Return it for editing: the fewest digits that lead back to exactly this value."""
        exact = self.shown(value)
        for precision in range(1, 22):
            short = Context(prec=precision, rounding=ROUND_HALF_EVEN).plus(exact)
            if self._nearest(short) == value:
                return f"{short.normalize():f}"
        return f"{exact:f}"

    def _nearest(self, number: Decimal) -> float:
        return float(_EXACT.divide(number, self.factor))


_DEGREES = _EXACT.divide(Decimal(180), _PI)

# Per SI unit what there is to choose from; the first is the usual one.
UNITS: Mapping[str, tuple[Unit, ...]] = MappingProxyType(
    {
        "rad": (Unit("°", "rad", _DEGREES, 1), Unit("rad", "rad", digits=3)),
        "rad/s": (
            Unit("°/s", "rad/s", _DEGREES, 1),
            Unit("rad/s", "rad/s", digits=3),
            Unit("rpm", "rad/s", _EXACT.divide(Decimal(30), _PI), 1),
        ),
        "Pa": (Unit("kPa", "Pa", Decimal("0.001"), 1), Unit("Pa", "Pa", digits=0)),
        "N": (Unit("N", "N", digits=0),),
        "N·m": (Unit("N·m", "N·m"),),
        "m": (
            Unit("mm", "m", Decimal(1000), 0),
            Unit("cm", "m", Decimal(100), 1),
            Unit("m", "m", digits=3),
        ),
        "m/s²": (Unit("m/s²", "m/s²"), Unit("g", "m/s²", _EXACT.divide(Decimal(1), _GRAVITY), 3)),
        "s": (Unit("s", "s"), Unit("ms", "s", Decimal(1000), 0)),
        "A": (Unit("A", "A"), Unit("mA", "A", Decimal(1000), 0)),
        "°C": (Unit("°C", "°C", digits=1),),
        "B": (Unit("MiB", "B", _EXACT.divide(Decimal(1), Decimal(1 << 20)), 1), Unit("B", "B", digits=0)),
        "": (Unit("", "", digits=3), Unit("%", "", Decimal(100), 1)),
    }
)


ALIASES: Mapping[str, str] = MappingProxyType(
    {"deg": "°", "deg/s": "°/s", "Nm": "N·m", "N.m": "N·m", "degC": "°C", "m/s2": "m/s²", "m/s^2": "m/s²"}
)  # as people type them


def unit_named(symbol: str, si: str) -> Unit:
    """Return the unit that a value of this SI unit was typed in; `si` itself where no symbol is given.

    Raises:
        ValueError: values of this SI unit cannot be in such a unit; says in which.

    """
    wanted = ALIASES.get(symbol, symbol)
    known = (*UNITS.get(si, ()), Unit(si, si))
    found = next((unit for unit in known if unit.symbol == wanted), None)
    if found is None:
        shown = dict.fromkeys(unit.symbol or "no unit" for unit in known)
        raise ValueError(f"it cannot be in {symbol!r}: write it in {' or '.join(shown)}")
    return found


def rounded(value: float, digits: int, sign: str = "") -> str:
    """Return a number with so many decimal places; `sign` "+" shows that of others, too; zero has none."""
    shown = round(value, digits) + 0.0
    return with_minus(f"{shown:{sign if shown else ''}.{digits}f}")


def with_minus(number: str) -> str:
    """Return numbers for reading: with the sign for minus, as wide as +; dates and words keep hyphens."""
    return _SIGN.sub("−", number)


def percent_body_weight(body_mass: float) -> Unit:
    """Return forces as a share of the wearer's weight; `body_mass` in kg, with the machine where it is worn.

    Raises:
        ValueError: no mass of a person.

    """
    if not 0.0 < body_mass < 1000.0:
        raise ValueError(f"a body mass of {body_mass} kg cannot be: give one above 0 and below 1000")
    weight = _EXACT.multiply(Decimal(body_mass), _GRAVITY)
    return Unit("% BW", "N", _EXACT.divide(Decimal(100), weight), 1)


@dataclass(frozen=True, slots=True)
class Units:
    """Display units of all quantities.

    `by_quantity` (such as `cop_x`) goes before `by_si` (such as `rad`); both name units by their symbols.
    `body_mass` (kg) makes `% BW` a unit of forces.
    """

    by_si: Mapping[str, str] = field(default_factory=dict)
    by_quantity: Mapping[str, str] = field(default_factory=dict)
    body_mass: float | None = None

    def choices(self, si: str) -> tuple[Unit, ...]:
        """Return the units to show this SI unit in, the usual first; an unknown unit stands for itself."""
        known = UNITS.get(si, (Unit(si, si, digits=3),))
        if si == "N" and self.body_mass is not None:
            return (*known, percent_body_weight(self.body_mass))
        return known

    def unit(self, quantity: str, si: str) -> Unit:
        """Return the unit that this quantity is shown in.

        Raises:
            ValueError: the one that was chosen cannot show it.

        """
        choices = self.choices(si)
        wanted = self.by_quantity.get(quantity, self.by_si.get(si))
        if wanted is None:
            return choices[0]
        for unit in choices:
            if unit.symbol == wanted:
                return unit
        allowed = ", ".join(unit.symbol or "(none)" for unit in choices)
        raise ValueError(
            f"{quantity} in {si or 'no unit'} cannot be shown in {wanted}: choose from {allowed}"
        )
