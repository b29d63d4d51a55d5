"""What the gateway holds at rest, serving resources and serving a whole robot, and how soon it is back.

The robot is the simulated one with eight drives, two insoles and an IMU. `--quick` is at rest for 10 s
instead of 60, and wakes it up less often. Times are the clock's: on a busy computer they are mostly waiting.
"""

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.bench._daemons import Cost
from tests.bench._sim import EXTRA
from tests.support.waiting import until
from tests.unit.gateway import processes
from tests.unit.gateway.harness import Client

QUICK = "--quick" in sys.argv
REST_S = 10.0 if QUICK else 60.0
WAKES = 5 if QUICK else 20
REQUESTS = 1000
SYNC_HZ = 100
DUTIES = (0.01, 0.05, 0.20)
PAPER_KB = 3398  # as the paper says of its daemon

RESOURCES = processes.RESTS_SOON
JOINT = """
[joint.extra_{node_id}]
bus = "main"
node_id = {node_id}
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
"""


@dataclass(frozen=True)
class Figure:
    """One measured value and, where there is one, the most that it may be."""

    name: str
    value: float
    unit: str
    most: float | None = None

    @property
    def kept(self) -> bool:
        return self.most is None or self.value <= self.most

    @property
    def line(self) -> str:
        limit = (
            "" if self.most is None else f"   at most {self.most:g}: {'kept' if self.kept else 'NOT KEPT'}"
        )
        return f"{self.name:<58}{self.value:>10.2f} {self.unit:<4}{limit}"


def memory(name: str, pid: int, most_mb: float | None = None) -> Iterator[Figure]:
    """A process's memory, in MB of 1024²; the limit is for what is resident."""
    held = Cost.of(pid).memory_kb
    yield Figure(f"{name}, RSS", held["rss"] / 1024, "MB", most_mb)
    yield Figure(f"{name}, PSS", held["pss"] / 1024, "MB")


def rest(pid: int) -> None:
    until(lambda: processes.rests(pid), "it rests")


@contextmanager
def gateway(file: Path) -> Iterator[tuple[int, tuple[str, int]]]:
    with processes.process(*processes.GATEWAY, str(file), "--port", "0") as running:
        yield running.pid, processes.address(running)


def woken(pid: int, address: tuple[str, int], good: Callable[[Client], object]) -> tuple[float, float]:
    """How long it takes from rest to an answer, in milliseconds, and the CPU of that: medians."""
    times_ms, cpu_ms = [], []
    for _ in range(WAKES):
        rest(pid)
        before, began_ns = Cost.of(pid).cpu_ms, time.monotonic_ns()
        with Client(address) as client:
            if not good(client):
                raise RuntimeError("the answer lacks what was asked for")
            times_ms.append((time.monotonic_ns() - began_ns) / 1e6)
            cpu_ms.append(Cost.of(pid).cpu_ms - before)
    return sorted(times_ms)[WAKES // 2], sorted(cpu_ms)[WAKES // 2]


def at_rest(pid: int) -> Iterator[Figure]:
    """After it has served."""
    rest(pid)
    yield from memory("at rest, after it has served", pid, 16)
    before = processes.kernel_saw(pid)
    time.sleep(REST_S)
    ticks, switches = (sum(part) for part in _differences(before, processes.kernel_saw(pid)))
    yield Figure(f"at rest, CPU ticks in {REST_S:g} s", ticks, "", 0)
    yield Figure(f"at rest, context switches in {REST_S:g} s", switches, "", 0)


def _differences(before: tuple[int, ...], after: tuple[int, ...]) -> tuple[list[int], list[int]]:
    changed = [new - old for old, new in zip(before, after, strict=True)]
    return changed[:2], changed[2:]


def resources(folder: Path) -> Iterator[Figure]:
    file = folder / "resources.toml"
    file.write_text(RESOURCES, encoding="utf-8")
    with gateway(file) as (pid, address):
        wake_ms, cpu_ms = woken(pid, address, lambda client: client.call("resource.snapshot")["processes"])
        yield Figure("from rest to a process table, p50", wake_ms, "ms", 400)
        yield Figure("CPU of that", cpu_ms, "ms")
        with Client(address) as client:
            for _ in range(REQUESTS):
                client.call("resource.snapshot")
            yield from memory(f"serving resources, after {REQUESTS} requests", pid, 20)
        yield from at_rest(pid)


@contextmanager
def robot(folder: Path) -> Iterator[Path]:
    """The simulated robot with eight drives; its file."""
    command = [sys.executable, "-m", "tests.bench._sim", str(folder), "1", str(SYNC_HZ)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as running:
        if running.stdout is None or not running.stdout.readline():
            raise RuntimeError("the simulator did not start")
        file = folder / "robot.toml"
        text = re.sub(
            r"^linger_s = \d+", "linger_s = 0.2", file.read_text(encoding="utf-8"), flags=re.MULTILINE
        )
        text += "".join(JOINT.format(node_id=node_id) for node_id in EXTRA)
        eight = folder / "eight.toml"
        eight.write_text(text, encoding="utf-8")
        yield eight
        running.communicate()


def whole(folder: Path) -> Iterator[Figure]:
    with robot(folder) as file, gateway(file) as (pid, address):

        def live(client: Client) -> bool:
            wanted = [f"{joint}.position" for joint in ("left_hip", "right_ankle", "extra_7", "extra_8")]

            def there() -> bool:
                values = client.call("component.snapshot", channels=wanted)["values"]
                return None not in values.values()

            until(there, "the joints are there")
            return True

        wake_ms, cpu_ms = woken(pid, address, live)
        yield Figure("from rest to the values of eight joints, p50", wake_ms, "ms", 1500)
        yield Figure("CPU of that", cpu_ms, "ms")
        with Client(address) as client:
            description = client.call("robot.describe")
            states = [
                one["state"] for one in description["components"] if one["kind"] in ("joint", "insole", "imu")
            ]
            yield Figure("joints, insoles and IMU that are there", states.count("ok"), "")
            client.call("resource.snapshot")
            client.call("status.snapshot")
            client.call("parameter.read")
            client.call("journal.tail")
            client.call("stream.start", modules=["component", "resource"], rate_hz=1000)
            end_s = time.monotonic() + 3.0
            while time.monotonic() < end_s:
                client.data()
            yield from memory("serving every module of them", pid, 40)


def duties(serving_mb: float, resting_mb: float) -> Iterator[Figure]:
    """What is held on the average, where a part of the time somebody looks at the resources."""
    for duty in DUTIES:
        name = f"on the average, {duty:.0%} of the time serving resources"
        yield Figure(f"{name}, socket activated", duty * serving_mb, "MB")
        yield Figure(f"{name}, started by hand", duty * serving_mb + (1 - duty) * resting_mb, "MB")
    yield Figure("the paper's daemon, always (as the paper says)", PAPER_KB / 1024, "MB")


def main() -> int:
    """Print the figures; 1 where a limit was not kept."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    write(f"Idle on {platform.machine()}, Python {platform.python_version()}, load {load:.1f} a core\n")
    figures: list[Figure] = []

    def put_down(more: Iterator[Figure]) -> None:
        for figure in more:
            write(figure.line)
            figures.append(figure)

    with tempfile.TemporaryDirectory() as folder:
        put_down(resources(Path(folder)))
        put_down(whole(Path(folder, "robot")))
    by_name = {figure.name: figure.value for figure in figures}
    serving = by_name[f"serving resources, after {REQUESTS} requests, RSS"]
    put_down(duties(serving, by_name["at rest, after it has served, RSS"]))
    for figure in figures:
        line: dict[str, Any] = {"name": figure.name, "value": round(figure.value, 3), "unit": figure.unit}
        write(json.dumps({"benchmark": "idle", **line}))
    return 0 if all(figure.kept for figure in figures) else 1


def write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
