"""`gwrms watch`: channels, live."""

import argparse
import itertools
from collections.abc import Iterator, Sequence

from gateway.cli.reach import channel_names, check_names, parser, reach
from gateway.cli.text import measured, say, say_json, warn
from gateway.client import Batch, Robot
from gateway.messages import ChannelInfo, Description

Row = tuple[int, dict[str, float | None]]

EPILOG = """A missing or stale value is a dash (null with --json), never the old number. Time is the
robot's, in seconds since the first line. Rows that were lost on the way are said on stderr.
Ctrl-C ends it.

examples:
  gwrms watch left_knee.position --rate 50
  gwrms watch '*_insole.force' --count 100 --json > forces.jsonl"""


def main(argv: list[str]) -> int:
    """Run `gwrms watch`."""
    made = parser("watch", "Follow channels live, one line for every tick.", EPILOG)
    made.add_argument("channels", metavar="CHANNEL", nargs="+", help="names or globs")
    made.add_argument(
        "--rate", type=_rate, default=10.0, metavar="HZ", help="ticks a second, 0.1 to 1000 (default 10)"
    )
    made.add_argument("--count", type=_count, metavar="N", help="end after N lines")
    arguments = made.parse_args(argv)
    with reach(arguments, "watch") as robot:
        description = robot.describe()
        check_names("channel", arguments.channels, channel_names(description))
        rows = itertools.islice(_rows(robot, arguments.channels, arguments.rate), arguments.count)
        try:
            if arguments.json:
                _follow_json(rows)
            else:
                _follow(rows, description)
        except KeyboardInterrupt:
            return 0  # how a watch ends
    return 0


def _rate(text: str) -> float:
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 0.1 <= rate_hz <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a rate from 0.1 to 1000 Hz")
    return rate_hz


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of lines")
    return int(text)


def _rows(robot: Robot, channels: Sequence[str], rate_hz: float) -> Iterator[Row]:
    dropped = 0
    for batch in robot.watch(*channels, rate_hz=rate_hz):
        dropped = _report_losses(batch, dropped)
        yield from batch.rows()


def _report_losses(batch: Batch, dropped: int) -> int:
    if batch.missed:
        warn("watch", f"{batch.missed} notifications were lost")
    if batch.dropped > dropped:
        warn("watch", f"the robot dropped {batch.dropped - dropped} rows: we read too slowly")
    return batch.dropped


def _follow_json(rows: Iterator[Row]) -> None:
    for stamp_ns, values in rows:
        say_json({"stamp_ns": stamp_ns, "values": values})


def _follow(rows: Iterator[Row], description: Description) -> None:
    channels = {channel.name: channel for channel in description.channels}
    first_ns: int | None = None
    names: tuple[str, ...] = ()
    for stamp_ns, values in rows:
        first_ns = stamp_ns if first_ns is None else first_ns
        if tuple(values) != names:
            names = tuple(values)
            say(f"{'s':>9}" + "".join(f"  {_title(name, channels):>12}" for name in names) + "\n")
        say(f"{(stamp_ns - first_ns) / 1e9:9.3f}" + "".join(_cells(values, channels)) + "\n")


def _title(name: str, channels: dict[str, ChannelInfo]) -> str:
    unit = channels[name].unit if name in channels else ""
    return f"{name} [{unit}]" if unit else name


def _cells(values: dict[str, float | None], channels: dict[str, ChannelInfo]) -> Iterator[str]:
    for name, value in values.items():
        width = max(12, len(_title(name, channels)))
        yield f"  {measured(value, channels.get(name)):>{width}}"
