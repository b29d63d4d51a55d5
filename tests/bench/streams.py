"""What streams cost the gateway, and how late they are: the simulated exoskeleton, walking.

CPU is the gateway's own, as the kernel counts it, above what reading the robot takes while a client is there
that streams nothing. `--quick` watches for 4 s instead of 15 s each.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.bench._daemons import Cost
from tests.scenario.processes import Bench
from tests.unit.gateway.harness import Client

WATCH_S = 4.0 if "--quick" in sys.argv else 15.0
WARM_S = 1.0
WAIT_S = 60.0
CORE_PERCENT, TEN_TO_ONE, LATE_MS = 15.0, 1.5, 5.0  # the limits


@dataclass(frozen=True)
class Way:
    """One way of streaming; `channels` None is all there are."""

    name: str
    rate_hz: float
    clients: int = 1
    channels: int | None = None


SIXTY = Way("60 channels at 1 kHz", 1000, channels=60)
ONE, TEN = Way("all at 50 Hz", 50), Way("all at 50 Hz, ten clients", 50, clients=10)
ALL = Way("all at 1 kHz", 1000)
OWN = Way("a joint's own samples", 0, channels=1)


@dataclass(frozen=True)
class Row:
    """What a way has cost, and what came."""

    way: Way
    percent: float  # of one core, above `reading`
    came: dict[str, Any]

    def age_ms(self, share: float) -> float:
        ordered = sorted(self.came["ages_ms"])
        return float(ordered[min(len(ordered) - 1, int(share * len(ordered)))])

    @property
    def figures(self) -> dict[str, object]:
        """For machines."""
        seconds = WATCH_S + 2 * WARM_S
        return {
            "name": self.way.name,
            "clients": self.way.clients,
            "channels": self.came["channels"],
            "cpu_percent": round(self.percent, 2),
            "rows_per_s": round(self.came["rows"] / seconds / self.way.clients),
            "gaps": self.came["gaps"],
            "dropped": self.came["dropped"],
            "kb_per_s": round(self.came["bytes"] / seconds / 1e3),
            "age_p50_ms": round(self.age_ms(0.5), 2),
            "age_p99_ms": round(self.age_ms(0.99), 2),
        }


def percent_now(pid: int) -> float:
    """The CPU of a process from now on, of one core."""
    time.sleep(WARM_S)
    before_ms, began_s = Cost.of(pid).cpu_ms, time.monotonic()
    time.sleep(WATCH_S)
    return (Cost.of(pid).cpu_ms - before_ms) / 10 / (time.monotonic() - began_s)


def measure(bench: Bench, way: Way, names: list[str], reading: float) -> Row:
    """One way, by clients in a process of their own."""
    words = ["127.0.0.1", bench.port, way.rate_hz, WATCH_S + 2 * WARM_S, way.clients, *names[: way.channels]]
    command = [sys.executable, "-m", "tests.bench._stream_client", *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
        percent = percent_now(bench.gateway.pid)
        said, _ = client.communicate(timeout=WAIT_S)
    return Row(way, percent - reading, json.loads(said))


def write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def table(rows: list[Row]) -> None:
    titles = ("CPU %", "rows/s", "kB/s", "gaps", "dropped", "age p50", "p99 ms")
    write(f"{'':<28}{'channels':>9}" + "".join(f"{title:>9}" for title in titles))
    for row in rows:
        one = row.figures
        keys = ("cpu_percent", "rows_per_s", "kb_per_s", "gaps", "dropped", "age_p50_ms", "age_p99_ms")
        write(f"{row.way.name:<28}{one['channels']:>9}" + "".join(f"{one[key]:>9}" for key in keys))


def verdict(rows: dict[Way, Row]) -> bool:
    """Whether the limits were kept; lateness is only told: on a busy machine the client is late too."""
    sixty, ratio = rows[SIXTY], rows[TEN].percent / max(0.1, rows[ONE].percent)
    late_ms = rows[OWN].age_ms(0.99)
    kept = {
        f"{SIXTY.name}: {sixty.percent:.1f} % of a core, at most {CORE_PERCENT:g}": sixty.percent
        <= CORE_PERCENT,
        f"{SIXTY.name}: nothing is lost": not (sixty.came["gaps"] or sixty.came["dropped"]),
        f"ten clients cost {ratio:.2f} times one, at most {TEN_TO_ONE:g}": ratio <= TEN_TO_ONE,
    }
    for what, good in kept.items():
        write(f"{what}: {'kept' if good else 'NOT KEPT'}")
    write(f"from a frame to its client, 99 of 100: {late_ms:.1f} ms; on a quiet machine at most {LATE_MS:g}")
    return all(kept.values())


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    write(f"Streams on {os.cpu_count()} cores of {platform.machine()}, load {load:.1f} a core")
    with tempfile.TemporaryDirectory() as folder, ExitStack() as processes:
        bench = Bench(Path(folder), processes)
        bench.until_whole()
        with Client(("127.0.0.1", bench.port)) as holder:
            names = [one["name"] for one in holder.call("robot.describe")["channels"]]
            reading = percent_now(bench.gateway.pid)
            write(f"reading the robot for one client: {reading:.1f} % of a core, not in what follows\n")
            rows = {way: measure(bench, way, names, reading) for way in (SIXTY, ALL, ONE, TEN, OWN)}
    table(list(rows.values()))
    write("")
    kept = verdict(rows)
    for row in rows.values():
        write(json.dumps({"benchmark": "streams", "reading_percent": round(reading, 2), **row.figures}))
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
