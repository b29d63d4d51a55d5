"""What stands in the cells of the joint table: what each drive tells, and how far it is from a limit."""

import re
from dataclasses import dataclass
from typing import Final

from gateway.units import Unit, rounded
from server_gui.core.alarms.advice import split_advice
from server_gui.core.alarms.alarm import Alarm
from server_gui.core.alarms.beyond import is_hot
from server_gui.core.alarms.marks import GLYPHS
from server_gui.core.alarms.severity import colour_of
from server_gui.core.alarms.texts import OF_VALUES, Kind, error_text
from server_gui.core.alarms.unconfirmed import enabled_mark
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.robot import FollowedComponent
from server_gui.core.tuning.stop import StopState, is_off
from server_gui.views.marks import state_mark

# column → quantity; the SI unit of each
COLUMNS: Final = (
    ("Joint", ""),
    ("State", ""),
    ("Angle / target", "position"),
    ("Velocity", "velocity"),
    ("Torque", "torque"),
    ("Current", "current"),
    ("Temp.", "temperature"),
    ("Error", "error_code"),
    ("Confirmed after", ""),
)
JOINT, STATE, ANGLE, VELOCITY, TORQUE, CURRENT, TEMPERATURE, ERROR, STOP = range(len(COLUMNS))
SI: Final = {
    "position": "rad",
    "velocity": "rad/s",
    "torque": "N·m",
    "current": "A",
    "temperature": "°C",
}
SIGNED: Final = frozenset({"position", "velocity", "torque", "current"})
ENABLED_AGAIN: Final = "enabled again"  # after which the latest STOP is no news
# How error codes of CiA 402 begin (IEC 61800-7-201) → the column that holds what they are about.
ABOUT: Final = {0x2000: CURRENT, 0x4000: TEMPERATURE, 0x8400: VELOCITY}
FAMILIES: Final = (0xF000, 0xFF00)  # of a code: how much of it says what it is about
FAR_RAD: Final = 0.175  # 10°: the end of the bar of how far a joint is from its target
NEAR_LIMIT: Final = 0.8  # of a limit
CODE: Final = re.compile(r"0x[0-9A-Fa-f]{4}(?P<words> [^(;:]+)?")
ENABLED: Final = "operation enabled"  # only then it is to be where its target is
NONE: Final = "–"
NOT_KNOWN: Final = "not known"
OFF: Final = "off"  # instead of a target, of a drive that neither holds nor brakes (CiA 402-2)
WITHOUT_POWER: Final = frozenset({"not ready to switch on", "switch on disabled", "ready to switch on"})
IN_FAULT: Final = "the drive is in fault: "  # with which what a robot says of it begins


@dataclass(frozen=True, slots=True)
class Bar:
    """From the middle to one side, −1 to 1; `colour` is a name of the palette."""

    share: float
    colour: str


@dataclass(frozen=True, slots=True)
class Cell:
    """What stands in a cell, in which colour of the palette, and below it a bar."""

    text: str
    colour: str = "text"
    bar: Bar | None = None
    tip: str = ""


def unit_of(desk: Desk, quantity: str) -> Unit:
    """Return the unit in which a quantity is shown."""
    return desk.shown.units.unit(quantity, SI[quantity])


def row_of(station: Station, joint: str, desk: Desk) -> list[Cell]:
    """Return the cells of a joint, as it is now."""
    robot = station.robot
    part = robot.parts[joint]
    gone = part.state in ("stale", "lost")
    stale = gone or not station.is_live
    word = part.state if gone else robot.word(f"{joint}.state")
    mark = enabled_mark(robot, station.stopping) if word == ENABLED else state_mark(word)
    colour = colour_of(joint, station.alarms, mark.colour) if gone else mark.colour
    age = "" if not gone or part.age_ms is None else f" {part.age_ms / 1000:.1f} s"
    side = joint.partition("_")[0]
    was = "was " if word == ENABLED and not station.is_live else ""
    state = f"{GLYPHS.get(mark.shape, '◆')} {was}{mark.word}{age}"
    return [
        Cell(joint.replace("_", " "), side if side in ("left", "right") else "text"),
        Cell(state, "old" if not station.is_live else colour),
        _angle(station, joint, desk, stale=stale),
        *(_value(station, joint, "velocity", desk, stale=stale),),
        _torque(station, joint, desk, stale=stale),
        *(_value(station, joint, quantity, desk, stale=stale) for quantity in ("current", "temperature")),
        _error(station, part, stale=stale),
        _stop(station, joint),
    ]


def _value(station: Station, joint: str, quantity: str, desk: Desk, *, stale: bool) -> Cell:
    value = station.robot.values.get(f"{joint}.{quantity}")
    known = "warn" if quantity == "temperature" and is_hot(value) else "text"
    return Cell(_text(unit_of(desk, quantity), quantity, value), "old" if stale or value is None else known)


def _text(unit: Unit, quantity: str, value: float | None) -> str:
    if value is None:
        return "–"
    return rounded(value * unit.scale, unit.digits, "+" if quantity in SIGNED else "")


def _angle(station: Station, joint: str, desk: Desk, *, stale: bool) -> Cell:
    """Return where it is, where it should be, and how far that is apart."""
    unit = unit_of(desk, "position")
    position, target = station.robot.values.get(f"{joint}.position"), _target(station, joint)
    word = station.robot.word(f"{joint}.state")
    if not stale and is_off(word):
        target = None  # it goes to none
    aim = OFF if not stale and word in WITHOUT_POWER else _text(unit, "position", target)
    text = f"{_text(unit, 'position', position)} / {aim}"
    beyond = next((one for one in _of_values(station, joint) if one.kind is Kind.BEYOND), None)
    known = "text" if beyond is None else beyond.mark.colour
    if position is None or target is None:
        return Cell(text, "old" if stale or position is None else known)
    off = position - target
    follows = not stale and word == ENABLED
    bar = None if not follows else Bar(off / FAR_RAD, "warn" if abs(off) > FAR_RAD / 2 else "accent")
    return Cell(
        text, "old" if stale else known, bar, f"{_text(unit, 'position', off)} {unit.symbol} from its target"
    )


def _target(station: Station, joint: str) -> float | None:
    """Return the target; if the drive tells none, its position plus its following error."""
    values = station.robot.values
    position, error = values.get(f"{joint}.position"), values.get(f"{joint}.following_error")
    told = values.get(f"{joint}.target_position")
    if told is not None or position is None or error is None:
        return told
    return position + error


def _torque(station: Station, joint: str, desk: Desk, *, stale: bool) -> Cell:
    """Return the torque as a share of what the drive may give, where that is known."""
    plain = _value(station, joint, "torque", desk, stale=stale)
    value, held = (
        station.robot.values.get(f"{joint}.torque"),
        station.robot.parameters.get(f"{joint}.max_torque"),
    )
    if value is None or held is None or not held.value or held.unit != SI["torque"]:
        return plain
    limit, share = f"{held.value * unit_of(desk, 'torque').scale:g}", value / held.value
    text = f"{plain.text} / {limit}"
    if stale:
        return Cell(text, plain.colour)
    colour = "bad" if abs(share) >= 1.0 else "warn" if abs(share) >= NEAR_LIMIT else "accent"
    return Cell(text, plain.colour, Bar(share, colour), f"{100 * abs(share):.0f} % of its limit")


def _error(station: Station, part: FollowedComponent, *, stale: bool) -> Cell:
    """Return the drive's error code in words, or what is wrong with the component.

    Nothing known is no dash.
    """
    code = station.robot.values.get(f"{part.name}.error_code")
    problem, colour = part.problem or "", colour_of(part.name, station.alarms)
    if code:
        number = f"0x{int(code):04X}"
        found = CODE.search(problem)
        words = (found["words"] or "").strip() if found and found[0].startswith(number) else ""
        said = f"{number} {words}" if words else error_text(int(code))
        return Cell(said, "old" if stale else colour, None, "\n".join(filter(None, (problem, said))))
    if part.state != "ok" and problem:
        told = CODE.match(problem.removeprefix(IN_FAULT))  # also where the code is not among what is sent
        said = told[0].strip() if told else split_advice(problem)[0]
        return Cell(said, "old" if not station.is_live else colour, None, problem)
    if stale:
        return Cell(NOT_KNOWN, "old")
    if beyond := _of_values(station, part.name):
        return Cell(beyond[0].mark.word, beyond[0].mark.colour, None, beyond[0].what)
    return Cell("–", "dim")


def _of_values(station: Station, joint: str) -> list[Alarm]:
    """Return the alarms of its values, the worst first."""
    found = [one for one in station.alarms.each if one.subject == joint and one.kind in OF_VALUES]
    return sorted(found, key=lambda alarm: alarm.rank)


def at_fault(station: Station, joints: list[str]) -> frozenset[int]:
    """Return the columns of the values that the drives' errors are about, or that are wrong themselves."""
    is_one_hot = any(is_hot(station.robot.values.get(f"{one}.temperature")) for one in joints)
    hot = frozenset({TEMPERATURE} if is_one_hot else ())
    codes = [int(station.robot.values.get(f"{joint}.error_code") or 0) for joint in joints]
    return hot | frozenset(ABOUT[code & part] for code in codes for part in FAMILIES if code & part in ABOUT)


def _stop(station: Station, joint: str) -> Cell:
    """Return what has shown that the latest stop stopped this drive.

    Without proof it is not known to have.
    """
    stopping = station.stopping
    proof = stopping.proofs.get(joint)
    if proof is not None:
        if station.robot.word(f"{joint}.state") == ENABLED:
            return Cell(ENABLED_AGAIN, "dim", None, f"{proof.text}; enabled again since")
        is_past = stopping.state is StopState.IDLE  # it was reset since
        is_ours = stopping.state is not StopState.NOT_CONFIRMED or joint in stopping.confirmed
        colour = "dim" if proof.was_so or is_past or not is_ours else "good"
        tip = f"{proof.text}, which was reset since" if is_past else proof.text
        return Cell(proof.when, colour if station.is_live else "old", None, tip)
    if stopping.state is StopState.IDLE:
        return Cell(NONE, "dim", None, "no stop was sent since the window opened")
    return Cell("no proof", "bad" if stopping.state is StopState.NOT_CONFIRMED else "warn")
