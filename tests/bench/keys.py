"""What keys cost: a stop over an open link, the first answer of a gateway at rest, and rest itself.

And whether a stop keeps its limit while 200 strangers a second are refused.

Two gateways run beside each other, one with keys and one without, and are asked in turn: what else the
computer does, both have to bear.
"""

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from tests.support.waiting import until
from tests.unit.gateway import processes
from tests.unit.gateway.harness import Client
from tests.unit.gateway.keyed import KeyedClient, keyed

STOPS, WAKES, REST_S = 300, 15, 5.0
GAP_S = 0.03  # who stops more often than that floods the drives, and is read later
LIMIT_MS = 10.0  # of a stop (docs/explanation/stop.md), also where 200 strangers a second knock
MORE_MS, TIMES = 1.0, 1.3  # what a stop and a first answer may take more with keys


class Gateway:
    """One process, and how it is reached."""

    def __init__(self, name: str, folder: Path, opened: ExitStack, linger_s: float) -> None:
        text = processes.RESTS_SOON.replace("0.05", str(linger_s)).replace("exo-test", name)
        (folder / "robot.toml").write_text(text, encoding="utf-8")
        environ = {**os.environ, "XDG_STATE_HOME": str(folder)}
        command = (*processes.GATEWAY, str(folder / "robot.toml"))
        self.name = name
        self.pid = (running := opened.enter_context(processes.process(*command, environ=environ))).pid
        self.address = processes.address(running)
        self._keyed = (folder / "keys").exists()

    def client(self) -> Client:
        return KeyedClient(self.address, "operator") if self._keyed else Client(self.address)

    def first_answer_ms(self) -> float:
        until(lambda: processes.rests(self.pid), "it rests")
        began_ns = time.perf_counter_ns()
        with self.client() as client:
            client.call("clock.read")
            return (time.perf_counter_ns() - began_ns) / 1e6

    def at_rest(self) -> tuple[int, float]:
        """CPU ticks in `REST_S`, and its memory in MB."""
        until(lambda: processes.rests(self.pid), "it rests")
        before = processes.kernel_saw(self.pid)[0:2]
        time.sleep(REST_S)  # what is measured is this time
        return sum(processes.kernel_saw(self.pid)[0:2]) - sum(before), processes.resident_mb(self.pid)


def main() -> int:
    """Exit code 1 where keys cost more than they may."""
    kept = [_stops(), _flooded(), _wakes()]
    return 0 if all(kept) else 1


def _pair(opened: ExitStack, linger_s: float) -> list[Gateway]:
    made = []
    for name in ("without", "with"):
        folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
        if name == "with":
            keyed(folder)
        made.append(Gateway(name, folder, opened, linger_s))
    return made


def _stops() -> bool:
    with ExitStack() as opened:
        clients = [opened.enter_context(one.client()) for one in _pair(opened, 1000)]
        asked: list[Callable[[], object]] = [
            lambda client=client: client.call("robot.stop", reason="bench")  # type: ignore[misc]
            for client in clients
        ]
        for ask in asked:
            ask()  # its modules come up
        found = _in_turn(asked, STOPS)
    p99 = [statistics.quantiles(one, n=100)[98] for one in found]
    for name, times, worst in zip(("without", "with"), found, p99, strict=True):
        _say(f"stop, {name:7} keys: p50 {statistics.median(times):6.2f} ms, p99 {worst:6.2f} ms")
    return _told("a stop over an open link", p99[1] - p99[0] <= MORE_MS, f"p99 {p99[1] - p99[0]:+.2f} ms")


def _flooded() -> bool:
    """Stops of who is let in, while strangers begin `FLOOD` handshakes a second, each of which is refused."""
    with ExitStack() as opened:
        gateway = _pair(opened, 1000)[1]
        client = opened.enter_context(gateway.client())
        stop = [lambda: client.call("robot.stop", reason="bench")]
        stop[0]()
        (quiet,) = _in_turn(stop, STOPS)
        flood = opened.enter_context(
            processes.process(sys.executable, "-m", "tests.bench.strangers", *map(str, gateway.address))
        )
        assert flood.stdout is not None
        flood.stdout.readline()  # from here on they come
        before, began_s = processes.kernel_saw(gateway.pid)[0:2], time.monotonic()
        (flooded,) = _in_turn(stop, STOPS)
        took_s = time.monotonic() - began_s
        flood.terminate()
        knocked = int(flood.communicate()[0] or 0)
        ticks = sum(processes.kernel_saw(gateway.pid)[0:2]) - sum(before)
    p99 = [statistics.quantiles(one, n=100)[98] for one in (quiet, flooded)]
    _say(f"stop, while {knocked / took_s:.0f} handshakes a second are refused: p99 {p99[1]:.2f} ms, "
         f"without {p99[0]:.2f} ms, {p99[1] / p99[0]:.1f} times")  # fmt: skip
    _say(f"a refused handshake: {10 * ticks / max(1, knocked):.2f} ms of the gateway's CPU, stops included")
    return _told("a stop in a flood of strangers", p99[1] <= LIMIT_MS, f"p99 {p99[1]:.2f} of {LIMIT_MS:g} ms")


def _in_turn(asked: list[Callable[[], object]], count: int) -> list[list[float]]:
    found: list[list[float]] = [[] for _ in asked]
    for _ in range(count):
        for ask, times in zip(asked, found, strict=True):
            began_ns = time.perf_counter_ns()
            ask()
            times.append((time.perf_counter_ns() - began_ns) / 1e6)
            time.sleep(GAP_S)
    return found


def _wakes() -> bool:
    with ExitStack() as opened:
        both = _pair(opened, 0.05)
        found = [[], []]  # type: list[list[float]]
        for _ in range(WAKES):
            for one, times in zip(both, found, strict=True):
                times.append(one.first_answer_ms())
        rest = [one.at_rest() for one in both]
    p50 = [statistics.median(one) for one in found]
    for one, first_ms, (ticks, memory_mb) in zip(both, p50, rest, strict=True):
        _say(
            f"rest, {one.name:7} keys: {ticks} ticks, {memory_mb:.1f} MB; first answer p50 {first_ms:.0f} ms"
        )
    first = _told("the first answer", p50[1] <= TIMES * p50[0], f"{p50[1] / p50[0]:.2f} times")
    idle = rest[1][0] == 0 and rest[1][1] <= rest[0][1] + 0.5
    return _told("rest", idle, f"{rest[1][1] - rest[0][1]:+.1f} MB") and first


def _told(what: str, kept: bool, found: str) -> bool:
    _say(f"{what}: {found} with keys, {'kept' if kept else 'NOT KEPT'}")
    return kept


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
