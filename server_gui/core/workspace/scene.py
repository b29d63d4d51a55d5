"""The signals of one robot as shown: live or frozen rows, beside another robot's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from gateway.units import Unit
from server_gui.core.desk.desk import Shown
from server_gui.core.desk.flags import Flag, FlagKind
from server_gui.core.desk.measuring import nearest
from server_gui.core.desk.station import Station
from server_gui.core.workspace.alignment import Align, offset_text, shift_ns
from server_gui.core.workspace.curve_binding import (
    BESIDE,
    Channels,
    CurveBinding,
    channels_of,
    meaning,
    with_beside,
)
from server_gui.core.workspace.layouts import Layout, PlotLayout, TriggerLayout
from server_gui.core.workspace.series import ALL_S, HELD_S, Beside, Floats, Series
from server_gui.core.workspace.trigger import Condition, On, Trigger, TriggerState
from server_gui.core.workspace.workspace import Workspace

KEPT_S: Final = 100.0  # of the past, when a view stands still
LEAST_S: Final = 10.0  # of what stands still, that is not given up for a curve
BESIDE_KEY: Final = "\N{NULL}beside "  # no curve's text
FAULT: Final = "fault"


@dataclass(frozen=True, slots=True, eq=False)
class Frozen:
    """Frozen contents of a view; `columns` by the texts of curves."""

    times: Floats
    columns: Mapping[str, Floats]
    newest_ns: int  # of its rows, on the robot's clock
    source: object  # of which rows they were
    trigger_ns: int | None = None  # where it is what a trigger has kept

    def times_of(self, seconds: float) -> Floats:
        """Return those of the last `seconds`."""
        if not len(self.times):
            return self.times
        return self.times[np.searchsorted(self.times, self.times[-1] - seconds) :]


class Scene:
    """For one view of a desk. `look` first, each frame; all else is of the robot that was looked at then."""

    def __init__(self, shown: Shown) -> None:
        self.workspace = Workspace()
        self.trigger = Trigger()
        self.frozen: Frozen | None = None
        self.beside: Beside | None = None
        self.align = Align.NOW
        self.nudge_s = 0.0
        self.remarks: Mapping[str, tuple[str, ...]] = {}  # on curves, while nobody points; the fullest first
        self.channels: Channels = {}
        self._shift_ns: int | None = 0  # before the nudge; None: the two have nothing in common
        self._shown = shown
        self._named = ("", "")  # what is looked at, and what is beside it
        self._station: Station | None = None
        self._series: Series | None = None
        self._theirs: Channels = {}
        self._meanings: dict[str, CurveBinding] = {}
        self._known: tuple[object, ...] = ()
        self._source: object = None

    def look(self, station: Station) -> bool:
        """Look at a robot as it is now; whether what curves mean may be something else than before."""
        if station is not self._station:
            self._station, self._series, self.frozen = station, Series(station), None
        if self._series is not None:
            self._series.beside = self.beside
        self._align(station)
        known = self._now_known(station)
        if known == self._known:
            return False
        self._known, self._meanings = known, {}
        theirs = () if self.beside is None else channels_of(self.beside.station)
        self.channels = with_beside(channels_of(station), theirs)
        self._theirs = {info.name: info for info in theirs}
        if self._series is not None:
            self._series.keep(frozenset(self.workspace.curves) | {self.trigger.condition.of})
        return True

    def _now_known(self, station: Station) -> tuple[object, ...]:
        other = None if self.beside is None else self.beside.station
        described = [
            (one, tuple((info.name, info.unit) for info in channels_of(one)))
            for one in (station, other)
            if one
        ]
        return (*described, self._named, self._shown.revision, self.workspace.revision)

    # --- what is drawn

    def meaning(self, text: str) -> CurveBinding:
        """Return the meaning of this text on the robot."""
        if text not in self._meanings:
            self._meanings[text] = meaning(text, self.channels, self._shown.units)
        return self._meanings[text]

    def meaning_beside(self, text: str) -> CurveBinding:
        """Return its meaning on the recording or robot beside it."""
        key = f"{BESIDE_KEY}{text}"
        if key not in self._meanings:
            self._meanings[key] = meaning(text, self._theirs, self._shown.units)
        return self._meanings[key]

    def unit(self, place: int) -> Unit | None:
        """Return the unit of a plot's values: of the first of its curves that means something."""
        found = (self.meaning(text).unit for text in self.workspace.plots[place].curves)
        return next((unit for unit in found if unit is not None), None)

    def units(self) -> list[Unit | None]:
        """Return the unit of each plot."""
        return [self.unit(place) for place in range(len(self.workspace.plots))]

    def drawn(self, text: str, unit: Unit | None) -> str:
        """Return why a curve of a plot in this unit is not drawn; empty if it is."""
        meant = self.meaning(text)
        if meant.problem:
            return meant.problem
        return "" if meant.unit == unit else "in another unit here than the plot"

    def times(self, seconds: float) -> Floats:
        """Return times of the rows of the last `seconds`, s; not to be kept."""
        if self.frozen is not None:
            return self.frozen.times_of(seconds)
        return np.zeros(0) if self._station is None else self._station.rings.times(seconds)

    def values(self, text: str, rows: int) -> Floats:
        """Return the newest values of a curve; not to be kept."""
        if self.frozen is None:
            return np.zeros(0) if self._series is None else self._series.values(self.meaning(text), rows)
        column = self.frozen.columns.get(text)
        return np.full(rows, np.nan) if column is None else column[len(column) - rows :]

    def values_beside(self, text: str, times: Floats) -> Floats:
        """Return those of what is beside it, at these times; not to be kept."""
        if self.frozen is not None:
            return self.values(f"{BESIDE_KEY}{text}", len(times))
        meant = self.meaning_beside(text)
        if self.beside is None or self._station is None or meant.problem or self._shift_ns is None:
            return np.full(len(times), np.nan)
        return self.beside.values(meant, self._station.rings, times)

    def read(self, text: str, at_s: float | None, *, beside: bool = False) -> float | None:
        """Return a curve's value at a time (s until the newest row), None: the newest; None where none is.

        A sample further away than `HELD_S` is none of that time.
        """
        times = self.times(ALL_S if at_s is not None else HELD_S)
        if not len(times):
            return None
        row = len(times) - 1 if at_s is None else nearest(times, float(times[-1]) + at_s)
        if row is None or (at_s is not None and abs(times[row] - times[-1] - at_s) > HELD_S):
            return None
        column = self.values_beside(text, times) if beside else self.values(text, len(times))
        return None if row >= len(column) or np.isnan(column[row]) else float(column[row])

    @property
    def newest_ns(self) -> int | None:
        """The newest row that is shown, on the robot's clock."""
        if self.frozen is not None:
            return self.frozen.newest_ns
        return None if self._station is None else self._station.rings.newest_ns

    # --- standing still

    def freeze(self, until_s: float | None = None, trigger_ns: int | None = None) -> None:
        """Stand still: with the last row up to `until_s` as the newest, where that is given."""
        self.frozen = None
        station = self._station
        if station is None:
            return
        times = self.times(KEPT_S).copy()
        texts = [*self.workspace.curves, *(plot.x for plot in self.workspace.plots if plot.is_xy)]
        columns = {text: self.values(text, len(times)).copy() for text in texts}
        if self.beside is not None:
            columns |= {f"{BESIDE_KEY}{text}": self.values_beside(text, times) for text in texts}
        end = len(times) if until_s is None else int(np.searchsorted(times, until_s, "right"))
        newest_ns = station.rings.stamp_ns(float(times[end - 1])) if end else 0
        cut = {text: column[:end] for text, column in columns.items()}
        self.frozen = Frozen(times[:end], cut, newest_ns, station.rings.source, trigger_ns)

    def keep_more(self, from_s: float = -LEAST_S) -> None:
        """Stand still as before, with the curves that there are now, while their rows are still there.

        Those that were shown stay also after that; in sight is what begins `from_s`, s until the newest.
        """
        kept, station = self.frozen, self._station
        if (
            kept is not None
            and station is not None
            and kept.source is station.rings.source
            and len(kept.times)
            and len(rows := station.rings.times(KEPT_S))
            and rows[0] <= max(float(kept.times[0]), float(kept.times[-1]) + from_s)
        ):
            self.freeze(float(kept.times[-1]), kept.trigger_ns)

    def go_on(self) -> None:
        """Follow the newest rows again."""
        self.frozen = None

    # --- the trigger

    def arm(self, condition: Condition) -> None:
        """Wait for this, from now on."""
        self.frozen = None
        self._source = None if self._station is None else self._station.rings.source
        self.trigger.arm(condition, self._newest_s())

    def intend(self, condition: Condition | None) -> None:
        """Wait for nothing; what a layout says would be waited for, and is saved with it, None: nothing."""
        self.disarm()
        self.trigger.condition = condition or Condition()

    def disarm(self) -> None:
        """Wait no more, and show what comes, unless one stands still by oneself."""
        self.trigger.off()
        if self.is_kept:
            self.frozen = None

    @property
    def is_kept(self) -> bool:
        """Whether it stands still by its trigger."""
        return self.frozen is not None and self.frozen.trigger_ns is not None

    def look_for_trigger(self, span_s: float) -> None:
        """Look at what has come; stands still with what was waited for, goes on where nothing comes.

        Not while one stands still by oneself.
        """
        station, trigger = self._station, self.trigger
        if station is None or self._series is None or trigger.state is TriggerState.OFF:
            return
        if self.frozen is not None and not self.is_kept:
            return
        rings = station.rings
        if rings.source is not self._source:
            self._source = rings.source
            trigger.begin_anew()
        times = rings.times(ALL_S)
        if not len(times):
            return
        if trigger.take(times, self._watched(station, len(times)), span_s) and trigger.at_s is not None:
            end_s = trigger.at_s + (1.0 - trigger.condition.before) * span_s
            self.freeze(end_s, rings.stamp_ns(trigger.at_s))
        elif self.frozen is not None and trigger.shows_live(float(times[-1])):
            self.frozen = None

    def trigger_text(self) -> str:
        """Return the trigger's state, in words; empty if there is none."""
        if self.trigger.state is TriggerState.OFF:
            return ""
        problem = self.trigger_problem(self.trigger.condition)
        return f"cannot trigger: {problem}" if problem else self.trigger.text(self._newest_s())

    def trigger_problem(self, condition: Condition) -> str:
        """Return why this cannot trigger on this robot; empty if it can."""
        if condition.problem:
            return condition.problem
        if condition.on is On.EMCY:
            return "" if self._errors(condition.of) else f"{condition.of} tells no errors and no states here"
        return self.meaning(condition.of).problem

    @property
    def drives(self) -> list[str]:
        """The components that an EMCY can be waited for."""
        names = (name for name in self.channels if not name.startswith(BESIDE))
        parts = dict.fromkeys(name.rpartition(".")[0] for name in names)
        return [part for part in parts if self._errors(part) is not None]

    def trigger_flag(self) -> Flag | None:
        """Return the instant at which it has triggered, as a flag."""
        kept = self.frozen
        if kept is None or kept.trigger_ns is None:
            return None
        return Flag(
            kept.trigger_ns,
            f"{self.trigger.condition.of} {self.trigger.condition.on.value}",
            FlagKind.TRIGGER,
        )

    def _watched(self, station: Station, rows: int) -> Floats:
        condition = self.trigger.condition
        if self._series is None:
            return np.full(rows, np.nan)
        if condition.on is not On.EMCY:
            return self._series.values(self.meaning(condition.of), rows)
        errors = self._errors(condition.of)
        return np.full(rows, np.nan) if errors is None else errors(station, rows)

    def _errors(self, component: str) -> Callable[[Station, int], Floats] | None:
        """Return the reader of a drive's errors.

        Its error code (603Fh), else whether its state is a fault.
        """
        code, state = f"{component}.error_code", f"{component}.state"
        if code in self.channels:
            return lambda station, rows: station.rings.values(code, rows)
        return (lambda station, rows: _faults(station, state, rows)) if state in self.channels else None

    def _newest_s(self) -> float | None:
        times = np.zeros(0) if self._station is None else self._station.rings.times(HELD_S)
        return float(times[-1]) if len(times) else None

    # --- beside

    def put_beside(self, station: Station | None, names: tuple[str, str] = ("", "")) -> None:
        """Show this robot, or recording, beside the one that is looked at; None: nothing.

        `names` are of both, where their titles would not tell them apart.
        """
        self.beside = None if station is None else Beside(station)
        self._named, self.remarks = names, {}
        self._shift_ns, self.nudge_s, self.frozen = 0, 0.0, None

    def _align(self, station: Station) -> None:
        if self.beside is None:
            return
        self._shift_ns = shift_ns(station, self.beside.station, self.align, self._shift_ns or 0)
        self.beside.shift_ns = (self._shift_ns or 0) + round(self.nudge_s * 1e9)

    @property
    def names(self) -> tuple[str, str] | None:
        """What tells both apart; None where nothing is beside."""
        if self.beside is None or self._station is None:
            return None
        both = self._station, self.beside.station
        titles = [f"recording of {one.title}" if one.robot.is_recording else one.title for one in both]
        here, beside = (given or title for given, title in zip(self._named, titles, strict=True))
        return here, beside

    def beside_text(self) -> str:
        """Return the companion's name, and the alignment of both; empty where both are played together.

        By what recordings are aligned stands where that is chosen.
        """
        if self.beside is None or self._station is None:
            return ""
        if self._station.robot.is_recording and self.beside.station.robot.is_recording:
            return ""
        said = offset_text(self._station, self.beside.station, self._shift_ns, self.nudge_s)
        by = "their clocks" if self.align is Align.NOW else self.align.value
        return f"─ {self.beside.station.title}, aligned by {by}: {said}"


def _faults(station: Station, channel: str, rows: int) -> Floats:
    """1 while a drive's state is a fault, 0 while it is none, NaN while nobody knows."""
    words = station.robot.state_words.get(channel, {})
    faults = [float(number) for number, word in words.items() if FAULT in word.lower()]
    values = station.rings.values(channel, rows)
    return np.where(np.isnan(values), np.nan, np.isin(values, faults).astype(float))


def layout_of(scene: Scene, name: str, span_s: float) -> Layout:
    """Return the arrangement as a layout; plots without a curve are left out."""
    condition = scene.trigger.condition
    plots = [PlotLayout(list(plot.curves), plot.x) for plot in scene.workspace.plots if plot.curves]
    kept = TriggerLayout.of_condition(condition) if condition.of and not condition.problem else None
    return Layout(name, plots, span_s, kept)
