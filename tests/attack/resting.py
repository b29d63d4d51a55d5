"""An attack on a daemon at rest: again and again it is woken up by somebody who has gone already.

Its victim has no bus and no guard, because with a guard a gateway never rests. Each measured stop is a cold
one where nobody attacks; it is reset at once, because who holds a stop does not rest either.
"""

import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.attack.attack import Lengths, Result, Strike
from tests.attack.barrage import Said, Target

CONNECTIONS = 1000
BURST, PAUSE_S = 50, 0.5  # so many at once, then nobody: time enough to rest again
RESTS_WITHIN_S = 20.0
COLUMNS = ("stop p50/p99", "under attack", "p99 +", "refused", "MB at rest", "after", "rests in s")


def bursts(target: Target) -> Said:
    """At least a thousand connections, and for as long as it lasts."""
    until, made, refused, error = time.monotonic() + target.seconds, 0, 0, None
    while made < CONNECTIONS or time.monotonic() < until:
        made += 1
        try:
            target.connect().close()
        except OSError as failed:
            refused, error = refused + 1, error or str(failed)
        if made % BURST == 0:
            time.sleep(PAUSE_S)
    return Said.of(None, error, answered=False, ended=refused)


@dataclass
class _Stops:
    times_ms: list[float] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)

    def ask(self, address: tuple[str, int]) -> None:
        """A stop by a newcomer, to its answer; then it is reset."""
        from tests.attack.robot_attack import patient
        from tests.unit.gateway.harness import Answered

        began_ns = time.monotonic_ns()
        try:
            with patient(address) as client:
                client.call("robot.stop", reason="measured")
                self.times_ms.append((time.monotonic_ns() - began_ns) / 1e6)
                client.call("control.acquire", ttl_s=5)
                client.call("robot.reset")
        except (OSError, Answered, ValueError) as error:
            self.refused.append(f"{type(error).__name__}: {error}")


@dataclass(frozen=True)
class RestingAttack(Strike):
    """Its victim is not the robot under load."""

    def measure(self, lengths: Lengths) -> Result:
        from tests.attack.robot import gateway
        from tests.unit.gateway.processes import RESTS_SOON, resident_mb

        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "robot.toml"
            file.write_text(RESTS_SOON + 'records = "records"\n', encoding="utf-8")
            with gateway(file) as (pid, address):
                quiet, attacked = _Stops(), _Stops()
                for _ in _until(lengths.quiet_s):
                    _await_rest(pid)
                    quiet.ask(address)
                _await_rest(pid)
                before_mb = resident_mb(pid)
                said = self._attack(address, lengths.attack_s, attacked)
                rest_s = _await_rest(pid)
                time.sleep(min(1.0, lengths.after_s))
                _await_rest(pid)
                return _judged(self.name, quiet, attacked, (before_mb, resident_mb(pid), rest_s), said)

    def _attack(self, address: tuple[str, int], seconds: float, stops: _Stops) -> Said:
        from tests.attack.robot_attack import Attacker

        attacker = Attacker(self, address, seconds)
        for _ in _until(seconds):
            time.sleep(0.2)
            stops.ask(address)
        return attacker.told()


def _until(seconds: float) -> Iterable[None]:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        yield


def _await_rest(pid: int) -> float:
    """How long it took; the most that is waited, where it does not rest."""
    from tests.unit.gateway.processes import rests

    began = time.monotonic()
    while not rests(pid) and time.monotonic() - began < RESTS_WITHIN_S:
        time.sleep(0.02)
    return time.monotonic() - began


def _judged(
    name: str, quiet: _Stops, attacked: _Stops, rest: tuple[float, float, float], said: Said
) -> Result:
    from tests.attack.robot_attack import percentile

    before_mb, after_mb, rest_s = rest
    more_ms = percentile(attacked.times_ms, 0.99) - percentile(quiet.times_ms, 0.99)
    cells = (
        *(
            f"{percentile(one.times_ms, 0.5):.1f}/{percentile(one.times_ms, 0.99):.1f}"
            for one in (quiet, attacked)
        ),
        f"{more_ms:+.1f}",
        f"{len(attacked.refused)}",
        f"{before_mb:.1f}",
        f"{after_mb:.1f}",
        f"{rest_s:.1f}",
    )
    figures = {"quiet": quiet.__dict__, "attacked": attacked.__dict__, "told": said.__dict__}
    return Result(
        name,
        COLUMNS,
        cells,
        tuple(_broken(more_ms, attacked, rest)),
        said.text,
        tuple(attacked.refused[:1]),
        figures,
    )


def _broken(more_ms: float, attacked: _Stops, rest: tuple[float, float, float]) -> Iterator[str]:
    from tests.attack.robot_attack import MEMORY_LIMIT, STOP_LIMIT_MS

    before_mb, after_mb, rest_s = rest
    if not more_ms <= STOP_LIMIT_MS:
        yield "stop"
    if attacked.refused:
        yield "refused"
    if not after_mb <= MEMORY_LIMIT * before_mb:
        yield "memory"
    if rest_s >= RESTS_WITHIN_S:
        yield "rest"


ATTACKS = (RestingAttack("resting", "connections that are closed at once, while it rests", bursts),)
