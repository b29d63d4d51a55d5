"""Watches a gateway and the robot's truth, in simulated time, as long as a scenario runs."""

from collections.abc import Mapping
from typing import Any

from hil_sim.clock import MILLISECOND_NS
from hil_sim.exoskeleton import Exoskeleton
from hil_sim.scenario.expectation import Moment, Seen, Track
from hil_sim.scenario.gateway import GatewayFailed, GatewayLink, Result
from hil_sim.scenario.truth import truth

_PERIOD_NS = 50 * MILLISECOND_NS


class Observer:
    """Looks twenty times a simulated second; `observed` is all that was seen."""

    def __init__(self, robot: Exoskeleton, link: GatewayLink) -> None:
        self.observed: dict[Track, list[Moment]] = {track: [] for track in Track}
        self._robot = robot
        self._link = link
        self._enums: Mapping[str, Mapping[str, str]] = {}
        self._answered = True
        link.ask("robot.describe", {}, self._described)
        robot.clock.every(_PERIOD_NS, self._look)

    def note(self, track: Track, values: Mapping[str, Seen]) -> None:
        """Something was seen now."""
        self.observed[track].append(Moment(self._robot.clock.now_s, values))

    def _look(self) -> None:
        self.note(Track.TRUTH, truth(self._robot))
        if self._answered:
            self._answered = False
            self._link.ask("component.snapshot", {}, self._snapshot)

    def _described(self, result: Result | None, refused: str) -> None:
        if result is None:
            raise GatewayFailed(f"robot.describe was refused: {refused}")
        self._enums = {one["name"]: one["enum"] for one in result["channels"] if "enum" in one}

    def _snapshot(self, result: Result | None, refused: str) -> None:
        if result is None:
            raise GatewayFailed(f"component.snapshot was refused: {refused}")
        self._answered = True
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
