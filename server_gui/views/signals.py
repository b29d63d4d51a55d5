"""Signals: chosen channels over time, one plot a unit; pause, zoom, measure, export while data go on."""

import csv
import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QResizeEvent, QShortcut
from PySide6.QtWidgets import (
    QBoxLayout,
    QComboBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QSplitter,
    QVBoxLayout,
    QWidget,
)

from gateway.units import Unit
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.measuring import measure, nearest, row_at
from server_gui.core.desk.station import Station
from server_gui.views.channel_tree import MOST_CURVES, ChannelTree, channels_of
from server_gui.views.marks import age_text
from server_gui.views.measuring import Measuring
from server_gui.views.theme import Theme
from server_gui.views.unit_plot import UnitPlot
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.plain import PlainLabel, set_tip
from server_gui.views.widgets.plot import PlacedFlag

Floats = npt.NDArray[np.float64]
NARROW, LIST = 700, 150  # wide, at text of 100 %: tools in two rows; the channels at least
GONE: Final = "Live: that instant is gone from here, see Recordings"
AROUND_S: Final = 5.0  # that are shown before and after an event
SLOW: Final = 5  # frames between two looks at what people read
SPANS_S: Final = (2, 5, 10, 30, 60, 100)


@dataclass(frozen=True, slots=True, eq=False)
class Frozen:
    """What a paused view goes on showing."""

    times: Floats
    columns: dict[str, Floats]
    newest_ns: int  # of its rows, on the robot's clock

    def times_of(self, seconds: float) -> Floats:
        """Return those of the last `seconds`."""
        return (
            self.times[np.searchsorted(self.times, self.times[-1] - seconds) :]
            if len(self.times)
            else self.times
        )


class Signals(QWidget):
    """Channels at the left, their curves at the right."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.plots: list[UnitPlot] = []
        self._frozen: Frozen | None = None
        self._frame = 0
        self._jumped_ns: int | None = None  # on the robot's clock
        self._is_gone = False  # the instant that was asked for last
        self._exported = ""  # what came of the latest export
        self._at = [0.0, 0.0]  # the cursors, s until the newest row
        self._active = 0
        self.setObjectName("page")
        self.channels = ChannelTree()
        self.channels.itemChanged.connect(self._rebuild)
        self._words = QLineEdit()
        self._words.setPlaceholderText("Filter channels")
        self._words.setAccessibleName("Filter of the channels")
        self._words.textChanged.connect(self.channels.show_only)
        self.measuring = Measuring(theme)
        self.measuring.chosen.connect(lambda cursor: self._move(cursor, self._at[cursor]))
        self.measuring.stepped.connect(self._step)
        self._stack = QVBoxLayout()
        self.empty = PlainLabel("Tick channels at the left to see them here.")
        self.empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.empty.setObjectName("dim")
        self._stack.addWidget(self.empty)
        left, right = QWidget(), QWidget()
        left_box, right_box = QVBoxLayout(left), QVBoxLayout(right)
        left_box.setContentsMargins(0, 0, 0, 8)
        right_box.setContentsMargins(0, 0, 0, 8)
        left_box.addWidget(self._words)
        left_box.addWidget(self.channels, 1)
        right_box.addLayout(self._stack, 1)
        right_box.addWidget(self.measuring)
        splitter = QSplitter()
        splitter.addWidget(left)
        splitter.addWidget(right)
        splitter.setStretchFactor(1, 1)
        splitter.setSizes([theme.px(190), theme.px(700)])
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 0)
        everything.addLayout(self._tools())
        everything.addWidget(splitter, 1)
        self._restyle()
        theme.changed.connect(self._restyle)

    def read_now(self) -> None:
        """Let the next frame say also what is read: what stands beside it is said anew then."""
        self._frame = 0

    def refresh(self) -> None:
        """Draw what is chosen; while paused, what was there then."""
        station = self._desk.selected
        if station is None:
            return
        if self.channels.show_channels(station, self._desk.shown.units, self._desk.shown.revision):
            self._rebuild()
        seconds = float(SPANS_S[self._span.currentIndex()])
        frozen = self._frozen
        times = station.rings.times(seconds) if frozen is None else frozen.times_of(seconds)
        source = station.rings.source if frozen is None else frozen
        for plot in self.plots:
            found = [self._column(station, name, len(times)) for name in plot.channels]
            paused = frozen is not None
            live = paused or not station.robot.is_stale()
            plot.plot.draw(source, times, found, live=live, scale=plot.unit.scale, paused=paused)
        self._frame += 1
        if self._frame % SLOW == 1:
            set_text(self.said, self._state(station) + self._exported)
            self._flag(station)
            for plot in self.plots:
                plot.show_values([self._newest(station, name) for name in plot.channels])
            if self.cursors.isChecked():
                self._measure(station)

    @property
    def chosen(self) -> list[str]:
        """The channels that are ticked, in the robot's order."""
        return self.channels.chosen

    def choose(self, names: Sequence[str]) -> None:
        """Tick exactly these."""
        self.channels.choose(names)
        self._rebuild()

    def show_around(self, names: Sequence[str], at_ns: int) -> None:
        """Choose these, and stand still with the seconds around an instant of the robot's clock in sight."""
        self.choose(names)
        self.pause.setChecked(False)  # else it would be what was seen before
        if not self.show_at(at_ns):
            self.pause.setChecked(False)  # nothing else is shown in its place as if it were that
            self._is_gone, self._frame = True, 0

    def save_csv(self, path: Path) -> None:
        """Save what is on screen, in SI units, a row a time."""
        station = self._desk.selected
        if station is None:
            return
        times, (left, right) = self._times(station), self._window
        sight = slice(int(np.searchsorted(times, left)), int(np.searchsorted(times, right, "right")))
        names = [name for plot in self.plots for name in plot.channels]
        columns = {name: self._column(station, name, len(times))[sight] for name in names}
        si = {info.name: info.unit for info in channels_of(station)}
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["time s", *(f"{name} {si.get(name, '')}".rstrip() for name in columns)])
            for row, time_s in enumerate(times[sight]):
                values = (column[row] for column in columns.values())
                writer.writerow([f"{time_s:.6f}", *("" if np.isnan(value) else value for value in values)])

    def save_png(self, path: Path) -> None:
        """Save what is on screen, as a picture."""
        if not self.grab().save(str(path), "PNG"):
            raise OSError(f"the picture could not be written: is there room in {path.parent}, and may you?")

    # --- how it is put together

    def _tools(self) -> QBoxLayout:
        self._span = QComboBox()
        self._span.addItems([f"{seconds} s" for seconds in SPANS_S])
        self._span.setCurrentIndex(SPANS_S.index(10))
        self._span.setAccessibleName("How much of the past is shown")
        self._span.currentIndexChanged.connect(self._span_changed)
        self.pause = QPushButton("Pause view")
        self.pause.setCheckable(True)
        self.pause.setToolTip("The view stands still; data and recording go on")
        self.pause.toggled.connect(self._paused)
        self.fit = QPushButton("Fit")
        self.fit.setToolTip("Undo zoom: the range follows the data again")
        self.fit.clicked.connect(self._follow)
        self.box = QPushButton("Box zoom")
        self.box.setCheckable(True)
        self.box.setToolTip("Drag a box around what is to be seen; else a drag moves, and the wheel zooms")
        self.box.toggled.connect(self._choose_by_box)
        self.cursors = QPushButton("Cursors")
        self.cursors.setCheckable(True)
        self.cursors.setToolTip("Two cursors with their difference, and every curve over what is in sight")
        self.cursors.toggled.connect(self._show_cursors)
        as_csv, as_png = QPushButton("CSV …"), QPushButton("PNG …")
        as_csv.setAccessibleName("Save what is on screen as CSV")
        as_png.setAccessibleName("Save what is on screen as a picture")
        self._before, self._next = QPushButton("◀"), QPushButton("▶")
        for button, way, which in ((self._before, -1, "before"), (self._next, 1, "after")):
            button.setAccessibleName(f"To the event {which}")
            set_tip(button, f"To the event {which}: a stop, fault, write, trial or mark")
            button.clicked.connect(lambda _=False, way=way: self._turn(way))
        self._keys(as_csv)
        as_csv.clicked.connect(lambda: self._ask("csv", self.save_csv))
        as_png.clicked.connect(lambda: self._ask("png", self.save_png))
        self.said = ElidedLabel("dim")
        self._rows = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        often = (self._span, self.pause, self.fit, self.box, self.cursors)
        for widgets in (often, (self._before, self._next, as_csv, as_png, self.said)):
            row = QHBoxLayout()
            for widget in widgets:
                row.addWidget(widget, int(widget is self.said))
            if widgets is often:
                row.addStretch(1)
            self._rows.addLayout(row, int(widgets is not often))
        return self._rows

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        direction, is_narrow = QBoxLayout.Direction, self.width() < self._theme.px(NARROW)
        self._rows.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)

    def _keys(self, as_csv: QPushButton) -> None:
        """Keys of this page; the sheet of keys tells them."""
        buttons = {
            "Ctrl+Shift+P": self.pause,
            "Ctrl+0": self.fit,
            "Ctrl+D": self.cursors,
            "Ctrl+E": as_csv,
            "Ctrl+Up": self._before,
            "Ctrl+Down": self._next,
        }
        for key, button in buttons.items():
            button.setShortcut(key)
            button.setToolTip(" ".join(filter(None, (button.toolTip(), f"({key})"))))
        moves: dict[str, Callable[[], None]] = {
            "Ctrl++": lambda: self._look(0.5),
            "Ctrl+-": lambda: self._look(2.0),
            "Ctrl+Left": lambda: self._look(1.0, -0.25),
            "Ctrl+Right": lambda: self._look(1.0, 0.25),
        }
        for key, move in moves.items():
            shortcut = QShortcut(QKeySequence(key), self, move)
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)

    def _look(self, wider: float, later: float = 0.0) -> None:
        """See so many times of the time, moved by a share of it."""
        left, right = self._window
        span = min((right - left) * wider, float(SPANS_S[self._span.currentIndex()]))
        end = min(right + later * span, 0.0)
        begin = max(end - span, -float(SPANS_S[self._span.currentIndex()]))
        self._zoomed(begin, min(begin + span, 0.0))

    def _rebuild(self) -> None:
        """A plot for each unit of the chosen channels."""
        for plot in self.plots:
            self._stack.removeWidget(plot)
            plot.hide()
            plot.deleteLater()
        station = self._desk.selected
        chosen = self.chosen[:MOST_CURVES]
        by_unit: dict[Unit, list[str]] = {}
        for info in () if station is None else channels_of(station):
            if info.name in chosen:
                by_unit.setdefault(self._desk.shown.units.unit(info.quantity, info.unit), []).append(
                    info.name
                )
        seconds = float(SPANS_S[self._span.currentIndex()])
        self.plots = [UnitPlot(self._theme, unit, names, seconds) for unit, names in by_unit.items()]
        for plot in self.plots:
            self._stack.addWidget(plot, 1)
            plot.plot.zoomed.connect(self._zoomed)
            plot.plot.moved.connect(self._move)
            plot.plot.fitted.connect(self._follow)
        self._choose_by_box(self.box.isChecked())
        self._mark()
        self.empty.setVisible(not self.plots)
        if self._frozen is not None and station is not None:
            self._freeze(station)

    def _restyle(self) -> None:
        self.channels.setIndentation(self._theme.px(10))
        self.channels.setMinimumWidth(self._theme.px(LIST))
        self._rebuild()

    # --- what people do

    def _span_changed(self, place: int) -> None:
        for plot in self.plots:
            plot.plot.set_seconds(float(SPANS_S[place]))

    def _paused(self, on: bool) -> None:
        self._frozen, self._jumped_ns, self._is_gone = None, None, False
        if on and self._desk.selected is not None:
            self._freeze(self._desk.selected)

    def _freeze(self, station: Station) -> None:
        times, columns = self._live(station, float(SPANS_S[-1]))
        self._frozen = Frozen(times, columns, station.rings.newest_ns or 0)

    def _follow(self) -> None:
        for plot in self.plots:
            plot.plot.follow_again()
        self._span_changed(self._span.currentIndex())

    def _zoomed(self, left: float, right: float) -> None:
        """Every plot shows the same time."""
        for plot in self.plots:
            plot.plot.show_window(left, right)

    def _choose_by_box(self, on: bool) -> None:
        for plot in self.plots:
            plot.plot.choose_by_box(on)

    # --- what happened

    def show_at(self, stamp_ns: int, around_s: float = AROUND_S) -> bool:
        """Stand still with this instant of the robot's clock in the middle; False where it is gone by now."""
        station = self._desk.selected
        if station is None:
            return False
        self.pause.setChecked(True)
        frozen = self._frozen
        if frozen is None or not len(frozen.times):
            return False
        at = (stamp_ns - frozen.newest_ns) / 1e9
        if not frozen.times[0] - frozen.times[-1] <= at <= 0.0:
            return False
        wanted = next((place for place, span in enumerate(SPANS_S) if span >= around_s - at), -1)
        self._span.setCurrentIndex(wanted % len(SPANS_S))
        self._zoomed(max(at - around_s, -float(SPANS_S[wanted])), min(at + around_s, 0.0))
        self._jumped_ns = stamp_ns
        self._frame = 0
        return True

    def _turn(self, way: int) -> None:
        """To the next event, or the one before: of where one has jumped to, else of the newest."""
        station = self._desk.selected
        if station is None:
            return
        newest_ns = station.rings.newest_ns or 0
        here_ns = newest_ns + 1 if self._jumped_ns is None else self._jumped_ns
        flags = [flag for flag in station.flags if (flag.at_ns - here_ns) * way > 0]
        if flags:
            flag = flags[0] if way > 0 else flags[-1]
            found = self.show_at(flag.at_ns)
            self._exported = f" · {flag.kind.value}: {flag.text}" if found else " · that is too long ago"

    def _flag(self, station: Station) -> None:
        """Every plot shows what happened in its time."""
        newest_ns = station.rings.newest_ns if self._frozen is None else self._frozen.newest_ns
        if newest_ns is None:
            return
        begin_ns = newest_ns - round(SPANS_S[-1] * 1e9)
        found = station.flags.between(begin_ns, newest_ns + 1)
        placed = [PlacedFlag((flag.at_ns - newest_ns) / 1e9, flag.kind, flag.text) for flag in found]
        for plot in self.plots:
            plot.plot.show_flags(placed)
        for button in (self._before, self._next):
            button.setEnabled(bool(len(station.flags)))

    # --- cursors

    def _show_cursors(self, on: bool) -> None:
        left, right = self._window
        self._at = [left + (right - left) * share for share in (1 / 3, 2 / 3)]
        self.measuring.setVisible(on)
        if on:
            self.measuring.setFocus()
        self._mark()
        self._frame = 0  # measure at once

    def _move(self, cursor: int, to_s: float) -> None:
        self._active, self._at[cursor] = cursor, to_s
        self._mark()
        self._frame = 0

    def _step(self, samples: int) -> None:
        """Move the active cursor by so many samples."""
        station = self._desk.selected
        times = np.zeros(0) if station is None else self._times(station)
        row = nearest(times, self._at[self._active])
        if row is not None:
            self._move(self._active, float(times[min(max(row + samples, 0), len(times) - 1)]))

    def _mark(self) -> None:
        at = tuple(self._at) if self.cursors.isChecked() else ()
        for plot in self.plots:
            plot.plot.show_cursors(at, self._active)

    def _measure(self, station: Station) -> None:
        """Read every curve at the cursors, where there are samples, and over what is in sight."""
        times, (left, right) = self._times(station), self._window
        if not len(times):
            return
        a, b = (row_at(times, cursor) for cursor in self._at)
        first, last = np.searchsorted(times, left), np.searchsorted(times, right, "right")
        rows = [
            (name, plot.unit, measure(self._column(station, name, len(times)), a, b, int(first), int(last)))
            for plot in self.plots
            for name in plot.channels
        ]
        a_s, b_s = self._at
        a_s, b_s = (a_s if a is None else float(times[a])), (b_s if b is None else float(times[b]))
        self.measuring.show_readings(a_s, b_s, self._active, rows)

    def _ask(self, kind: str, save: Callable[[Path], None]) -> None:
        station = self._desk.selected
        robot = "signals" if station is None else station.title
        name = f"{robot}-{datetime.datetime.now().astimezone():%Y%m%d-%H%M%S}"
        ask_save(self, f"Export as {kind.upper()}", kind, lambda path: self.export(save, path), name)

    def export(self, save: Callable[[Path], None], path: Path) -> None:
        """Save what is on screen, and say what came of it."""
        self._exported = f" · {save_whole(save, path)}"

    # --- data

    @property
    def _window(self) -> tuple[float, float]:
        """What part of the past is in sight, s until the newest row."""
        return (
            self.plots[0].plot.window_s if self.plots else (-float(SPANS_S[self._span.currentIndex()]), 0.0)
        )

    def _times(self, station: Station) -> Floats:
        """Of the rows of the chosen span, s until the newest."""
        seconds = float(SPANS_S[self._span.currentIndex()])
        times = station.rings.times(seconds) if self._frozen is None else self._frozen.times_of(seconds)
        return times - times[-1] if len(times) else times

    def _column(self, station: Station, name: str, rows: int) -> Floats:
        """The newest values of a channel; not to be kept."""
        if self._frozen is None:
            return station.rings.values(name, rows)
        return self._frozen.columns[name][-rows:]

    def _live(self, station: Station, seconds: float) -> tuple[Floats, dict[str, Floats]]:
        times = station.rings.times(seconds).copy()
        names = [name for plot in self.plots for name in plot.channels]
        return times, {name: station.rings.values(name, len(times)).copy() for name in names}

    def _newest(self, station: Station, name: str) -> float | None:
        column = None if self._frozen is None else self._frozen.columns[name]
        if column is None:
            return station.robot.values.get(name)
        return None if not len(column) or np.isnan(column[-1]) else float(column[-1])

    def _state(self, station: Station) -> str:
        more = len(self.chosen) - MOST_CURVES
        many = f" · {more} more are not drawn: {MOST_CURVES} at a time" if more > 0 else ""
        if self._frozen is not None:
            return f"Paused, data go on{many}"
        if self._is_gone:
            return GONE
        if station.robot.age_s() is None:
            return f"no data yet{many}"
        if station.robot.is_stale():
            return f"STALE, {age_text(station.robot.age_s())} old{many}"
        return f"{station.robot.rate_hz():.0f} rows/s{many}"
