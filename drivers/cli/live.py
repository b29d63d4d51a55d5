"""`gwrms sensor PORT`: tries baud rates and formats on an unknown sensor, then shows it live."""

import argparse
import sys
import threading
import time
from collections.abc import Callable

import msgspec

from drivers.cli.listen import best, listen, nothing
from drivers.component import Component
from drivers.identify import Match
from drivers.imu.device import Imu
from drivers.imu.formats import FORMATS as IMU_FORMATS
from drivers.imu.settings import ImuSettings
from drivers.insole import layout as layouts
from drivers.insole.build import insoles
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.settings import InsoleSettings
from drivers.samples import ComponentState

REFRESH_S = 0.25
AXES = "# which of its axes point forward, left and up; here as its maker means it to sit"


def options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.add_argument("port", metavar="PORT", help="preferably a stable path: /dev/serial/by-id/…")
    parser.add_argument("--baud", type=int, help="try this baud rate only")
    parser.add_argument(
        "--seconds", type=float, help="show live values for so long (0: not at all; default: until Ctrl-C)"
    )
    parser.add_argument(
        "--json", action="store_true", help="print the result as one JSON line, with the table"
    )
    return run


def run(options: argparse.Namespace) -> int:
    """Identify, print the table for the robot's file, then show it live; 1 when nothing fits.

    Raises:
        Unavailable: the port cannot be opened.

    """
    heard = []
    for one in listen(options.port, options.baud):
        heard.append(one)
        if not options.json:
            sys.stdout.write(f"{one.baudrate:>7} baud: {one}\n")
            sys.stdout.flush()
    found = best(heard)
    wired = None if found.match is None else table(options.port, found.baudrate, found.match)
    if options.json:
        told = {"port": options.port, "found": found, "table": wired}
        sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
    if found.match is None:
        sys.stderr.write(f"gwrms sensor: {nothing(options.port, heard)}\n")
        return 1
    if options.json:
        return 0
    sys.stdout.write(f"\nfor the robot's file:\n\n{wired}\n")
    if options.seconds != 0:
        _show(_components(options.port, found.baudrate, found.match), options.seconds)
    return 0


def table(port: str, baudrate: int, match: Match) -> str:
    """Return the sensor's tables for the robot's file: one, or one for each foot."""
    keys = f'port = "{port}"\nbaudrate = {baudrate}\nformat = "{match.format_name}"\n'
    if match.format_name in IMU_FORMATS:
        axes = msgspec.json.encode(IMU_FORMATS[match.format_name].conventions.axes).decode()
        return f"[imu.trunk]\n{keys}axes = {axes:<22} {AXES}\n"
    layout = _layout(match)
    keys += f'layout = "{layout}"\n' if layout is not None else ""
    if not match.feet:
        return (
            f"[insole.left_insole]  # or right_insole: which foot it is under, its frames do not say\n{keys}"
        )
    return "\n".join(f"[insole.{foot}_insole]\n{keys}" for foot in match.feet)


def _layout(match: Match) -> str | None:
    """Return the layout that the table must name; `None` if the format knows its cells' positions."""
    if match.layout is not None or INSOLE_FORMATS[match.format_name].layout is not None:
        return match.layout
    return next(
        (name for name in layouts.shipped() if len(layouts.load(name).cells) == match.cells), "yours.toml"
    )


def _components(port: str, baudrate: int, match: Match) -> list[Component]:
    if match.format_name in IMU_FORMATS:
        settings = {"port": port, "baudrate": baudrate, "format": match.format_name}
        return [Imu("trunk", msgspec.convert(settings, ImuSettings))]
    layout = _layout(match)
    if layout is not None and layout.endswith(".toml"):
        return []
    chosen = {"port": port, "baudrate": baudrate, "format": match.format_name, "layout": layout}
    feet = msgspec.convert(chosen, InsoleSettings)
    return [*insoles({"left_insole": feet, "right_insole": feet})]


def _show(components: list[Component], seconds: float | None) -> None:
    until = time.monotonic() + seconds if seconds is not None else float("inf")
    for component in components:
        component.start()
    pause = threading.Event()
    try:
        while time.monotonic() < until:
            pause.wait(REFRESH_S)
            now_ns = time.monotonic_ns()
            there = [one for one in components if one.quality(now_ns).state is not ComponentState.LOST]
            sys.stdout.write("\n".join(_line(one, now_ns) for one in there or components) + "\n")
            sys.stdout.flush()
    except KeyboardInterrupt:
        return
    finally:
        for component in components:
            component.stop()


def _line(component: Component, now_ns: int) -> str:
    quality = component.quality(now_ns)
    values = []
    for index, channel in enumerate(component.channels):
        value, _ = component.latest.read(index, now_ns)
        if value is not None and not channel.quantity.startswith(("cell_", "orientation_")):
            values.append(f"{channel.quantity} {value:.3g} {channel.unit}".rstrip())
    return f"{component.name} {quality.state}: {', '.join(values) or quality.problem or 'no values yet'}"
