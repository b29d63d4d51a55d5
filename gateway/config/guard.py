"""`[guard]` of the robot's file, and what a guard can watch: one row a rule.

Whatever depends on a rule is taken from its row: the kind of rule says its keys and how it is judged.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta, Struct

from drivers.component import ComponentKind
from gateway.config.guard_rules import (
    BusRule,
    DriftRule,
    EmcyRule,
    GuardRule,
    HeatRule,
    InputRule,
    LatencyRule,
    LevelRule,
    RangeRule,
    SilenceRule,
    StoppingRule,
    SymmetryRule,
    SyncRule,
)

ALARMS = "alarms"  # the channel that counts them; no rule is called so
BUS = "bus"  # what a rule can watch beside components
TABLES: Mapping[str, str] = {
    **{kind: kind.value for kind in ComponentKind},
    BUS: "can",
}  # of the robot's file


@dataclass(frozen=True, slots=True)
class WatchedBy:
    """A kind of rule: its condition, and the inputs that it needs."""

    trips: str  # when, in words; `code` stands for its keys
    rule: type[GuardRule]
    kinds: tuple[str, ...]  # of what it watches each
    quantities: tuple[str, ...] = ()  # the channels that it looks at
    unit: str = ""  # of what it compares


_JOINT, _ON_CAN, _IMU = (
    (ComponentKind.JOINT,),
    (ComponentKind.JOINT, ComponentKind.DEVICE),
    (ComponentKind.IMU,),
)
_MAGNITUDE = "its magnitude is `above`"

WATCHES: Mapping[str, WatchedBy] = {
    "node_lost": WatchedBy(
        "its heartbeat is missing for `silent_s` (else `heartbeat_timeout_s` of its table, else 2.5 × 1017h) "
        "or it has booted anew: a drive, or the controller",
        SilenceRule,
        _ON_CAN,
    ),
    "emcy": WatchedBy("it sends an emergency message", EmcyRule, _ON_CAN),
    "sdo_latency": WatchedBy(
        "its answer to an SDO request (for 1000h, once a second) takes longer than `above`, or does not come",
        LatencyRule,
        _ON_CAN,
        unit="s",
    ),
    "digital_input": WatchedBy(
        "a bit of 60FDh is not as it must be: emergency stop, STO, limit switch",
        InputRule,
        _JOINT,
        ("digital_inputs",),
    ),
    "voltage": WatchedBy(
        "its supply (6079h) is outside of `min` … `max`", RangeRule, _JOINT, ("voltage",), "V"
    ),
    "following_error": WatchedBy(_MAGNITUDE, LevelRule, _JOINT, ("following_error",), "rad"),
    "velocity": WatchedBy(_MAGNITUDE, LevelRule, _JOINT, ("velocity",), "rad/s"),
    "current": WatchedBy(_MAGNITUDE, LevelRule, _JOINT, ("current",), "A"),
    "torque": WatchedBy(_MAGNITUDE, LevelRule, _JOINT, ("torque",), "N·m"),
    "i2t": WatchedBy(
        "the mean of (current or torque / `rated`)² over `time_constant_s` is `above`; it begins at 0, "
        "whatever heat is there",
        HeatRule,
        _JOINT,
        ("current", "torque"),  # one of them
    ),
    "temperature": WatchedBy("its drive or motor is `above`", LevelRule, _JOINT, ("temperature",), "°C"),
    "joint_limit": WatchedBy(
        "its position is outside of `min` … `max`", RangeRule, _JOINT, ("position",), "rad"
    ),
    "stopping_distance": WatchedBy(
        "it would come to rest outside of `min` … `max`, at its velocity v after v · `reaction_s` + "
        "v² / (2 · `deceleration`)",
        StoppingRule,
        _JOINT,
        ("position", "velocity"),
        "rad",
    ),
    "drift_while_held": WatchedBy(
        "it has moved by more than `above`, by hand too, since `settle_s` after a stop that is held; and "
        "each time that it has moved so far again",
        DriftRule,
        _JOINT,
        ("position",),
        "rad",
    ),
    "asymmetry": WatchedBy(
        "`left` and `right` differ by more than `above` in range (highest − lowest) or mean over `window_s`: "
        "some strides, for at no instant do two legs do the same",
        SymmetryRule,
        (ComponentKind.JOINT, ComponentKind.INSOLE),
    ),
    "tilt": WatchedBy(
        "the trunk leans, forward or to a side", LevelRule, _IMU, ("tilt_forward", "tilt_side"), "rad"
    ),
    "tilt_rate": WatchedBy(
        "the trunk tilts so fast, forward or to a side",
        LevelRule,
        _IMU,
        ("angular_velocity_x", "angular_velocity_y"),
        "rad/s",
    ),
    "insole_stale": WatchedBy(
        "it is silent for `silent_s` (else its `stale_after_s`)", SilenceRule, (ComponentKind.INSOLE,)
    ),
    "bus": WatchedBy(
        "our CAN controller is error passive or bus off, its interface is gone, or no frame comes for "
        "`silent_s`",
        BusRule,
        (BUS,),
    ),
    "sync_lost": WatchedBy("SYNC comes `tolerance_s` too late, or not at all", SyncRule, (BUS,)),
}


class GuardSettings(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """`[guard]`: the heartbeat that arms the drives, and the rules."""

    heartbeat_ms: Annotated[int, Meta(ge=10, le=20_000)] | None = None  # arms drives to stop without it
    rule: dict[str, GuardRule] = {}


def limit(rule: GuardRule) -> str:
    """Return the condition on which it trips, in words."""
    return rule.words(WATCHES[rule.watch].unit)


def ends(rule: GuardRule) -> tuple[float | None, float | None]:
    """Between what its quantities may be (SI), where nothing else matters but how long; else nothing."""
    if type(rule) is RangeRule:
        return rule.min, rule.max
    return (-rule.above, rule.above) if type(rule) is LevelRule else (None, None)


def quantities(rule: GuardRule) -> tuple[str, ...]:
    """Return the channels that a rule looks at."""
    if isinstance(rule, HeatRule):
        return (rule.of,)
    return (rule.quantity,) if isinstance(rule, SymmetryRule) else WATCHES[rule.watch].quantities
