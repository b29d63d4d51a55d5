"""Mistakes in `[guard]`, each in words with table, key and remedy."""

import fnmatch
from collections.abc import Iterator
from functools import singledispatch

import msgspec

from drivers.bus.settings import Role
from gateway.config.guard import ALARMS, TABLES, WATCHES, GuardSettings
from gateway.config.guard_rules import (
    SIDED,
    EmcyRule,
    GuardRule,
    InputRule,
    RangeRule,
    SymmetryRule,
    SyncRule,
    bit_words,
    mask,
)
from gateway.config.likelihood import implausible
from gateway.config.robot import RobotConfig
from gateway.tables.finding import Finding, meant, warning

_LONG_HEARTBEAT_MS = 1000  # a drive goes on for two or three of them after the gateway died
_LONG_S = 60.0  # longer than what goes wrong with a robot may last before anything is done


def complaints(config: RobotConfig, guard: GuardSettings) -> Iterator[Finding]:
    """Everything that is wrong with a guard's table in this robot's file."""
    if guard.heartbeat_ms is None and not guard.rule and not config.lost.get("guard"):
        yield Finding(
            "[guard]", "", "has neither heartbeat_ms nor a [guard.rule.NAME]: it would watch nothing"
        )
    if guard.heartbeat_ms is not None:
        yield from _about_heartbeat(config)
        yield from _about_period(guard.heartbeat_ms)
    for name, rule in guard.rule.items():
        where = f"[guard.rule.{name}]"
        if name == ALARMS:
            yield Finding(where, "", f"the name {name!r} is taken by the guard itself; choose another")
        yield from _about_numbers(where, rule)
        yield from _about(rule, where, config)
        yield from _about_components(config, where, rule)
        unit = WATCHES[rule.watch].unit
        for key in ("above", "min", "max"):
            if (bound := getattr(rule, key, None)) is not None:
                yield from implausible(where, key, bound, unit)
        for key in ("for_s", "silent_s", "settle_s"):
            if (getattr(rule, key, None) or 0.0) > _LONG_S:
                yield warning(where, key, _waits(getattr(rule, key)))
        if rule.clear_s > _LONG_S:
            text = f"{rule.clear_s:g} s is long: it stays tripped until all has been well for that time"
            yield warning(where, "clear_s", f"{text}; {rule.clear_s:g} ms is {rule.clear_s / 1000:g}")
    yield from _about_doubles(guard)


def _about_doubles(guard: GuardSettings) -> Iterator[Finding]:
    """Yield the same twice: who changes one of them believes that it is changed."""
    seen: dict[bytes, str] = {}
    for name, rule in guard.rule.items():
        where = f"[guard.rule.{name}]"
        other = seen.setdefault(msgspec.json.encode(rule, order="sorted"), where)
        if other != where:
            yield warning(where, "", f"says the same as {other}: keep one of them")


def _about_period(heartbeat_ms: int) -> Iterator[Finding]:
    if heartbeat_ms > _LONG_HEARTBEAT_MS:
        text = (
            f"{heartbeat_ms} is long: for more than that a drive goes on by itself after the gateway died; "
            "usual are 50 to 500"
        )
        yield warning("[guard]", "heartbeat_ms", text)


def _waits(seconds: float) -> str:
    return f"{seconds:g} s is long for a guard to wait; {seconds:g} ms is {seconds / 1000:g}"


def _about_heartbeat(config: RobotConfig) -> Iterator[Finding]:
    if not config.names("joint"):
        yield Finding("[guard]", "heartbeat_ms", "there is no joint whose drive could be armed")
    for name in dict.fromkeys(joint.bus for joint in config.joint.values()):
        bus = config.can.get(name)
        if bus is None:
            continue
        if bus.node_id is None:
            text = (
                "is missing, which [guard] heartbeat_ms needs: a node id that nobody else on that bus has, "
                "under which our heartbeat is sent"
            )
            yield Finding(f"[can.{name}]", "node_id", text)
        if bus.heartbeat_s is not None:
            text = "the guard's heartbeat_ms sends the heartbeat of that bus; remove heartbeat_s"
            yield Finding(f"[can.{name}]", "heartbeat_s", text)


def _about_numbers(where: str, rule: GuardRule) -> Iterator[Finding]:
    numbers = {key: getattr(rule, key) for key in rule.__struct_fields__}
    hysteresis, above = (numbers.get(key) for key in ("hysteresis", "above"))
    if hysteresis is not None and above is not None and hysteresis >= above:
        yield Finding(where, "hysteresis", f"{hysteresis:g} is not below above: it would never be over")


@singledispatch
def _about(_rule: GuardRule, _where: str, _config: RobotConfig) -> Iterator[Finding]:
    """Yield the mistakes in the keys of this kind of rule."""
    yield from ()


@_about.register(RangeRule)
def _range(rule: RangeRule, where: str, _config: RobotConfig) -> Iterator[Finding]:
    if rule.min is None and rule.max is None:
        yield Finding(where, "min, max", "one of them or both are needed: it could never trip")
    elif rule.min is not None and rule.max is not None and rule.max - rule.min <= 2 * rule.hysteresis:
        text = (
            f"nothing lies between min {rule.min:g} and max {rule.max:g} "
            f"with a hysteresis of {rule.hysteresis:g}: it would never be over"
        )
        yield Finding(where, "min", text)


@_about.register(EmcyRule)
def _emcy(rule: EmcyRule, where: str, _config: RobotConfig) -> Iterator[Finding]:
    for code in rule.codes or ():
        if code.startswith("0x0"):
            yield Finding(where, "codes", f"{code} says that an error is over; name errors, 0x1 to 0xFFFF")


@_about.register(InputRule)
def _input(rule: InputRule, where: str, _config: RobotConfig) -> Iterator[Finding]:
    if not mask(rule.must_be_set) | mask(rule.must_be_clear):
        text = "one of them or both are needed, with a bit: it could never trip"
        yield Finding(where, "must_be_set, must_be_clear", text)
    both = mask(rule.must_be_set) & mask(rule.must_be_clear)
    if both:
        yield Finding(where, "must_be_clear", f"{bit_words(both)} must be set too: it would never be over")


@_about.register(SyncRule)
def _sync(rule: SyncRule, where: str, config: RobotConfig) -> Iterator[Finding]:
    ours = config.gateway.role is Role.MASTER
    for name, bus in config.can.items():
        if ours and bus.sync_period_s and any(fnmatch.fnmatchcase(name, glob) for glob in rule.on or "*"):
            text = f"the SYNC of [can.{name}] is ours (sync_period_s), and not heard; leave it out"
            yield Finding(where, "on", text)


@_about.register(SymmetryRule)
def _symmetry(rule: SymmetryRule, where: str, config: RobotConfig) -> Iterator[Finding]:
    if rule.on is not None:
        yield Finding(where, "on", f"{rule.watch} watches its left and right; remove on")
    if rule.left == rule.right:
        yield Finding(where, "right", f"{rule.right!r} is its left too; name the other side")
    kind, _unit = SIDED[rule.quantity]
    known = config.names(TABLES[kind])
    for key, name in (("left", rule.left), ("right", rule.right)):
        if name not in known:
            here = ", ".join(known) or "none"
            text = f"{name!r} is no {kind}, which has a {rule.quantity}: {meant(name, known)}here are {here}"
            yield Finding(where, key, text)


def _about_components(config: RobotConfig, where: str, rule: GuardRule) -> Iterator[Finding]:
    kinds = WATCHES[rule.watch].kinds
    known = config.names(*(TABLES[kind] for kind in kinds))
    what = " or ".join(kinds)
    if not known:
        yield Finding(where, "watch", f"{rule.watch} watches each {what}, and this robot has none")
    for glob in rule.on or ():
        if known and not fnmatch.filter(known, glob):
            text = f"{glob!r} is no {what} of this robot; {meant(glob, known)}here are {', '.join(known)}"
            yield Finding(where, "on", text)
