"""Units as products of powers, so that an expression cannot add an angle to a torque."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Self

from gateway.units import ALIASES, UNITS

Powers = tuple[tuple[str, int], ...]

_BASES: Final[Mapping[str, Mapping[str, int]]] = {
    "": {},
    "rad": {"rad": 1},  # kept, though SI has none: an angle is no ratio, nor a torque an energy
    "m": {"m": 1},
    "kg": {"kg": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "V": {
        "kg": 1,
        "m": 2,
        "s": -3,
        "A": -1,
        "rad": 1,
    },  # as power counts the angle that a torque goes through
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3, "rad": 1},
    "Hz": {"s": -1},
}
_SIGNS: Final = {"²": 2, "³": 3, "⁴": 4}
_NAMES: Final = ("", "rad", "rad/s", "rad/s²", "m", "m/s", "m/s²", "N", "N/s", "N·m", "N·m/s", "N·m/rad",
                 "Pa", "Pa/s", "A", "A/s", "V", "W", "s", "Hz", "kg", "N·m/A", "m²", "rad²")  # fmt: skip


@dataclass(frozen=True, slots=True)
class Dimension:
    """Powers of what a unit is made of, none of them 0. What is no known SI unit stands for itself."""

    powers: Powers = ()

    @classmethod
    def of(cls, symbol: str) -> Self:
        """Return the dimension of an SI unit as robots write it: `N·m`, `rad/s`, `m/s²`."""
        over, _, under = symbol.partition("/")
        powers: dict[str, int] = {}
        for part, sign in ((over, 1), *((each, -1) for each in under.split("/") if each)):
            for factor in part.split("·"):
                name, power = (factor[:-1], _SIGNS[factor[-1]]) if factor[-1:] in _SIGNS else (factor, 1)
                for base, count in _BASES.get(name, {name: 1}).items():
                    powers[base] = powers.get(base, 0) + sign * power * count
        return cls(_kept(powers))

    def times(self, other: "Dimension", sign: int = 1) -> "Dimension":
        """Return the dimension of a product; of a quotient, where `sign` is −1."""
        powers = dict(self.powers)
        for base, count in other.powers:
            powers[base] = powers.get(base, 0) + sign * count
        return Dimension(_kept(powers))

    def root(self) -> "Dimension | None":
        """Return the dimension of the square root; None where there is none."""
        if any(count % 2 for _, count in self.powers):
            return None
        return Dimension(tuple((base, count // 2) for base, count in self.powers))

    @property
    def symbol(self) -> str:
        """The SI unit, with the name that robots use where it has one."""
        known = _BY_POWERS.get(self.powers)
        if known is not None:
            return known
        over = [_raised(base, count) for base, count in self.powers if count > 0]
        under = [_raised(base, -count) for base, count in self.powers if count < 0]
        return "/".join(["·".join(over) or "1", *under])

    @property
    def said(self) -> str:
        """The unit for a sentence."""
        return self.symbol or "no unit"


def literal(symbol: str) -> tuple[float, Dimension] | None:
    """Return a unit's size in SI, from its written form (`°`, `deg`, `Nm`); None if unknown."""
    wanted = ALIASES.get(symbol, symbol)
    for si, units in UNITS.items():
        for unit in units:
            if wanted and unit.symbol == wanted:
                return 1.0 / unit.scale, Dimension.of(si)
    found = Dimension.of(wanted)
    return (1.0, found) if all(base in _BASES for base, _ in found.powers) else None


def _kept(powers: Mapping[str, int]) -> Powers:
    return tuple(sorted((base, count) for base, count in powers.items() if base and count))


def _raised(base: str, count: int) -> str:
    return (
        base if count == 1 else base + {power: sign for sign, power in _SIGNS.items()}.get(count, f"^{count}")
    )


_BY_POWERS: Final = {Dimension.of(name).powers: name for name in reversed(_NAMES)}
