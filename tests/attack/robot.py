"""The robot that is attacked: drives, sensors, gateway and five clients that stream, each its own process."""

import contextlib
import itertools
import json
import re
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim.sensors.suite import SensorChoice
from tests.attack import robot_file
from tests.attack._bus import Drive
from tests.bench._daemons import Cost
from tests.support.waiting import until
from tests.unit.gateway.harness import Client

RATE = 2000.0  # TPDOs a second
QUICK_STOP = 0x0002
TRIP_COUNTS = 1_000_000  # a position that no drive is at
WAIT_S = 30.0
SOON_S = 0.01  # what a drive has told is read until then


class Part:
    """A process that is told lines and tells lines, and ends with its input."""

    def __init__(self, module: str, *arguments: str) -> None:
        pipe = subprocess.PIPE
        command = [sys.executable, "-m", f"tests.attack.{module}", *arguments]
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def say(self, line: str) -> None:
        if self._process.stdin is not None:
            self._process.stdin.write(f"{line}\n")
            self._process.stdin.flush()

    def line(self) -> str:
        """What it tells next; empty at its end."""
        return "" if self._process.stdout is None else self._process.stdout.readline()

    def close(self) -> None:
        with contextlib.suppress(BrokenPipeError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        self._process.wait(WAIT_S)
        if self._process.stdout is not None:
            self._process.stdout.close()


class Bus(Part):
    """The drives' process, and what it has told: stamps are ns of the one monotonic clock."""

    def __init__(self, rate: float) -> None:
        super().__init__("_bus", str(rate))
        self.port = int(self.line())
        self.wrote = 0  # parameters
        self._told = threading.Condition()
        self._stops: deque[tuple[int, int]] = deque(maxlen=100_000)  # when, and which node
        self._beats: list[int] = []
        self._trips: deque[int] = deque()
        self._reader = threading.Thread(target=self._read, name="what the bus tells")
        self._reader.start()

    def stopped(self, nodes: Iterable[int], since_ns: int, within_s: float) -> int | None:
        """When the last of these nodes got its first quick stop since then; waits for it."""
        wanted = set(nodes)
        until_s = time.monotonic() + within_s
        with self._told:
            while True:
                first: dict[int, int] = {}
                for stamp_ns, node_id in self._stops:
                    if stamp_ns >= since_ns and node_id in wanted:
                        first.setdefault(node_id, stamp_ns)
                if len(first) == len(wanted):
                    return max(first.values())
                left_s = until_s - time.monotonic()
                if left_s <= 0 or not self._told.wait(left_s):
                    return None

    def trip(self, node_id: int) -> int:
        """Send a frame that trips the rule; returns when it went out."""
        with self._told:
            self._trips.clear()
            self.say(f"trip {node_id} {TRIP_COUNTS}")
            if not self._told.wait_for(lambda: self._trips, WAIT_S):
                raise RuntimeError("the drives do not answer")
            return self._trips.popleft()

    def take_gap_ms(self) -> float:
        """The longest time without a heartbeat of the gateway since the last call, up to now."""
        with self._told:
            beats, self._beats = self._beats, self._beats[-1:]
        stamps = [*beats, time.monotonic_ns()]
        return max((after - before for before, after in itertools.pairwise(stamps)), default=0) / 1e6

    def forget(self) -> None:
        """What was told so far belongs to earlier stops."""
        with self._told:
            self._stops.clear()

    def close(self) -> None:
        super().close()
        self._reader.join()

    def _read(self) -> None:
        with contextlib.suppress(ValueError):  # closed
            while line := self.line():
                what, *numbers = line.split()
                self._note(what, *map(int, numbers))

    def _note(self, what: str, node_id: int, value: int, stamp_ns: int) -> None:
        with self._told:
            if what == "word" and value == QUICK_STOP:
                self._stops.append((stamp_ns, node_id))
            elif what == "beat":
                self._beats.append(stamp_ns)
            elif what == "trip":
                self._trips.append(stamp_ns)
            elif what == "wrote":
                self.wrote += 1
            self._told.notify_all()


class Streams(Part):
    """The five clients."""

    def __init__(self, port: int) -> None:
        super().__init__("_streams", str(port))
        if self.line() != "ready\n":
            raise RuntimeError("the streams do not flow")

    def report(self) -> dict[str, float]:
        """What came since the last one."""
        self.say("report")
        found: dict[str, float] = json.loads(self.line())
        return found


@dataclass
class Robot:
    """All of it, running."""

    folder: Path
    bus: Bus
    sensors: Part
    address: tuple[str, int]
    pid: int
    streams: Streams

    @property
    def rss_mb(self) -> float:
        return Cost.of(self.pid).memory_kb["rss"] / 1024

    @property
    def cpu_s(self) -> float:
        """What the gateway has worked since it began."""
        return Cost.of(self.pid).cpu_ms / 1e3

    def forget_peak(self) -> None:
        """From now on, `peak_mb` is of what comes."""
        Path(f"/proc/{self.pid}/clear_refs").write_text("5", encoding="ascii")

    @property
    def peak_mb(self) -> float:
        status = Path(f"/proc/{self.pid}/status").read_text(encoding="ascii", errors="replace")
        return int(re.findall(r"VmHWM:\s+(\d+) kB", status)[0]) / 1024

    def ask(self, method: str, **params: Any) -> Any:
        """By a client that comes only for that."""
        with Client(self.address) as client:
            return client.call(method, **params)


@contextmanager
def gateway(file: Path) -> Iterator[tuple[int, tuple[str, int]]]:
    """`gwrms gateway`; its log is beside the file. It is killed: its end is refused while drives are on."""
    command = [sys.executable, "-P", "-m", "gateway.main", "gateway", str(file)]
    with (
        (file.parent / "gateway.log").open("wb") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True) as process,
    ):
        try:
            line = process.stdout.readline() if process.stdout else ""
            said = re.fullmatch(r"listening on (\S+):(\d+)\n", line)
            if said is None:
                raise RuntimeError("the gateway did not start")
            yield process.pid, (said[1], int(said[2]))
        finally:
            process.kill()


@contextmanager
def robot(folder: Path, choice: SensorChoice | None = None, rate: float = RATE) -> Iterator[Robot]:
    """Everything is there, armed and flowing."""
    choice = choice or SensorChoice()
    with ExitStack() as stack:
        bus = _entered(stack, Bus(rate))
        sensors = _entered(stack, Part("_sensors", str(folder), choice.insole, choice.imu))
        if sensors.line() != "ready\n":
            raise RuntimeError("the sensors did not start")
        file = robot_file.write(folder, bus.port, choice, Drive(1).objects)
        pid, address = stack.enter_context(gateway(file))
        _until_armed(address)
        yield Robot(folder, bus, sensors, address, pid, _entered(stack, Streams(address[1])))


def _entered(stack: ExitStack, part: Any) -> Any:
    stack.callback(part.close)
    return part


def _until_armed(address: tuple[str, int]) -> None:
    """Every component is well, and every drive armed."""
    with Client(address) as client:

        def is_whole() -> bool:
            description = client.call("robot.describe")
            arming = description["guard"]["arming"].values()
            components = [
                one for one in description["components"] if one["kind"] in ("joint", "insole", "imu")
            ]
            return all(one["state"] == "ok" for one in components) and all(
                text.startswith("armed") for text in arming
            )

        until(is_whole, "every drive is armed")
