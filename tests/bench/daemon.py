"""What one look at the process table costs: our daemon, the seed paper's, and two that people know.

All run on the same machine in the same run and are asked in turns, so that whatever else the machine does is
shared out. CPU is the daemon's and its ended children's, as the kernel counts it; what the client needs is
not in it. `--quick` asks less often and idles for 10 s instead of 60 s.

They do not all answer the same: node_exporter has no process table, and Glances answers out of a cache of
some seconds. Where a daemon is not installed its rows are left out, and a line says so.
"""

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from tests.bench._crowd import SERVER, crowd, inside, namespace, processes_now, wire_bytes
from tests.bench._daemons import PROGRAMS, Running, absent, running
from tests.unit.gateway.harness import Client

QUICK = "--quick" in sys.argv
ROUNDS = 4
SIZES = {100: 1000, 1000: 200, 5000: 40}  # processes on the machine → requests to each daemon
IDLE_S = 10.0 if QUICK else 60.0
LINGER_S = 15.0  # until each has put away what it was asked for; ours after 12 s, with the paper's exchange

# row → the program that answers, and the way it is asked
WAYS = {
    "gwrms, connection held": ("gwrms", "held"),
    "gwrms, connection each": ("gwrms", "anew"),
    "gwrms, paper's exchange": ("gwrms", "classic"),
    "paper's daemon": ("paper", "classic"),
    "Glances (cached)": ("glances", "glances"),
    "node_exporter (no processes)": ("node_exporter", "node_exporter"),
    "psutil.process_iter, no server": ("", "process_iter"),
}
OURS, PAPER, PSUTIL = "gwrms, connection held", "paper's daemon", "psutil.process_iter, no server"
LIMITS = ((PAPER, 1 / 6, "cpu_ms"), (PAPER, 1 / 6, "p50_ms"), (PSUTIL, 1 / 5, "cpu_ms"))


@dataclass
class Row:
    """One way of asking, at one size of the process table, over one network."""

    name: str
    network: str
    machine: int  # processes on it
    times_ms: list[float] = field(default_factory=list)
    cpu_ms: float = 0.0  # over all requests
    asked: int = 0  # requests that the CPU was spent on, the uncounted first of each round among them
    payload: int = 0
    wire: int | None = None
    told: int = 0  # processes in an answer

    def at(self, share: float) -> float:
        ordered = sorted(self.times_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]

    @property
    def figures(self) -> dict[str, object]:
        """For machines."""
        return {
            "name": self.name,
            "network": self.network,
            "machine_processes": self.machine,
            "n": len(self.times_ms),
            "p50_ms": round(self.at(0.5), 3),
            "p99_ms": round(self.at(0.99), 3),
            "mean_ms": round(sum(self.times_ms) / len(self.times_ms), 3),
            "cpu_ms": round(self.cpu_ms / self.asked, 3),
            "payload_bytes": self.payload,
            "wire_bytes": self.wire,
            "answer_processes": self.told,
        }


def ask(row: Row, way: str, daemon: Running | None, number: int, network: str) -> None:
    """One round: a client of its own, and the daemon's CPU before and after."""
    host, port = ("-", 0) if daemon is None else (daemon.host, daemon.port)
    if daemon is not None and way == "classic" and daemon.classic_port is not None:
        port = daemon.classic_port
    command = [sys.executable, "-m", "tests.bench._daemon_client", way, host, str(port), str(number)]
    before_ms = 0.0 if daemon is None else daemon.cost.cpu_ms
    before_bytes = wire_bytes() if network == "netns" else 0
    done = subprocess.run(
        inside(command) if network == "netns" else command, capture_output=True, text=True, check=True
    )
    taken = json.loads(done.stdout)
    row.times_ms += taken["times_ms"]
    if daemon is None:
        row.cpu_ms, row.asked = row.cpu_ms + taken["cpu_ms"] * number, row.asked + number
    else:
        row.cpu_ms, row.asked = row.cpu_ms + daemon.cost.cpu_ms - before_ms, row.asked + number + 1
    row.payload, row.told = taken["sent"] + taken["received"], taken["processes"]
    if network == "netns":
        row.wire = round((wire_bytes() - before_bytes) / (number + 1))


def rounds(daemons: dict[str, Running], network: str, number: int) -> list[Row]:
    """Every way in turns, `ROUNDS` times."""
    machine = processes_now()
    rows = {
        name: Row(name, network, machine)
        for name, (program, _) in WAYS.items()
        if program in daemons or (not program and network == "local")
    }
    with ExitStack() as held:
        if (gwrms := daemons.get("gwrms")) is not None:  # what waking costs: `idle`
            held.enter_context(Client((gwrms.host, gwrms.port))).call("clock.read")
        for _ in range(ROUNDS):
            for name, row in rows.items():
                program, way = WAYS[name]
                ask(row, way, daemons.get(program), max(1, number // ROUNDS), network)
    return list(rows.values())


def started(host: str, stack: ExitStack, folder: Path) -> dict[str, Running]:
    """Every daemon that is installed."""
    present = [program for program in PROGRAMS if not absent(program)]
    return {one.name: stack.enter_context(running(one, host, folder)) for one in present}


def idle(daemons: dict[str, Running]) -> Iterator[dict[str, object]]:
    """What each costs while nobody asks, all of them at the same time."""
    write(f"\nidle for {IDLE_S:g} s; memory in kB before the first request, and now")
    write(f"{'':<32}{'CPU ms':>9}{'wake-ups':>9}" + "".join(f"{kind:>16}" for kind in ("RSS", "PSS", "USS")))
    time.sleep(LINGER_S)
    before = {name: daemon.cost for name, daemon in daemons.items()}
    time.sleep(IDLE_S)
    for name, daemon in daemons.items():
        after, fresh = daemon.cost, daemon.fresh.memory_kb
        cpu_ms, wake_ups = after.cpu_ms - before[name].cpu_ms, after.wake_ups - before[name].wake_ups
        held = "".join(f"{fresh[kind]:>8,}{kb:>8,}" for kind, kb in after.memory_kb.items())
        write(f"{name:<32}{cpu_ms:>9.0f}{wake_ups:>9}{held}")
        yield {
            "name": name,
            "idle_s": IDLE_S,
            "idle_cpu_ms": round(cpu_ms, 1),
            "wake_ups": wake_ups,
            **{f"{kind}_fresh_kb": kb for kind, kb in daemon.fresh.memory_kb.items()},
            **{f"{kind}_served_kb": kb for kind, kb in after.memory_kb.items()},
        }


def write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def table(rows: Sequence[Row]) -> None:
    for row in rows:
        one = row.figures
        figures = "".join(f"{one[key]:>9.2f}" for key in ("p50_ms", "p99_ms", "mean_ms", "cpu_ms"))
        wire = "-" if row.wire is None else f"{row.wire:,}"
        write(f"{row.name:<32}{one['n']:>6}{row.told:>7}{figures}{row.payload:>11,}{wire:>11}")


def header(network: str, machine: int) -> None:
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    write(f"\n{network}, {machine} processes on the machine, load {load:.1f} a core")
    titles = "".join(f"{title:>9}" for title in ("p50 ms", "p99 ms", "mean ms", "CPU ms"))
    write(f"{'':<32}{'n':>6}{'told':>7}{titles}{'payload':>11}{'on wire':>11}")


def measure(folder: Path) -> tuple[list[Row], list[dict[str, object]]]:
    rows: list[Row] = []
    resting: list[dict[str, object]] = []
    share = 10 if QUICK else 1
    with ExitStack() as stack:
        daemons = started("127.0.0.1", stack, folder)
        for size, number in SIZES.items():
            with crowd(size):
                header("local", processes_now())
                found = rounds(daemons, "local", number // share)
            table(found)
            rows += found
            resting = resting or list(idle(daemons))  # after what a robot has; a crowd takes more memory
    with namespace() as name, ExitStack() as stack:
        if name is None:
            write("\nacross a network namespace: left out, it needs root and iproute2")
            return rows, resting
        daemons = started(SERVER, stack, folder)
        header("netns", processes_now())
        found = rounds(daemons, "netns", SIZES[100] // share)
        table(found)
        rows += found
    return rows, resting


def verdict(rows: Sequence[Row]) -> bool:
    """Whether ours is as cheap as it has to be on the machine's own table; the crowds show the growth."""
    machines = sorted({row.machine for row in rows if row.network == "local"})
    kept = [_compare(rows, machine, limited=machine == machines[0]) for machine in machines]
    return all(kept)


def _compare(rows: Sequence[Row], machine: int, *, limited: bool) -> bool:
    by_name = {row.name: row.figures for row in rows if (row.machine, row.network) == (machine, "local")}
    kept = True
    for other, most, key in LIMITS:
        if other in by_name:
            ours, theirs = float(str(by_name[OURS][key])), float(str(by_name[other][key]))
            good = ours <= theirs * most
            kept = kept and (good or not limited)
            word = f" ({'kept' if good else 'NOT KEPT'}: at least {1 / most:.0f})" if limited else ""
            write(f"{machine} processes, {key}: {theirs / ours:.1f} times cheaper than {other}{word}")
    return kept


def main() -> int:
    """Print the tables; 1 where ours is not as cheap as it has to be."""
    write(f"Daemons on {os.cpu_count()} cores of {platform.machine()}, Python {platform.python_version()}")
    for program in PROGRAMS:
        if absent(program):
            write(f"{program.name}: left out, it is not installed (Debian: {program.package})")
    with tempfile.TemporaryDirectory() as folder:
        rows, resting = measure(Path(folder))
    write("")
    kept = verdict(rows)
    for figures in [*(row.figures for row in rows), *resting]:
        write(json.dumps({"benchmark": "daemon", **figures}))
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
