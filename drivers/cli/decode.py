"""`gwrms sensor decode`: raw bytes of a sensor as JSON lines, one a frame, and the counters last."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import msgspec

from drivers.identify import format_of
from drivers.imu import frame as imu_frame
from drivers.imu.can import FORMATS as CAN_FORMATS
from drivers.imu.formats import FORMATS as IMU_FORMATS
from drivers.insole import frame as insole_frame
from drivers.insole import layout as layouts
from drivers.insole.calibration import Cells
from drivers.insole.formats import FORMATS as INSOLE_FORMATS
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import Layout
from drivers.insole.load import load_of
from drivers.parsing import Parser

CHUNK = 65536
FORCE_THRESHOLD = 20.0  # N, below it there is no centre of pressure
FORMATS = (*IMU_FORMATS, *CAN_FORMATS, *INSOLE_FORMATS)

Flatten = Callable[[Any], dict[str, object]]


def options(parser: argparse.ArgumentParser) -> Callable[[argparse.Namespace], int]:
    parser.description = (
        'Print a JSON line per frame, {"frame": kind, …}, in SI with angles in rad, then {"counters": {…}}. '
        "Exit status 1 if most bytes belong to no frame of this format."
    )
    parser.add_argument("--format", required=True, choices=FORMATS, help="the sensor's data format")
    parser.add_argument(
        "--layout", help=f"an insole's layout file, or a shipped one: {', '.join(layouts.shipped())}"
    )
    parser.add_argument("capture", nargs="?", metavar="CAPTURE", help="a file (default: standard input)")
    return run


def run(options: argparse.Namespace) -> int:
    """Decode the capture to standard output; 1 where most of it is of no frame.

    Raises:
        SettingsError: the layout is wrong, or the format needs one.
        OSError: the capture cannot be read.

    """
    parser, flatten = _reader(options.format, options.layout)
    if options.capture is None:
        return _told(_decode(sys.stdin.buffer, parser, flatten), options, parser)
    with Path(options.capture).open("rb") as capture:
        return _told(_decode(capture, parser, flatten), options, parser)


def _reader(name: str, layout_name: str | None) -> tuple[Parser[Any], Flatten]:
    for folder in (IMU_FORMATS, CAN_FORMATS):
        if name in folder:
            return folder[name].parser(), imu_frame.flat
    layout = layouts.load(layout_name) if layout_name else None
    flatten = insole_frame.flat if layout is None else _with_load(layout)
    return INSOLE_FORMATS[name].parser(layout)(), flatten


def _told(heard: tuple[bytes, int], options: argparse.Namespace, parser: Parser[Any]) -> int:
    """Say it where most bytes were of no frame, and what they look like; returns the exit status."""
    (start, size), counters = heard, parser.counters
    if counters.frames and 2 * counters.bytes_dropped <= size:
        return 0
    found = format_of(start)
    said = f"{counters.bytes_dropped} of {size} bytes belong to no frame of {options.format}"
    said += f", they are {found}: say --format {found}" if found not in (None, options.format) else ""
    sys.stderr.write(f"gwrms sensor: {options.capture or 'standard input'}: {said}\n")
    return 1


def _decode(source: BinaryIO, parser: Parser[Any], flatten: Flatten) -> tuple[bytes, int]:
    """Write all that it has; returns its first bytes, and how many there were."""
    start, size = b"", 0
    write = sys.stdout.write
    read = getattr(source, "read1", source.read)  # what is there already, so that a pipe is shown live
    while data := read(CHUNK):
        start, size = (start + data)[:CHUNK], size + len(data)
        for frame in parser.feed(data):
            write(_line(flatten(frame)))
        sys.stdout.flush()
    for frame in parser.finish():
        write(_line(flatten(frame)))
    write(_line({"counters": parser.counters.as_dict()}))
    sys.stdout.flush()
    return start, size


def _line(values: dict[str, object]) -> str:
    return msgspec.json.encode(values).decode("utf-8") + "\n"


def _with_load(layout: Layout) -> Flatten:
    """Add pressure, force and centre of pressure where the layout suffices."""
    count = len(layout.cells)
    cells = Cells(layout.calibration, count) if layout.calibration is not None and count else None

    def flatten(frame: InsoleFrame) -> dict[str, object]:
        line = insole_frame.flat(frame)
        if count != len(frame.cells):
            return line
        if not frame.calibrated:
            if cells is None:
                return line
            line["pressures"] = cells.pressures(frame.cells)
        pressures: Any = line["pressures"]
        on_foot = layout if frame.foot is None else layout.for_foot(frame.foot)
        return line | load_of(pressures, on_foot, FORCE_THRESHOLD)._asdict()

    return flatten
