"""`gwrms sensor PORT`: tries baud rates and formats on an unknown sensor, then shows it live."""

import argparse
import os
import select
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import msgspec

from drivers.component import Component
from drivers.errors import Unavailable
from drivers.identify import Match, matches
from drivers.imu.device import Imu
from drivers.imu.formats import FORMATS as IMU_FORMATS
from drivers.imu.settings import ImuSettings
from drivers.insole import layout as layouts
from drivers.insole.build import insoles
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.settings import InsoleSettings
from drivers.port import open_port
from drivers.samples import State

BAUDRATES = (115200, 230400, 9600, 460800, 921600, 57600, 38400, 19200, 4800)
LISTEN_S = 1.0
SURE = 0.9  # a share of the bytes that needs no other baud rate tried
REFRESH_S = 0.25


@dataclass(frozen=True, slots=True)
class Heard:
    """What came at one baud rate."""

    baudrate: int
    bytes: int
    match: Match | None


def options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.add_argument("port", metavar="PORT", help="best a stable path: /dev/serial/by-id/…")
    parser.add_argument("--baud", type=int, help="try this baud rate only")
    parser.add_argument(
        "--seconds", type=float, help="show it live for so long (0: not at all; default: Ctrl-C)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON line: what was found")
    return run


def run(options: argparse.Namespace) -> int:
    """Identify, then show; 1 when nothing fits.

    Raises:
        Unavailable: the port cannot be opened.

    """
    heard = []
    for one in listen(options.port, (options.baud,) if options.baud else BAUDRATES):
        heard.append(one)
        if not options.json:
            sys.stdout.write(f"{one.baudrate:>7} baud: {_described(one)}\n")
            sys.stdout.flush()
    best = max(heard, key=lambda one: one.match.share if one.match else -1.0)
    if options.json:
        sys.stdout.write(msgspec.json.encode({"port": options.port, "found": best}).decode() + "\n")
    if best.match is None:
        sys.stderr.write(f"gwrms sensor: {_nothing(options.port, heard)}\n")
        return 1
    if options.json or options.seconds == 0:
        return 0
    sys.stdout.write(f"\nfor the robot's file:\n\n{table(options.port, best.baudrate, best.match)}\n")
    _show(_components(options.port, best.baudrate, best.match), options.seconds)
    return 0


def listen(port: str, baudrates: tuple[int, ...]) -> Iterator[Heard]:
    """What speaks at each baud rate, until one fits."""
    for baudrate in baudrates:
        data = _read(port, baudrate, LISTEN_S)
        match = next(iter(matches(data)), None)
        yield Heard(baudrate, len(data), match)
        if match is not None and match.share >= SURE:
            return


def table(port: str, baudrate: int, match: Match) -> str:
    """What of the robot's file wires the sensor: a table, or one for each foot."""
    keys = f'port = "{port}"\nbaudrate = {baudrate}\nformat = "{match.format_name}"\n'
    if match.format_name in IMU_FORMATS:
        return f"[imu.trunk]\n{keys}"
    layout = _layout(match)
    keys += f'layout = "{layout}"\n' if layout is not None else ""
    return "\n".join(f"[insole.{foot}_insole]\n{keys}" for foot in match.feet or ("left",))


def _read(port: str, baudrate: int, seconds: float) -> bytes:
    data = b""
    until = time.monotonic() + seconds
    with open_port(port, baudrate) as line:
        while (left := until - time.monotonic()) > 0:
            if select.select([line.fileno()], [], [], left)[0]:
                try:
                    part = os.read(line.fileno(), 4096)
                except OSError as error:
                    raise Unavailable(f"{port} went away while it was read: check its cable") from error
                if not part:
                    raise Unavailable(f"{port} went away while it was read: check its cable")
                data += part
    return data


def _described(heard: Heard) -> str:
    if not heard.bytes:
        return "silent"
    if heard.match is None:
        return f"{heard.bytes} bytes in no format known"
    match = heard.match
    cells = f", {match.cells} cells" if match.cells else ""
    return (
        f"{match.format_name}{cells}: {match.frames} frames explain {match.share:.0%} of {heard.bytes} bytes"
    )


def _nothing(port: str, heard: list[Heard]) -> str:
    if not any(one.bytes for one in heard):
        return f"{port} is silent: check the sensor's power and its TX wire, and whether it has to be started"
    return (
        f"{port} sends bytes that no known format explains: try another --baud, or describe it in a layout "
        "file (formats insole-csv and insole-frame)"
    )


def _layout(match: Match) -> str | None:
    """What the table has to name; `None` where the format knows where its cells are."""
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
            there = [one for one in components if one.quality(now_ns).state is not State.LOST]
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
