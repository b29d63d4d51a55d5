"""The dashboard's panels: each draws one part of a robot's state and asks nothing of anybody."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from rich import box
from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from gateway.client import ConnectionState
from gateway.plain_text import plain
from gateway.units import Unit, Units
from gateway.wire.parameter import ParameterInfo, ParameterValue
from ml.danger.levels import Level
from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.marks import ENABLED, GLYPHS
from server_gui.core.alarms.texts import RESET_BUTTON
from server_gui.core.alarms.unconfirmed import enabled_mark, unstopped
from server_gui.core.alarms.undriven import is_driven
from server_gui.core.desk.station import Station
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import Gait
from server_gui.core.tuning.edits import unit_of
from server_gui.core.tuning.stop import StopState
from server_gui.core.tuning.writing import WriteState
from server_gui.terminal.controls import Controls
from server_gui.terminal.marks import (
    BAD,
    COLOURS,
    DIM,
    GOOD,
    NONE,
    OLD,
    WARN,
    bar,
    degrees,
    mark_text,
    needle,
    scale,
    side_colour,
    sparkline,
    state_text,
    words,
)

FULL_FORCE_N = 1000.0
JOINT_LOW_RAD, JOINT_HIGH_RAD = math.radians(-30), math.radians(75)
SHOWN_PROCESSES = 8
TILT_RAD = math.radians(15)
SPARK_SPAN_RAD = math.radians(20)  # at least: a joint at rest is a flat line, not a magnified one
PAST_ROWS = 240
ROWS_A_BLOCK = 6
RESET_KEY = "r r"  # pressed twice: in place of the window's button
SAID_S = 10.0  # for so long what became of a reset is shown
STOP_STYLES = {StopState.SENT: WARN, StopState.CONFIRMED: GOOD, StopState.NOT_CONFIRMED: BAD}
NOT_WRITTEN = (WriteState.FAILED, WriteState.NOT_STORED, WriteState.UNKNOWN)


@dataclass(frozen=True, slots=True)
class PanelWidths:
    """Widths of the drawings in columns, 0 for those left out."""

    angle: int
    past: int
    foot: int
    parameter: int
    share: int
    roomy: bool  # frames, limits and process numbers


WIDE = PanelWidths(angle=28, past=34, foot=20, parameter=10, share=12, roomy=True)
NARROW = PanelWidths(angle=22, past=0, foot=12, parameter=9, share=0, roomy=False)


def header(station: Station, where: str, look: PanelWidths) -> RenderableType:
    """Return the header: the robot, its worst state, its link, the age of its data."""
    robot = station.robot
    row = Table.grid(expand=True, padding=(0, 2))
    row.add_column(ratio=1)
    row.add_column(justify="right")
    name = robot.description.robot if robot.description is not None else where
    known = mark_text(station.mark)
    where = f"{where}  {station.who}" if station.who else where
    row.add_row(
        Text.assemble((plain(name), "bold"), "  ", known, _danger(station), ("  " + plain(where), DIM)),
        _link(robot, look),
    )
    if not look.roomy:
        return row
    return Panel(row, title="[bold]GWRMS[/]", title_align="left", box=box.ROUNDED, border_style=DIM)


def learned(text: str) -> Text:
    """Return the line on a model adapted to the wearer, while it serves or may serve."""
    return Text(plain(text), style=WARN, no_wrap=True, overflow="ellipsis")


def _danger(station: Station) -> Text:
    """Return the level of danger, or that it is not known.

    Nothing where nobody foresees it, or it is no sign.
    """
    shown = station.predictions.danger
    if not station.predictions.foresees or not is_driven(station.robot, station.stopping):
        return words("")
    if shown is None or not shown.is_known:
        return words("  danger: not known", style=OLD)
    level = shown.said.verdict.level
    style = BAD if level >= Level.ALARM else WARN if level > Level.NONE else DIM
    return words(f"  danger: {level.word}", style=style)


def _link(robot: Robot, look: PanelWidths) -> Text:
    link = robot.link
    age_s = robot.age_s()
    if link.state is not ConnectionState.CONNECTED:
        age = f", shown is {age_s:.1f} s old" if age_s is not None else ""
        return words(f"✕ {link.state.value}{age}", style=BAD)
    age = NONE if age_s is None else f"{age_s * 1000:.0f} ms"
    trip = NONE if link.round_trip_ns is None else f"{link.round_trip_ns / 1e6:.1f} ms"
    text = Text.assemble(
        f"age {age}  {robot.rate_text()}  ",
        f"round trip {trip}  " if look.roomy else "",
    )
    lost = link.missed + link.dropped
    text.append(f"lost {lost}", style=WARN if lost else DIM)
    if link.links > 1:
        text.append(f"  links {link.links}", style=WARN)
    return text


def joints(station: Station, look: PanelWidths) -> RenderableType:
    """Return every joint with its drive's state and its angle over the last seconds."""
    robot = station.robot
    stale = robot.is_stale()
    grid = Table(box=None, expand=True, padding=(0, 1), header_style=DIM)
    for title in ("joint", "drive"):
        grid.add_column(title, no_wrap=True)
    grid.add_column("angle", justify="right", no_wrap=True, min_width=7)
    grid.add_column(scale(JOINT_LOW_RAD, JOINT_HIGH_RAD, look.angle), no_wrap=True, min_width=look.angle)
    grid.add_column("last seconds" if look.past else "", no_wrap=True, width=look.past)
    for name in robot.names("joint"):
        channel = f"{name}.position"
        value = robot.values.get(channel)
        colour = OLD if stale or value is None else side_colour(name)
        past = [None if math.isnan(was) else float(was) for was in station.rings.values(channel, PAST_ROWS)]
        past = past[::ROWS_A_BLOCK]
        grid.add_row(
            words(name.replace("_", " "), style=side_colour(name)),
            _drive(station, name, stale),
            words(degrees(value), style=colour),
            words(needle(value, JOINT_LOW_RAD, JOINT_HIGH_RAD, look.angle), style=colour),
            words(sparkline(past, *_spark_range(past), look.past), style=colour),
        )
    return _panel(grid, "Joints", robot)


def _spark_range(past: list[float | None]) -> tuple[float, float]:
    seen = [value for value in past if value is not None] or [0.0]
    low, high = min(seen), max(seen)
    margin = max(0.0, SPARK_SPAN_RAD - (high - low)) / 2
    return low - margin, high + margin


def _drive(station: Station, name: str, stale: bool) -> Text:
    robot = station.robot
    part = robot.parts[name]
    if part.state in ("stale", "lost"):
        return _part_state(robot, name)
    word = robot.word(f"{name}.state")
    if stale or word is None:
        return words(word or NONE, style=OLD)
    code = robot.values.get(f"{name}.error_code")
    more = f"0x{int(code):04X}" if code else ""
    if word == ENABLED:
        return mark_text(enabled_mark(robot, station.stopping), more)
    return state_text(word, more)


def _part_state(robot: Robot, name: str) -> Text:
    part = robot.parts[name]
    text = state_text(part.state)
    if part.state != "ok" and part.age_ms is not None:
        text.append(f" {part.age_ms / 1000:.1f} s", style=OLD)
    return text


def feet_and_trunk(robot: Robot, gait: Gait, look: PanelWidths) -> RenderableType:
    """Return the loads of the feet, the lean of the trunk, and the gait."""
    stale = robot.is_stale()
    grid = Table.grid(expand=True, padding=(0, 1))
    grid.add_column(no_wrap=True)
    grid.add_column(justify="right", min_width=7, no_wrap=True)
    grid.add_column(no_wrap=True)
    for name in robot.names("insole"):
        force = robot.values.get(f"{name}.force")
        colour = OLD if stale or force is None else side_colour(name)
        share = None if force is None else force / FULL_FORCE_N
        label = words(name.replace("_insole", " foot").replace("_", " "), style=side_colour(name))
        number = _part_state(robot, name) if force is None else words(f"{force:.0f} N", style=colour)
        grid.add_row(label, number, words(bar(share, look.foot), style=colour))
    for name in robot.names("imu"):
        for quantity, said in (("tilt_forward", "forward"), ("tilt_side", "to the side")):
            tilt = robot.values.get(f"{name}.{quantity}")
            colour = OLD if stale or tilt is None else "default"
            number = _part_state(robot, name) if tilt is None else words(degrees(tilt), style=colour)
            grid.add_row(
                words(f"{name} {said}"),
                number,
                words(needle(tilt, -TILT_RAD, TILT_RAD, look.foot), style=colour),
            )
    return _panel(grid, "Feet and trunk", robot, _walk(gait, look))


def _walk(gait: Gait, look: PanelWidths) -> str:
    """Return steps a minute and, where there is room, each foot's share of its stride on the ground."""
    if gait.cadence_spm is None:
        return ""
    cadence = f"{gait.cadence_spm:.0f} steps/min"
    stances = [gait.legs[leg].stance for leg in Leg]
    if not look.roomy or None in stances:
        return cadence
    shares = " / ".join(f"{100 * stance:.0f}" for stance in stances if stance is not None)
    return f"{cadence}, stance {shares} %"


def parameters(robot: Robot, controls: Controls, look: PanelWidths, rows: int) -> RenderableType:
    """Return the parameters as the devices have them, as many as fit; the chosen one can be moved."""
    grid = Table.grid(expand=True, padding=(0, 1))
    for width in (1, None, 7, 4, None):
        grid.add_column(justify="right" if width == 7 else "left", no_wrap=True, min_width=width)
    known = robot.description.parameters if robot.description is not None else []
    infos = {info.name: info for info in known}
    names = list(robot.parameters)
    for name in _around(names, controls.selected, rows):
        held = robot.parameters[name]
        chosen = name == controls.selected
        style = "bold" if chosen else "default"
        unit = unit_of(name, held.unit, Units())
        value = words(unit.brief(held.value), style=style)
        grid.add_row(
            "▶" if chosen else " ",
            words(name, style=style),
            value,
            words(unit.symbol),
            _range(held, infos.get(name), unit, look),
        )
    if not robot.parameters:
        grid.add_row("", words("not known yet", style=OLD), "", "", "")
    hidden = len(names) > rows and controls.selected is not None
    place = f" {names.index(controls.selected or names[0]) + 1} of {len(names)}" if hidden else ""
    notes = filter(None, (_age(robot.parameters_at_ns), controls.no_change))
    return _panel(grid, f"Parameters{place}", robot, plain(", ".join(notes)))


def _around(names: Sequence[str], chosen: str | None, rows: int) -> Sequence[str]:
    """As many of them as there are rows, with the chosen one among them."""
    place = names.index(chosen) if chosen in names else 0
    first = max(0, min(place - rows // 2, len(names) - rows))
    return names[first : first + max(1, rows)]


def _range(held: ParameterValue, info: ParameterInfo | None, unit: Unit, look: PanelWidths) -> Text:
    if held.problem is not None or info is None or info.min is None or info.max is None:
        return words(held.problem or "no limits known", style=WARN)
    where = needle(held.value, info.min, info.max, look.parameter)
    if not look.roomy:
        return words(where, style=DIM)
    return Text.assemble(f"{unit.brief(info.min):>6} ", (where, DIM), f" {unit.brief(info.max)}")


def resources(station: Station, look: PanelWidths) -> RenderableType:
    """Return the robot's computer: CPU, memory, and who uses them most."""
    robot, table = station.robot, station.processes
    seen = robot.resources
    if seen is None:
        return _panel(words("not known yet", style=OLD), "Computer", robot)
    grid = Table.grid(expand=True, padding=(0, 1))
    grid.add_column(no_wrap=True, ratio=1)
    for _ in range(3):
        grid.add_column(justify="right", no_wrap=True)
    cpu = None if seen.cpu.percent is None else seen.cpu.percent / 100
    memory = seen.memory.used / seen.memory.total if seen.memory.total > 0 else None
    grid.add_row(words("CPU"), words(bar(cpu, look.share)), _percent(seen.cpu.percent), "")
    grid.add_row(
        words("memory"),
        words(bar(memory, look.share)),
        NONE if memory is None else f"{100 * memory:.0f} %",
        _mib(seen.memory.used),
    )
    grid.add_row(
        words("this gateway", style=DIM), "", _percent(seen.gateway.cpu_percent), _mib(seen.gateway.rss_bytes)
    )
    if table is not None and isinstance(table.processes, list):
        for process in table.processes[:SHOWN_PROCESSES]:
            pid = words(str(process.pid) if look.roomy else "", style=DIM)
            grid.add_row(words(process.name), pid, _percent(process.cpu_percent), _mib(process.memory_bytes))
    return _panel(grid, "Computer", robot, _age(robot.resources_at_ns))


def footer(station: Station, controls: Controls, where: str, *, in_full: bool = False) -> Group:
    """Return the keys, grey where one may not, and the last thing that was said, `in_full` or cut."""
    change, reset = (OLD if no else "" for no in (controls.no_change, controls.no_reset))
    keys = Text.assemble(
        (" s ", "bold white on red"),
        " STOP ",
        ("(software, not safety-rated)", DIM),  # first of all, so that no narrow terminal cuts it off
        "  ",
        ("↑↓", "bold"),
        " choose  ",
        ("←→", change or "bold"),
        (" change  ", change),
        ("r r", reset or "bold"),
        (" reset  ", reset),
        ("q", "bold"),
        " quit",
    )
    news = _news(station, controls, where)
    for text in (keys,) if in_full else (keys, news):
        text.no_wrap, text.overflow = True, "ellipsis"
    return Group(keys, news)


def news_lines(station: Station, controls: Controls, where: str, columns: int) -> int:
    """Return the number of lines that the last message takes in full."""
    return len(_news(station, controls, where).wrap(Console(width=columns), columns))


def _news(station: Station, controls: Controls, where: str) -> Text:
    """Return the one thing that matters most now."""
    robot, writing = station.robot, station.writing
    active, newest = station.alarms.active, next(iter(station.news.items), None)
    if not station.stopping.is_unproven and unstopped(robot, station.stopping) is not None:
        return _alarm(active, controls)
    if controls.stop_sent:
        return words(station.stopping.text, style=f"bold {STOP_STYLES.get(station.stopping.state, BAD)}")
    if controls.refusal:
        return words(f"✕ {controls.refusal}", style=WARN)
    if controls.asks_again:
        return words(controls.note, style=WARN)
    if writing.state in NOT_WRITTEN:
        return words(f"✕ {writing.state.value}: {writing.text}", style=BAD)
    if (
        newest is not None
        and newest.kind in (NewsKind.STOP, NewsKind.RESET)
        and time.time() - newest.utc_s < SAID_S
    ):
        return words(newest.text, style=WARN)
    if active and active[0].alarm.mark.colour in ("bad", "warn"):
        return _alarm(active, controls)
    if robot.last_failure is not None:
        return words(f"✕ {robot.last_failure.what}: {robot.last_failure.reason}", style=BAD)
    if controls.writing:
        return words(controls.note, style=DIM)
    if writing.state is WriteState.DONE:
        return words(f"✓ {writing.text}", style=GOOD)
    if active:
        return _alarm(active, controls)
    hint = controls.no_reset or f"or in another terminal: gwrms set --robot {where} gait.step_length=0.5"
    return words(controls.note or hint, style=DIM)


def _alarm(active: Sequence[Active], controls: Controls) -> Text:
    """Return the worst: what, then what to check, and how many more there are."""
    alarm, more = active[0].alarm, len(active) - 1
    others = f"  (+{more} more)" if more else ""
    key = "  r r clears it" if alarm.clears and not controls.no_reset else ""
    check = f"  → {alarm.check.replace(RESET_BUTTON, RESET_KEY)}" if alarm.check else ""
    style = COLOURS[alarm.mark.colour]
    return words(f"{GLYPHS[alarm.mark.shape]} {alarm.line}{others}{key}{check}", style=style)


def _panel(content: RenderableType, title: str, robot: Robot, note: str = "") -> Panel:
    stale = robot.is_stale()
    age_s = robot.age_s()
    old = f" {age_s:.1f} s old" if stale and age_s is not None else ""
    style = OLD if stale else DIM
    return Panel(
        content,
        title=f"{title}{old}",
        subtitle=note or None,
        subtitle_align="right",
        title_align="left",
        box=box.ROUNDED,
        border_style=style,
        style=OLD if stale else "none",
    )


def _age(at_ns: int | None) -> str:
    if at_ns is None:
        return ""
    age_s = (time.monotonic_ns() - at_ns) / 1e9
    return f"{age_s:.1f} s old" if age_s > 2.0 else ""


def _percent(value: float | None) -> str:
    return NONE if value is None else f"{value:.1f} %"


def _mib(count: int) -> str:
    return f"{count / (1 << 20):.0f} MiB"
