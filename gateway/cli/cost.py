"""`gwrms cost`: what monitoring costs the robot now, in all and for each client."""

import time
from collections.abc import Iterator

from gateway.amounts import NONE, percent, size
from gateway.cli.arguments import seconds
from gateway.cli.connect import connect, parser
from gateway.cli.text import budget, say, say_json, table
from gateway.wire.cost import BusCost, ClientCost, GatewayCost, StreamCost

SECONDS = 2.0

EPILOG = """CPU is of one core. A client's part is the gateway's work for its requests and streams; what
clients share, such as the encoding of a stream that both asked for, is divided among them, and
reading the devices belongs to nobody alone.

examples:
  gwrms cost --seconds 10
  gwrms cost --json"""


def main(argv: list[str]) -> int:
    """Run `gwrms cost`."""
    made = parser("cost", "Show the cost of monitoring a robot: CPU, memory, wake-ups, bus, network.", EPILOG)
    made.add_argument("--seconds", type=seconds, default=SECONDS, help="duration (default: %(default)g)")
    arguments = made.parse_args(argv)
    with connect(arguments, "cost") as robot:
        robot.cost()  # rates are from here on
        time.sleep(arguments.seconds)
        cost = robot.cost()
    if arguments.json:
        say_json(cost)
    else:
        say(text(cost))
    return 0


def text(cost: GatewayCost) -> str:
    """Return the costs for people."""
    facts = "".join(f"{name:<8} {words}\n" for name, words in _facts(cost))
    clients = [_client(one) for one in cost.clients]
    streams = [_stream(one.who, stream) for one in cost.clients for stream in one.streams]
    header = ("CLIENT", "CPU", "REQUESTS/S", "SENT/S", "RECEIVED/S", "WAITING")
    parts = [facts, table(header, clients, right=range(1, 6))]
    if streams:
        parts.append(
            table(("STREAM OF", "RATE", "CHANNELS", "ROWS/S", "DROPPED"), streams, right=range(1, 5))
        )
    return "\n".join(parts)


def _facts(cost: GatewayCost) -> Iterator[tuple[str, str]]:
    yield "CPU", f"{percent(cost.cpu_percent)} of a core, {_rate(cost.wake_ups_per_s)} wake-ups/s"
    yield "memory", f"{size(cost.rss_bytes)} in {cost.threads} threads"
    running = [name for name, phase in cost.modules.items() if phase != "off"]
    yield "modules", ", ".join(running) or "none"
    for name, bus in cost.buses.items():
        yield "bus", f"{name}: {_bus(bus)}"
    if cost.budget is not None:
        yield "budget", budget(cost.budget)


def _bus(bus: BusCost) -> str:
    sent = f"{_rate(bus.sent_frames_per_s)} frames/s and {_rate(bus.sent_bytes_per_s)} B/s sent"
    load = "" if bus.load_percent is None else f" ({bus.load_percent:.2f} % of the bus with their answers)"
    return f"{sent}{load}, {_rate(bus.received_frames_per_s)} frames/s read"


def _client(one: ClientCost) -> tuple[str, ...]:
    return (
        one.who,
        NONE if one.cpu_percent is None else f"{one.cpu_percent:.2f} %",
        _rate(one.requests_per_s),
        _bytes(one.sent_bytes_per_s),
        _bytes(one.received_bytes_per_s),
        size(one.waiting_bytes),
    )


def _stream(who: str, one: StreamCost) -> tuple[str, ...]:
    rate = "own samples" if not one.rate_hz else f"{one.rate_hz:g} Hz"
    shed = "" if one.shed == 1 else f" / {one.shed}"
    return who, rate + shed, str(one.channels), _rate(one.rows_per_s), str(one.dropped)


def _rate(per_s: float | None) -> str:
    return NONE if per_s is None else f"{per_s:.1f}"


def _bytes(per_s: float | None) -> str:
    return NONE if per_s is None else size(round(per_s))
