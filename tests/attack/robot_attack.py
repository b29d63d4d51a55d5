"""An attack on the robot under load: measured without it, with it, and after it, in one run.

One client asks for stops, again and again; every fourth comes from somebody who connects for it. In between
a drive sends a frame that trips the guard. Meanwhile heartbeats and streams are recorded by those who get
them.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from hil_sim.sensors.suite import SensorChoice
from tests.attack.attack import DeviceAttack, Lengths, Result, Strike
from tests.attack.barrage import Said, printable
from tests.attack.machine import BUSY_MS, Stalls
from tests.attack.robot import SOON_S, Robot, robot
from tests.attack.robot_file import ARMED_MS
from tests.bench._drives import DRIVES
from tests.unit.gateway.harness import Answered, Client

STOP_LIMIT_MS = 20.0  # by which the 99th percentile may be more than without the attack
GUARD_LIMIT_MS = 100.0  # from the frame that trips to the last controlword, each time
MEMORY_LIMIT = 1.20  # of what it was before, some time after the attack
PATIENCE_S = 5.0  # who is not answered by then was refused
TRIED_S = 1.5  # by who may change nothing, before the first stop
ROUND = 8  # of each so many, two stops are by newcomers, and one is the guard's
_NEWCOMERS, _GUARDS = (2, 5), (7,)
_ALL = tuple(range(1, DRIVES + 1))

COLUMNS = (
    "stop p50/p99",
    "under attack",
    "p99 +",
    "refused",
    "guard",
    "beat",
    "lost",
    "CPU %",
    "MB before",
    "peak",
    "after",
)


def percentile(times_ms: list[float], share: float) -> float:
    """A percentile; of nothing, it is not a number."""
    ordered = sorted(times_ms)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")


@dataclass
class Phase:
    """What was measured in one part of the run."""

    stops_ms: list[float] = field(default_factory=list)
    newcomers_ms: list[float] = field(default_factory=list)  # those of them by newcomers
    answers_ms: list[float] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)  # why
    guard_ms: list[float] = field(default_factory=list)
    guard_missed: int = 0
    gap_ms: float = 0.0
    stall_ms: float = 0.0  # of the machine
    cpu: float = 0.0  # of the gateway: 1 is a whole core
    streams: dict[str, float] = field(default_factory=dict)

    @property
    def lost(self) -> int:
        return int(self.streams["lost"] + self.streams["gaps"])


class Stopping:
    """The client that stops, the newcomers, and the guard's frames."""

    def __init__(self, victim: Robot, nodes: tuple[int, ...]) -> None:
        self._victim = victim
        self._nodes = nodes
        self._client: Client | None = None
        self._number = 0

    def measure(self, seconds: float) -> Phase:
        """Stops and trips for so long."""
        stalls = Stalls()
        stalls.start()
        try:
            phase = self._measured(seconds)
        finally:
            stall_ms = stalls.stop()
        return replace(phase, stall_ms=stall_ms)

    def _measured(self, seconds: float) -> Phase:
        phase, until = Phase(), time.monotonic() + seconds
        self._victim.streams.report()
        self._victim.bus.take_gap_ms()
        began, used_s = time.monotonic(), self._victim.cpu_s
        while time.monotonic() < until:
            self._number += 1
            self._one(phase)
            time.sleep(0.02 + self._number % 7 * 0.005)  # at no fixed phase of the telemetry
        phase.cpu = (self._victim.cpu_s - used_s) / (time.monotonic() - began)
        phase.gap_ms = self._victim.bus.take_gap_ms()
        phase.streams = self._victim.streams.report()
        return phase

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def _one(self, phase: Phase) -> None:
        place = self._number % ROUND
        if place in _GUARDS:
            self._trip(phase)
        elif place in _NEWCOMERS:
            before = len(phase.stops_ms)
            self._stop(phase, self._newcomer)
            phase.newcomers_ms += phase.stops_ms[before:]
        else:
            self._stop(phase, self._resident)

    def _stop(self, phase: Phase, ask: Callable[[], object]) -> None:
        """From the request to the last controlword, or to the answer where that comes first."""
        self._victim.bus.forget()
        began_ns = time.monotonic_ns()
        try:
            ask()
        except (OSError, Answered, ValueError) as error:
            phase.refused.append(f"{type(error).__name__}: {error}")
            self.close()
            return
        answered_ns = time.monotonic_ns()
        acted_ns = self._victim.bus.stopped(self._nodes, began_ns, SOON_S)
        phase.answers_ms.append((answered_ns - began_ns) / 1e6)
        phase.stops_ms.append((min(answered_ns, acted_ns or answered_ns) - began_ns) / 1e6)

    def _resident(self) -> object:
        if self._client is None:
            self._client = patient(self._victim.address)
        return self._client.call("robot.stop", reason=f"measured {self._number}")

    def _newcomer(self) -> object:
        client = patient(self._victim.address)
        with client:
            return client.call("robot.stop", reason=f"measured {self._number}, newly come")

    def _trip(self, phase: Phase) -> None:
        time.sleep(0.1)  # who is being stopped is not asked twice
        self._victim.bus.forget()
        began_ns = self._victim.bus.trip(self._nodes[self._number // ROUND % len(self._nodes)])
        acted_ns = self._victim.bus.stopped(self._nodes, began_ns, 1.0)
        if acted_ns is None:
            phase.guard_missed += 1
        else:
            phase.guard_ms.append((acted_ns - began_ns) / 1e6)
        time.sleep(0.1)


def patient(address: tuple[str, int]) -> Client:
    """One that takes no answer for a refusal."""
    client = Client(address)
    client.socket.settimeout(PATIENCE_S)
    return client


class Attacker:
    """A strike in a process of its own."""

    def __init__(self, strike: Strike, address: tuple[str, int], seconds: float) -> None:
        command = [sys.executable, "-m", "tests.attack._attacker", strike.name]
        command += [str(address[1]), str(seconds)]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._seconds = seconds

    def told(self) -> Said:
        """Wait for its end."""
        try:
            out, _ = self._process.communicate(timeout=self._seconds + PATIENCE_S * 4)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return Said("the attacker did not end")
        return Said(**json.loads(out)) if out else Said("the attacker failed")


def measure(strike: Strike, lengths: Lengths) -> Result:
    """By clients."""
    with tempfile.TemporaryDirectory() as folder, robot(Path(folder)) as victim:
        early = Said("")
        if strike.changes_nothing:  # while a write would be done
            early = Attacker(strike, victim.address, TRIED_S).told()
        attackers: list[Attacker] = []

        def strike_now() -> Callable[[], Said]:
            attackers.append(Attacker(strike, victim.address, lengths.attack_s))
            return attackers[0].told

        result = _Run(victim, _ALL, lengths).result(strike.name, strike_now)
        more = _changed(victim, early) if strike.changes_nothing else ()
        return _with(result, more)


def measure_device(attack: DeviceAttack, lengths: Lengths) -> Result:
    """By something on the robot's own wires."""
    choice = SensorChoice(attack.imu, attack.insole)
    with tempfile.TemporaryDirectory() as folder, robot(Path(folder), choice) as victim:
        part, what = (victim.bus, attack.name) if attack.sensor is None else (victim.sensors, attack.sensor)

        def strike_now() -> Callable[[], Said]:
            part.say(f"hostile {what}")
            return end

        def end() -> Said:
            said = problems(victim)
            part.say("hostile none")
            return said

        return _Run(victim, attack.nodes, lengths).result(attack.name, strike_now)


def problems(victim: Robot) -> Said:
    """What the gateway says of its devices."""
    try:
        components = victim.ask("robot.describe")["components"]
    except (OSError, Answered, ValueError) as error:
        return Said(printable(f"{type(error).__name__}: {error}"))
    named = [f"{one['name']}: {one['problem']}" for one in components if one["problem"]]
    return Said(printable(named[0] if named else "nothing is said of it"))


def _changed(victim: Robot, early: Said) -> tuple[str, ...]:
    wrote = (f"{victim.bus.wrote} parameters written",) if victim.bus.wrote else ()
    return (*wrote, "answered") if early.answered else wrote


def _with(result: Result, broken: tuple[str, ...]) -> Result:
    return replace(result, broken=(*result.broken, *broken))


class _Run:
    """One run of one attack."""

    def __init__(self, victim: Robot, nodes: tuple[int, ...], lengths: Lengths) -> None:
        self._victim = victim
        self._lengths = lengths
        self._stopping = Stopping(victim, nodes)

    def result(self, name: str, strike: Callable[[], Callable[[], Said]]) -> Result:
        victim, lengths = self._victim, self._lengths
        try:
            time.sleep(1.0)
            quiet = self._stopping.measure(lengths.quiet_s)
            before_mb = victim.rss_mb
            victim.forget_peak()
            told = strike()
            time.sleep(0.3)
            attacked = self._stopping.measure(lengths.attack_s - 0.3)
            said = told()
            peak_mb = victim.peak_mb
            time.sleep(lengths.after_s)
            memory = (before_mb, peak_mb, victim.rss_mb)
        except (FileNotFoundError, ProcessLookupError, IndexError) as error:
            return Result(name, COLUMNS, ("",) * len(COLUMNS), (f"the gateway has ended: {error}",), "")
        finally:
            self._stopping.close()
        return _judged(name, quiet, attacked, memory, said)


def _judged(
    name: str, quiet: Phase, attacked: Phase, memory: tuple[float, float, float], said: Said
) -> Result:
    more_ms = percentile(attacked.stops_ms, 0.99) - percentile(quiet.stops_ms, 0.99)
    worst_ms = max(attacked.guard_ms, default=float("nan"))
    cells = (
        f"{percentile(quiet.stops_ms, 0.5):.1f}/{percentile(quiet.stops_ms, 0.99):.1f}",
        f"{percentile(attacked.stops_ms, 0.5):.1f}/{percentile(attacked.stops_ms, 0.99):.1f}",
        f"{more_ms:+.1f}",
        f"{len(attacked.refused)}",
        f"{worst_ms:.1f}" + f" −{attacked.guard_missed}" * bool(attacked.guard_missed),
        f"{attacked.gap_ms:.0f}",
        f"{attacked.lost}",
        f"{100 * quiet.cpu:.0f}/{100 * attacked.cpu:.0f}",
        *(f"{one:.1f}" for one in memory),
    )
    figures = {
        "quiet": asdict(quiet),
        "attacked": asdict(attacked),
        "rss_mb": dict(zip(("before", "peak", "after"), memory, strict=True)),
        "told": asdict(said),
    }
    anyway = set(_broken_in(quiet))  # then this machine is too busy to tell
    broken = tuple(
        f"{limit} (without it too)" if limit in anyway else limit
        for limit in _broken(more_ms, attacked, memory)
    )
    return Result(name, COLUMNS, cells, broken, said.text, tuple(_notes(attacked)), figures)


def _notes(attacked: Phase) -> Iterator[str]:
    if attacked.stall_ms > BUSY_MS:
        yield f"this machine kept an ordinary thread waiting for {attacked.stall_ms:.0f} ms"
    if attacked.refused:
        yield f"refused: {printable(attacked.refused[0])}"
    for who, times_ms in (("answers", attacked.answers_ms), ("newcomers' stops", attacked.newcomers_ms)):
        yield f"{who}: p50 {percentile(times_ms, 0.5):.1f} ms, p99 {percentile(times_ms, 0.99):.1f} ms"


def _broken(more_ms: float, attacked: Phase, memory: tuple[float, float, float]) -> Iterator[str]:
    """The limits that were not kept. A comparison with no number is not kept."""
    if not more_ms <= STOP_LIMIT_MS:
        yield "stop"
    yield from _broken_in(attacked)
    if not memory[2] <= MEMORY_LIMIT * memory[0]:
        yield "memory"


def _broken_in(phase: Phase) -> Iterator[str]:
    """Those that need no comparison."""
    if phase.refused:
        yield "refused"
    if phase.guard_missed or not max(phase.guard_ms, default=float("nan")) <= GUARD_LIMIT_MS:
        yield "guard"
    if not phase.gap_ms <= ARMED_MS:
        yield "heartbeat"
    if phase.lost:
        yield "rows"
    if phase.streams["ended"]:
        yield "streams ended"
