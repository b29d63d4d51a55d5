"""The guard's kinds of rules: their keys, in SI units, and their conditions in words."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Literal

from msgspec import Meta, Struct

from drivers.component import ComponentKind

UNIT = "{unit}"  # in a key's words: the unit of what is watched
_CODES = "how they begin, `0x2` current, `0x23`, `0x2310`; without, any"
_BITS = "numbers, names of CiA 402-2, masks `0x30000`"

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Above = Annotated[float, Meta(gt=0, description=UNIT)]
Bound = Annotated[float | None, Meta(description=UNIT)]
Hysteresis = Annotated[float, Meta(ge=0, description=UNIT)]
CodePrefix = Annotated[str, Meta(pattern=r"^0x[0-9A-Fa-f]{1,4}$")]

# Bits of 60FDh that have a name (CiA 402-2); 16 to 31 are the manufacturer's.
INPUTS: Mapping[str, int] = {
    "negative_limit_switch": 0,
    "positive_limit_switch": 1,
    "home_switch": 2,
    "interlock": 3,
}
_BIT_NAMES = {bit: name.replace("_", " ") for name, bit in INPUTS.items()}
BitNumber = Annotated[int, Meta(ge=0, le=31)]
BitName = Annotated[str, Meta(pattern=rf"^({'|'.join(INPUTS)}|0x[0-9A-Fa-f]{{1,8}})$")]
Bits = Annotated[tuple[BitNumber | BitName, ...], Meta(description=_BITS)]

# What left and right can be compared by: where there is such a channel, and its unit.
SIDED: Mapping[str, tuple[ComponentKind, str]] = {
    "position": (ComponentKind.JOINT, "rad"),
    "velocity": (ComponentKind.JOINT, "rad/s"),
    "torque": (ComponentKind.JOINT, "N·m"),
    "current": (ComponentKind.JOINT, "A"),
    "force": (ComponentKind.INSOLE, "N"),
    "load_share": (ComponentKind.INSOLE, ""),
}


class Action(StrEnum):
    """Consequences of a tripped rule; in this order."""

    QUICK_STOP = "quick_stop"  # on every drive, held until it is reset
    REVERT_TRIALS = "revert_trials"  # what was written on trial is taken back
    HOLD_PARAMETERS = "hold_parameters"  # as long as it is tripped none may be changed
    ALARM = "alarm"  # an entry of the journal


class Blind(StrEnum):
    """Reaction of a rule to a missing input."""

    ALARM = "alarm"
    ACT = "act"  # as if it had tripped


class GuardRule(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The common keys of all rules."""

    watch: str  # kind of the rule
    on: Annotated[tuple[str, ...], Meta(min_length=1)] | None = (
        None  # globs of components; None: all with the input
    )
    actions: Annotated[tuple[Action, ...], Meta(min_length=1)] = (Action.ALARM,)  # when it trips
    blind: Blind = Blind.ALARM  # reaction to a missing input
    clear_s: Positive = 1.0  # time without trouble until it is over

    def words(self, unit: str, /) -> str:
        """Return the condition on which it trips; `unit` is that of the watched quantity."""
        raise NotImplementedError


class LevelRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a magnitude, in either direction, is `above` this for `for_s`.

    It is over when the magnitude is `hysteresis` below that.
    """

    above: Above
    hysteresis: Hysteresis = 0.0
    for_s: NotNegative = 0.0

    def words(self, unit: str, /) -> str:
        return f"above {with_unit(self.above, unit)}{_for(self.for_s)}"


class LatencyRule(LevelRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The same for the time that a node takes to answer; no answer is above everything."""


class RangeRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a value is below `min` or above `max` for `for_s`."""

    min: Bound = None
    max: Bound = None
    hysteresis: Hysteresis = 0.0
    for_s: NotNegative = 0.0

    def words(self, unit: str, /) -> str:
        bounds = (("below", self.min), ("above", self.max))
        told = [f"{word} {with_unit(bound, unit)}" for word, bound in bounds if bound is not None]
        return f"{' or '.join(told)}{_for(self.for_s)}"


class StoppingRule(RangeRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The same for where a joint would come to rest: after `reaction_s`, by its `deceleration`."""

    deceleration: Annotated[float, Meta(gt=0, description="rad/s²")]
    reaction_s: NotNegative = 0.0

    def words(self, unit: str, /) -> str:
        braking = f"braking by {self.deceleration:g} rad/s²"
        after = f" after {self.reaction_s:g} s" if self.reaction_s else ""
        return f"at rest only {super().words(unit)}, {braking}{after}"


class HeatRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """I²t: trips where the mean of (current or torque / `rated`)² over the time constant is `above` this.

    The mean is a leaky integrator; 1 is what `rated`, held for ever, comes to.
    """

    of: Annotated[Literal["current", "torque"], Meta(description="`torque`, else current")] = "current"
    rated: Annotated[float, Meta(gt=0, description="A, N·m")]  # what the motor stands for ever
    time_constant_s: Positive
    above: Positive = 1.0
    hysteresis: NotNegative = 0.0

    def words(self, _unit: str, /) -> str:
        rated = with_unit(self.rated, SIDED[self.of][1])
        return f"mean of ({self.of} / {rated})² over {self.time_constant_s:g} s above {self.above:g}"


class SilenceRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips after a silence of `silent_s`; without it, of the time that the component's own table allows."""

    silent_s: Positive | None = None

    def words(self, _unit: str, /) -> str:
        return "silent" if self.silent_s is None else f"silent for {self.silent_s:g} s"


class EmcyRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips at an emergency message whose code begins so: `0x2` current, `0x23`, `0x2310`; without, any."""

    codes: Annotated[tuple[CodePrefix, ...], Meta(min_length=1, description=_CODES)] | None = None

    def words(self, _unit: str, /) -> str:
        return "any EMCY" if self.codes is None else f"EMCY {', '.join(self.codes)}"


class InputRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a bit is not as it must be, for `for_s`; `name` is what people call that."""

    name: Annotated[str, Meta(min_length=1, description="what people call it")] | None = None
    must_be_set: Bits = ()
    must_be_clear: Bits = ()
    for_s: NotNegative = 0.0

    def wrong(self, inputs: float) -> int:
        """Return the bits of 60FDh that are not as they must be."""
        now = int(inputs)
        return (mask(self.must_be_set) & ~now) | (mask(self.must_be_clear) & now)

    def says(self, wrong: float) -> str:
        """Return the meaning of these wrong bits."""
        bits = int(wrong)
        found = ((mask(self.must_be_set) & bits, "clear"), (mask(self.must_be_clear) & bits, "set"))
        told = "; ".join(f"{bit_words(some)} {state}" for some, state in found if some)
        return told if self.name is None else f"{self.name}, {told}"

    def words(self, _unit: str, /) -> str:
        return f"{self.says(mask(self.must_be_set) | mask(self.must_be_clear))}{_for(self.for_s)}"


class BusRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a bus is gone or silent, or its controller all but takes part no more."""

    silent_s: Positive = 0.5

    def words(self, _unit: str, /) -> str:
        return f"error passive, bus off, gone, or silent for {self.silent_s:g} s"


class SyncRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where SYNC comes more than `tolerance_s` after its time."""

    period_s: Positive
    tolerance_s: Positive = 0.05
    can_id: Annotated[int, Meta(ge=1, le=0x7FF)] = 0x080

    @property
    def longest_s(self) -> float:
        return self.period_s + self.tolerance_s

    def words(self, _unit: str, /) -> str:
        return f"no SYNC for {self.longest_s:g} s"


class SymmetryRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where `left` and `right` differ by more than `above` for `for_s`, over a window of strides."""

    left: str
    right: str
    quantity: Annotated[str, Meta(pattern=rf"^({'|'.join(SIDED)})$", description=", ".join(SIDED))]
    of: Annotated[Literal["range", "mean"], Meta(description="`mean`, else range")] = "range"
    above: Annotated[float, Meta(gt=0, description="unit of the quantity")]
    hysteresis: NotNegative = 0.0
    window_s: Positive = 5.0
    for_s: NotNegative = 0.0

    @property
    def unit(self) -> str:
        return SIDED[self.quantity][1]

    def words(self, _unit: str, /) -> str:
        differ = f"{self.of} of {self.quantity} over {self.window_s:g} s differs by more than"
        return f"{differ} {with_unit(self.above, self.unit)}{_for(self.for_s)}"


class DriftRule(GuardRule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips each time that a joint has moved by more than `above`, from `settle_s` after a stop on."""

    above: Above
    settle_s: NotNegative = 1.0

    def words(self, unit: str, /) -> str:
        return f"moved more than {with_unit(self.above, unit)}, from {self.settle_s:g} s after a stop on"


def mask(bits: Bits) -> int:
    """Return the bits that are meant, as one number."""
    found = 0
    for bit in bits:
        if isinstance(bit, str):
            found |= 1 << INPUTS[bit] if bit in INPUTS else int(bit, 16)
        else:
            found |= 1 << bit
    return found


def bit_words(bits: int) -> str:
    """Bits by their names, as far as they have one."""
    set_bits = (bit for bit in range(32) if bits >> bit & 1)
    return ", ".join(_BIT_NAMES.get(bit, f"bit {bit}") for bit in set_bits)


def with_unit(number: float, unit: str) -> str:
    return f"{number:g} {unit}".rstrip()


def _for(seconds: float) -> str:
    return f" for {seconds:g} s" if seconds else ""
