"""Clients that ask a gateway for much at once, as a process: `python -m tests.bench._clients PORT`.

One asks for process tables with command lines ten times a second, one lists every parameter, also locked
ones, as often, and ten stream: one every sample as it comes, nine a hundred rows a second. It says `ready`
when all streams flow, and ends with its standard input.
"""

import contextlib
import json
import selectors
import socket
import sys
import time
from typing import Any

STREAMS = 10
PERIOD_S = 0.1
ASKED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("resource.snapshot", {"include": ["cmdline"]}),
    ("parameter.list", {"names": ["*"]}),
)


class Asker:
    """One client that asks the same again and again, once it has its answer."""

    def __init__(self, port: int, method: str, params: dict[str, Any]) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        message = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
        self._line = json.dumps(message).encode() + b"\n"
        self.answers = self.bytes = 0
        self._waits = False
        self._due = time.monotonic()

    def ask(self) -> float:
        """Where it is time; returns in how many seconds it is."""
        now = time.monotonic()
        if not self._waits and now >= self._due:
            self._waits, self._due = True, max(self._due + PERIOD_S, now)
            self.socket.sendall(self._line)
        return max(0.0, self._due - now)

    def take(self, data: bytes) -> None:
        self.bytes += len(data)
        if data.endswith(b"\n"):
            self.answers += 1
            self._waits = False


class Stream:
    """One client that takes all it is sent."""

    def __init__(self, port: int, rate_hz: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.bytes = 0
        params = {"modules": ["component"], "rate_hz": rate_hz}
        message = {"jsonrpc": "2.0", "id": 1, "method": "stream.start", "params": params}
        self.socket.sendall(json.dumps(message).encode() + b"\n")

    def take(self, data: bytes) -> None:
        self.bytes += len(data)


def main(port: int) -> None:
    askers = [Asker(port, method, params) for method, params in ASKED]
    streams = [Stream(port, 0 if number == 0 else 100) for number in range(STREAMS)]
    clients: tuple[Asker | Stream, ...] = (*askers, *streams)
    said = False
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin, selectors.EVENT_READ)
        for client in clients:
            selector.register(client.socket, selectors.EVENT_READ, client)
        while True:
            wait_s = min(asker.ask() for asker in askers)
            for key, _events in selector.select(min(wait_s, PERIOD_S)):
                if key.data is None:
                    return
                key.data.take(key.data.socket.recv(1 << 20))
            if not said and all(client.bytes > 1000 for client in clients):
                said = True
                sys.stdout.write("ready\n")
                sys.stdout.flush()


if __name__ == "__main__":
    with contextlib.suppress(ConnectionError):  # the gateway has gone
        main(int(sys.argv[1]))
