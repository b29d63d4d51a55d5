"""A robot's alarms, from what is known of it. What is not known is an alarm too."""

import dataclasses
import re
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from drivers.error_codes import code_in
from gateway.client import ConnectionState
from gateway.plain_text import one_line
from gateway.wire.robot import GuardRuleInfo
from ml.danger.levels import Level
from server_gui.core.alarms.advice import split_advice
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.beyond import FoundBeyond
from server_gui.core.alarms.bus_alarms import bus_alarms
from server_gui.core.alarms.causes import Stall, stood_still
from server_gui.core.alarms.drive_states import FAULTY, device_of, drives_did, listed
from server_gui.core.alarms.marks import age_text
from server_gui.core.alarms.overload import load_first, overloaded
from server_gui.core.alarms.silent_nodes import MISSED_CODES, NO_VALUES, said_of_missed, silent_nodes
from server_gui.core.alarms.simulated import without_wires
from server_gui.core.alarms.stop_alarms import stop_alarms
from server_gui.core.alarms.texts import Kind, check_of, error_check, error_text
from server_gui.core.alarms.undriven import is_driven
from server_gui.core.follow.robot import FollowedComponent, Robot
from server_gui.core.prediction.newest_predictions import ShownDanger
from server_gui.core.processing import bus_health
from server_gui.core.tuning.stop import StopProgress

UNLOOKED_S: Final = 8.0  # without a word of how devices are: several looks have failed
NOT_LOOKED: Final = "how its devices are has not come for some seconds: ok is what they were"
NO_CODE_YET: Final = "its code has not come yet"
NO_CODE_THEN: Final = "its code is not known at this instant"
_PREFIX: Final = re.compile(r"^(the drive is in fault: |it reports )")
_LASTING: Final = re.compile(r" \(for \d+ s\)")  # an alarm says by itself since when
_MISSING: Final = re.compile(r"(?<=heartbeat has been missing for )(?=\d)")  # it is so still, and longer
# What shows it best, by the code's beginning; else the position.
_SHOWN_BY: Final = (
    ("2", ("current", "torque")),
    ("3", ("voltage", "current")),
    ("4", ("temperature",)),
    ("71", ("torque", "current")),
    ("83", ("torque", "current")),
    ("84", ("velocity",)),
    ("86", ("following_error", "target_position", "position")),
)
_KINDS: Final = {
    "fault": Kind.IMPLAUSIBLE,
    "lost": Kind.LOST,
    "stale": Kind.PART_STALE,
}


@dataclass(frozen=True, slots=True)
class Facts:
    """What alarms are found in; `journal` is the robot's, oldest first."""

    robot: Robot
    stopping: StopProgress
    address: str
    journal: Iterable[Mapping[str, Any]] = ()
    stalls: Sequence[Stall] = ()
    danger: ShownDanger | None = None
    is_overloaded: bool = False  # this computer
    beyond: Sequence[FoundBeyond] = ()


def alarms(facts: Facts) -> Iterator[Alarm]:
    """Yield what is wrong now, in no order."""
    first = overloaded(facts.robot, is_ours=facts.is_overloaded)
    told = without_wires(map(_in_one_line, _found(facts)), facts.robot)
    return load_first(told, first, len(facts.robot.parts))


def _in_one_line(alarm: Alarm) -> Alarm:
    """Return it without lines of its own, which would look like ours: a robot may say what it likes."""
    what, did, check, why, aside = map(one_line, (alarm.what, alarm.did, alarm.check, alarm.why, alarm.aside))
    return dataclasses.replace(alarm, what=what, did=did, check=check, why=why, aside=aside)


def _found(facts: Facts) -> Iterator[Alarm]:
    robot = facts.robot
    yield from stop_alarms(robot, facts.stopping)
    if not robot.is_recording:
        yield from _of_link(robot, facts.address)
    for name in robot.names("joint"):
        yield from _of_drive(robot, name, facts.stopping)
    for part in robot.parts.values():
        if not part.comes_up:
            yield from _of_part(robot, part, facts.stopping)
    yield from _of_silent(robot)
    yield from _of_those_that_come_up(robot)
    yield from _of_looks(robot)
    yield from _of_guard(facts)
    yield from _of_buses(robot)
    yield from _of_beyond(facts)
    yield from _of_danger(facts)
    if not robot.is_recording:
        yield from stood_still(facts.stalls)


def _did(robot: Robot, stopping: StopProgress) -> str:
    """Return what the robot did about it, as far as is known."""
    held = f"STOP is held ({stopping.reason})" if stopping.held and stopping.reason else ""
    held = held or ("STOP is held" if stopping.held else "")
    return "; ".join(filter(None, (held, drives_did(robot))))


# --- the link


def _of_link(robot: Robot, address: str) -> Iterator[Alarm]:
    link = robot.link
    since_s = _utc_s(link.since_ns) if link.since_ns else None
    shown = f"what is shown is {age_text(robot.age_s())} old" if robot.age_s() is not None else ""
    if link.state is not ConnectionState.CONNECTED:
        kind = Kind.NO_LINK if link.links else Kind.NEVER_REACHED
        kind = Kind.ANOTHER if link.is_another else kind
        what = link.problem or f"{address} does not answer yet"
        did = "what it does now is not known" + (f"; {shown}" if shown else "")
        yield Alarm(kind, "", what, did=did, check=check_of(kind), since_s=since_s if link.links else None)
    elif robot.age_s() is None:
        what = "linked, but no value has come"
        yield Alarm(Kind.NO_DATA, "", what, check=check_of(Kind.NO_DATA), since_s=since_s)
    elif robot.is_stale():
        since_s = robot.now_s() - (robot.age_s() or 0.0)
        yield Alarm(
            Kind.STALE, "", "nothing new comes", did=shown, check=check_of(Kind.STALE), since_s=since_s
        )


# --- drives and sensors


def _of_drive(robot: Robot, name: str, stopping: StopProgress) -> Iterator[Alarm]:
    part = robot.parts[name]
    if not _is_in_fault(robot, part):
        return
    said, code = _cause(robot, part)
    what, more = split_advice(said_of_missed(code, said))
    check = check_of(Kind.FAULT) if code is None else error_check(code)
    yield Alarm(
        Kind.FAULT,
        name,
        what,
        where=_where(robot, name),
        did=_did(robot, stopping),
        check="; ".join(filter(None, (check, more))),
        channel=_channel(robot, name, code),
        grade=code or 0,
        clears=not robot.is_recording,
        is_now=not robot.is_stale(),
    )


def _is_in_fault(robot: Robot, part: FollowedComponent) -> bool:
    is_told = part.state == "fault" and "in fault" in (part.problem or "")
    return is_told or robot.word(f"{part.name}.state") in FAULTY


def _cause(robot: Robot, part: FollowedComponent) -> tuple[str, int | None]:
    """Return why a drive is in fault, and its code: as the robot says, else by the drive's own code."""
    said = _LASTING.sub("", _PREFIX.sub("", part.problem or ""))
    if (code := code_in(said)) is not None:
        return said, code
    told = robot.values.get(f"{part.name}.error_code")
    if told:
        return error_text(int(told)), int(told)
    return said or (NO_CODE_THEN if robot.is_recording else NO_CODE_YET), None


def _of_part(robot: Robot, part: FollowedComponent, stopping: StopProgress) -> Iterator[Alarm]:
    if robot.is_recording:
        return
    problem = _MISSING.sub("more than ", _LASTING.sub("", part.problem or ""))
    where = _where(robot, part.name)
    kind = _KINDS.get(part.state)
    channel = _channel(robot, part.name, None)
    is_now = not robot.is_stale()
    if part.state == "ok":
        code = code_in(problem)
        if problem.startswith("it reports ") and code is not None:
            check = error_check(code)
            what = said_of_missed(code, _PREFIX.sub("", problem))
            yield Alarm(
                Kind.REPORTS,
                part.name,
                what,
                where,
                check=check,
                channel=channel,
                grade=code,
                clears=True,
                is_now=is_now,
            )
        return
    if part.kind == "joint" and (robot.word(f"{part.name}.state") in FAULTY or "in fault" in problem):
        return  # told as the drive's fault
    if kind is None:
        what = problem or f"the robot says {part.state!r} of it"
        yield Alarm(Kind.UNKNOWN, part.name, what, where, check=check_of(Kind.UNKNOWN), is_now=is_now)
        return
    did = _did(robot, stopping) if part.kind == "joint" else ""
    what, advice = split_advice(problem)
    if problem.startswith("it reports ") and ";" not in what:
        what = said_of_missed(code_in(problem), what)
    since_s = None if part.age_ms is None or not is_now else time.time() - part.age_ms / 1000
    yield Alarm(
        kind,
        part.name,
        what or "it does not say why",
        where,
        did,
        advice or check_of(kind, part.kind),  # who says what is wrong knows best
        since_s if kind is not Kind.IMPLAUSIBLE else None,
        channel,
        is_now=is_now,
        node=_bus(robot, part.name),
    )


def _of_silent(robot: Robot) -> Iterator[Alarm]:
    """Yield the nodes that others miss already, and of which nothing comes, before the robot has said so."""
    if robot.is_recording:
        return
    reporters = {
        part.name
        for part in robot.parts.values()
        if (part.kind == "joint" and _is_in_fault(robot, part) and _cause(robot, part)[1] in MISSED_CODES)
        or code_in(part.problem or "") in MISSED_CODES
    }
    for name in silent_nodes(robot, reporters, lambda name: _bus(robot, name)):
        check = check_of(Kind.PART_STALE, robot.parts[name].kind)
        yield Alarm(
            Kind.PART_STALE, name, NO_VALUES, _where(robot, name), check=check, node=_bus(robot, name)
        )


def _of_those_that_come_up(robot: Robot) -> Iterator[Alarm]:
    """One alarm, not one a device, while a gateway that was asked just now begins to read."""
    names = [part.name for part in robot.parts.values() if part.comes_up]
    if names and not robot.is_recording:
        yield Alarm(
            Kind.NO_DATA,
            "devices",
            f"not read yet: {listed(names)}",
            check=check_of(Kind.NO_DATA),
            is_now=not robot.is_stale(),
        )


def _of_looks(robot: Robot) -> Iterator[Alarm]:
    """Yield that nobody tells how its devices are, though rows come: "ok" is what they were."""
    if robot.is_recording or not robot.is_linked or not robot.parts or robot.unlooked_s < UNLOOKED_S:
        return
    yield Alarm(
        Kind.UNKNOWN,
        "devices",
        NOT_LOOKED,
        check=check_of(Kind.STALE),
        since_s=time.time() - robot.unlooked_s,
        is_now=not robot.is_stale(),
    )


# --- guard and buses


def _of_guard(facts: Facts) -> Iterator[Alarm]:
    robot, description = facts.robot, facts.robot.description
    if description is None or not description.guard.configured:
        return
    if description.guard.problem is not None:
        why = f"it does not run: {description.guard.problem}"
        yield Alarm(Kind.BLIND, "guard", why, "the guard", check=check_of(Kind.BLIND), is_now=False)
    for rule in description.guard.rules:
        word = robot.word(f"guard.{rule.name}")
        kind = {"tripped": Kind.GUARD, "blind": Kind.BLIND}.get(word or rule.state)
        if kind is not None:
            yield _of_rule(kind, rule, facts, is_now=word is not None and not robot.is_stale())


def _of_rule(kind: Kind, rule: GuardRuleInfo, facts: Facts, *, is_now: bool) -> Alarm:
    blind = "; ".join(rule.problems) if kind is Kind.BLIND else ""
    why = _told(facts.journal, rule.name) or rule.reason or blind or f"{rule.watch} {rule.limit}"
    actions = ", ".join(action.replace("_", " ") for action in rule.actions)
    did = f"the rule's actions: {actions}" if kind is Kind.GUARD and actions else ""
    drives = drives_did(facts.robot) if kind is Kind.GUARD else ""
    on = next((name for name in rule.on if name in facts.robot.parts), None)
    channel = None if on is None else _channel(facts.robot, on, None, (rule.watch,))
    did = "; ".join(filter(None, (did, drives)))
    where = f"rule {rule.name}"
    return Alarm(kind, f"guard.{rule.name}", why, where, did, check_of(kind), None, channel, is_now=is_now)


def _told(journal: Iterable[Mapping[str, Any]], rule: str) -> str:
    """Return what the guard last wrote of one of its rules."""
    found = ""
    for entry in journal:
        if entry.get("who") == "guard" and entry.get("about") == rule and entry.get("what") == "alarm":
            found = str(entry.get("reason") or "")
    return found


def _of_buses(robot: Robot) -> Iterator[Alarm]:
    """As they are now; where nobody looks at them, as the robot has told it once with the link."""
    if robot.is_recording or robot.description is None:
        return
    now = bus_health.seen(robot)
    for bus in robot.description.buses if now is None else now:
        yield from bus_alarms(bus, is_now=now is not None)


# --- values beyond their limits


def _of_beyond(facts: Facts) -> Iterator[Alarm]:
    """Yield them."""
    robot = facts.robot
    for one in facts.beyond:
        code = robot.values.get(f"{one.component}.error_code") or 0
        if one.kind is Kind.HOT and _is_in_fault(robot, robot.parts[one.component]) and int(code) >> 12 == 4:
            continue  # its drive says so itself
        yield Alarm(
            one.kind,
            one.component,
            one.what,
            _where(robot, one.component),
            _did(robot, facts.stopping),
            check_of(one.kind),
            channel=_channel(robot, one.component, None, (one.quantity,)),
            grade=one.grade,
            is_now=one.is_now and not robot.is_stale(),
        )


# --- danger


def _of_danger(facts: Facts) -> Iterator[Alarm]:
    """Yield the alarm from advice on; what was so last does not end by being unknown."""
    shown = facts.danger
    known = None if shown is None else shown.known
    if shown is None or known is None or known.level < Level.ADVICE:
        return
    if not is_driven(facts.robot, facts.stopping):
        return
    kind = Kind.DANGER if known.level >= Level.ALARM else Kind.DANGER_ADVICE
    did = "" if shown.is_known else "whether it is so still is not known"
    level = f"level {known.level.word}"
    yield Alarm(kind, "danger", known.reasons, level, did, check_of(kind), is_now=shown.is_known)


# --- small things


def _where(robot: Robot, name: str) -> str:
    """`left knee, node 2 on can0`."""
    spoken, bus = name.replace("_", " "), _bus(robot, name)
    return f"{spoken}, node {device_of(robot, name)['node_id']} on {bus}" if bus else spoken


def _bus(robot: Robot, name: str) -> str:
    """Return the bus of a component that is a node."""
    device = device_of(robot, name)
    return str(device.get("bus", "its bus")) if "node_id" in device else ""


def _channel(robot: Robot, name: str, code: int | None, first: tuple[str, ...] = ()) -> str | None:
    """Return the channel that shows what is wrong with a component, of those that the robot has."""
    known = () if robot.description is None else robot.description.channels
    names = [channel.name for channel in known if channel.component == name and not channel.enum]
    told = "" if code is None else f"{code:04X}"
    wanted = next((shown for begin, shown in _SHOWN_BY if told.startswith(begin)), ()) if told else ()
    for quantity in (*first, *wanted, "position", "force", "tilt_forward"):
        if f"{name}.{quantity}" in names:
            return f"{name}.{quantity}"
    return names[0] if names else None


def _utc_s(monotonic_ns: int) -> float:
    return time.time() - (time.monotonic_ns() - monotonic_ns) / 1e9
