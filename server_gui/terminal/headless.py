"""The run without a screen: one compact line a second, and a table of what the run showed."""

import math

from gateway.client import ConnectionState
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import Gait
from server_gui.terminal.summary import Range, Summary

NONE = "–"


def line(robot: Robot, gait: Gait, elapsed_s: float) -> str:
    """Return the present state in one line."""
    joints = " ".join(_degrees(robot.values.get(f"{name}.position")) for name in robot.names("joint"))
    feet = "/".join(_newtons(robot.values.get(f"{name}.force")) for name in robot.names("insole"))
    tilts = " ".join(_degrees(robot.values.get(f"{name}.tilt_forward")) for name in robot.names("imu"))
    cpu = robot.resources.cpu.percent if robot.resources is not None else None
    wrong = ", ".join(f"{part.name} {part.state}" for part in robot.not_ok()) or "all ok"
    return (
        f"{elapsed_s:5.0f} s  {_link(robot)}  joints {joints} °  feet {feet} N  "
        f"trunk {tilts} °  {_cadence(gait)}  cpu {NONE if cpu is None else f'{cpu:.0f}'} %  {wrong}"
    )


def _link(robot: Robot) -> str:
    age_s = robot.age_s()
    age = NONE if age_s is None else f"{age_s * 1000:.0f} ms"
    if robot.link.state is not ConnectionState.CONNECTED:
        return f"{robot.link.state.value}, {age} old"
    return f"{'STALE ' if robot.is_stale() else ''}age {age} {robot.rate_text()}"


def table(summary: Summary, gait: Gait, robot: Robot) -> str:
    """Return the summary of the run."""
    link = robot.link
    links = "once" if link.links == 1 else f"{link.links} times"
    lines = [
        "",
        f"{'joint':<14}{'angle over the run':>26}",
        *(f"{name:<14}{_range(seen):>26}" for name, seen in summary.joints.items()),
        "",
        f"{'foot':<14}{'loaded':>26}",
        *(f"{name:<14}{_share(foot.loaded_share):>26}" for name, foot in summary.feet.items()),
        f"the weight changed feet {summary.alternations} times",
        f"at last {_cadence(gait)}, on the ground {_stances(gait)}",
        "",
        f"{'component':<14}{'worst state':>26}",
        *(f"{name:<14}{state:>26}" for name, state in summary.worst.items()),
        "",
        f"{summary.rows} rows, {link.dropped} dropped, {link.missed} batches missed, linked {links}",
    ]
    return "\n".join(lines) + "\n"


def _cadence(gait: Gait) -> str:
    return f"{NONE if gait.cadence_spm is None else f'{gait.cadence_spm:.0f}'} steps/min"


def _stances(gait: Gait) -> str:
    shares = ((leg, gait.legs[leg].stance) for leg in Leg)
    return ", ".join(f"{leg} {NONE if share is None else f'{100 * share:.0f}'} %" for leg, share in shares)


def _degrees(value_rad: float | None) -> str:
    return NONE if value_rad is None else f"{math.degrees(value_rad):+.0f}"


def _newtons(force_n: float | None) -> str:
    return NONE if force_n is None else f"{force_n:.0f}"


def _range(seen: Range) -> str:
    if seen.low is None or seen.high is None:
        return NONE
    return f"{math.degrees(seen.low):+.1f}° … {math.degrees(seen.high):+.1f}°"


def _share(share: float | None) -> str:
    return NONE if share is None else f"{100 * share:.0f} % of the time"
