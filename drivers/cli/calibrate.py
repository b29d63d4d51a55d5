"""`gwrms calibrate`: an insole's calibration or an IMU's zero, shown before it is written."""

import argparse
import datetime
import math
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from drivers.build_context import BuildContext
from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.cli.robot_file_port import named
from drivers.cli.sensor import run_parsed
from drivers.errors import Unavailable
from drivers.identify import format_of
from drivers.imu import zero
from drivers.imu.build import build_imu
from drivers.imu.device import Imu
from drivers.imu.formats import FORMATS as IMU_FORMATS
from drivers.imu.settings import Axes, ImuSettings, kind_of
from drivers.imu.trunk import TrunkImu
from drivers.insole import calibration_fit
from drivers.insole.calibration import CellCalibration, loaded_counts
from drivers.insole.device import USUAL_LAYOUT, layout_of, line_for
from drivers.insole.foot import Foot
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.insole.settings import InsoleSettings
from drivers.line import Line
from drivers.samples import ComponentState

STANDARD_GRAVITY = 9.80665
AVERAGE_S = 2.0
USAGE = """usage: gwrms calibrate insole|imu PORT --write FILE …
       gwrms calibrate joint ROBOT.toml:NAME …

  insole   its cells' pressure, by the unloaded insole and known weights
  imu      the present posture as upright
  joint    its zero, in the posture in which it was found before

gwrms calibrate COMMAND --help says more.
"""


def main(arguments: Sequence[str]) -> int:
    """Run `gwrms calibrate` and return its exit status."""
    kinds = {"insole": _insole_options, "imu": _imu_options}
    if not arguments or arguments[0] not in kinds:
        helped = bool(arguments) and arguments[0] in ("-h", "--help")
        (sys.stdout if helped else sys.stderr).write(USAGE)
        return 0 if helped else 2
    kind, *rest = arguments
    parser = argparse.ArgumentParser(prog=f"gwrms calibrate {kind}")
    parser.add_argument("port", metavar="PORT")
    parser.add_argument("--write", type=Path, required=True, metavar="FILE", help="file for the result")
    return run_parsed(parser, kinds[kind](parser), rest)


def _insole_options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.description = (
        "Measure the unloaded cells, then known loads on the whole insole; fit, show the fit, and ask "
        "before writing. Name the file in [insole.NAME] as `calibration`. ROBOT.toml:NAME instead of a "
        "port takes everything from [insole.NAME]. A device that sends pressure needs no calibration."
    )
    parser.add_argument(
        "--format", choices=tuple(INSOLE_FORMATS), default="insole-cobs", help="default: %(default)s"
    )
    parser.add_argument("--baud", type=int, default=230400, help="default: %(default)s")
    parser.add_argument(
        "--layout", help=f"a shipped layout or a .toml file; default: the device's own, else {USUAL_LAYOUT}"
    )
    parser.add_argument("--foot", choices=("left", "right"), help="needed if both feet are on the port")
    parser.add_argument("--falling", type=float, metavar="FULL_SCALE", help="fewer counts mean more load")
    parser.add_argument("--saturation", type=float, help="counts at which a cell saturates")
    parser.add_argument("--power", action="store_true", help="fit a power law (two different loads or more)")
    return _insole


def _imu_options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.description = (
        "Take the present posture as upright, and write it. Stand upright and still; name the file in "
        "[imu.NAME] as `zero`. ROBOT.toml:NAME instead of a port takes everything from [imu.NAME], "
        "also for an IMU on a CAN bus."
    )
    parser.add_argument(
        "--format", choices=tuple(IMU_FORMATS), default="witmotion", help="default: %(default)s"
    )
    parser.add_argument("--baud", type=int, default=115200, help="default: %(default)s")
    # One argument: three would be taken for options where an axis points the other way.
    parser.add_argument(
        "--axes", type=_axes, metavar="'X Y Z'", help="as in [imu.NAME], such as 'y -x z'; in quotes"
    )
    parser.add_argument(
        "--mounting",
        nargs=3,
        type=float,
        default=(0.0, 0.0, 0.0),
        metavar=("ROLL", "PITCH", "YAW"),
        help="as in [imu.NAME], rad",
    )
    return _imu


def _axes(text: str) -> tuple[str, ...]:
    try:
        axes: tuple[str, ...] = msgspec.convert(text.split(), Axes)
    except msgspec.ValidationError as error:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not three of x, y, z, -x, -y, -z, such as 'y -x z'"
        ) from error
    return axes


class _Average:
    """A line's user that averages the cells' counts of one foot."""

    def __init__(self, foot: Foot | None, cells: int) -> None:
        self._foot = foot
        self._cells = cells
        self.sums: list[float] | None = None
        self.frames = 0
        self.refused = ""  # why the last frame that came does not count

    def received(self, frames: Sequence[InsoleFrame], _stamp_ns: int) -> None:
        for frame in frames:
            self._add(frame)

    def _add(self, frame: InsoleFrame) -> None:
        self.refused = self._why_not(frame)
        if self.refused:
            return
        before = self.sums or [0.0] * self._cells
        self.sums = [total + (count or 0.0) for total, count in zip(before, frame.cells, strict=True)]
        self.frames += 1

    def _why_not(self, frame: InsoleFrame) -> str:
        if frame.foot is not None and self._foot not in (None, frame.foot):
            return f"frames of the {frame.foot} foot come, not of the {self._foot} one"
        if len(frame.cells) != self._cells:
            return (
                f"frames of {len(frame.cells)} cells come, and the layout has {self._cells}: name another one"
            )
        return "it sends pressure already and needs no calibration" if frame.calibrated else ""

    def disconnected(self) -> None:
        self.sums, self.frames = None, 0


def _insole(options: argparse.Namespace) -> int:
    line, layout, foot = _insole_in_file(options.port) or _insole_on_port(options)
    base = CellCalibration(
        polarity="falling" if options.falling else "rising",
        full_scale=options.falling,
        saturation=options.saturation,
    )
    rising = loaded_counts(base)

    def measure() -> list[float]:
        return [rising(count) for count in _average(line, foot, len(layout.cells))]

    _say("Take all load off the insole (shoe on, foot lifted), then press Enter.")
    _read()
    tares = measure()
    _say("tare: " + " ".join(f"{tare:.0f}" for tare in tares))
    loads: list[calibration_fit.Load] = []
    while (mass := _mass()) is not None:
        loads.append(calibration_fit.Load(mass * STANDARD_GRAVITY, tuple(measure())))
    fitted = calibration_fit.fit(layout, tares, loads, base, options.power)
    for load, force in zip(loads, fitted.forces, strict=True):
        _say(f"  load {load.force:7.1f} N   measured {force:7.1f} N   off by {force - load.force:+6.1f} N")
    _say(f"  error {fitted.rms_error:.1f} N (rms)")
    return _write(options.write, calibration_fit.text(fitted, _now()))


_Sole = tuple[Line[InsoleFrame], Layout, Foot | None]  # what is listened to, its cells, whose frames count


def _insole_on_port(options: argparse.Namespace) -> _Sole:
    settings = InsoleSettings(port=options.port, baudrate=options.baud, format=options.format)
    layout = layout_of(options.format, options.layout)
    return line_for(settings, layout, format_of), layout, options.foot


def _insole_in_file(where: str) -> _Sole | None:
    """Return the insole at `ROBOT.toml:NAME`; `None` for a port.

    Raises:
        SettingsError: the file, its table or the layout cannot be used.

    """
    with named(where, "insole") as found:
        if found is None:
            return None
        settings = msgspec.convert(found.table, InsoleSettings)
    layout = layout_of(settings.format, settings.layout, found.file.parent)
    return line_for(settings, layout, format_of), layout, settings.side(found.name)


def _imu(options: argparse.Namespace) -> int:
    imu = _imu_in_file(options.port) or _imu_on_port(options)
    imu.start()
    try:
        threading.Event().wait(AVERAGE_S)
        quality = imu.quality(time.monotonic_ns())
        if quality.state is not ComponentState.OK:
            raise Unavailable(quality.problem or f"nothing came from {options.port}")
        measured = imu.zero_now()
    finally:
        imu.stop()
    angle = math.degrees(2 * math.acos(min(1.0, abs(measured[0]))))
    _say(f"upright is {angle:.1f}° from how the IMU is mounted")
    return _write(options.write, zero.text(measured, _now()))


def _imu_on_port(options: argparse.Namespace) -> Imu:
    settings = {"port": options.port, "baudrate": options.baud, "format": options.format}
    settings |= {"mounting": options.mounting} | ({"axes": options.axes} if options.axes else {})
    return Imu("trunk", msgspec.convert(settings, ImuSettings), recognise=format_of)


def _imu_in_file(where: str) -> TrunkImu | None:
    """Return the IMU at `ROBOT.toml:NAME`, with no zero yet; `None` for a port.

    Raises:
        SettingsError: the file or its table cannot be used.

    """
    with named(where, "imu") as found:
        if found is None:
            return None
        settings = msgspec.structs.replace(msgspec.convert(found.table, kind_of(found.table)), zero=None)
        bus = found.table.get("bus")
        tables = {} if bus is None else {bus: found.tables["can"][bus]}
        buses = {name: CanBus(name, CanSettings.from_table(table)) for name, table in tables.items()}
    return build_imu(found.name, settings, BuildContext(found.file, buses, recognise=format_of))


def _average(line: Line[InsoleFrame], foot: Foot | None, cells: int) -> list[float]:
    average = _Average(foot, cells)
    line.start(average)
    try:
        threading.Event().wait(AVERAGE_S)
        problem = line.problem(time.monotonic_ns())
    finally:
        line.stop(average)
    if average.sums is None or not average.frames:
        came = f"{line.path}: {average.refused}" if average.refused else ""
        raise Unavailable(came or problem or f"no frame of {cells} cells came from {line.path}")
    return [total / average.frames for total in average.sums]


def _mass() -> float | None:
    """Return the next known load in kg; `None` when there are no more."""
    while True:
        _say("Put a known load on the whole insole, type its mass in kg and press Enter (empty: done).")
        text = _read()
        if not text:
            return None
        try:
            mass = float(text)
        except ValueError:
            mass = math.nan
        if 0.1 <= mass <= 500.0:
            return mass
        _say(f"{text!r} is no mass between 0.1 and 500 kg")


def _write(path: Path, content: str) -> int:
    _say(f"Write this to {path}? [y/N]")
    if _read().lower() not in ("y", "yes"):
        _say("nothing written")
        return 1
    path.write_text(content, encoding="utf-8")
    _say(f"written to {path}")
    return 0


def _read() -> str:
    return sys.stdin.readline().strip()


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
