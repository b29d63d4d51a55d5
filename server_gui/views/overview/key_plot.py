"""A plot of the overview: its channels with their values, its limits, and what happened when."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gateway.units import Unit, with_minus
from gateway.wire.parameter import ParameterValue
from server_gui.core.archive.playback import PlayedRobot
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.measuring import row_at
from server_gui.core.desk.station import Station
from server_gui.core.follow.position_ends import position_ends
from server_gui.views.marks import old_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.plot import Curve, Mouse, PlacedFlag, Plot, css
from server_gui.views.widgets.time_axis import NOW, SHOWN, time_text
from server_gui.views.widgets.wrapping_legend import WrappingLegend

SECONDS: Final = 10.0
WIDE_NUMBER: Final = re.compile(r"^−?\d+")
SEEN: Final = ("limit ", "limit ", "")  # before limits in the legend, the fullest first
BEYOND: Final = ("beyond the plot: limit ", "limit ", "")  # likewise, of those that are out of its range
# Likewise, where nobody knows of changes since the beginning of a recording.
SEEN_AT_START: Final = ("limit at the start ", "start ", "start ")
BEYOND_AT_START: Final = ("beyond the plot: limit at the start ", "start ", "start ")
HINT: Final = (
    "Wheel: time · double click: all of it · click: open in Signals. "
    "┅ limit: its line · ↕ limit: beyond the range, where an arrow stands at the edge"
)
LETTERS: Final = {"left": "L", "right": "R"}  # alone in their colours, as on the cards beside it
AT_FLAG: Final = 0.01  # of what is in sight, that the pointer may be beside a flag


Part = tuple[str, str, str]  # of the legend: colour, what is drawn, what it says


@dataclass(frozen=True, slots=True)
class PlotKind:
    """What is plotted: channels with the colours and words of their curves; `least` range is SI.

    Curves whose channel's component has a parameter of the CiA 402 object `most` may come no further from 0
    than that; of joints, with `ends`, no further than their drives' position limits.
    """

    title: str
    si: str
    least: float
    curves: tuple[tuple[str, str, str], ...]  # channel, colour, word
    most: str = ""
    ends: bool = False


class KeyPlot(Card):
    """Its time is that of all plots beside it."""

    def __init__(self, desk: Desk, theme: Theme, kind: PlotKind) -> None:
        super().__init__(kind.title)
        self._desk = desk
        self._theme = theme
        self._kind = kind
        self._curves = kind.curves  # of what the robot that is looked at has
        self.legend = WrappingLegend(f"Values of {kind.title}")
        self.plot = Plot(theme, SECONDS, self._unit.scale * kind.least, Mouse.TIME)
        self.plot.set_curves([Curve(channel, colour) for channel, colour, _ in self._curves])
        self.plot.setAccessibleName(kind.title)
        self.plot.setToolTip(HINT)
        self.body.addWidget(self.legend)
        self.body.addWidget(self.plot, 1)
        self._hover: float | None = None
        theme.changed.connect(self._resize)
        self._resize()

    @property
    def channels(self) -> tuple[str, ...]:
        """What is plotted."""
        return tuple(channel for channel, _, _ in self._curves)

    def show_hover(self, at: float | None) -> None:
        """Read the values at this time (s until the newest row), None: the newest."""
        self._hover = at
        self.plot.show_hover(at)

    def refresh(self, station: Station, flags: Sequence[PlacedFlag], *, slow: bool) -> None:
        """Draw the past of the channels."""
        self._show_curves(station)
        unit, rings = self._unit, station.rings
        times = rings.times(SECONDS)
        columns = [rings.values(name, len(times)) for name in self.channels]
        live = station.is_live
        self.plot.show_flags(flags)
        self.plot.show_limits([limit * unit.scale for limit in self._limits(station)])
        end = SHOWN if station.robot.is_recording else NOW
        self.plot.draw(rings.source, times, columns, live=live, scale=unit.scale, end=end)
        if slow or self._hover is not None:
            self._say(station, unit, flags, live=live)

    def _show_curves(self, station: Station) -> None:
        """Leave out what the robot does not have, such as its other leg: all where it has none of it."""
        parts = station.robot.parts
        there = tuple(one for one in self._kind.curves if one[0].partition(".")[0] in parts)
        if (there or self._kind.curves) != self._curves:
            self._curves = there or self._kind.curves
            self.plot.set_curves([Curve(channel, colour) for channel, colour, _ in self._curves])

    def _say(self, station: Station, unit: Unit, flags: Sequence[PlacedFlag], *, live: bool) -> None:
        self.set_title(f"{self._kind.title} ({unit.symbol})", whole=True)
        values = self._values(station)
        told = {word: unit.text(value) for (_, _, word), value in zip(self._curves, values, strict=True)}
        inks = [css(self._theme, colour if live else "old") for _, colour, _ in self._curves]
        seen, beyond = self._limits_told(station, unit)
        at_start = bool(_at_start(station))
        of_seen, of_beyond = (SEEN_AT_START, BEYOND_AT_START) if at_start else (SEEN, BEYOND)

        def parts(texts: Collection[str], wording: int, words: Mapping[str, str]) -> list[Part]:
            named, drawn = zip(inks, self._curves, texts, strict=True), "" if words else "━"
            curves = [(ink, drawn, f"{words.get(word, word)} {text}") for ink, (_, _, word), text in named]
            bad, dim = css(self._theme, "bad"), css(self._theme, "dim")
            lines = [(bad, "┅", f"{of_seen[wording]}{seen}")] if seen else []
            return [*curves, *lines, *([(dim, "↕", f"{of_beyond[wording]}{beyond}")] if beyond else [])]

        widest = [WIDE_NUMBER.sub("−88", text) for text in told.values()]  # else it changes with the number
        wordings: tuple[tuple[int, Mapping[str, str]], ...] = (
            (0, {}),
            (1, {}),
            (1, LETTERS),
            (2, {}),
            (2, LETTERS),
        )
        fits = (one for one in wordings if self.legend.is_one_line(parts(widest, *one)))
        self.legend.say(parts(told.values(), *next(fits, wordings[-1 if at_start else 3])))
        self.plot.setAccessibleDescription(
            ", ".join(f"{word} {text} {unit.symbol}" for word, text in told.items())
        )
        self.set_note(*self._when(station, flags, live=live))

    def _when(self, station: Station, flags: Sequence[PlacedFlag], *, live: bool) -> tuple[str, ...]:
        if self._hover is None:
            return ("",) if live else old_text(station)
        at, (left, right) = self._hover, self.plot.window_s
        close = [flag for flag in flags if abs(flag.at - at) <= AT_FLAG * (right - left)]
        return tuple(
            dict.fromkeys(
                (*(f"{flag.text} · {time_text(round(at, 2))}" for flag in close[:1]), time_text(round(at, 2)))
            )
        )

    def _values(self, station: Station) -> list[float | None]:
        """Return the newest, or those at the pointer."""
        if self._hover is None:
            return [station.robot.values.get(name) for name in self.channels]
        times = station.rings.times(SECONDS)
        row = row_at(times, times[-1] + self._hover) if len(times) else None
        if row is None:
            return [None] * len(self.channels)
        found = [station.rings.values(name, len(times))[row] for name in self.channels]
        return [None if np.isnan(value) else float(value) for value in found]

    def _limits_told(self, station: Station, unit: Unit) -> tuple[str, str]:
        """Return the limits with a line in the plot, and those beyond its range."""
        limits = self._limits(station)
        near = {limit for limit in limits if self.plot.is_in_range(limit * unit.scale)}
        seen = [limit for limit in limits if limit in near or -limit in near]  # `±20` is said once
        return _limit_texts(seen, unit), _limit_texts([one for one in limits if one not in seen], unit)

    def _limits(self, station: Station) -> list[float]:
        most = self._held(station, self._kind.most)
        held = [*most, *(-limit for limit in most), *self._ends(station)]
        return list(dict.fromkeys([*held, *self._guarded(station)]))

    def _guarded(self, station: Station) -> list[float]:
        """Return where a rule of the guard trips."""
        rules = () if station.robot.description is None else station.robot.description.guard.rules
        ends = [
            (rule.low, rule.high)
            for rule in rules
            if any(
                part in rule.on and quantity in rule.quantities
                for part, _, quantity in (channel.partition(".") for channel in self.channels)
            )
        ]
        return [end for both in ends for end in both if end is not None]

    def _ends(self, station: Station) -> list[float]:
        """Return the angles to which drives let their joints go."""
        joints = dict.fromkeys(channel.partition(".")[0] for channel in self.channels if self._kind.ends)
        of_now = station.robot.parameters or _at_start(station)
        both = (position_ends(station.robot, joint, of_now) for joint in joints)
        return [end for ends in both if ends is not None for end in ends]

    def _held(self, station: Station, wanted: str) -> list[float]:
        """Return what drives hold in an object, where the robot's file gives it the plot's unit."""
        parts = {channel.partition(".")[0] for channel in self.channels}
        known = (
            () if not wanted or station.robot.description is None else station.robot.description.parameters
        )
        of_now = station.robot.parameters or _at_start(station)
        held = [
            of_now.get(info.name)
            for info in known
            if info.component in parts
            and info.object.lower().startswith(wanted)
            and info.unit == self._kind.si
        ]
        return [one.value for one in held if one is not None and one.value is not None]

    @property
    def _unit(self) -> Unit:
        return self._desk.shown.units.unit("", self._kind.si)

    def _resize(self) -> None:
        self.plot.setMinimumHeight(self._theme.px(48))


def _at_start(station: Station) -> Mapping[str, ParameterValue]:
    """Return the parameters of a recording's start, where nobody knows of later changes."""
    return station.robot.at_start if isinstance(station.robot, PlayedRobot) else {}


def _limit_texts(limits: Sequence[float], unit: Unit) -> str:
    """`±40 and ±80`, `−5 and 120`."""
    both = [limit for limit in limits if limit > 0 and -limit in limits]
    said = [f"±{limit * unit.scale:.4g}" for limit in both]
    said += [with_minus(f"{limit * unit.scale:.4g}") for limit in sorted(limits) if abs(limit) not in both]
    return " and ".join(dict.fromkeys(said))
