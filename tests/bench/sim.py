"""What the simulator costs: eight drives, two insoles and an IMU in real time, and as fast as it goes.

In real time the robot is a process of its own (`_sim.py`), and this one reads its hubs and its serial ports
as any program would: it stamps SYNC and counts the PDOs between two of them. Counted is the processor time of
the robot's process for a simulated second. Beside it eight `canopen.LocalNode`s that only answer SYNC.
"""

import itertools
import json
import os
import re
import resource
import selectors
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from hil_sim.robot import SimulatedRobot
from tests.bench._sim import CYCLE_PERIOD, give

WARM_UP_S = 5.0  # the drives are enabled, the robot walks
SECONDS = 10.0
FAST_S = 60.0
TEN_MINUTES_S = 600.0
OVERLOAD_HZ, OVERLOAD_S = 1000, 3.0
PORTS = ("left_insole", "right_insole", "trunk")
SYNC = 0x080
PDOS = [base + node for base in (0x180, 0x200) for node in range(1, 9)]
_FRAME = re.compile(rb"< frame ([0-9A-F]+) ")


@dataclass(frozen=True)
class Row:
    """One figure and its limit."""

    name: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def kept(self) -> bool:
        return self.limit is None or self.value <= self.limit

    @property
    def text(self) -> str:
        limit = "" if self.limit is None else f"{self.limit:>9g}{self.value / self.limit:>8.2f}"
        return f"{self.name:<66}{self.value:>9.2f} {self.unit:<4}{limit}\n"


@dataclass
class Heard:
    """What came from one hub, stamped when it was read (s)."""

    wire: socket.socket
    chunks: list[tuple[float, bytes]] = field(default_factory=list)

    def frames(self) -> Iterator[tuple[float, int]]:
        """When, and which identifier; a message counts with the chunk that ends it."""
        rest = b""
        for stamp_s, data in self.chunks:
            *messages, rest = (rest + data).split(b">")
            for message in messages:
                if found := _FRAME.search(message):
                    yield stamp_s, int(found[1], 16)


def in_real_time(buses: int, sync_hz: int) -> Iterator[Row]:
    """Processor time, jitter of SYNC, and PDOs that are missing."""
    title = f"{buses} {'bus' if buses == 1 else 'buses'}, SYNC {sync_hz} Hz"
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "tests.bench._sim", folder, str(buses), str(sync_hz)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as child:
            if child.stdin is None or child.stdout is None:
                raise RuntimeError("the robot has no pipes")
            ports = json.loads(child.stdout.readline())["ports"]
            hubs, cpu_s = listen(ports, Path(folder), psutil.Process(child.pid))
            child.stdin.close()
            skipped_s = json.loads(child.stdout.readline())["skipped_s"]
    yield from judged(title, hubs, cpu_s, 1.0 / sync_hz)
    if skipped_s:
        yield Row(f"{title}: simulated time left out, this computer was too busy", skipped_s, "s")


def listen(ports: list[int], folder: Path, robot: psutil.Process) -> tuple[list[Heard], float]:
    """Everything the robot sends for a while, and the processor time that it takes for that."""
    hubs = [Heard(connect(port)) for port in ports]
    lines = [os.open(folder / name, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK) for name in PORTS]
    with selectors.DefaultSelector() as selector:
        for hub in hubs:
            selector.register(hub.wire, selectors.EVENT_READ, hub)
        for line in lines:
            selector.register(line, selectors.EVENT_READ, None)
        read(selector, WARM_UP_S)
        for hub in hubs:
            hub.chunks.clear()
        before = sum(robot.cpu_times()[:2])
        read(selector, SECONDS)
        cpu_s = sum(robot.cpu_times()[:2]) - before
    for line in lines:
        os.close(line)
    for hub in hubs:
        hub.wire.close()
    return hubs, cpu_s


def connect(port: int) -> socket.socket:
    """A socketcand client in raw mode."""
    wire = socket.create_connection(("127.0.0.1", port))
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for word in (b"", b"< open sim >", b"< rawmode >"):
        wire.sendall(word)
        wire.recv(100)
    return wire


def read(selector: selectors.BaseSelector, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while (left_s := end_s - time.monotonic()) > 0:
        for key, _ in selector.select(left_s):
            data = os.read(key.fd, 65536)
            if key.data is not None:
                key.data.chunks.append((time.monotonic(), data))


def judged(title: str, hubs: list[Heard], cpu_s: float, period_s: float) -> Iterator[Row]:
    frames = [list(hub.frames()) for hub in hubs]
    syncs = [[stamp for stamp, cob_id in of if cob_id == SYNC] for of in frames]
    simulated_s = len(syncs[0]) * period_s
    yield Row(f"{title}: processor, share of a core", 100.0 * cpu_s / simulated_s, "%", 60.0)
    yield from jitter(f"{title}: SYNC jitter", syncs, period_s, 1.0)
    yield Row(f"{title}: PDOs missing of {16 * len(syncs[0])}", sum(map(missing, frames)), "", 0.5)


def jitter(title: str, stamps_s: list[list[float]], period_s: float, limit: float | None) -> Iterator[Row]:
    off_ms = sorted(
        abs(later - one - period_s) * 1000.0 for of in stamps_s for one, later in itertools.pairwise(of)
    )
    yield Row(f"{title} p50", off_ms[len(off_ms) // 2], "ms")
    yield Row(f"{title} p99", off_ms[int(0.99 * len(off_ms))], "ms", limit)
    yield Row(f"{title} max", off_ms[-1], "ms")


def ticker(hz: int) -> Iterator[Row]:
    """How evenly messages come here from a program that only sends them: what this computer can do."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        command = [sys.executable, "-m", "tests.bench._ticker", str(port), str(hz), str(SECONDS)]
        with subprocess.Popen(command):
            wire, _ = server.accept()
            with wire:
                stamps_s = [time.monotonic() for _ in iter(lambda: wire.recv(65536), b"")]
    yield from jitter(f"a program that only sends, {hz} Hz: jitter", [stamps_s], 1.0 / hz, None)


def missing(frames: list[tuple[float, int]]) -> int:
    """How many PDOs did not come: each of those that are on this bus comes once with every SYNC."""
    cob_ids = [cob_id for _, cob_id in frames]
    first = cob_ids.index(SYNC)
    last = len(cob_ids) - 1 - cob_ids[::-1].index(SYNC)
    counts = Counter(cob_ids[first:last])
    return sum(abs(counts[SYNC] - counts[pdo]) for pdo in PDOS if counts[pdo])


def peer(sync_hz: int, ours_percent: float) -> Iterator[Row]:
    """The plain way to simulate eight drives, which move nothing."""
    command = [sys.executable, "-m", "tests.bench._local_nodes", str(sync_hz), str(SECONDS)]
    said = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    percent = 100.0 * said["cpu_s"] / (said["syncs"] / sync_hz)
    yield Row(f"8 canopen LocalNodes, SYNC {sync_hz} Hz: processor, share of a core", percent, "%")
    yield Row("the whole robot on one bus / 8 canopen LocalNodes", ours_percent / percent, "×")


def fast() -> Iterator[Row]:
    """The robot as it comes, as a command, from start to end."""
    command = [
        sys.executable,
        "-m",
        "gateway.main",
        "sim",
        "--seconds",
        str(FAST_S),
        "--speed",
        "max",
        "--dir",
    ]
    with tempfile.TemporaryDirectory() as folder:
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        subprocess.run([*command, folder], check=True, stdout=subprocess.DEVNULL)
        wall_s = time.monotonic() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    times = TEN_MINUTES_S / FAST_S
    name = f"ten minutes at --speed max ({FAST_S:g} s × {times:g})"
    yield Row(f"{name}: processor", cpu_s * times, "s", 200.0)
    yield Row(f"{name}: wall", wall_s * times, "s")


def overloaded() -> Iterator[Row]:
    """SYNC so often that the PDOs do not fit: the bus carries what it can, and the simulator says so."""
    said: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        robot = SimulatedRobot(Path(folder), speed=None, say=said.append)
        give(robot.exoskeleton.controller, CYCLE_PERIOD, 1_000_000 // OVERLOAD_HZ)
        robot.open()
        try:
            robot.run(OVERLOAD_S)
        finally:
            robot.close()
        busy = robot.exoskeleton.bus.busy_ns / 1e9 / OVERLOAD_S
    yield Row(f"SYNC {OVERLOAD_HZ} Hz, more than fits: bus carries", 100.0 * busy, "%", 100.1)
    yield Row("reports of the overload that are missing", float(not said), "", 0.5)


def measure() -> Iterator[Row]:
    one_bus = list(in_real_time(1, 250))
    yield from one_bus
    yield from ticker(250)
    yield from in_real_time(2, 500)
    yield from peer(250, one_bus[0].value)
    yield from fast()
    yield from overloaded()


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    sys.stdout.write(
        "Simulator: 8 drives with set-points, gait controller, 2 insoles, IMU; "
        f"load of this machine before: {load:.1f} a core\n"
    )
    sys.stdout.write(f"{'':<66}{'':>9} {'':<4}{'limit':>9}{'ratio':>8}\n")
    rows = []
    for row in measure():
        rows.append(row)
        sys.stdout.write(row.text)
        sys.stdout.flush()
    figures = [{**vars(row), "kept": row.kept} for row in rows]
    sys.stdout.write(json.dumps({"benchmark": "sim", "results": figures}, ensure_ascii=False) + "\n")
    return 0 if all(row.kept for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
