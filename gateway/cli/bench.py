"""`gwrms bench`: what a gateway's answers and streams cost, measured on the robot that one has."""

import argparse
import contextlib
import time
from collections.abc import Callable, Iterator

import psutil
from msgspec import Struct

from gateway.amounts import NONE, percent, size
from gateway.cli.connect import connect, parser
from gateway.cli.text import say, say_json, table
from gateway.client import Batch, Robot
from gateway.client.address import Address
from gateway.client.clock import ClockOffset
from gateway.wire.resource import ResourceSnapshotParams

REQUESTS, SECONDS, RATES_HZ = 200, 5.0, (50.0, 1000.0)
MOST_WITH_PSUTIL = 200
LOOPBACK = ("127.0.0.1", "::1", "localhost")

EPILOG = """It only reads, and changes nothing. CPU is the gateway's, of one core. P50 and P99 of a request
are the time until its answer; of a stream, the age of a row on arrival, accurate to half a round trip.
On the robot itself, psutil reading the same processes in this command is shown for comparison.
Measure with everything that the robot runs, and again without, to see the share of each.

examples:
  gwrms bench
  gwrms bench --robot 192.0.2.7:7420 --requests 1000 --json"""


class Figure(Struct, frozen=True):
    """One measurement; times in ms, `None` where there is none."""

    what: str
    count: int  # requests, or rows
    lost: int  # rows that did not come
    p50_ms: float | None  # of a request; of a stream, how old a row is when it is here
    p99_ms: float | None
    cpu_ms: float | None  # of the gateway for one request
    cpu_percent: float | None  # of one core meanwhile
    rss_bytes: int | None


def main(argv: list[str]) -> int:
    """Run `gwrms bench`."""
    made = parser("bench", "Measure a robot's gateway: latency, CPU and memory.", EPILOG)
    made.add_argument(
        "--requests", type=_count, default=REQUESTS, help="requests of each kind (default: %(default)d)"
    )
    arguments = made.parse_args(argv)
    figures = []
    with connect(arguments, "bench") as robot:
        for figure in measure(robot, arguments.robot, arguments.requests):
            figures.append(figure)
            if arguments.json:
                say_json(figure)
    if not arguments.json:
        say(text(figures))
    return 0


def measure(robot: Robot, address: Address, requests: int) -> Iterator[Figure]:
    """One figure after another, the lightest first."""
    alone = ResourceSnapshotParams(processes=False)
    yield _asked("CPU and memory", lambda: robot.resources(alone), robot, requests)
    yield _asked("every process", robot.resources, robot, requests)
    if address.host in LOOPBACK:
        yield _with_psutil(min(requests, MOST_WITH_PSUTIL))
    yield _asked("every component", robot.components, robot, requests)
    for rate_hz in RATES_HZ:
        yield _streamed(robot, rate_hz)


def _asked(what: str, ask: Callable[[], object], robot: Robot, requests: int) -> Figure:
    ask()  # modules start
    robot.cost()  # rates are from here on
    began_s = time.monotonic()
    took_ms = [_took_ms(ask) for _ in range(requests)]
    elapsed_ms = (time.monotonic() - began_s) * 1e3
    cost = robot.cost()
    share = cost.cpu_percent
    cpu_ms = None if share is None else share / 100 * elapsed_ms / requests
    return Figure(what, requests, 0, *_quantiles(took_ms), cpu_ms, share, cost.rss_bytes)


def _took_ms(ask: Callable[[], object]) -> float:
    began_s = time.perf_counter()
    ask()
    return (time.perf_counter() - began_s) * 1e3


def _with_psutil(requests: int) -> Figure:
    """Return the same table as `every process`, by a plain loop of psutil in this process."""

    def ask() -> None:
        for one in psutil.process_iter(["pid", "name", "cpu_percent", "memory_info"]):
            one.info.keys()

    ask()
    began_s = time.process_time()
    took_ms = [_took_ms(ask) for _ in range(requests)]
    cpu_ms = (time.process_time() - began_s) / requests * 1e3
    share = 100 * cpu_ms * requests / sum(took_ms)
    return Figure("… by psutil, here", requests, 0, *_quantiles(took_ms), cpu_ms, share, None)


def _streamed(robot: Robot, rate_hz: float) -> Figure:
    """Every channel, for `SECONDS`."""
    ages_ms: list[float] = []
    lost = 0
    with contextlib.closing(robot.watch(rate_hz=rate_hz)) as stream:
        next(stream)
        robot.cost()
        end_s = time.monotonic() + SECONDS
        dropped = None
        for batch in stream:
            dropped = batch.dropped if dropped is None else dropped
            lost = batch.dropped - dropped
            ages_ms += _ages_ms(batch, robot.clock_offset)
            if time.monotonic() > end_s:
                break
        cost = robot.cost()
    what = f"all channels, {rate_hz:g} Hz"
    return Figure(what, len(ages_ms), lost, *_quantiles(ages_ms), None, cost.cpu_percent, cost.rss_bytes)


def _ages_ms(batch: Batch, offset: ClockOffset | None) -> list[float]:
    if offset is None:
        return []
    here_ns = batch.received_ns + offset.offset_ns
    return [(here_ns - stamp_ns) / 1e6 for stamp_ns in batch.stamps_ns]


def _quantiles(values: list[float]) -> tuple[float | None, float | None]:
    """Return the median, and what 99 % stay below."""
    if not values:
        return None, None
    values = sorted(values)
    return values[len(values) // 2], values[int(0.99 * len(values))]


def text(figures: list[Figure]) -> str:
    """Return the figures for people."""
    header = ("", "COUNT", "LOST", "P50", "P99", "CPU A REQUEST", "CPU", "MEMORY")
    rows = [
        (
            one.what,
            str(one.count),
            str(one.lost),
            _ms(one.p50_ms),
            _ms(one.p99_ms),
            _ms(one.cpu_ms),
            percent(one.cpu_percent),
            NONE if one.rss_bytes is None else size(one.rss_bytes),
        )
        for one in figures
    ]
    return table(header, rows, right=range(1, len(header)))


def _ms(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f} ms"


def _count(text: str) -> int:
    if not text.isdecimal() or not 10 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of requests from 10 to 1000000")
    return int(text)
