"""`gwrms watch`: channels, live."""

import argparse
import csv
import itertools
import sys
from collections.abc import Iterator, Mapping, Sequence

from gateway.cli.arguments import lines, number
from gateway.cli.connect import (
    absent_components,
    channel_names,
    check_names,
    connect,
    meant,
    modules_of,
    parser,
    widened,
)
from gateway.cli.text import measured, say, say_json, warn
from gateway.cli.value_display import Channels, add_degrees, utc
from gateway.client import Batch, ClientError, Robot
from gateway.plain_text import plain
from gateway.wire.robot import Clock
from gateway.wire.stream import ModuleName

Row = tuple[int, str | None, dict[str, float | None]]  # its stamp, that in UTC, its values

MIN_WIDTH = 12
FIRST_VALUE_S = 3

EPILOG = """A missing or stale value is shown as a dash (null with --json), never as the old number. Time is
the robot's, in seconds since the first line; --json and --csv also give it as UTC, by the robot's own clock,
and --csv has the format of gwrms sessions export. Rows lost on the way are reported on stderr. Ctrl-C ends
it.

examples:
  gwrms watch left_knee.position --rate 50
  gwrms watch left_knee --deg
  gwrms watch '*_insole.force' --count 100 --json > forces.jsonl
  gwrms watch '*.position' --rate 100 --csv > walk.csv"""


def main(argv: list[str]) -> int:
    """Run `gwrms watch`."""
    made = parser("watch", "Show channels live, one line per tick.", EPILOG)
    made.add_argument(
        "channels", metavar="CHANNEL", nargs="+", help="names, globs, or a component: all of its channels"
    )
    made.add_argument(
        "--rate", type=_rate, default=10.0, metavar="HZ", help="ticks a second, 0.1 to 1000 (default 10)"
    )
    made.add_argument(
        "--csv",
        action="store_true",
        help="print comma-separated values, a column per channel; missing ones are empty",
    )
    add_degrees(made)
    made.add_argument("--count", type=lines, metavar="N", help="end after N lines")
    arguments = made.parse_args(argv)
    with connect(arguments, "watch") as robot:
        description = robot.describe()
        channels = widened(arguments.channels, description)
        check_names("channel", channels, channel_names(description), absent_components(description))
        named = meant(channels, description)
        every = _rows(robot, channels, modules_of(named), arguments.rate, description.clock)
        rows = itertools.islice(_from_first_value(every), arguments.count)
        try:
            shown = Channels(description, degrees=arguments.deg)
            if arguments.json:
                _follow_json(rows)
            elif arguments.csv:
                _follow_csv(rows, [each.name for each in named], shown)
            else:
                _follow(rows, shown)
        except KeyboardInterrupt:
            return 0  # how a watch ends
    return 0


def _rate(text: str) -> float:
    rate_hz = number(text)
    if not 0.1 <= rate_hz <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a rate from 0.1 to 1000 Hz")
    return rate_hz


def _rows(
    robot: Robot, channels: Sequence[str], modules: Sequence[ModuleName], rate_hz: float, clock: Clock | None
) -> Iterator[Row]:
    dropped, shed, link = 0, 1, 1  # `clock` was told over the first
    for batch in robot.watch(*channels, rate_hz=rate_hz, modules=modules):
        if batch.link != link:  # it may have booted anew: its clock is another one
            clock = _clock(robot)
        link = batch.link
        _report_losses(batch, dropped, shed)
        dropped, shed = batch.dropped, batch.shed
        for stamp_ns, values in batch.rows():
            yield stamp_ns, utc(stamp_ns, clock), values


def _from_first_value(rows: Iterator[Row]) -> Iterator[Row]:
    """Yield rows from the first that has a value: a bus that was closed is opened for the first client.

    Where none has one, all from `FIRST_VALUE_S` on: that nothing comes is shown, too.
    """
    first_ns: int | None = None
    for row in rows:
        stamp_ns, _at, values = row
        if first_ns is None:
            first_ns = stamp_ns
            if _is_empty(values):
                warn("watch", f"no value has come yet; waiting for {FIRST_VALUE_S} s at most")
        if not _is_empty(values) or stamp_ns - first_ns >= FIRST_VALUE_S * 1e9:
            yield row
            break
    yield from rows


def _is_empty(values: Mapping[str, float | None]) -> bool:
    return all(value is None for value in values.values())


def _clock(robot: Robot) -> Clock | None:
    """Return the robot's clocks as of now; None if it does not answer: no time is better than a wrong one."""
    try:
        return robot.describe().clock
    except ClientError:
        return None


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
    for stamp_ns, at, values in rows:
        say_json({"stamp_ns": stamp_ns, "utc": at, "values": values})


def _follow_csv(rows: Iterator[Row], names: Sequence[str], shown: Channels) -> None:
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["utc", "stamp_ns [ns]", *(plain(shown.title(name)) for name in names)])
    for stamp_ns, at, values in rows:
        cells = (shown.value(name, values.get(name)) for name in names)
        out.writerow([at or "", stamp_ns, *("" if cell is None else cell for cell in cells)])
        sys.stdout.flush()


def _follow(rows: Iterator[Row], shown: Channels) -> None:
    first_ns: int | None = None
    widths: dict[str, int] = {}
    for stamp_ns, _at, values in rows:
        first_ns = stamp_ns if first_ns is None else min(first_ns, stamp_ns)
        if values.keys() != widths.keys():
            widths = {name: _width(name, shown) for name in values}
            titles = (shown.title(name).rjust(width) for name, width in widths.items())
            say("  ".join([f"{'s':>9}", *titles]) + "\n")
        cells = (
            measured(shown.value(name, values[name]), shown.info(name)).rjust(width)
            for name, width in widths.items()
        )
        say("  ".join([f"{(stamp_ns - first_ns) / 1e9:9.3f}", *cells]) + "\n")


def _width(name: str, shown: Channels) -> int:
    channel = shown.info(name)
    words = (channel.enum or {}).values() if channel is not None else ()
    return max(MIN_WIDTH, len(shown.title(name)), *map(len, words))
