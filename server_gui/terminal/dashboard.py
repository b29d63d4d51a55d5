"""The terminal dashboard: lays the panels out and draws them ten times a second."""

import io
import re
import time
from collections.abc import Callable
from pathlib import Path

from rich.console import Console, Group, RenderableType
from rich.layout import Layout
from rich.live import Live

from server_gui.core.desk.station import Station
from server_gui.terminal import panels
from server_gui.terminal.controls import Controls
from server_gui.terminal.keys import Keyboard

FRAME_S = 0.1
PICTURE_SIZE = (118, 27)
WIDE_COLUMNS, WIDE_LINES = 110, 27
FEET_LINES = 6
FRAME = 2  # lines of a panel that are its frame


def draw(station: Station, controls: Controls, where: str, size: tuple[int, int]) -> RenderableType:
    """Draw a frame for a screen of `size` (columns, lines); nothing that matters is left out of 80 × 24.

    Whatever the size, the last lines are the keys, and what became of a STOP.
    """
    columns, lines = size
    look = panels.WIDE if columns >= WIDE_COLUMNS and lines >= WIDE_LINES else panels.NARROW
    learned = station.predictions.elsewhere
    above, below = (3 if look.roomy else 1) + bool(learned), 2
    unknown = not station.robot.parts  # nothing else explains what is there to do
    if unknown:
        below = 1 + min(panels.news_lines(station, controls, where, columns), lines // 3)
    room, footer = lines - above - below, panels.footer(station, controls, where, in_full=unknown)
    if room <= 0:
        return footer
    page = Layout()
    header = panels.header(station, where, look)
    page.split_column(
        Layout(Group(header, panels.learned(learned)) if learned else header, size=above),
        Layout(name="body"),
        Layout(footer, size=below),
    )
    joints = min(2 + 1 + max(6, len(station.robot.names("joint"))), room)
    page["body"].split_column(Layout(panels.joints(station, look), size=joints), Layout(name="lower"))
    _fill(page["lower"], station, controls, look, room - joints)
    return page


def _fill(lower: Layout, station: Station, controls: Controls, look: panels.PanelWidths, room: int) -> None:
    """Draw what stands below the joints; what no line is left for is out of sight."""
    robot, gait = station.robot, station.processing.derived().gait
    lower.visible = room > 0
    lower.split_row(Layout(name="left", ratio=3), Layout(panels.resources(station, look), ratio=2))
    feet = min(FEET_LINES, room)
    parameters = panels.parameters(robot, controls, look, room - feet - FRAME)
    lower["left"].split_column(
        Layout(panels.feet_and_trunk(robot, gait, look), size=feet),
        Layout(parameters, visible=room > feet),
    )


class Dashboard:
    """Shows a robot in the terminal until `tick` says that it is enough, or the user quits."""

    def __init__(self, station: Station, controls: Controls, where: str) -> None:
        self._station = station
        self._controls = controls
        self._where = where

    def run(self, tick: Callable[[], bool]) -> None:
        """Draw; `tick` is called before every frame, takes what has come, and returns whether to go on."""
        console = Console()
        live = Live(
            console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
        )
        with Keyboard() as keyboard, live:
            next_frame = time.monotonic()
            while tick() and not self._controls.is_over:
                live.update(self._frame(console.size), refresh=True)
                next_frame = max(next_frame + FRAME_S, time.monotonic())
                for key in keyboard.wait(next_frame - time.monotonic()):
                    self._controls.press(key)

    def _frame(self, size: tuple[int, int]) -> RenderableType:
        return draw(self._station, self._controls, self._where, size)


def save_picture(path: Path, station: Station, controls: Controls, where: str) -> None:
    """Save the present frame as an SVG file."""
    width, height = PICTURE_SIZE
    console = Console(record=True, width=width, height=height, file=io.StringIO(), force_terminal=True)
    console.print(draw(station, controls, where, PICTURE_SIZE), height=height)
    svg = console.export_svg(title="gwrms demo")
    # rich names a font on somebody's server; a picture of ours asks nobody for anything.
    path.write_text(re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL), encoding="utf-8")
