"""`gwrms watch`: channels, live."""

import argparse
import fnmatch
import itertools
from collections.abc import Iterator, Sequence

from gateway.cli.arguments import number
from gateway.cli.connect import (
    absent_components,
    channel_names,
    check_names,
    connect,
    parser,
    widened,
)
from gateway.cli.text import measured, say, say_json, warn
from gateway.client import Batch, Robot
from gateway.wire.component import ChannelInfo
from gateway.wire.robot import Description
from gateway.wire.stream import ModuleName

Row = tuple[int, dict[str, float | None]]

MIN_WIDTH = 12

EPILOG = """A missing or stale value is a dash (null with --json), never the old number. Time is the
robot's, in seconds since the first line. Rows that were lost on the way are said on stderr.
Ctrl-C ends it.

examples:
  gwrms watch left_knee.position --rate 50
  gwrms watch '*_insole.force' --count 100 --json > forces.jsonl"""


def main(argv: list[str]) -> int:
    """Run `gwrms watch`."""
    made = parser("watch", "Follow channels live, one line for every tick.", EPILOG)
    made.add_argument(
        "channels", metavar="CHANNEL", nargs="+", help="names, globs, or a component: all of its channels"
    )
    made.add_argument(
        "--rate", type=_rate, default=10.0, metavar="HZ", help="ticks a second, 0.1 to 1000 (default 10)"
    )
    made.add_argument("--count", type=_count, metavar="N", help="end after N lines")
    arguments = made.parse_args(argv)
    with connect(arguments, "watch") as robot:
        description = robot.describe()
        channels = widened(arguments.channels, description)
        check_names("channel", channels, channel_names(description), absent_components(description))
        modules = _modules(channels, description)
        rows = itertools.islice(_rows(robot, channels, modules, arguments.rate), arguments.count)
        try:
            if arguments.json:
                _follow_json(rows)
            else:
                _follow(rows, description)
        except KeyboardInterrupt:
            return 0  # how a watch ends
    return 0


def _rate(text: str) -> float:
    rate_hz = number(text)
    if not 0.1 <= rate_hz <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a rate from 0.1 to 1000 Hz")
    return rate_hz


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of lines")
    return int(text)


def _modules(globs: Sequence[str], description: Description) -> list[ModuleName]:
    """The modules that give the channels: the computer's own are the resource module's."""
    wanted = (
        known for known in description.channels if any(fnmatch.fnmatchcase(known.name, g) for g in globs)
    )
    modules: set[ModuleName] = {
        "resource" if channel.component == "resource" else "component" for channel in wanted
    }
    return sorted(modules)


def _rows(
    robot: Robot, channels: Sequence[str], modules: Sequence[ModuleName], rate_hz: float
) -> Iterator[Row]:
    dropped, shed = 0, 1
    for batch in robot.watch(*channels, rate_hz=rate_hz, modules=modules):
        _report_losses(batch, dropped, shed)
        dropped, shed = batch.dropped, batch.shed
        yield from batch.rows()


def _report_losses(batch: Batch, dropped: int, shed: int) -> None:
    if batch.missed:
        warn("watch", f"{batch.missed} notifications were lost")
    if batch.dropped > dropped:
        warn("watch", f"the robot dropped {batch.dropped - dropped} rows: we read too slowly")
    if batch.shed > shed:
        warn(
            "watch",
            f"the robot sends one row of {batch.shed}: more would be late, or beyond its max_cpu_percent",
        )


def _follow_json(rows: Iterator[Row]) -> None:
    for stamp_ns, values in rows:
        say_json({"stamp_ns": stamp_ns, "values": values})


def _follow(rows: Iterator[Row], description: Description) -> None:
    channels = {channel.name: channel for channel in description.channels}
    first_ns: int | None = None
    widths: dict[str, int] = {}
    for stamp_ns, values in rows:
        first_ns = stamp_ns if first_ns is None else first_ns
        if values.keys() != widths.keys():
            widths = {name: _width(name, channels.get(name)) for name in values}
            titles = (_title(name, channels.get(name)).rjust(width) for name, width in widths.items())
            say("  ".join([f"{'s':>9}", *titles]) + "\n")
        cells = (measured(values[name], channels.get(name)).rjust(width) for name, width in widths.items())
        say("  ".join([f"{(stamp_ns - first_ns) / 1e9:9.3f}", *cells]) + "\n")


def _title(name: str, channel: ChannelInfo | None) -> str:
    return f"{name} [{channel.unit}]" if channel is not None and channel.unit else name


def _width(name: str, channel: ChannelInfo | None) -> int:
    words = (channel.enum or {}).values() if channel is not None else ()
    return max(MIN_WIDTH, len(_title(name, channel)), *map(len, words))
