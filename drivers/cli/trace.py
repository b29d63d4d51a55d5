"""`gwrms trace`: every frame of a bus or of a recording, decoded; or what takes the bus's time."""

import argparse
import contextlib
import datetime
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from drivers.bus.frames import EXTENDED
from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.cli.trace_load import show_load
from drivers.errors import SettingsError
from drivers.trace.decoding import Decoder, Kind, Line
from drivers.trace.devices import Device, Devices
from drivers.trace.files import SUFFIXES, Captured, Put, is_file, writing
from drivers.trace.load import Meter
from drivers.trace.robot_file import described, devices
from drivers.trace.sources import Batches, live, recorded, until
from drivers.trace.wanted import Wanted, by_kind, by_node, by_object

MORE = """\
examples:
  gwrms trace can0 --robot robot.toml                  everything, by the EDS files that robot.toml names
  gwrms trace robot.toml --node left_knee --kind sdo   who asks the knee what
  gwrms trace can0 --eds 5=drive.eds --object 0x6041   node 5's statusword, wherever it comes from
  gwrms trace can0 --write walk.pcap --quiet           record for Wireshark; *.log: for candump's friends
  gwrms trace walk.log --robot robot.toml --json       decode a recording of candump -l, or a PCAP file
  gwrms trace can0 --load                              who takes the bus's time, a table a second

It never sends. PDOs are decoded as the EDS files say, until somebody reads or writes their mapping.
"""
TICK_S = 0.2
_IDENTIFIER = 0x1FFF_FFFF
_NODE_IDS = range(1, 128)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms trace",
        description="Shows the frames of a CAN bus or of a recording, decoded by EDS. Only listens.",
        epilog=MORE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "source",
        metavar="SOURCE",
        help="can0, INTERFACE:CHANNEL of python-can, a robot's file with one bus; or FILE.log, FILE.pcap",
    )
    parser.add_argument(
        "--robot", type=Path, metavar="FILE", help="robot's file that names nodes and EDS files"
    )
    parser.add_argument(
        "--eds",
        action="append",
        default=[],
        metavar="NODE=FILE",
        help="EDS or DCF of a node (again for others)",
    )
    parser.add_argument(
        "--node", action="append", default=[], metavar="NODE", help="only this one, by id or name (or again)"
    )
    parser.add_argument(
        "--kind", action="append", default=[], metavar="KIND", help=f"only these: {', '.join(Kind)}"
    )
    parser.add_argument(
        "--object",
        action="append",
        default=[],
        metavar="OBJECT",
        help="only 0x6041, 0x1018:4 or '*position*'",
    )
    parser.add_argument("--write", type=Path, metavar="FILE", help="what is shown also to *.log or *.pcap")
    parser.add_argument("--quiet", action="store_true", help="show nothing: with --write")
    parser.add_argument(
        "--load", action="store_true", help="a table a second: frames and load by node and kind"
    )
    parser.add_argument("--bitrate", type=int, help="bit/s, for the load, and for interfaces opened with one")
    parser.add_argument("--seconds", type=float, metavar="N", help="end after N seconds (default: Ctrl-C)")
    parser.add_argument("--count", type=int, metavar="N", help="end after N frames that are shown")
    parser.add_argument("--json", action="store_true", help="one JSON line a frame, or a table")
    return parser


def main(arguments: Sequence[str]) -> int:
    """Trace one bus or one recording; returns the exit status.

    Raises:
        DriverError: the interface cannot be opened or goes, or a file cannot be read.

    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if wrong := _misused(options):
        parser.error(wrong)
    if is_file(options.source):
        settings, source = None, recorded(Path(options.source))
    else:
        buses = list(named([options.source], options.bitrate))
        if len(buses) != 1:
            parser.error(f"{options.source} has {len(buses)} buses: name the interface of one, with --robot")
        settings = buses[0][1]
        source = live(settings, _tell_lost)
    known = _known(options, settings)
    bitrate = options.bitrate or (None if settings is None else settings.bitrate)
    with contextlib.closing(source), _sink(options, settings) as sink:
        if options.load:
            names = {device.node_id: device.name for device in known}
            show_load(until(source, options.seconds), Meter(bitrate), names, as_json=options.json)
        else:
            _show_frames(source, sink, known, options)
    return 0


def _misused(options: argparse.Namespace) -> str | None:
    if options.seconds is not None and not 0 < options.seconds <= 1e7:
        return f"--seconds {options.seconds:g} is outside 0 to 10000000"
    if options.count is not None and options.count < 1:
        return f"--count {options.count} is no number of frames"
    if options.quiet and options.write is None:
        return "--quiet is for --write FILE"
    if options.load and (options.node or options.kind or options.object or options.count or options.write):
        return "--load is of all frames: without --node, --kind, --object, --count and --write"
    if options.write is not None and options.write.suffix not in SUFFIXES:
        return f"--write {options.write}: is to be called *.log (candump) or *.pcap"
    return None


def _known(options: argparse.Namespace, settings: CanSettings | None) -> list[Device]:
    """The devices that files describe; what `--eds` says counts more than the robot's file."""
    robot = options.robot or (Path(options.source) if options.source.endswith(".toml") else None)
    channel = None if settings is None else settings.channel
    found = {} if robot is None else {device.node_id: device for device in devices(robot, channel)}
    for word in options.eds:
        node, equals, file = word.partition("=")
        if not equals or not node.isdecimal() or int(node) not in _NODE_IDS:
            raise SettingsError(f"--eds {word}: say NODE=FILE, as in 5=drive.eds")
        before = found.get(int(node))
        beside = Path.cwd() / "here"
        found[int(node)] = described(int(node), before.name if before else None, file, beside)
    return list(found.values())


def _tell_lost(frames: int) -> None:
    sys.stderr.write(f"gwrms trace: {frames} frames were lost on their way to this program\n")


def _nowhere(_captured: Captured) -> None:
    """Nothing is to be written."""


@contextlib.contextmanager
def _sink(options: argparse.Namespace, settings: CanSettings | None) -> Iterator[Put]:
    if options.write is None:
        yield _nowhere
        return
    channel = "can" if settings is None else str(settings.channel)
    with writing(options.write, channel) as put:
        yield put


def _show_frames(source: Batches, sink: Put, known: list[Device], options: argparse.Namespace) -> None:
    decoder, wanted = Decoder(Devices(known)), _wanted(options, known)
    show: Callable[[Line], str] = _json if options.json else _text
    left = options.count
    for batch in until(source, options.seconds):
        for captured in batch.frames:
            line = decoder.take(captured)
            if not all(one(line) for one in wanted):
                continue
            sink(captured)
            if not options.quiet:
                sys.stdout.write(show(line) + "\n")
            if left is not None and (left := left - 1) == 0:
                return
        if batch.live:
            sys.stdout.flush()


def _wanted(options: argparse.Namespace, known: list[Device]) -> list[Wanted]:
    found: list[Wanted] = []
    if options.node:
        found.append(by_node(options.node, known))
    if options.kind:
        found.append(by_kind(options.kind))
    if options.object:
        found.append(by_object(options.object))
    return found


def _text(line: Line) -> str:
    captured = line.captured
    moment = datetime.datetime.fromtimestamp(captured.stamp_ns // 10**9).astimezone()
    clock = f"{moment:%H:%M:%S}.{captured.stamp_ns % 10**9 // 1000:06d}"
    identifier = f"{captured.can_id & _IDENTIFIER:03X}"
    return f"{clock} {identifier:>3}  {line.title:<10} {line.name or '':<12} {line.words}".rstrip()


def _json(line: Line) -> str:
    captured = line.captured
    told: dict[str, Any] = {
        "t": captured.stamp_ns / 1e9,
        "id": captured.can_id & _IDENTIFIER,
        "extended": bool(captured.can_id & EXTENDED),
        "data": captured.data.hex(),
        "kind": line.kind,
        "title": line.title,
        "node_id": line.node_id,
        "name": line.name,
        "words": line.words,
        "values": [
            {
                "object": f"0x{value.index:04X}:{value.subindex}",
                "name": value.name,
                "value": value.value,
                "words": value.words,
            }
            for value in line.values
        ],
    }
    return msgspec.json.encode(told).decode()
