"""Draws what a scene shows into its cards, and says what they show."""

from collections.abc import Sequence

import numpy as np

from server_gui.core.archive.playback import PlayedRobot
from server_gui.core.desk.flags import Flag
from server_gui.core.desk.station import Station
from server_gui.core.workspace.curve_binding import BESIDE
from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.series import Floats
from server_gui.core.workspace.trigger import WINDOWS, On, TriggerState
from server_gui.views.widgets.plot import PlacedFlag
from server_gui.views.widgets.time_axis import NOW, PAUSED, SHOWN, session_text, time_text
from server_gui.views.workspace.unit_plot import EmptyPlot, UnitPlot
from server_gui.views.workspace.xy_plot import XYPlot

AnyPlot = UnitPlot | XYPlot | EmptyPlot
Window = tuple[float, float]


def draw(scene: Scene, cards: Sequence[AnyPlot], station: Station, seconds: float, window: Window) -> None:
    """Draw the last `seconds`; XY plots what is in the `window` of them (s until the newest row)."""
    times = scene.times(seconds)
    paused = scene.frozen is not None
    live = paused or not station.robot.is_stale()
    for card in cards:
        if isinstance(card, UnitPlot):
            _draw_plot(scene, card, station, times, live=live)
        elif isinstance(card, XYPlot):
            sight = _sight(times, window)
            xs, *columns = (scene.values(text, len(times))[sight] for text in (card.over.text, *card.drawn))
            card.draw(xs, columns, live=live)


def _draw_plot(scene: Scene, card: UnitPlot, station: Station, times: Floats, *, live: bool) -> None:
    columns = [scene.values(text, len(times)) for text in card.drawn]
    if scene.beside is not None:
        columns += [scene.values_beside(text, times) for text in card.drawn]
    if scene.frozen is None and _comes_late(scene, card):
        card.plot.draw_anew()
    source = station.rings.source if scene.frozen is None else scene.frozen
    end = PAUSED if scene.frozen is not None else SHOWN if station.robot.is_recording else NOW
    since_s = _session_s(scene, station)
    card.plot.draw(source, times, columns, live=live, scale=card.unit.scale, end=end, since_s=since_s)


def _session_s(scene: Scene, station: Station) -> float | None:
    """Return when the newest row of a recording that stands still was, as its bar counts; else None."""
    frozen, robot = scene.frozen, station.robot
    return None if frozen is None or not isinstance(robot, PlayedRobot) else robot.session_s(frozen.newest_ns)


def _comes_late(scene: Scene, card: UnitPlot) -> bool:
    """Return whether values come for rows that were drawn already."""
    needed = (name for text in card.drawn for name in scene.meaning(text).needs)
    return scene.beside is not None or any(name.startswith(BESIDE) for name in needed)


def read(scene: Scene, cards: Sequence[AnyPlot], station: Station, at_s: float | None) -> None:
    """Say the values at a time (s until the newest row), None: the newest."""
    live = scene.frozen is not None or not station.robot.is_stale()
    when = "" if at_s is None else _when(at_s, _session_s(scene, station))
    for card in cards:
        if isinstance(card, EmptyPlot):
            continue
        values = [scene.read(text, at_s) for text in card.drawn]
        if isinstance(card, XYPlot):
            card.show_values(scene.read(card.over.text, at_s), values, live=live, when=when)
            continue
        theirs = [] if scene.beside is None else [scene.read(text, at_s, beside=True) for text in card.drawn]
        alone = card.drawn[0] if len(card.drawn) == 1 and at_s is None else ""
        card.show_values(values, theirs, live=live, notes=scene.remarks.get(alone) or (when,))


def _when(at_s: float, session_s: float | None) -> str:
    """Return a time (s until the newest row) as the axis of time says it, to 10 ms."""
    return time_text(round(at_s, 2)) if session_s is None else session_text(session_s + at_s, 0.01)


def flag(scene: Scene, cards: Sequence[AnyPlot], found: Sequence[Flag], newest_ns: int) -> None:
    """Every plot over time shows what happened in its time, and the levels of a trigger by its curves."""
    placed = [PlacedFlag((one.at_ns - newest_ns) / 1e9, one.kind, one.text) for one in found]
    for card in cards:
        if isinstance(card, UnitPlot):
            card.plot.show_flags(placed)
            card.plot.show_limits(_levels(scene, card))


def _levels(scene: Scene, card: UnitPlot) -> list[float]:
    trigger = scene.trigger
    condition = trigger.condition
    if trigger.state is TriggerState.OFF or condition.on is On.EMCY or condition.of not in card.drawn:
        return []
    levels = (condition.level, condition.high) if condition.on in WINDOWS else (condition.level,)
    return [level * card.unit.scale for level in levels]


def _sight(times: Floats, window: Window) -> slice:
    if not len(times):
        return slice(0, 0)
    ends = np.searchsorted(times, (times[-1] + window[0], times[-1] + window[1] + 1e-9))
    return slice(int(ends[0]), int(ends[1]))
