"""Signals: chosen channels over time, one plot a unit; pause, zoom and export while data go on coming."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from gateway.messages import ChannelInfo
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.processing.units import Unit
from server_gui.views.marks import age_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.elided import ElidedLabel
from server_gui.views.widgets.files import ask_save, save_whole
from server_gui.views.widgets.plot import Curve, Plot

Floats = npt.NDArray[np.float64]
MOST_CURVES: Final = 24
SLOW: Final = 5  # frames between two looks at what people read
SPANS_S: Final = (2, 5, 10, 30, 60, 100)
USUAL: Final = ("left_hip.position", "right_hip.position", "left_insole.force", "right_insole.force")
# Okabe & Ito's colours for what is neither the first left nor the first right channel of its plot.
OTHERS: Final = ("#009e73", "#cc79a7", "#d55e00", "#f0e442", "#8f8fd6", "#7fb36b")
NAME_ROLE: Final = Qt.ItemDataRole.UserRole + 1


@dataclass(frozen=True, slots=True, eq=False)
class Frozen:
    """What a paused view goes on showing."""

    times: Floats
    columns: dict[str, Floats]

    def times_of(self, seconds: float) -> Floats:
        """Those of the last `seconds`."""
        return (
            self.times[np.searchsorted(self.times, self.times[-1] - seconds) :]
            if len(self.times)
            else self.times
        )


class UnitPlot(Card):
    """All chosen channels of one unit."""

    def __init__(self, theme: Theme, unit: Unit, channels: Sequence[str], seconds: float) -> None:
        super().__init__(unit.symbol or "no unit")
        self.unit = unit
        self.channels = tuple(channels)
        self.plot = Plot(theme, seconds, least=1e-3)
        self._curves = [
            Curve(name, colour) for name, colour in zip(channels, _colours(channels), strict=True)
        ]
        self.plot.set_curves(self._curves)
        self._theme = theme
        self._legend = QLabel()
        self._legend.setTextFormat(Qt.TextFormat.RichText)
        self._legend.setWordWrap(True)
        self.body.addWidget(self._legend)
        self.body.addWidget(self.plot)
        self.setMinimumHeight(theme.px(120))

    def show_values(self, values: Sequence[float | None]) -> None:
        """The newest value of each curve, behind its name."""
        names = (
            f'<span style="color:{_css(self._theme, curve.colour)}">━ {curve.channel} '
            f"<b>{self.unit.text(value)}</b></span>"
            for curve, value in zip(self._curves, values, strict=True)
        )
        set_text(self._legend, "&nbsp;&nbsp; ".join(names))


class Signals(QWidget):
    """Channels at the left, their curves at the right."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._theme = theme
        self.plots: list[UnitPlot] = []
        self._frozen: Frozen | None = None
        self._frame = 0
        self._exported = ""  # what came of the latest export
        self._described: tuple[object, ...] = ()
        self.setObjectName("page")
        self.channels = QTreeWidget()
        self.channels.setHeaderHidden(True)
        self.channels.setObjectName("framed")
        self.channels.setAccessibleName("Channels")
        self.channels.itemChanged.connect(self._rebuild)
        self._words = QLineEdit()
        self._words.setPlaceholderText("Filter channels")
        self._words.setAccessibleName("Filter of the channels")
        self._words.textChanged.connect(self._filter)
        self._stack = QVBoxLayout()
        self.empty = QLabel("Tick channels at the left to see them here.")
        self.empty.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.empty.setObjectName("dim")
        self._stack.addWidget(self.empty)
        left, right = QWidget(), QWidget()
        left_box, right_box = QVBoxLayout(left), QVBoxLayout(right)
        left_box.setContentsMargins(8, 8, 0, 8)
        right_box.setContentsMargins(0, 8, 8, 8)
        left_box.addWidget(self._words)
        left_box.addWidget(self.channels, 1)
        right_box.addLayout(self._tools())
        right_box.addLayout(self._stack, 1)
        splitter = QSplitter()
        splitter.addWidget(left)
        splitter.addWidget(right)
        splitter.setStretchFactor(1, 1)
        splitter.setSizes([theme.px(190), theme.px(700)])
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        everything.addWidget(splitter)
        theme.changed.connect(self._rebuild)

    def refresh(self) -> None:
        """Draw what is chosen; while paused, what was there then."""
        station = self._desk.selected
        if station is None:
            return
        self._list_channels(station)
        seconds = float(SPANS_S[self._span.currentIndex()])
        frozen = self._frozen
        times = station.rings.times(seconds) if frozen is None else frozen.times_of(seconds)
        source = station.rings.source if frozen is None else frozen
        for plot in self.plots:
            found = [
                station.rings.values(name, len(times))
                if frozen is None
                else frozen.columns[name][-len(times) :]
                for name in plot.channels
            ]
            live = frozen is not None or not station.robot.is_stale()
            plot.plot.draw(source, times, found, live=live, scale=plot.unit.scale)
        self._frame += 1
        if self._frame % SLOW == 1:
            set_text(self.said, self._state(station) + self._exported)
            for plot in self.plots:
                plot.show_values([self._newest(station, name) for name in plot.channels])

    @property
    def chosen(self) -> list[str]:
        """The channels that are ticked, in the robot's order."""
        return [
            item.data(0, NAME_ROLE) for item in self._items() if item.checkState(0) is Qt.CheckState.Checked
        ]

    def choose(self, names: Sequence[str]) -> None:
        """Tick exactly these."""
        self.channels.blockSignals(True)
        for item in self._items():
            wanted = item.data(0, NAME_ROLE) in names
            item.setCheckState(0, Qt.CheckState.Checked if wanted else Qt.CheckState.Unchecked)
        self.channels.blockSignals(False)
        self._rebuild()

    def save_csv(self, path: Path) -> None:
        """What is on screen, in SI units, a row a time."""
        station = self._desk.selected
        if station is None:
            return
        times, columns = self._data(station, float(SPANS_S[self._span.currentIndex()]))
        si = {info.name: info.unit for info in _infos(station)}
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["time s", *(f"{name} {si.get(name, '')}".rstrip() for name in columns)])
            for row, time_s in enumerate(times - times[-1:]):
                values = (column[row] for column in columns.values())
                writer.writerow([f"{time_s:.6f}", *("" if np.isnan(value) else value for value in values)])

    def save_png(self, path: Path) -> None:
        """What is on screen, as a picture."""
        if not self.grab().save(str(path), "PNG"):
            raise OSError(f"the picture could not be written: is there room in {path.parent}, and may you?")

    # --- how it is put together

    def _tools(self) -> QHBoxLayout:
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
        as_csv, as_png = QPushButton("CSV …"), QPushButton("PNG …")
        as_csv.clicked.connect(lambda: self._ask("csv", self.save_csv))
        as_png.clicked.connect(lambda: self._ask("png", self.save_png))
        self.said = ElidedLabel("dim")
        row = QHBoxLayout()
        for widget in (self._span, self.pause, self.fit, as_csv, as_png):
            row.addWidget(widget)
        row.addWidget(self.said, 1)
        return row

    def _list_channels(self, station: Station) -> None:
        infos = _infos(station)
        described = (station, self._desk.shown.revision, *(info.name for info in infos))
        if described == self._described:
            return
        before = self.chosen if self._described else list(USUAL)
        self._described = described
        self.channels.blockSignals(True)
        self.channels.clear()
        groups: dict[str, QTreeWidgetItem] = {}
        for info in infos:
            if info.component not in groups:
                groups[info.component] = QTreeWidgetItem(self.channels, [info.component.replace("_", " ")])
                groups[info.component].setFlags(Qt.ItemFlag.ItemIsEnabled)
            item = QTreeWidgetItem(groups[info.component], [f"{info.quantity}  {info.unit}".rstrip()])
            item.setData(0, NAME_ROLE, info.name)
            item.setCheckState(0, Qt.CheckState.Unchecked)
        self.channels.blockSignals(False)
        self.choose(before)
        for item in self._items():
            if item.checkState(0) is Qt.CheckState.Checked:
                _open_group(item)

    def _items(self) -> list[QTreeWidgetItem]:
        tops = [self.channels.topLevelItem(row) for row in range(self.channels.topLevelItemCount())]
        found = [top.child(row) for top in tops if top is not None for row in range(top.childCount())]
        return [item for item in found if item is not None]

    def _rebuild(self) -> None:
        """A plot for each unit of the chosen channels."""
        for plot in self.plots:
            self._stack.removeWidget(plot)
            plot.deleteLater()
        station = self._desk.selected
        chosen = self.chosen[:MOST_CURVES]
        by_unit: dict[Unit, list[str]] = {}
        for info in () if station is None else _infos(station):
            if info.name in chosen:
                by_unit.setdefault(self._desk.shown.units.unit(info.quantity, info.unit), []).append(
                    info.name
                )
        seconds = float(SPANS_S[self._span.currentIndex()])
        self.plots = [UnitPlot(self._theme, unit, names, seconds) for unit, names in by_unit.items()]
        for plot in self.plots:
            self._stack.addWidget(plot, 1)
        self.empty.setVisible(not self.plots)
        if self._frozen is not None and station is not None:
            self._freeze(station)

    def _filter(self, words: str) -> None:
        wanted = words.lower().split()
        for item in self._items():
            name = str(item.data(0, NAME_ROLE))
            item.setHidden(not all(word in name for word in wanted))
            if words and not item.isHidden():
                _open_group(item)

    # --- what people do

    def _span_changed(self, place: int) -> None:
        for plot in self.plots:
            plot.plot.set_seconds(float(SPANS_S[place]))

    def _paused(self, on: bool) -> None:
        self._frozen = None
        if on and self._desk.selected is not None:
            self._freeze(self._desk.selected)

    def _freeze(self, station: Station) -> None:
        times, columns = self._live(station, float(SPANS_S[-1]))
        self._frozen = Frozen(times, columns)

    def _follow(self) -> None:
        for plot in self.plots:
            plot.plot.follow_again()

    def _ask(self, kind: str, save: Callable[[Path], None]) -> None:
        ask_save(self, f"Export as {kind.upper()}", kind, lambda path: self.export(save, path))

    def export(self, save: Callable[[Path], None], path: Path) -> None:
        """Save what is on screen, and say what came of it."""
        self._exported = f" · {save_whole(save, path)}"

    # --- data

    def _data(self, station: Station, seconds: float) -> tuple[Floats, dict[str, Floats]]:
        if self._frozen is None:
            return self._live(station, seconds)
        times = self._frozen.times_of(seconds)
        return times, {name: column[-len(times) :] for name, column in self._frozen.columns.items()}

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
        if station.robot.is_stale():
            return f"STALE, {age_text(station.robot.age_s())} old{many}"
        return f"{station.robot.rate_hz():.0f} rows/s{many}"


def _infos(station: Station) -> list[ChannelInfo]:
    description = station.robot.description
    return (
        [] if description is None else [info for info in description.channels if info.component != "resource"]
    )


def _open_group(item: QTreeWidgetItem) -> None:
    group = item.parent()
    if group is not None:
        group.setExpanded(True)


def _colours(channels: Sequence[str]) -> list[str]:
    others, taken = cycle(OTHERS), set()
    colours: list[str] = []
    for name in channels:
        side = name.partition("_")[0]
        if side in ("left", "right") and side not in taken:
            taken.add(side)
            colours.append(side)
        else:
            colours.append(next(others))
    return colours


def _css(theme: Theme, colour: str) -> str:
    return colour if colour.startswith("#") else theme.colour(colour).name()
