"""`./dev bench gui`: what a frame of the window costs, beside the same curves with pyqtgraph as it comes.

CPU time of this process, not wall time. Drawn offscreen by Qt's raster engine, as on a screen without OpenGL.
"""

import math
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import msgspec
import numpy as np
import numpy.typing as npt
import pyqtgraph as pg
from PySide6.QtCore import QSettings
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

from gateway.wire.stream import StreamData
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.rings import Rings
from server_gui.core.desk.soles import cells_of
from server_gui.core.desk.station import Station
from server_gui.core.workspace.layouts import Layouts
from server_gui.core.workspace.workspace import PlotSpec
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from server_gui.views.widgets.figure import Pose, StickFigure
from server_gui.views.widgets.plot import Curve, Plot
from server_gui.views.widgets.pressure_map import PressureMap
from server_gui.views.workspace.page import Signals
from tests.gui.fakes import Bench
from tests.support.desk import described, looked, resources, walking

Floats = npt.NDArray[np.float64]
FRAMES, WARM_UP = 45, 8
FRAMES_PER_S = 30
ROWS_A_FRAME = 1000 // FRAMES_PER_S  # at 1 kHz
FEW, MANY = (6, 4, 1_000), (2, 4, 10_000)  # plots, curves in each, points in each
SIZE = 520, 190
COLOURS = ("left", "right", "good", "accent")
MOST_OF_A_CORE = 0.6


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table; `limit` is what `value` must not pass."""

    what: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def text(self) -> str:
        asked = "" if self.limit is None else f"≤ {self.limit:g}"
        return f"{self.what:<72}{self.value:>10,.3g} {self.unit:<10}{asked}\n"


Draw = Callable[[int], None]  # a frame
SPAN_S = 10.0
SECOND_NS = 1_000_000_000


class Source:
    """Rings that a robot fills: after every frame there are rows for another thirtieth of a second."""

    def __init__(self, curves: int, points: int) -> None:
        self._names = [f"curve {number}" for number in range(curves)]
        self._rate_hz = points / SPAN_S
        self._row = 0
        self.rings = Rings()
        self.feed(points)

    def feed(self, rows: int) -> None:
        """So many rows more."""
        numbers = range(self._row, self._row + rows)
        self._row += rows
        stamps_ns = [round(number / self._rate_hz * SECOND_NS) for number in numbers]
        self.rings.take(
            stamps_ns,
            {
                name: [
                    math.sin(2e-9 * math.pi * stamp_ns + place) + 0.01 * math.cos(37e-9 * stamp_ns)
                    for stamp_ns in stamps_ns
                ]
                for place, name in enumerate(self._names)
            },
        )

    def feed_until(self, frame: int) -> None:
        """The rows that have come when a frame is drawn."""
        self.feed(round((SPAN_S + frame / FRAMES_PER_S) * self._rate_hz) - self._row)

    def curves(self, of: slice) -> tuple[Floats, list[Floats]]:
        """Times, and the values of some curves."""
        times = self.rings.times(SPAN_S)
        return times, [self.rings.values(name, len(times)) for name in self._names[of]]


def ours(theme: Theme, page: QVBoxLayout, source: Source, plots: int, each: int) -> Draw:
    """Our plots."""
    made = [Plot(theme, SPAN_S) for _ in range(plots)]
    for plot in made:
        plot.set_curves([Curve(f"curve {number}", COLOURS[number]) for number in range(each)])
        page.addWidget(plot)

    def draw(_frame: int) -> None:
        for number, plot in enumerate(made):
            times, values = source.curves(slice(number * each, (number + 1) * each))
            plot.draw(source.rings.source, times, values, live=True)

    return draw


def plain(theme: Theme, page: QVBoxLayout, source: Source, plots: int, each: int) -> Draw:
    """The same with pyqtgraph's own defaults."""
    made = [pg.PlotWidget() for _ in range(plots)]
    lines = [[plot.plot(pen=theme.colour(COLOURS[number])) for number in range(each)] for plot in made]
    for plot in made:
        page.addWidget(plot)

    def draw(_frame: int) -> None:
        for number, drawn in enumerate(lines):
            times, values = source.curves(slice(number * each, (number + 1) * each))
            for line, column in zip(drawn, values, strict=True):
                line.setData(times - times[-1], column)

    return draw


def maps_and_figure(theme: Theme, page: QVBoxLayout) -> Draw:
    """Both feet and the stick figure."""
    feet = [PressureMap(theme, side) for side in ("left", "right")]
    for side, foot in zip(("left", "right"), feet, strict=True):
        foot.set_cells(cells_of(16, right=side == "right"))
        page.addWidget(foot)
    figure = StickFigure(theme)
    page.addWidget(figure)

    def draw(frame: int) -> None:
        phase = 2 * np.pi * frame / FRAMES_PER_S
        pressures = [150_000.0 * max(0.0, float(np.sin(phase + cell / 5))) for cell in range(16)]
        for foot in feet:
            foot.show_pressures(pressures, (0.1 + 0.05 * float(np.sin(phase)), 0.0), live=True)
        pose = Pose(0.4 * float(np.sin(phase)), 0.5 + 0.5 * float(np.cos(phase)), 0.1)
        texts = {side: ["+12°", "+30°", "-4°"] for side in ("left", "right")}
        figure.show_pose(dict.fromkeys(("left", "right"), pose), 0.05, frozenset(), texts, live=True)

    return draw


def ms_a_frame(make: Callable[[QVBoxLayout], Draw], before: Draw = lambda _frame: None) -> float:
    """The median CPU time of a frame; what happens `before` it does not count."""
    window = QWidget()
    page = QVBoxLayout(window)
    draw = make(page)
    window.resize(SIZE[0], SIZE[1] * max(1, page.count()))
    window.show()
    QApplication.processEvents()
    took = []
    for frame in range(WARM_UP + FRAMES):
        before(frame)
        began = time.process_time()
        draw(frame)
        QApplication.processEvents()
        took.append((time.process_time() - began) * 1e3)
    window.close()
    window.deleteLater()
    return statistics.median(took[WARM_UP:])


def curves_ms(draws: Callable[..., Draw], theme: Theme, shape: tuple[int, int, int]) -> float:
    """A frame of so many plots, with so many curves of so many points each."""
    plots, each, points = shape
    source = Source(plots * each, points)
    return ms_a_frame(lambda page: draws(theme, page, source, plots, each), source.feed_until)


def telemetry() -> Iterator[Row]:
    """What 1 kHz of all channels costs: decoded, and taken into rings, gait and joints."""
    event = walking(ROWS_A_FRAME, rate_hz=1000.0)
    batch = event.batch
    line = msgspec.json.encode(StreamData(1, 0, 0, batch.stamps_ns, batch.columns))
    decode = msgspec.json.Decoder(StreamData).decode
    station = Bench(Desk()).add("robot")
    station.take([described()])
    ages_s = [-frame / FRAMES_PER_S for frame in range(FRAMES)]  # one after another
    events = iter([walking(ROWS_A_FRAME, age_s, rate_hz=1000.0) for age_s in ages_s])
    channels = len(batch.columns)
    yield Row(f"telemetry, {channels} channels at 1 kHz: decode", _median_ms(lambda: decode(line)), "ms")
    taken = _median_ms(lambda: station.take([next(events)]))
    yield Row("telemetry: rings, gait events, joints", taken, "ms")


def _median_ms(do: Callable[[], object]) -> float:
    took = []
    for _ in range(FRAMES):
        began = time.process_time()
        do()
        took.append((time.process_time() - began) * 1e3)
    return statistics.median(took)


def whole_window(theme: Theme, tab: int) -> float:
    """A frame of the window itself, 30 a second, with telemetry at 1 kHz and a tab in sight: the mean, ms."""
    bench = Bench(Desk())
    station = bench.add("robot")
    station.take([described(), looked(), resources()])
    with tempfile.TemporaryDirectory() as folder:
        window = MainWindow(bench.desk, theme, QSettings(f"{folder}/kept.ini", QSettings.Format.IniFormat))
        window.tabs.setCurrentIndex(tab)
        window.show()
        bench.draw(window)
        window.tabs.signals.choose([info.name for info in described().description.channels][:24])
        took = [_frame_ms(window, station, frame) for frame in range(WARM_UP + FRAMES)]
        window.close()
        window.deleteLater()
    return statistics.mean(took[WARM_UP:])


def signals_ms(theme: Theme, written: str) -> float:
    """A frame of 15 curves in 8 plots of the signals, each `written` so: as `whole_window`, the mean, ms."""
    bench = Bench(Desk())
    station = bench.add("robot")
    station.take([described(), looked(), walking(ROWS_A_FRAME, rate_hz=1000.0)])
    units: dict[str, list[str]] = {}
    for info in described().description.channels:
        if info.component != "resource":
            units.setdefault(info.unit, []).append(written.format(info.name))
    pairs = [names[at : at + 2] for names in units.values() for at in range(0, len(names) - 1, 2)]
    plots = [PlotSpec(pair) for pair in pairs[:8]]
    del plots[-1].curves[1:]
    with tempfile.TemporaryDirectory() as folder:
        signals = Signals(bench.desk, theme, layouts=Layouts(Path(folder)))
        signals.resize(1366, 768)
        signals.show()
        signals.refresh()
        signals.scene.workspace.show(plots)
        took = [_frame_ms(signals, station, frame) for frame in range(WARM_UP + FRAMES)]
        if [len(card.drawn) for card in signals.plots] != [2] * 7 + [1]:
            raise RuntimeError("these are not the curves that were to be drawn")
        signals.close()
        signals.deleteLater()
    return statistics.mean(took[WARM_UP:])


def _frame_ms(window: MainWindow | Signals, station: Station, frame: int) -> float:
    """Rows are stamped ahead of time, so that none is old; a frame begins when it would."""
    event = walking(ROWS_A_FRAME, -(frame + 1) / FRAMES_PER_S, rate_hz=1000.0)
    began, began_s = time.process_time(), time.monotonic()
    station.take([event])
    window.refresh()
    QApplication.processEvents()
    took = time.process_time() - began
    time.sleep(max(0.0, began_s + 1 / FRAMES_PER_S - time.monotonic()))
    return took * 1e3


def rows() -> Iterator[Row]:
    """Everything that is measured."""
    theme = Theme(QApplication.instance() or QApplication([]))  # type: ignore[arg-type]
    total = 0.0
    for plots, each, points in (FEW, MANY):
        mine, theirs = (curves_ms(draws, theme, (plots, each, points)) for draws in (ours, plain))
        name = f"{plots * each} curves × {points:,} points"
        yield Row(f"{name}, ours", mine, "ms")
        yield Row(f"{name}, pyqtgraph's defaults", theirs, "ms")
        yield Row(f"{name}: defaults cost", theirs / mine, "times")
        total += mine
    drawings = ms_a_frame(lambda page: maps_and_figure(theme, page))
    yield Row("both pressure maps and the figure", drawings, "ms")
    incoming = list(telemetry())
    yield from incoming
    everything = total + drawings + sum(row.value for row in incoming)
    yield Row("all of it together, a frame", everything, "ms")
    yield Row("share of one core at 30 frames a second", everything * FRAMES_PER_S / 1e3, "", MOST_OF_A_CORE)
    for tab, name in enumerate(("Overview", "Signals, 24 curves")):
        share = whole_window(theme, tab) * FRAMES_PER_S / 1e3
        yield Row(f"the whole window with {name}, telemetry at 1 kHz", share, "of a core", MOST_OF_A_CORE)
    for name, written in (("curves", "{}"), ("expressions", "{0} - mean({0}, 0.5)")):
        share = signals_ms(theme, written) * FRAMES_PER_S / 1e3
        yield Row(f"15 {name} in 8 plots of the signals, at 1 kHz", share, "of a core", MOST_OF_A_CORE)


def main() -> int:
    """Print the table; 1 where a limit is not kept."""
    kept = True
    for row in rows():
        sys.stdout.write(row.text)
        sys.stdout.flush()
        kept = kept and (row.limit is None or row.value <= row.limit)
    return 0 if kept else 1
