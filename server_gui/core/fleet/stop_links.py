"""Links over which rules stop robots: open all the time, because a stop must not wait for a connection."""

import concurrent.futures
from collections.abc import Callable, Sequence

from gateway.client import Address
from gateway.wire.stop import Stopped
from server_gui.core.follow.network import Network
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.tuning.link import CommandLink

StopRobot = Callable[[str, str], "concurrent.futures.Future[Stopped]"]  # (robot, reason); from any thread


class StopLinks:
    """One command link to each robot that a rule may stop, beside the feed: no telemetry is before a stop."""

    def __init__(self, network: Network, rules: Sequence[RuleSettings]) -> None:
        self._network = network
        self._rules = [rule for rule in rules if rule.action is Action.STOP]
        self._links: dict[str, CommandLink] = {}
        self._running: list[concurrent.futures.Future[None]] = []

    def follow(self, robot: str, address: Address) -> None:
        """Hold a link to this robot from now on, if any rule may stop it."""
        if any(rule.concerns(robot) for rule in self._rules):
            link = CommandLink(
                self._network, address, lambda _event: None, lambda: None, "gwrms collect (rules)"
            )
            self._links[robot] = link
            self._running.append(self._network.run(link.run()))

    def stop(self, robot: str, reason: str) -> "concurrent.futures.Future[Stopped]":
        """Quick stop on every drive of a robot."""
        return self._links[robot].stop(reason)

    def look(self) -> None:
        """Raise the mistake of ours that has ended a link, if one has."""
        for running in self._running:
            if running.done() and not running.cancelled():
                running.result()
