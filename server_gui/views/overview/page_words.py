"""What the overview says beside its pictures, and when what has happened stands in its plots."""

from typing import Final

from gateway.units import Unit, rounded
from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.severity import worst_of
from server_gui.core.desk.soles import Load
from server_gui.core.desk.station import Station
from server_gui.views.marks import age_text, old_text
from server_gui.views.widgets.figure import Pose
from server_gui.views.widgets.plot import PlacedFlag

SIDES: Final = ("left", "right")


def unwell_sensors(station: Station) -> tuple[list[str], Mark]:
    """Return what of the wearer's sensors is not well, and the mark of the worst of it."""
    joints = station.robot.names("joint")
    names = [part.name for part in station.robot.not_ok() if part.name not in joints]
    shown = [name for name in names if name.endswith("_insole") or name == "trunk"]
    return [name.replace("_", " ") for name in shown], worst_of(shown, station.alarms)


def legs_of(station: Station) -> tuple[str, ...]:
    """Return the sides of which the robot has a joint; both where that is not known."""
    joints = station.robot.names("joint")
    return tuple(side for side in SIDES if any(one.startswith(side) for one in joints)) or SIDES


def placed_flags(station: Station, seconds: float) -> list[PlacedFlag]:
    """Return what has happened within the last `seconds`, s until the newest row."""
    newest_ns = station.rings.newest_ns
    if newest_ns is None:
        return []
    found = station.flags.between(newest_ns - round(seconds * 1e9), newest_ns + 1)
    return [PlacedFlag((flag.at_ns - newest_ns) / 1e9, flag.kind, flag.text) for flag in found]


def load_texts(side: str, load: Load, force: Unit) -> tuple[str, ...]:
    """Return how much a foot carries, the fullest wording first."""
    if load.problem or load.force is None:
        return f"{side.upper()}  {load.problem or 'not known'}", f"{side[0].upper()}  –"
    said = f"{force.text(load.force)} {force.symbol}"
    return f"{side.upper()}  {said}", f"{side[0].upper()}  {said}"


def age_texts(station: Station) -> tuple[str, ...]:
    """Return how old the values are."""
    if not station.is_live:
        return old_text(station)
    age = age_text(station.robot.age_s())
    return (f"{age} old then",) if station.robot.is_recording else (f"age {age}",)


def angle_texts(pose: Pose, unit: Unit) -> list[str]:
    """Return the angles of hip, knee and ankle."""
    digits = 0 if unit.symbol == "°" else 2
    angles = (pose.hip, pose.knee, pose.ankle)
    mark = unit.symbol if unit.symbol == "°" else ""
    return ["–" if angle is None else f"{rounded(angle * unit.scale, digits, '+')}{mark}" for angle in angles]
