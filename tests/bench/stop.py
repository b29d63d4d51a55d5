"""How soon a stop is on the bus: from the request's bytes to the last drive's controlword.

Eight drives send 8,457 TPDOs a second, two clients stream all of it, and the drives' own process stamps each
controlword as it reads it (`_bus.py`); all stamps are of the one monotonic clock. The same again while other
clients ask for all they can (`_clients.py`) and a second bus takes nothing (`_blocked_bus.py`). Beside it, on
the same bus without a gateway, a plain canopen script that writes the controlword to one node after another;
and the guard, from the frame that trips a rule to the controlwords, likewise.
"""

import contextlib
import json
import logging
import os
import queue
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import can
import canopen

import eds
from drivers.inbox import Inbox
from tests.bench._blocked_bus import blocked_bus
from tests.bench._bus import Drive
from tests.bench._crowd import crowd
from tests.bench._drives import DRIVES
from tests.support.waiting import until
from tests.unit.gateway.harness import Client
from tests.unit.joint.conftest import drive_eds

RATE = 8457.0
STOPS = 200
LIMIT_MS = 10.0
QUICK_STOP = 0x0002
WAIT_S = 20.0
CONFIRMED_S = 2.0  # until then every drive has confirmed its quick stop, and may be asked again
LOADED = ", under load"
TRIP_COUNTS = 1_000_000  # a position that no drive is at

HEAD = """
[robot]
name = "bench"
[gateway]
port = 0
records = "records"
[can.bench]
interface = "socketcand"
channel = "bench"
host = "127.0.0.1"
port = {port}
"""
JOINT = """
[joint.joint_{node_id}]
bus = "bench"
node_id = {node_id}
eds = "drive.eds"
parameters = "eds"
counts_per_revolution = 4096
gear_ratio = 100
"""
BLOCKED = """
[can.blocked]
interface = "slcan"
channel = "{port}"
[joint.beyond]
bus = "blocked"
node_id = 9
stop_timeout_s = 0.05
eds = "drive.eds"
counts_per_revolution = 4096
gear_ratio = 100
"""
GUARD = """
[guard.rule.limit]
watch = "joint_limit"
max = 10.0
clear_s = 0.001
actions = ["quick_stop"]
"""
PARAMETERS = 904  # in all drives
PROCESSES = 300  # on the computer, at least: their tables are asked for


@dataclass
class Row:
    """One row of the table, in milliseconds; its limit is that of the 99th percentile."""

    name: str
    limit_ms: float | None = None
    times_ms: list[float] = field(default_factory=list)

    def at(self, share: float) -> float:
        ordered = sorted(self.times_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]

    @property
    def kept(self) -> bool:
        return self.limit_ms is None or self.at(0.99) <= self.limit_ms

    @property
    def figures(self) -> dict[str, object]:
        """For machines."""
        return {
            "name": self.name,
            "n": len(self.times_ms),
            "p50_ms": self.at(0.5),
            "p99_ms": self.at(0.99),
            "max_ms": max(self.times_ms),
            "limit_ms": self.limit_ms,
        }

    @property
    def text(self) -> str:
        figures = "".join(f"{one:>9.2f}" for one in (self.at(0.5), self.at(0.99), max(self.times_ms)))
        ratio = "" if self.limit_ms is None else f"{self.limit_ms:>9g}{self.at(0.99) / self.limit_ms:>9.2f}"
        return f"{self.name:<62}{len(self.times_ms):>5}{figures}{ratio}\n"


class Bus:
    """The drives' process, and what it tells."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self._told: Inbox[tuple[str, int, int, int]] = Inbox()
        self.port = int(self._line())
        self._reader = threading.Thread(target=self._read, name="what the bus tells")
        self._reader.start()

    def say(self, line: str) -> None:
        if self._process.stdin is None:
            raise RuntimeError("the drives have no pipes")
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()

    def quick_stops_ns(self, within_s: float = WAIT_S) -> list[int]:
        """When each drive got its next quick stop, in their order of time; raises `queue.Empty`."""
        found: dict[int, int] = {}
        while len(found) < DRIVES:
            what, node_id, word, stamp_ns = self._told.get(timeout=within_s)
            if what == "word" and word == QUICK_STOP:
                found.setdefault(node_id, stamp_ns)
        return sorted(found.values())

    def trip(self, node_id: int) -> int:
        """Send a frame that trips the rule; returns when it went out."""
        self.say(f"trip {node_id} {TRIP_COUNTS}")
        while True:
            what, _, _, stamp_ns = self._told.get(timeout=WAIT_S)
            if what == "trip":
                return stamp_ns

    def forget(self) -> None:
        """What was told so far belongs to an earlier stop."""
        while not self._told.empty():
            self._told.get()

    def close(self) -> None:
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._reader.join()

    def _line(self) -> str:
        if self._process.stdout is None:
            raise RuntimeError("the drives have no pipes")
        return self._process.stdout.readline()

    def _read(self) -> None:
        while line := self._line():
            what, *numbers = line.split()
            node_id, value, stamp_ns = map(int, numbers)
            self._told.put((what, node_id, value, stamp_ns))


@contextmanager
def bus() -> Iterator[Bus]:
    """Eight drives in a process of their own; they send once they are told their rate."""
    command = [sys.executable, "-m", "tests.bench._bus"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        made = Bus(process)
        try:
            yield made
        finally:
            made.close()


@contextmanager
def gateway(folder: Path, drives: Bus, more: str) -> Iterator[tuple[str, int]]:
    """`gwrms gateway` for these drives."""
    more_objects = {(0x3000 + at, 1): bytes(4) for at in range(PARAMETERS // DRIVES)}
    (folder / "drive.eds").write_text(drive_eds(Drive(1).objects | more_objects), encoding="utf-8")
    joints = "".join(JOINT.format(node_id=node_id) for node_id in range(1, DRIVES + 1))
    file = folder / "robot.toml"
    file.write_text(HEAD.format(port=drives.port) + joints + more, encoding="utf-8")
    command = [sys.executable, "-P", "-m", "gateway.main", "gateway", str(file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        said = re.fullmatch(
            r"listening on (\S+):(\d+)\n", process.stdout.readline() if process.stdout else ""
        )
        try:
            if said is None:
                raise RuntimeError("the gateway did not start")
            yield said[1], int(said[2])
        finally:
            process.terminate()


@contextmanager
def telemetry(address: tuple[str, int]) -> Iterator[None]:
    """Two clients that take all there is: every sample as it comes, and 100 rows a second."""
    with ExitStack() as clients:
        for rate_hz in (0, 100):
            client = clients.enter_context(Client(address))
            client.call("stream.start", modules=["component"], rate_hz=rate_hz)
            reader = threading.Thread(target=drain, args=(client,), name="telemetry")
            reader.start()
            clients.callback(reader.join)
            clients.callback(client.socket.shutdown, socket.SHUT_RDWR)
        yield


def drain(client: Client) -> None:
    with contextlib.suppress(ConnectionResetError):  # the end, with something unread
        while client.socket.recv(1 << 20):
            pass


@contextmanager
def busy(port: int) -> Iterator[None]:
    """Clients that ask for all they can, of a computer with many processes."""
    command = [sys.executable, "-m", "tests.bench._clients", str(port)]
    pipe = subprocess.PIPE
    with crowd(PROCESSES), subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        try:
            if process.stdout is None or process.stdout.readline() != "ready\n":
                raise RuntimeError("the clients are not served")
            yield
        finally:
            if process.stdin is not None:
                process.stdin.close()


@contextmanager
def robot(folder: Path, more: str = "", *, loaded: bool = False) -> Iterator[tuple[Bus, Client]]:
    """Drives, gateway and telemetry, all flowing, and a client that stops; `loaded` with all there is."""
    with ExitStack() as stack:
        drives = stack.enter_context(bus())
        if loaded:
            more += BLOCKED.format(port=stack.enter_context(blocked_bus()))
        address = stack.enter_context(gateway(folder, drives, more))
        client = stack.enter_context(Client(address))
        drives.say(f"{RATE}")

        def flows() -> bool:
            quality = client.call("component.snapshot")["quality"]
            return {one["state"] for name, one in quality.items() if name != "beyond"} == {"ok"}

        until(flows, "every drive is there")
        stack.enter_context(busy(address[1]) if loaded else telemetry(address))
        time.sleep(1.0)
        yield drives, client


def stops(folder: Path, *, loaded: bool = False) -> Iterator[Row]:
    """A client's request → the last controlword."""
    row = Row(f"robot.stop: request → last of 8 controlwords{LOADED * loaded}", LIMIT_MS)
    with robot(folder, loaded=loaded) as (drives, client):
        for number in range(STOPS):
            drives.forget()
            began_ns = time.monotonic_ns()
            request = client.request("robot.stop", reason=f"measured {number}")
            row.times_ms.append((drives.quick_stops_ns()[-1] - began_ns) / 1e6)
            client.answer(request)
            time.sleep(0.02 + number % 7 * 0.005)  # at no fixed phase of the telemetry
    yield row


def reactions(folder: Path, *, loaded: bool = False) -> Iterator[Row]:
    """A frame that trips the guard → the first and the last controlword."""
    first = Row(f"guard: frame that trips → first controlword{LOADED * loaded}")
    last = Row(f"guard: frame that trips → last of 8 controlwords{LOADED * loaded}", LIMIT_MS)
    with robot(folder, GUARD, loaded=loaded) as (drives, client):

        def watches() -> bool:
            (rule,) = client.call("robot.describe")["guard"]["rules"]
            return rule["state"] in ("watching", "cleared", "blind")

        missed = 0
        while len(first.times_ms) < STOPS:
            until(watches, "the guard has seen that all is well again")
            drives.forget()
            began_ns = drives.trip(1 + len(first.times_ms) % DRIVES)
            try:
                stamps_ns = drives.quick_stops_ns(CONFIRMED_S)
            except queue.Empty:  # the drives were still confirming, and such a one is not asked twice
                missed += 1
                if missed > STOPS // 10:
                    raise
                continue
            first.times_ms.append((stamps_ns[0] - began_ns) / 1e6)
            last.times_ms.append((stamps_ns[-1] - began_ns) / 1e6)
            time.sleep(0.1 + len(first.times_ms) % 7 * 0.005)
    yield from (first, last)


def plain_script(folder: Path) -> Iterator[Row]:
    """What one writes with canopen: one node after another, its network hearing the same telemetry."""
    logging.getLogger("can").setLevel(logging.ERROR)  # it says each time that a message came in two parts
    row = Row("canopen script: 8 × node.sdo[0x6040].raw = 2, alone")
    path = folder / "drive.eds"
    path.write_text(drive_eds(Drive(1).objects), encoding="utf-8")
    with bus() as drives:
        network = canopen.Network(
            can.Bus("bench", "socketcand", host="127.0.0.1", port=drives.port, tcp_tune=True)
        )
        network.NOTIFIER_CYCLE = 0.1
        network.connect()
        nodes = [network.add_node(at, eds.load(path, at).object_dictionary) for at in range(1, DRIVES + 1)]
        drives.say(f"{RATE}")
        for number in range(STOPS):
            drives.forget()
            began_ns = time.monotonic_ns()
            for node in nodes:
                node.sdo[0x6040].raw = QUICK_STOP
            row.times_ms.append((drives.quick_stops_ns()[-1] - began_ns) / 1e6)
            time.sleep(0.02 + number % 7 * 0.005)
        network.disconnect()
    yield row


MEASUREMENTS: tuple[Callable[[Path], Iterator[Row]], ...] = (
    stops,
    partial(stops, loaded=True),
    plain_script,
    reactions,
    partial(reactions, loaded=True),
)


def main() -> int:
    """Print the table; 1 where a limit was not kept."""
    rows: list[Row] = []
    load = os.getloadavg()[0] / (os.cpu_count() or 1)
    sys.stdout.write(
        f"Stop: {DRIVES} drives, {RATE:,.0f} TPDOs/s, two clients streaming all of it.\n"
        f"Under load: ten streams, process tables with command lines and {PARAMETERS} parameters ten times\n"
        f"a second, and a second bus that takes nothing. Load of this machine before: {load:.1f} a core\n"
    )
    sys.stdout.write(f"{'':<62}{'n':>5}{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}{'limit':>9}{'p99/lim':>9}\n")
    for measure in MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            for row in measure(Path(folder)):
                rows.append(row)
                sys.stdout.write(row.text)
                sys.stdout.flush()
    sys.stdout.write(json.dumps({"benchmark": "stop", "results": [row.figures for row in rows]}) + "\n")
    return 0 if all(row.kept for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
