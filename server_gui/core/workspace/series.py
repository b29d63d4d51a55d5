"""The values of curves, row by row: channels as they are, expressions computed once a row."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from server_gui.core.desk.rings import Rings
from server_gui.core.desk.station import Station
from server_gui.core.workspace.curve_binding import BESIDE, CurveBinding
from server_gui.core.workspace.expressions import Block, Program

Floats = npt.NDArray[np.float64]
HELD_S: Final = 0.1  # a sample of another clock stands for its channel no longer
ALL_S: Final = 1e9
ROUNDED_S: Final = 1e-6  # that a time as a float is beside what it was in ns, at most


class Computed:
    """One expression over one robot's rows: only rows that are new are computed."""

    def __init__(self, made: Callable[[], Program], rows: int) -> None:
        self._made = made
        self._rows = rows
        self._program = made()
        self._source: object = None
        self._seen = 0
        self._kept: Floats = np.full(2 * rows, np.nan)
        self._end = rows

    def values(self, rings: Rings, count: int) -> Floats:
        """Return the newest `count` values, as many as there are; not to be kept."""
        times = rings.times(ALL_S)
        new = rings.written - self._seen
        if rings.source is not self._source or new > len(times):
            self._program, self._source, new = self._made(), rings.source, len(times)
        self._seen = rings.written
        if new > 0:
            columns = {name: rings.values(name, new) for name in self._program.channels}
            self._add(self._program.take(Block(times[len(times) - new :], columns)))
        count = min(count, len(times))
        return self._kept[self._end - count : self._end]

    def _add(self, values: Floats) -> None:
        values = values[-self._rows :]
        if self._end + len(values) > len(self._kept):  # seldom: the newest go to the front
            keep = self._rows - len(values)
            self._kept[:keep] = self._kept[self._end - keep : self._end].copy()
            self._end = keep
        self._kept[self._end : self._end + len(values)] = values
        self._end += len(values)


class Beside:
    """Another robot, or a recording, on the time of the one that is looked at: `shift_ns` after its clock."""

    def __init__(self, station: Station) -> None:
        self.station = station
        self.shift_ns = 0
        self.series = Series(station)

    def values(self, meant: CurveBinding, rings: Rings, times: Floats) -> Floats:
        """Return a value for each of these times of `rings`: the last, no older than `HELD_S`, else none."""
        other = self.station.rings
        if other.newest_ns is None or not len(times) or rings.newest_ns is None:
            return np.full(len(times), np.nan)
        theirs = other.times(ALL_S)
        at = times - rings.seconds(other.stamp_ns(0.0) + self.shift_ns)
        return joined(at, theirs, self.series.values(meant, len(theirs)))


def joined(times: Floats, theirs: Floats, values: Floats, held_s: float = HELD_S) -> Floats:
    """Return at each time the last of `values` (at `theirs`, rising); none where older than `held_s`."""
    if not len(theirs):
        return np.full(len(times), np.nan)
    place = np.searchsorted(theirs, times + ROUNDED_S, "right") - 1
    there = np.maximum(place, 0)
    known = (place >= 0) & (times - theirs[there] <= held_s + ROUNDED_S)
    return np.where(known, values[there], np.nan)


class Series:
    """The curves of one robot; what is not asked for any more is forgotten by `keep`."""

    def __init__(self, station: Station, beside: Beside | None = None) -> None:
        self.station = station
        self.beside = beside
        self._computed: dict[tuple[str, tuple[tuple[str, str], ...]], Computed] = {}

    def values(self, meant: CurveBinding, count: int) -> Floats:
        """Return the newest `count` values, all NaN for what means nothing here; not to be kept."""
        rings = self.station.rings
        if meant.problem:
            return np.full(min(count, len(rings.times(ALL_S))), np.nan)
        if meant.written is None and not meant.text.startswith(BESIDE):
            return rings.values(meant.text, count)
        if any(name.startswith(BESIDE) for name in meant.needs):
            return self._over_both(meant, count)
        key = (meant.text, tuple(sorted((meant.si or {}).items())))
        if key not in self._computed:
            self._computed[key] = Computed(meant.program, rings.rows)
        return self._computed[key].values(rings, count)

    def keep(self, texts: Mapping[str, object] | frozenset[str]) -> None:
        """Forget all but these."""
        self._computed = {key: known for key, known in self._computed.items() if key[0] in texts}

    def _over_both(self, meant: CurveBinding, count: int) -> Floats:
        """Compute over two robots: late rows of one belong to older ones of the other, so all is anew."""
        rings = self.station.rings
        times = rings.times(ALL_S)
        times = times[len(times) - min(count, len(times)) :]
        columns = {name: self._column(name, rings, times) for name in meant.needs}
        if meant.written is None:
            return columns[meant.text]
        return meant.program().take(Block(times, columns))

    def _column(self, name: str, rings: Rings, times: Floats) -> Floats:
        if not name.startswith(BESIDE):
            return rings.values(name, len(times))
        if self.beside is None:
            return np.full(len(times), np.nan)
        channel = name.removeprefix(BESIDE)
        return self.beside.values(CurveBinding(channel, channel), rings, times)
