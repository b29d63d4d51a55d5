"""One run: the world, the gateway's present life, what happens to them in which order, and who judges it."""

from collections.abc import Callable
from dataclasses import dataclass

from tests.explore import about_all, about_stops, about_writes  # noqa: F401 - they make themselves known
from tests.explore.can import Sent
from tests.explore.facts import Facts
from tests.explore.gateway_life import Asked, Life
from tests.explore.invariants import EVERYTHING, KNOWN, Judged
from tests.explore.world import World

QUIET_NS = 600_000_000  # so long after the last thing it did, the gateway has come to rest
LONGEST_S = 9.5  # how long that is waited for while something is wrong
HEALED_S = 14.0  # and when nothing is any more


class Violation(Exception):
    """Something that must never be; the text says which sentence does not hold, and how."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What was found: the invariant by its name, and in words what is wrong."""

    invariant: str
    text: str


class Stage:
    """Where a run is played."""

    def __init__(self, world: World, judged: Judged = EVERYTHING) -> None:
        self.world = world
        self.runtime = world.runtime
        self.life = Life(world)
        self.facts = Facts(world, self.life)
        self._listen(self.life)
        self.findings: list[Finding] = []
        self._judged = judged
        self._judges = tuple(KNOWN.always.items())
        self.runtime.after_task = self.judge

    def happened(self) -> None:
        """Something has happened that was not the gateway's doing."""
        self.facts.last_change_ns = self.runtime.now_ns
        self.facts.look_at_devices()

    def fingerprint(self) -> int:
        """What tells this situation from others: where each thread is, the devices, what is kept and held."""
        devices = tuple(device.state for device in self.world.devices.values())
        places = tuple(task.place for task in self.runtime.tasks)
        facts = self.facts
        asked = tuple((one.who, one.method, one.answered_ns is None, one.kind) for one in self.life.asked)
        wires = tuple((wire.blocked, wire.gone, wire.in_flight) for wire in self.world.wires.values())
        told = (facts.undo_bytes, facts.held, tuple(facts.tripped_since), asked, wires)
        return hash((devices, places, told, self.world.disk.full))

    @property
    def frames(self) -> list[Sent]:
        """What was on the buses lately, in its order."""
        return sorted(frame for wire in self.world.wires.values() for frame in wire.frames)

    # What events do

    def ask(self, who: str, method: str, **params: object) -> Asked:
        asked = self.life.ask(who, method, **params)
        self.facts.on_asked(asked)
        return asked

    def stop_by(self, who: str, line: bytes) -> None:
        """A stop in whatever form; nobody waits for its answer."""
        self.life.say(who, line)
        asked = Asked(0, who, "robot.stop", {}, self.runtime.now_ns, lost=True)
        self.facts.on_stop(asked)

    def leave(self, who: str, *, gone: bool = True) -> None:
        self.life.leave(who, gone=gone)
        self.facts.on_left(who)

    def restart(self, *, power: bool = False) -> None:
        """Kill the gateway where it stands; a moment later the next one starts."""
        self.life.kill()
        if power:
            self.world.disk.lose_power()
            for wire in self.world.wires.values():
                wire.lose_power()
        life = Life(self.world)
        self._listen(life)
        self.facts.on_new_life(life)
        self.life = life

    # How it goes on

    def judge(self) -> None:
        """Between two tasks: nothing may be that must never be."""
        self.facts.look()
        for name, check in self._judges:
            for text in check(self.facts):
                self._find(name, text)

    @property
    def quiet(self) -> bool:
        """Whether nothing is under way."""
        facts = self.facts
        if self.runtime.ready or self.runtime.now_ns - facts.last_change_ns < QUIET_NS or facts.undo:
            return False
        return not facts.waiting

    def settle(self, longest_s: float = LONGEST_S) -> bool:
        """Let everything happen until it is quiet; whether it is."""
        return self._run(longest_s, lambda: self.quiet)

    def run_for(self, seconds: float, ended: Callable[[], bool] = lambda: False) -> bool:
        return self._run(seconds, ended)

    def end(self) -> None:
        """All that was wrong is well again: then everything comes to rest, and a reset ends a held stop."""
        self.settle()
        self.heal()
        self.settle(HEALED_S)
        self.run_for(1.0)
        if self.facts.held:
            self._reset()
        for name, check in KNOWN.at_the_end.items():
            for text in check(self.facts):
                self._find(name, text)

    def _reset(self) -> None:
        """Whoever it is can reset a robot that is well."""
        for who in tuple(self.life.people):
            self.leave(who)
        self.run_for(0.1)
        self.ask("carol", "control.acquire", ttl_s=60.0)
        reset = self.ask("carol", "robot.reset")
        self.settle(HEALED_S)
        if self.facts.held:
            self._find("A robot that is well can be reset.", f"{reset.result or reset.error}")

    def heal(self) -> None:
        from tests.explore.events import heal

        heal(self)

    def _run(self, seconds: float, ended: Callable[[], bool]) -> bool:
        found = self.runtime.run_for(seconds, lambda: bool(self.findings) or ended())
        if self.findings:
            raise Violation(f"{self.findings[0].invariant}: {self.findings[0].text}")
        return found

    def _listen(self, life: Life) -> None:
        life.answered, life.cut = self._on_answer, self.facts.on_left

    def _on_answer(self, asked: Asked) -> None:
        self.facts.on_answer(asked)
        for name, check in KNOWN.at_answers.items():
            for text in check(self.facts, asked):
                self._find(name, text)

    def _find(self, invariant: str, text: str) -> None:
        if self._judged.counts(invariant, text):
            self.findings.append(Finding(invariant, text))
