"""`gwrms plot`: channels over time, in the window or in the terminal."""

import argparse
import collections
import contextlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from gateway.cli.arguments import seconds
from gateway.cli.connect import (
    absent_components,
    add_robot,
    channel_names,
    check_names,
    connect,
    meant,
    modules_of,
    widened,
)
from gateway.cli.text import measured, say
from gateway.cli.value_display import Channels
from gateway.client import LinkSettings, Robot
from server_gui.qt_needs import can_open
from server_gui.terminal.braille import Sample, draw, extent
from server_gui.terminal.keys import Key, Keyboard

SPAN_S: Final = 10.0  # that is in sight
RATE_HZ: Final = 50.0
FRAME_S: Final = 0.2
SILENT_S: Final = 1.0  # after which the newest value is none any more
ROWS: Final = 6  # of a curve
LABEL: Final = 10  # letters of a scale
EPILOG: Final = f"""If there is a display, the window opens on its page Signals with these channels ticked,
and records nothing; otherwise, and with --terminal, they are drawn in the terminal: the last {SPAN_S:g} s,
one curve per channel, angles in degrees. Missing values are gaps; when no data comes, the curves move on.
If the output is not a terminal, the curves of --seconds are printed once.

examples
  gwrms plot left_knee.position right_knee.position
  gwrms plot '*_insole.force' --terminal
  gwrms plot trunk --terminal --seconds 10 > trunk.txt"""


def main(argv: list[str]) -> int:
    """Run `gwrms plot`."""
    arguments = _parser().parse_args(argv)
    if not arguments.terminal and can_open():
        return _window(arguments)
    return _terminal(arguments)


def _window(arguments: argparse.Namespace) -> int:
    from msgspec.structs import replace

    from server_gui.app import run
    from server_gui.core.settings.server_file import add_robots, load, name_of

    with connect(arguments, "plot") as robot:
        description = robot.describe()
        channels = widened(arguments.channels, description)
        check_names("channel", channels, channel_names(description), absent_components(description))
    settings, address = load(), str(arguments.robot)
    names = (name for name, each in settings.robots.items() if each.where == arguments.robot)
    name = next(names, name_of(address))
    alone = add_robots(replace(settings, robots={}), {name: address})
    return run(alone, seconds=arguments.seconds, signals=channels)


def _terminal(arguments: argparse.Namespace) -> int:
    is_live = sys.stdout.isatty()
    ends_s = time.monotonic() + (arguments.seconds or (float("inf") if is_live else SPAN_S))
    # A link that drops is told by the curves themselves: no line comes between them.
    link = LinkSettings(client="gwrms plot")
    with Robot(arguments.robot, link) as robot, contextlib.suppress(KeyboardInterrupt), _keys() as is_left:
        description = robot.describe()
        channels = widened(arguments.channels, description)
        check_names("channel", channels, channel_names(description), absent_components(description))
        modules = modules_of(meant(channels, description))
        curves = Curves(
            Channels(description, degrees=True), SPAN_S if is_live else arguments.seconds or SPAN_S
        )
        screen = _Screen() if is_live else None
        for batch in robot.watch(*channels, rate_hz=RATE_HZ, modules=modules, idle_s=FRAME_S):
            for stamp_ns, values in batch.rows():
                curves.take(stamp_ns / 1e9, values)
            if screen is not None:
                screen.show(curves)
            if time.monotonic() >= ends_s or is_left():
                break
        if screen is None:
            say("\n".join(curves.lines(shutil.get_terminal_size().columns)) + "\n")
    return 0


@contextlib.contextmanager
def _keys() -> Iterator[Callable[[], bool]]:
    """Yield how to know whether q was pressed."""
    if os.name != "posix":  # there are no keys without Enter elsewhere: Ctrl-C
        yield lambda: False
        return
    with Keyboard() as keyboard:
        yield lambda: Key.QUIT in keyboard.wait(0.0)


class Curves:
    """The last seconds of each channel, which go on where nothing comes."""

    def __init__(self, shown: Channels, span_s: float) -> None:
        self._shown = shown
        self._span_s = span_s
        self._samples: dict[str, collections.deque[Sample]] = {}
        self._newest_s = 0.0
        self._taken_s = time.monotonic()  # on our clock

    def take(self, time_s: float, values: dict[str, float | None]) -> None:
        """Add a row, and let go what is out of sight."""
        if time_s < self._newest_s:  # the robot has booted anew: its clock is another one
            self._samples.clear()
        self._newest_s, self._taken_s = time_s, time.monotonic()
        for name, value in values.items():
            samples = self._samples.setdefault(name, collections.deque())
            samples.append((time_s, self._shown.value(name, value)))
            while samples[0][0] < self._newest_s - self._span_s:
                samples.popleft()

    def lines(self, columns: int) -> list[str]:
        """Return the lines to print: a title and the curve of each channel."""
        silent_s = time.monotonic() - self._taken_s
        silent_s = silent_s if silent_s > SILENT_S else 0.0
        found: list[str] = []
        for name, samples in self._samples.items():
            found += self._curve(name, list(samples), columns, silent_s)
        said = f", nothing came in the last {silent_s:.1f} s" if silent_s else ""
        return [*found, f"{'':>{LABEL}} the last {self._span_s:g} s{said}"]

    def _curve(self, name: str, samples: Sequence[Sample], columns: int, silent_s: float) -> list[str]:
        low, high = extent(samples)
        size = max(10, columns - LABEL - 2), ROWS
        now_s = self._newest_s + silent_s
        curve = draw(samples, now_s - self._span_s, now_s, low, high, size)
        scale = [f"{high:.6g}", *[""] * (ROWS - 2), f"{low:.6g}"]
        newest = measured(None if silent_s else samples[-1][1], self._shown.info(name))
        title = f"{self._shown.title(name)}  {newest}"
        return [title, *(f"{at:>{LABEL}} {line}" for at, line in zip(scale, curve, strict=True))]


def fitted(lines: list[str], rows: int) -> list[str]:
    """Return as many whole curves as so many rows have room for, and how many they have none for."""
    if len(lines) <= rows:
        return lines
    curves, room = (len(lines) - 1) // (ROWS + 1), (rows - 1) // (ROWS + 1)
    last = f"{lines[-1]}; {curves - room} of {curves} channels need a taller terminal"
    return [*lines[: room * (ROWS + 1)], last]


class _Screen:
    """A terminal that is drawn anew some times a second, in its place."""

    def __init__(self) -> None:
        self._lines = 0
        self._next_s = 0.0

    def show(self, curves: Curves) -> None:
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + FRAME_S
        columns, rows = shutil.get_terminal_size()
        lines = [line[: columns - 1] for line in fitted(curves.lines(columns), rows - 1)]
        up = f"\x1b[{self._lines}F" if self._lines else ""  # ECMA-48, CPL and ED
        sys.stdout.write(f"{up}\x1b[J")
        say("\n".join(lines) + "\n")
        self._lines = len(lines)


def _parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="gwrms plot",
        description="Plot channels live, until q or Ctrl-C.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_robot(made)
    made.add_argument(
        "channels", metavar="CHANNEL", nargs="+", help="names, globs, or a component: all of its channels"
    )
    made.add_argument("--terminal", action="store_true", help="use the terminal even with a display")
    made.add_argument("--seconds", type=seconds, metavar="N", help="end after N seconds")
    return made
