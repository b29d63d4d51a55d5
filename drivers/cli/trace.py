"""`gwrms trace`: every frame of buses or recordings, decoded; or what takes a bus's time."""

import argparse
import contextlib
import datetime
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from drivers.bus.frames import EXTENDED
from drivers.bus.settings import CanSettings
from drivers.cli.buses import named
from drivers.cli.trace_context import TraceContext
from drivers.cli.trace_load import Meters, show_load
from drivers.trace.decoding import DecodedFrame, Decoder, FrameKind
from drivers.trace.devices import Devices
from drivers.trace.files import SUFFIXES, Captured, Put, is_file, writing
from drivers.trace.filters import Filter, by_kind, by_node, by_object
from drivers.trace.merged import merged
from drivers.trace.sources import Batches, live, recorded, until

MORE = """\
examples:
  gwrms trace can0 --robot robot.toml                  everything, by the EDS files that robot.toml names
  gwrms trace robot.toml --node left_knee --kind sdo   who asks the knee what
  gwrms trace can0 can1 --robot robot.toml             two buses, one after the other as frames came
  gwrms trace can0 --eds 5=drive.eds --object 0x6041   node 5's statusword, wherever it comes from
  gwrms trace can0 --write walk.pcap --quiet           record for Wireshark; *.log: for candump's friends
  gwrms trace walk.log --robot robot.toml --json       decode a recording of candump -l, or a PCAP file
  gwrms trace can0 --load                              who takes the bus's time, a table a second

It never sends. PDOs are decoded as the EDS files say, until somebody reads or writes their mapping.
"""
TICK_S = 0.2
_IDENTIFIER = 0x1FFF_FFFF


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms trace",
        description="Show the frames of CAN buses or recordings, decoded by EDS. Only listens.",
        epilog=MORE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="+",
        help="can0, INTERFACE:CHANNEL of python-can, a robot's file; or FILE.log, FILE.pcap; or several",
    )
    parser.add_argument(
        "--robot", type=Path, metavar="FILE", help="robot's file with names of nodes and EDS files"
    )
    parser.add_argument(
        "--eds",
        action="append",
        default=[],
        metavar="NODE=FILE",
        help="EDS or DCF of a node (repeatable); can1/5=FILE: on that interface only",
    )
    parser.add_argument(
        "--node",
        action="append",
        default=[],
        metavar="NODE",
        help="only this node, by id or name (repeatable)",
    )
    parser.add_argument(
        "--kind", action="append", default=[], metavar="KIND", help=f"only these: {', '.join(FrameKind)}"
    )
    parser.add_argument(
        "--object",
        action="append",
        default=[],
        metavar="OBJECT",
        help="only 0x6041, 0x1018:4 or '*position*'",
    )
    parser.add_argument(
        "--write", type=Path, metavar="FILE", help="also write the frames shown to *.log or *.pcap"
    )
    parser.add_argument("--quiet", action="store_true", help="with --write: show nothing")
    parser.add_argument(
        "--load", action="store_true", help="print a table per second: frames and load by node and kind"
    )
    parser.add_argument("--bitrate", type=int, help="bit/s, for the load, and for interfaces that need one")
    parser.add_argument("--seconds", type=float, metavar="N", help="end after N seconds (default: Ctrl-C)")
    parser.add_argument("--count", type=int, metavar="N", help="end after N frames shown")
    parser.add_argument("--json", action="store_true", help="print one JSON line per frame or table")
    return parser


def main(arguments: Sequence[str]) -> int:
    """Trace buses or recordings; returns the exit status.

    Raises:
        DriverError: an interface cannot be opened or goes, or a file cannot be read.

    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if wrong := _misused(options):
        parser.error(wrong)
    files = [Path(name) for name in options.source if is_file(name)]
    buses = {} if files else _by_interface(named(options.source, options.bitrate))
    source = recorded(files) if files else _live(buses)
    known = TraceContext(options.robot or _robot(options.source), options.eds, buses)
    with contextlib.closing(source), _sink(options) as sink:
        if options.load:
            rates = {name: options.bitrate or settings.bitrate for name, settings in buses.items()}
            meters = Meters(rates, options.bitrate)
            show_load(until(source, options.seconds), meters, known.names, as_json=options.json)
        else:
            shown = TracePrinter(known, _wanted(options, known), options, with_interface=len(buses) != 1)
            _show_frames(source, sink, shown, options)
    return 0


def _by_interface(buses: Iterable[tuple[str, CanSettings]]) -> dict[str, CanSettings]:
    """Return them by the interface's name, as candump has it; by the table's if two have the same."""
    found = list(buses)
    often = Counter(str(settings.channel) for _, settings in found)
    return {
        str(settings.channel) if often[str(settings.channel)] == 1 else name: settings
        for name, settings in found
    }


def _live(buses: Mapping[str, CanSettings]) -> Batches:
    if len(buses) > 1:
        return merged(buses, _tell_lost)
    ((interface, settings),) = buses.items()
    return live(settings, interface, _tell_lost)


def _robot(sources: Sequence[str]) -> Path | None:
    """Return a robot's file among what is traced."""
    return next((Path(name) for name in sources if name.endswith(".toml")), None)


def _misused(options: argparse.Namespace) -> str | None:
    if len({is_file(name) for name in options.source}) > 1:
        return "buses and recordings cannot be traced together"
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


def _tell_lost(frames: int) -> None:
    sys.stderr.write(f"gwrms trace: {frames} frames were lost on their way to this program\n")


def _nowhere(_captured: Captured) -> None:
    """Nothing is to be written."""


@contextlib.contextmanager
def _sink(options: argparse.Namespace) -> Iterator[Put]:
    if options.write is None:
        yield _nowhere
        return
    with writing(options.write) as put:
        yield put


class TracePrinter:
    """Lines of all buses: each has a decoder of its own, for it has nodes and conversations of its own."""

    def __init__(
        self,
        known: TraceContext,
        wanted: Sequence[Filter],
        options: argparse.Namespace,
        *,
        with_interface: bool,
    ) -> None:
        self._known = known
        self._wanted = wanted
        self._decoders: dict[str, Decoder] = {}
        self._as_json = options.json
        self._with_interface = with_interface

    def line(self, captured: Captured) -> str | None:
        """Return a frame's line; `None` if it is filtered out."""
        interface = captured.interface
        if interface not in self._decoders:
            self._decoders[interface] = Decoder(Devices(self._known.on(interface)))
        line = self._decoders[interface].take(captured)
        if not all(one(line) for one in self._wanted):
            return None
        return _json(line) if self._as_json else self._text(line)

    def _text(self, line: DecodedFrame) -> str:
        captured = line.captured
        moment = datetime.datetime.fromtimestamp(captured.stamp_ns // 10**9).astimezone()
        clock = f"{moment:%H:%M:%S}.{captured.stamp_ns % 10**9 // 1000:06d}"
        interface = f" {captured.interface:<5}" if self._with_interface and captured.interface else ""
        identifier = f"{captured.can_id & _IDENTIFIER:03X}"
        words = f"{identifier:>3}  {line.title:<10} {line.name or '':<12} {line.words}"
        return f"{clock}{interface} {words}".rstrip()


def _show_frames(source: Batches, sink: Put, shown: TracePrinter, options: argparse.Namespace) -> None:
    left = options.count
    for batch in until(source, options.seconds):
        for captured in batch.frames:
            line = shown.line(captured)
            if line is None:
                continue
            sink(captured)
            if not options.quiet:
                sys.stdout.write(line + "\n")
            if left is not None and (left := left - 1) == 0:
                return
        if batch.live:
            sys.stdout.flush()


def _wanted(options: argparse.Namespace, known: TraceContext) -> list[Filter]:
    found: list[Filter] = []
    if options.node:
        found.append(by_node(options.node, known.all, known.on))
    if options.kind:
        found.append(by_kind(options.kind))
    if options.object:
        found.append(by_object(options.object))
    return found


def _json(line: DecodedFrame) -> str:
    captured = line.captured
    told: dict[str, Any] = {
        "t": captured.stamp_ns / 1e9,
        "interface": captured.interface or None,
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
