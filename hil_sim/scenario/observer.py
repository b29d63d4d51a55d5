"""Watches a gateway and the robot's truth, in simulated time, as long as a scenario runs."""

from collections.abc import Mapping
from typing import Any, Protocol

from hil_sim.clock import MILLISECOND_NS
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.scenario.expectation import Moment, Seen, Track
from hil_sim.scenario.gateway import Answered, GatewayFailed, Result
from hil_sim.scenario.script import GATEWAY_LINES, NEEDS_LEASE
from hil_sim.scenario.truth import truth

_PERIOD_NS = 100 * MILLISECOND_NS
_LEASE_S = 60.0


class Link(Protocol):
    """Connection for queries to a gateway."""

    def ask(self, method: str, params: Result, answered: Answered) -> None: ...


class Observer:
    """Looks ten times a simulated second; `observed` is all that was seen.

    Where the robot has a guard, each look is also for its rules, and for whose stop is held.
    """

    def __init__(self, robot: Exoskeleton, link: Link) -> None:
        self.observed: dict[Track, list[Moment]] = {track: [] for track in Track}
        self._robot = robot
        self._link = link
        self._enums: Mapping[str, Mapping[str, str]] = {}
        self._guarded = False
        self._waiting = 0  # answers to the last look
        link.ask("robot.describe", {}, self._described)
        robot.clock.every(_PERIOD_NS, self._look)

    def note(self, track: Track, values: Mapping[str, Seen]) -> None:
        """Something was seen now."""
        self.observed[track].append(Moment(self._robot.clock.now_s, values))

    def ask(self, key: str, wanted: object) -> None:
        """Ask for what a line says; the answer is seen as `KEY` ("done", or why not) and `KEY.DRIVE`."""
        method, parameter = GATEWAY_LINES[key]

        def answered(result: Result | None, refused: str) -> None:
            drives = {} if result is None else result.get("drives", {})
            words = {f"{key}.{drive}": str(word) for drive, word in drives.items()}
            self.note(Track.ANSWER, {key: refused or "done", **words})

        if key in NEEDS_LEASE:  # without it, what needs it is refused and says so
            self._link.ask("control.acquire", {"ttl_s": _LEASE_S}, lambda _result, _refused: None)
        self._link.ask(method, {parameter: wanted}, answered)

    def _look(self) -> None:
        self.note(Track.TRUTH, truth(self._robot))
        if not self._waiting:
            self._waiting = 1 + self._guarded
            self._link.ask("component.snapshot", {}, self._snapshot)
            if self._guarded:
                self._link.ask("robot.describe", {}, self._rules)

    def _described(self, result: Result | None, refused: str) -> None:
        if result is None:
            raise GatewayFailed(f"robot.describe was refused: {refused}")
        self._enums = {one["name"]: one["enum"] for one in result["channels"] if "enum" in one}
        self._guarded = bool(result["guard"]["rules"])

    def _rules(self, result: Result | None, refused: str) -> None:
        if result is None:
            raise GatewayFailed(f"robot.describe was refused: {refused}")
        self._waiting -= 1
        rules = result["guard"]["rules"]
        held = str(result["stop"]["reason"] or "") if result["stop"]["held"] else ""
        self.note(Track.RULE, {one["name"]: str(one["state"]) for one in rules})
        self.note(Track.REASON, {one["name"]: str(one["reason"] or "") for one in rules})
        self.note(Track.STOP, {one["name"]: _stopped_by(one["name"], held) for one in rules})

    def _snapshot(self, result: Result | None, refused: str) -> None:
        if result is None:
            raise GatewayFailed(f"component.snapshot was refused: {refused}")
        self._waiting -= 1
        quality = result["quality"]
        self.note(Track.STATE, {name: str(one["state"]) for name, one in quality.items()})
        self.note(Track.PROBLEM, {name: str(one["problem"] or "") for name, one in quality.items()})
        values = {name: self._word(name, value) for name, value in result["values"].items()}
        self.note(Track.CHANNEL, values)

    def _word(self, name: str, value: Any) -> Seen:
        if value is None:
            return None
        words = self._enums.get(name)
        return float(value) if words is None else words.get(str(int(value)), str(value))


def _stopped_by(rule: str, held: str) -> str:
    """Return why the robot is held stopped, if the stop's reason names this rule."""
    return held if held.startswith(f"guard rule {rule}: ") else ""
