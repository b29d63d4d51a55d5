"""`python -m tests.bench._stream_client HOST PORT RATE_HZ SECONDS CLIENTS GLOB …`: follow channels.

CLIENTS connections ask for the same. At the end it prints a line of JSON: rows, gaps between rows and bytes
of all together, the rows told as dropped, and how old each notification's newest row was when it was read.
"""

import json
import selectors
import socket
import sys
import time
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

WAIT_S = 60.0


@dataclass
class Came:
    """What all connections were given."""

    rows: int = 0
    gaps: int = 0
    dropped: int = 0
    bytes: int = 0
    channels: int = 0
    ages_ms: list[float] = field(default_factory=list)


class Follower:
    """One connection with one stream."""

    def __init__(self, address: tuple[str, int], rate_hz: float, globs: list[str], came: Came) -> None:
        self.socket = socket.create_connection(address, WAIT_S)
        self._period_ns = round(1e9 / rate_hz) if rate_hz else None
        self._came = came
        self._rest = b""
        self._last_ns: int | None = None
        params = {"modules": ["component", "resource"], "rate_hz": rate_hz, "channels": globs}
        request = {"jsonrpc": "2.0", "id": 1, "method": "stream.start", "params": params}
        self.socket.sendall(json.dumps(request).encode() + b"\n")

    def read(self) -> None:
        data = self.socket.recv(1 << 20)
        now_ns = time.monotonic_ns()
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._came.bytes += len(data)
        for line in lines:
            self._take(json.loads(line), now_ns)

    def _take(self, message: dict[str, Any], now_ns: int) -> None:
        if "params" not in message:
            if "error" in message:
                raise RuntimeError(message["error"])
            return
        params, came = message["params"], self._came
        stamps = params["stamp_ns"]
        came.rows += len(stamps)
        came.dropped = max(came.dropped, params["dropped"])
        came.channels = len(params["columns"])
        came.ages_ms.append((now_ns - stamps[-1]) / 1e6)
        before = stamps if self._last_ns is None else [self._last_ns, *stamps]
        if self._period_ns is not None:
            came.gaps += sum(new - old != self._period_ns for old, new in pairwise(before))
        self._last_ns = stamps[-1]


def main() -> None:
    host, port, rate_hz, seconds, clients, *globs = sys.argv[1:]
    came = Came()
    followers = [Follower((host, int(port)), float(rate_hz), globs, came) for _ in range(int(clients))]
    with selectors.DefaultSelector() as selector:
        for follower in followers:
            selector.register(follower.socket, selectors.EVENT_READ, follower.read)
        end_s = time.monotonic() + float(seconds)
        while time.monotonic() < end_s:
            for key, _ in selector.select(0.1):
                key.data()
    for follower in followers:
        follower.socket.close()
    sys.stdout.write(json.dumps(asdict(came)) + "\n")


if __name__ == "__main__":
    main()
