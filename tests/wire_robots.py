"""`python -m tests.wire_robots ROBOTS`: robots for a server to follow, which cost next to nothing themselves.

As the wire contract describes them, and nothing of ours imported. The first line of output is a list of their
ports. Each streams rows at `--rate`, in real time or, with `--fast`, as fast as they are taken, and after
`--seconds` of its own time none any more; that goes on from link to link. `value` says what it sends.
"""

import argparse
import asyncio
import functools
import json
import sys
import time
from typing import Any

VARIANTS = 100  # rows that differ
AT_ONCE = 50  # rows that a fast robot writes before it looks whether somebody takes them
LINE = (
    b'{"jsonrpc":"2.0","method":"stream.data","params":'
    b'{"stream":1,"seq":%d,"dropped":0,"stamp_ns":[%d],"columns":%b}}\n'
)
NOTHING: dict[str, Any] = {"components": [], "parameters": [], "modules": {}, "guard": {}}
STOP: dict[str, Any] = {"held": False, "reason": None, "since_ns": None, "stopped_again": {}, "drives": {}}


def channel(number: int) -> str:
    return f"joint_{number // 6}.quantity_{number % 6}"


def value(row: int, channel: int) -> float:
    """What channel number `channel` is in row `row` of the robot's own time."""
    return (row + channel) % VARIANTS + 0.25


class Robot:
    """What one robot is, over all its links."""

    def __init__(self, name: str, channels: int, rate_hz: float, seconds: float) -> None:
        self.name = name
        self.began_ns = time.monotonic_ns()
        self.period_ns = round(1e9 / rate_hz)
        self.rows = round(seconds * rate_hz)
        self.next = 0
        self._channels = [channel(number) for number in range(channels)]
        self._columns = [
            json.dumps({name: [value(row, c)] for c, name in enumerate(self._channels)}).encode()
            for row in range(VARIANTS)
        ]

    def due(self) -> int:
        """How many rows there have been until now, in real time."""
        return min(self.rows, (time.monotonic_ns() - self.began_ns) // self.period_ns)

    def take(self, seq: int) -> bytes:
        """The next row, as notification `seq`."""
        row, self.next = self.next, self.next + 1
        return LINE % (seq, self.began_ns + row * self.period_ns, self._columns[row % VARIANTS])

    def answer(self, method: str) -> dict[str, Any]:
        """The result of any method that a server's feed asks for."""
        now_ns = time.monotonic_ns()
        clock = {"monotonic_ns": now_ns, "utc_ns": time.time_ns(), "boot_id": "boot-1"}
        me = {"robot": self.name, "role": "observer", "boot_id": "boot-1"}
        parts = [(name, *name.split(".")) for name in self._channels]
        channels = [{"name": n, "unit": "rad", "component": c, "quantity": q} for n, c, q in parts]
        answers: dict[str, dict[str, Any]] = {
            "hello": {**me, "protocol": 1},
            "clock.read": clock,
            "robot.describe": {**me, **NOTHING, "stop": STOP, "clock": clock, "channels": channels},
            "stream.start": {"stream": 1},
            "stream.stop": {},
            "journal.tail": {"entries": []},
            "component.snapshot": {"stamp_ns": now_ns, "values": {}, "stamps_ns": {}, "quality": {}},
            "resource.snapshot": {
                "stamp_ns": now_ns,
                "cpu": {"percent": 5.0, "per_core": [5.0], "load": [0.1, 0.1, 0.1]},
                "memory": {"total": 4, "available": 2, "used": 2, "swap_used": 0},
                "gateway": {"cpu_percent": 1.0, "rss_bytes": 1 << 24},
                "processes": [],
            },
        }
        return answers[method]


class Link(asyncio.Protocol):
    """A server that has come to a robot."""

    def __init__(self, robot: Robot, fast: bool) -> None:
        self._robot = robot
        self._fast = fast
        self._seq = 0
        self._rest = b""
        self._open = True
        self._held = False
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def connection_lost(self, error: Exception | None) -> None:
        self._open = False

    def pause_writing(self) -> None:
        self._held = True

    def resume_writing(self) -> None:
        self._held = False

    def data_received(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            asked = json.loads(line)
            answer = {"jsonrpc": "2.0", "id": asked["id"], "result": self._robot.answer(asked["method"])}
            self._transport.write(json.dumps(answer).encode() + b"\n")
            if asked["method"] == "stream.start":
                self._stream()

    def _stream(self) -> None:
        """Write what is due, and again a little later."""
        robot = self._robot
        if not self._open or robot.next == robot.rows:
            return
        due = min(robot.rows, robot.next + AT_ONCE) if self._fast else robot.due()
        while robot.next < due and not self._held:
            self._transport.write(robot.take(self._seq))
            self._seq += 1
        at_once = self._fast and not self._held
        asyncio.get_running_loop().call_later(0.0 if at_once else robot.period_ns / 1e9, self._stream)


async def serve(arguments: argparse.Namespace) -> None:
    """Until somebody ends us."""
    loop = asyncio.get_running_loop()
    servers = []
    for number in range(arguments.robots):
        robot = Robot(f"exo-{number:02}", arguments.channels, arguments.rate, arguments.seconds)
        made = functools.partial(Link, robot, arguments.fast)
        servers.append(await loop.create_server(made, "127.0.0.1", 0))
    sys.stdout.write(json.dumps([server.sockets[0].getsockname()[1] for server in servers]) + "\n")
    sys.stdout.flush()
    await asyncio.gather(*(server.serve_forever() for server in servers))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", type=int)
    parser.add_argument("--channels", type=int, default=60)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--seconds", type=float, default=86_400.0)
    parser.add_argument("--fast", action="store_true")
    asyncio.run(serve(parser.parse_args()))


if __name__ == "__main__":
    main()
