"""What cannot work in `[guard]`, each in words with the table, the key and what to do."""

import fnmatch
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from gateway.guard.settings import (
    WATCHES,
    EmcyRule,
    GuardSettings,
    HeatRule,
    LevelRule,
    RangeRule,
    Rule,
)

if TYPE_CHECKING:
    from gateway.config import RobotConfig

ALARMS = "alarms"  # the channel that counts them; no rule is called so


def complaints(config: "RobotConfig", guard: GuardSettings) -> Iterator[str]:
    """Everything that is wrong with a guard's table in this robot's file."""
    if guard.heartbeat_ms is None and not guard.rule:
        yield "[guard] has neither heartbeat_ms nor a [guard.rule.NAME]: it would watch nothing"
    if guard.heartbeat_ms is not None:
        yield from _about_heartbeat(config)
    for name, rule in guard.rule.items():
        where = f"[guard.rule.{name}]"
        if name == ALARMS:
            yield f"{where}: the name {name!r} is taken by the guard itself; choose another"
        yield from _about_numbers(where, rule)
        yield from _about_components(config, where, rule)


def _about_heartbeat(config: "RobotConfig") -> Iterator[str]:
    if not config.joint:
        yield "[guard] heartbeat_ms: there is no joint whose drive could be armed"
    for name in dict.fromkeys(joint.bus for joint in config.joint.values()):
        bus = config.can[name]
        if bus.node_id is None:
            yield (
                f"[guard] heartbeat_ms: [can.{name}] lacks node_id: a node id that nobody else on that bus "
                "has, under which our heartbeat is sent"
            )
        if bus.heartbeat_s is not None:
            yield (
                f"[can.{name}] heartbeat_s: the guard's heartbeat_ms sends the heartbeat of that bus; "
                "remove heartbeat_s"
            )


def _about_numbers(where: str, rule: Rule) -> Iterator[str]:
    for key in rule.__struct_fields__:
        number = getattr(rule, key)
        if isinstance(number, float) and not math.isfinite(number):
            yield f"{where} {key}: {number} is no finite number"
    if isinstance(rule, LevelRule | HeatRule) and rule.hysteresis >= rule.above:
        yield f"{where} hysteresis: {rule.hysteresis:g} is not below above: it would never be over"
    if isinstance(rule, RangeRule):
        yield from _about_range(where, rule)
    if isinstance(rule, EmcyRule):
        for code in rule.codes or ():
            if code.startswith("0x0"):
                yield f"{where} codes: {code} says that an error is over; name errors, 0x1 to 0xFFFF"


def _about_range(where: str, rule: RangeRule) -> Iterator[str]:
    if rule.min is None and rule.max is None:
        yield f"{where} lacks min, max or both: it could never trip"
    elif rule.min is not None and rule.max is not None and rule.max - rule.min <= 2 * rule.hysteresis:
        yield (
            f"{where} min: nothing lies between min {rule.min:g} and max {rule.max:g} "
            f"with a hysteresis of {rule.hysteresis:g}: it would never be over"
        )


def _about_components(config: "RobotConfig", where: str, rule: Rule) -> Iterator[str]:
    kinds = WATCHES[rule.watch].kinds
    known = [name for kind in kinds for name in getattr(config, kind.value)]
    what = " or ".join(kinds)
    if not known:
        yield f"{where} watch: {rule.watch} watches each {what}, and this robot has none"
    for glob in rule.on or ():
        if known and not fnmatch.filter(known, glob):
            yield f"{where} on: {glob!r} is no {what} of this robot; here are {', '.join(known)}"
