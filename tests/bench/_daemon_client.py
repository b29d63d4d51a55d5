"""`python -m tests.bench._daemon_client WAY HOST PORT N`: ask N times, print what it took as a line of JSON.

A process of its own, so that it can run in another network namespace. `sent` and `received` are the bytes of
one exchange without TCP's own; `processes` is how many the last answer told of, where it told of any.
"""

import json
import re
import socket
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import psutil

WAIT_S = 60.0
RECEIVE_BYTES = 1 << 20
SNAPSHOT = b'{"jsonrpc":"2.0","id":1,"method":"resource.snapshot"}\n'
GLANCES_CALL = (
    b"<?xml version='1.0'?><methodCall><methodName>getProcesslist</methodName><params/></methodCall>"
)
GLANCES = (
    b"POST /RPC2 HTTP/1.0\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n" % len(GLANCES_CALL)
    + GLANCES_CALL
)
METRICS = b"GET /metrics HTTP/1.0\r\n\r\n"

Address = tuple[str, int]
Ask = Callable[[], tuple[int, bytes]]  # sent bytes, and the answer


@dataclass(frozen=True)
class Taken:
    """What N requests took."""

    times_ms: list[float]
    cpu_ms: float  # of this process, a request
    sent: int
    received: int
    processes: int


def one_call(address: Address, said: bytes) -> bytes:
    """A connection for one answer, read to its end."""
    with socket.create_connection(address, WAIT_S) as connection:
        connection.sendall(said)
        return b"".join(iter(lambda: connection.recv(RECEIVE_BYTES), b""))


def line_of(connection: socket.socket) -> bytes:
    connection.sendall(SNAPSHOT)
    pieces = [connection.recv(RECEIVE_BYTES)]
    while not pieces[-1].endswith(b"\n"):
        pieces.append(connection.recv(RECEIVE_BYTES))
    return b"".join(pieces)


def held(address: Address) -> Ask:
    """JSON-RPC, one connection for all requests."""
    connection = socket.create_connection(address, WAIT_S)
    return lambda: (len(SNAPSHOT), line_of(connection))


def anew(address: Address) -> Ask:
    """JSON-RPC, a connection for each request."""

    def ask() -> tuple[int, bytes]:
        with socket.create_connection(address, WAIT_S) as connection:
            return len(SNAPSHOT), line_of(connection)

    return ask


def classic(address: Address) -> Ask:
    """The paper's exchange: the length, then piece after piece, a connection each."""

    def ask() -> tuple[int, bytes]:
        length = one_call(address, b"x")
        text, calls = b"", 1
        while len(text) < int(length):
            text += one_call(address, b"x")
            calls += 1
        return calls, text

    return ask


def glances(address: Address) -> Ask:
    return lambda: (len(GLANCES), one_call(address, GLANCES))


def node_exporter(address: Address) -> Ask:
    return lambda: (len(METRICS), one_call(address, METRICS))


def process_iter(_address: Address) -> Ask:
    """No server at all: what psutil takes for the same table in this process."""

    def ask() -> tuple[int, bytes]:
        wanted = ["name", "pid", "cpu_percent", "memory_info"]
        table = [
            {
                "pid": one.pid,
                "name": one.info["name"],
                "cpu": one.info["cpu_percent"],
                "mem": one.info["memory_info"].rss if one.info["memory_info"] else None,
            }
            for one in psutil.process_iter(wanted)
        ]
        return 0, json.dumps(table).encode()

    return ask


WAYS: dict[str, Callable[[Address], Ask]] = {
    "held": held,
    "anew": anew,
    "classic": classic,
    "glances": glances,
    "node_exporter": node_exporter,
    "process_iter": process_iter,
}


def measure(ask: Ask, number: int) -> Taken:
    """After one request that is not counted."""
    sent, answer = ask()
    times_ms: list[float] = []
    cpu_s = time.process_time()
    for _ in range(number):
        began_ns = time.perf_counter_ns()
        sent, answer = ask()
        times_ms.append((time.perf_counter_ns() - began_ns) / 1e6)
    cpu_ms = (time.process_time() - cpu_s) / number * 1e3
    return Taken(times_ms, cpu_ms, sent, len(answer), len(re.findall(rb'"pid\\*":', answer)))


def main() -> None:
    way, host, port, number = sys.argv[1:]
    sys.stdout.write(json.dumps(asdict(measure(WAYS[way]((host, int(port))), int(number)))) + "\n")


if __name__ == "__main__":
    main()
