"""What an integrator says about the guard: `[guard]` and its rules, `[guard.rule.NAME]`.

Each rule names what it watches; `WATCHES` says which keys, components and channels belong to that.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Literal

from msgspec import Meta, Struct

from drivers.component import Kind

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
CodePrefix = Annotated[str, Meta(pattern=r"^0x[0-9A-Fa-f]{1,4}$")]


class Action(StrEnum):
    """What a rule that trips leads to; in this order."""

    QUICK_STOP = "quick_stop"  # on every drive, held until it is reset
    REVERT_TRIALS = "revert_trials"  # what was written on trial is taken back
    ALARM = "alarm"  # an entry of the journal


class Blind(StrEnum):
    """What a rule does that cannot see what it watches."""

    ALARM = "alarm"
    ACT = "act"  # as if it had tripped


class Rule(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every rule has. `on` are globs of components; without them, all that have what is watched."""

    watch: str
    on: Annotated[tuple[str, ...], Meta(min_length=1)] | None = None
    actions: Annotated[tuple[Action, ...], Meta(min_length=1)] = (Action.ALARM,)
    blind: Blind = Blind.ALARM
    clear_s: Positive = 1.0  # how long all must be well again before it is over

    @property
    def words(self) -> str:
        """What makes it trip."""
        return ""


class LevelRule(Rule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a magnitude, in either direction, is `above` this for `for_s`.

    It is over when the magnitude is `hysteresis` below that.
    """

    above: Positive
    hysteresis: NotNegative = 0.0
    for_s: NotNegative = 0.0

    @property
    def words(self) -> str:
        return f"above {self.above:g}{_unit(self)}{_for(self.for_s)}"


class RangeRule(Rule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips where a value is below `min` or above `max` for `for_s`."""

    min: float | None = None
    max: float | None = None
    hysteresis: NotNegative = 0.0
    for_s: NotNegative = 0.0

    @property
    def words(self) -> str:
        bounds = (("below", self.min), ("above", self.max))
        told = [f"{word} {bound:g}{_unit(self)}" for word, bound in bounds if bound is not None]
        return f"{' or '.join(told)}{_for(self.for_s)}"


class HeatRule(Rule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """I²t: trips where the mean of (current or torque / `rated`)² over the time constant is `above` this.

    The mean is a leaky integrator; 1 is what `rated`, held for ever, comes to.
    """

    of: Literal["current", "torque"] = "current"
    rated: Positive  # A, or N·m at the joint: what the motor stands for ever
    time_constant_s: Positive
    above: Positive = 1.0
    hysteresis: NotNegative = 0.0

    @property
    def words(self) -> str:
        unit = {"current": "A", "torque": "N·m"}[self.of]
        mean = f"mean of ({self.of} / {self.rated:g} {unit})² over {self.time_constant_s:g} s"
        return f"{mean} above {self.above:g}"


class SilenceRule(Rule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips after a silence of `silent_s`; without it, of the time that the component's own table allows."""

    silent_s: Positive | None = None

    @property
    def words(self) -> str:
        return "silent" if self.silent_s is None else f"silent for {self.silent_s:g} s"


class EmcyRule(Rule, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Trips at an emergency message whose code begins so: `0x2` current, `0x23`, `0x2310`; without, any."""

    codes: Annotated[tuple[CodePrefix, ...], Meta(min_length=1)] | None = None

    @property
    def words(self) -> str:
        return "any EMCY" if self.codes is None else f"EMCY {', '.join(self.codes)}"


class GuardSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[guard]`. With `heartbeat_ms` the drives are armed to stop by themselves when the gateway dies."""

    heartbeat_ms: Annotated[int, Meta(ge=10, le=20_000)] | None = None
    rule: dict[str, Rule] = {}


@dataclass(frozen=True, slots=True)
class Watch:
    """What a rule of this name needs."""

    rule: type[Rule]
    kinds: tuple[Kind, ...]
    quantities: tuple[str, ...] = ()  # the channels that it looks at, each by itself
    unit: str = ""


_JOINT, _ON_CAN = (Kind.JOINT,), (Kind.JOINT, Kind.DEVICE)
WATCHES: Mapping[str, Watch] = {
    "node_lost": Watch(SilenceRule, _ON_CAN),
    "emcy": Watch(EmcyRule, _ON_CAN),
    "following_error": Watch(LevelRule, _JOINT, ("following_error",), "rad"),
    "current": Watch(LevelRule, _JOINT, ("current",), "A"),
    "torque": Watch(LevelRule, _JOINT, ("torque",), "N·m"),
    "i2t": Watch(HeatRule, _JOINT, ("current", "torque")),  # one of them
    "temperature": Watch(LevelRule, _JOINT, ("temperature",), "°C"),
    "joint_limit": Watch(RangeRule, _JOINT, ("position",), "rad"),
    "tilt": Watch(LevelRule, (Kind.IMU,), ("tilt_forward", "tilt_side"), "rad"),
    "tilt_rate": Watch(LevelRule, (Kind.IMU,), ("angular_velocity_x", "angular_velocity_y"), "rad/s"),
    "insole_stale": Watch(SilenceRule, (Kind.INSOLE,)),
}


def quantities(rule: Rule) -> tuple[str, ...]:
    """The channels that a rule looks at."""
    return (rule.of,) if isinstance(rule, HeatRule) else WATCHES[rule.watch].quantities


def _unit(rule: Rule) -> str:
    return f" {WATCHES[rule.watch].unit}"


def _for(seconds: float) -> str:
    return f" for {seconds:g} s" if seconds else ""
