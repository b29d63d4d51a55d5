"""Five ordinary clients that stream, and record what they are sent: `python -m tests.attack._streams PORT`.

The first takes every sample as it comes, the others a hundred rows a second. It says `ready` when all flow,
and answers each line of its standard input with what has come since the last one, as a line of JSON.
"""

import json
import selectors
import socket
import sys
import time
from dataclasses import asdict, dataclass, fields
from typing import Any

import msgspec

RATES_HZ = (0, 100, 100, 100, 100)


class _Data(msgspec.Struct):
    seq: int
    dropped: int
    stamp_ns: list[int]
    shed: int = 1


class _Line(msgspec.Struct):
    method: str = ""
    params: _Data | None = None
    error: dict[str, Any] | None = None


@dataclass
class Recorded:
    """What came; `lost` are rows that the gateway says it dropped, `gaps` notifications that are missing."""

    rows: int = 0
    lost: int = 0
    gaps: int = 0
    shed: int = 0
    ended: int = 0
    silent_ms: float = 0.0  # the longest that one of them waited for its next row

    def add(self, other: "Recorded") -> None:
        for one in fields(self):
            mine, more = getattr(self, one.name), getattr(other, one.name)
            setattr(self, one.name, max(mine, more) if one.name == "silent_ms" else mine + more)


_decoder = msgspec.json.Decoder(_Line)


class Stream:
    """One client; a stream that ends is not begun anew."""

    def __init__(self, port: int, rate_hz: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port))
        params = {"modules": ["component"], "rate_hz": rate_hz}
        message = {"jsonrpc": "2.0", "id": 1, "method": "stream.start", "params": params}
        self.socket.sendall(json.dumps(message).encode() + b"\n")
        self.flows = False
        self._seq, self._dropped, self._rest = 0, 0, b""
        self._heard = time.monotonic()
        self._recorded = Recorded()

    def take(self) -> bool:
        """Read; false at the end."""
        try:
            data = self.socket.recv(1 << 20)
        except OSError:
            data = b""
        if not data:
            self._recorded.ended += 1
            return False
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._record(_decoder.decode(line))
        return True

    def report(self) -> Recorded:
        """Since the last one."""
        self._listen()
        recorded, self._recorded = self._recorded, Recorded()
        return recorded

    def _record(self, line: _Line) -> None:
        if line.error is not None:
            self._recorded.ended += 1
        if line.params is None:
            return
        self._listen()
        self._heard = time.monotonic()
        data, self.flows = line.params, True
        self._recorded.rows += len(data.stamp_ns)
        self._recorded.gaps += data.seq - self._seq
        self._recorded.lost += data.dropped - self._dropped
        self._recorded.shed += data.shed > 1
        self._seq, self._dropped = data.seq + 1, data.dropped

    def _listen(self) -> None:
        if self.flows:
            silent_ms = 1e3 * (time.monotonic() - self._heard)
            self._recorded.silent_ms = max(self._recorded.silent_ms, silent_ms)


def report(streams: list[Stream]) -> str:
    whole = Recorded()
    for stream in streams:
        whole.add(stream.report())
    return json.dumps(asdict(whole))


def main(port: int) -> None:
    streams = [Stream(port, rate_hz) for rate_hz in RATES_HZ]
    said = False
    with selectors.DefaultSelector() as selector:
        selector.register(sys.stdin, selectors.EVENT_READ)
        for stream in streams:
            selector.register(stream.socket, selectors.EVENT_READ, stream)
        while True:
            for key, _events in selector.select():
                if key.data is None:
                    if not sys.stdin.readline():
                        return
                    sys.stdout.write(report(streams) + "\n")
                    sys.stdout.flush()
                elif not key.data.take():
                    selector.unregister(key.data.socket)
            if not said and all(stream.flows for stream in streams):
                said = True
                sys.stdout.write("ready\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main(int(sys.argv[1]))
