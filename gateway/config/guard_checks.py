"""What cannot work in `[guard]`, each in words with the table, the key and what to do."""

import fnmatch
import math
from collections.abc import Iterator
from functools import singledispatch

from drivers.bus.settings import Role
from gateway.config.guard import ALARMS, TABLES, WATCHES, GuardSettings
from gateway.config.guard_rules import (
    SIDED,
    EmcyRule,
    InputRule,
    RangeRule,
    Rule,
    SymmetryRule,
    SyncRule,
    bit_words,
    mask,
)
from gateway.config.robot import RobotConfig


def complaints(config: RobotConfig, guard: GuardSettings) -> Iterator[str]:
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
        yield from _about(rule, where, config)
        yield from _about_components(config, where, rule)


def _about_heartbeat(config: RobotConfig) -> Iterator[str]:
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
    numbers = {key: getattr(rule, key) for key in rule.__struct_fields__}
    for key, number in numbers.items():
        if isinstance(number, float) and not math.isfinite(number):
            yield f"{where} {key}: {number} is no finite number"
    hysteresis, above = (numbers.get(key) for key in ("hysteresis", "above"))
    if hysteresis is not None and above is not None and hysteresis >= above:
        yield f"{where} hysteresis: {hysteresis:g} is not below above: it would never be over"


@singledispatch
def _about(_rule: Rule, _where: str, _config: RobotConfig) -> Iterator[str]:
    """What is wrong with the keys of this kind of rule."""
    yield from ()


@_about.register(RangeRule)
def _range(rule: RangeRule, where: str, _config: RobotConfig) -> Iterator[str]:
    if rule.min is None and rule.max is None:
        yield f"{where} lacks min, max or both: it could never trip"
    elif rule.min is not None and rule.max is not None and rule.max - rule.min <= 2 * rule.hysteresis:
        yield (
            f"{where} min: nothing lies between min {rule.min:g} and max {rule.max:g} "
            f"with a hysteresis of {rule.hysteresis:g}: it would never be over"
        )


@_about.register(EmcyRule)
def _emcy(rule: EmcyRule, where: str, _config: RobotConfig) -> Iterator[str]:
    for code in rule.codes or ():
        if code.startswith("0x0"):
            yield f"{where} codes: {code} says that an error is over; name errors, 0x1 to 0xFFFF"


@_about.register(InputRule)
def _input(rule: InputRule, where: str, _config: RobotConfig) -> Iterator[str]:
    if not mask(rule.must_be_set) | mask(rule.must_be_clear):
        yield f"{where} lacks must_be_set, must_be_clear or both, with a bit: it could never trip"
    both = mask(rule.must_be_set) & mask(rule.must_be_clear)
    if both:
        yield f"{where} must_be_clear: {bit_words(both)} must be set too: it would never be over"


@_about.register(SyncRule)
def _sync(rule: SyncRule, where: str, config: RobotConfig) -> Iterator[str]:
    ours = config.gateway.role is Role.MASTER
    for name, bus in config.can.items():
        if ours and bus.sync_period_s and any(fnmatch.fnmatchcase(name, glob) for glob in rule.on or "*"):
            yield f"{where} on: the SYNC of [can.{name}] is ours (sync_period_s), and not heard; leave it out"


@_about.register(SymmetryRule)
def _symmetry(rule: SymmetryRule, where: str, config: RobotConfig) -> Iterator[str]:
    if rule.on is not None:
        yield f"{where} on: {rule.watch} watches its left and right; remove on"
    if rule.left == rule.right:
        yield f"{where} right: {rule.right!r} is its left too; name the other side"
    kind, _unit = SIDED[rule.quantity]
    known = getattr(config, TABLES[kind])
    for key, name in (("left", rule.left), ("right", rule.right)):
        if name not in known:
            here = ", ".join(known) or "none"
            yield f"{where} {key}: {name!r} is no {kind}, which has a {rule.quantity}; here are {here}"


def _about_components(config: RobotConfig, where: str, rule: Rule) -> Iterator[str]:
    kinds = WATCHES[rule.watch].kinds
    known = [name for kind in kinds for name in getattr(config, TABLES[kind])]
    what = " or ".join(kinds)
    if not known:
        yield f"{where} watch: {rule.watch} watches each {what}, and this robot has none"
    for glob in rule.on or ():
        if known and not fnmatch.filter(known, glob):
            yield f"{where} on: {glob!r} is no {what} of this robot; here are {', '.join(known)}"
