"""`gwrms scan`: what is on a CAN bus and on serial ports, from an interface's name alone."""

import argparse
import sys
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.cli.listen import best, listen
from drivers.errors import Unavailable
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library, files
from drivers.scan.report import as_json, as_text
from drivers.scan.scan import scan
from eds.table import BUS

MORE = """\
examples:
  gwrms scan can0                              listen for 3 s: who sends what, who is the master
  gwrms scan can0 --active --eds ~/eds         then query every node, and find its EDS file
  gwrms scan robot.toml --active               the buses of a robot's file, whatever else is wrong in it
  gwrms scan --serial /dev/ttyUSB0             what talks on a serial port

Without --active not one frame is sent. With it, nodes that another client queries by SDO are left alone, and
nothing is ever written. If the interface is down or its bit rate is wrong, the remedy is shown.
"""
WAIT_S = 3.0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms scan",
        description="Identify the devices on a CAN bus and on serial ports. Only listens without --active.",
        epilog=MORE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "buses",
        nargs="*",
        metavar="BUS",
        help="can0, INTERFACE:CHANNEL of python-can, or a robot's file",
    )
    parser.add_argument("--bitrate", type=int, help="bit/s, for interfaces that need one")
    parser.add_argument("--seconds", type=float, default=WAIT_S, help="how long to listen (default 3)")
    parser.add_argument("--active", action="store_true", help="query all 127 node ids")
    parser.add_argument(
        "--eds", type=Path, action="append", default=[], metavar="DIR", help="folder of EDS files"
    )
    parser.add_argument("--serial", action="append", default=[], metavar="PORT", help="a serial port")
    parser.add_argument(
        "--json", action="store_true", help="print one JSON line per bus or port, for programs"
    )
    return parser


def main(arguments: Sequence[str]) -> int:
    """Scan each bus and port; one that cannot be opened hides no other. Returns the exit status."""
    parser = _parser()
    options = parser.parse_args(arguments)
    if not 0 < options.seconds <= 3600:
        parser.error(f"--seconds {options.seconds:g} is outside 0 to 3600")
    if not options.buses and not options.serial:
        parser.error("name a bus (can0, INTERFACE:CHANNEL, robot.toml) or --serial PORT")
    missing = [str(folder) for folder in options.eds if not folder.is_dir()]
    if missing:
        parser.error(f"--eds {', '.join(missing)}: there is no such folder")
    failed = False
    library = Library(files(options.eds)) if options.active else Library(())
    for problem in library.unreadable.values():
        sys.stderr.write(f"gwrms scan: {problem}\n")
    for name, settings in named(options.buses, options.bitrate):
        bus = BUS if name in options.buses else name
        failed |= not _told(name, partial(_scan_bus, bus, settings, options, library))
    for port in options.serial:
        failed |= not _told(port, lambda port=port: _scan_port(port, options))
    return int(failed)


def _told(name: str, act: Any) -> bool:
    try:
        act()
    except Unavailable as error:
        sys.stderr.write(f"gwrms scan: {name}: {error}\n")
        return False
    return True


def _scan_bus(bus: str, settings: CanSettings, options: argparse.Namespace, library: Library) -> None:
    found = scan(settings, options.seconds, threading.Event().wait, active=options.active)
    proposals = {
        node: library.proposals(node, told)
        for node, told in found.told.items()
        if isinstance(told, NodeAnswers)
    }
    if options.json:
        line = msgspec.json.encode(as_json(settings, found, proposals, bus)).decode()
    else:
        line = "\n".join(as_text(settings, found, proposals, bus, active=options.active)) + "\n"
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def _scan_port(port: str, options: argparse.Namespace) -> None:
    heard = best(list(listen(port)))
    if options.json:
        sys.stdout.write(msgspec.json.encode({"port": port, "found": heard}).decode() + "\n")
    else:
        sys.stdout.write(f"{port}: {heard.baudrate} baud: {heard}\n")
