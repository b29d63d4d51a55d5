"""One robot followed for a view: its feed in the network's thread, its state in ours."""

import concurrent.futures
from collections.abc import Mapping
from typing import Self

from gateway.client import Address
from server_gui.core.follow.events import Failed, Looked, StopAnswered, Telemetry
from server_gui.core.follow.feed import Feed, Following
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.follow.network import Network
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.robot_processing import RobotProcessing
from server_gui.terminal.summary import Summary

FOLLOWING = Following(
    "gwrms view",
    channels=("*.position", "*.state", "*.force", "*.tilt_forward", "*.tilt_side"),
    parameters=("gait.*",),
)


class Session:
    """Use it as a context manager; call `update` often, then read `robot` and `processing`."""

    def __init__(self, address: Address) -> None:
        self.robot = Robot()
        self.processing = RobotProcessing()
        self.summary: Summary | None = None
        self._mailbox = Mailbox()
        self._network = Network()
        self._feed = Feed(address, self._mailbox.put, FOLLOWING)
        self._following: concurrent.futures.Future[None] | None = None

    def __enter__(self) -> Self:
        self._network.__enter__()
        self._following = self._network.run(self._feed.run())
        return self

    def __exit__(self, *exc: object) -> None:
        self._network.__exit__(*exc)

    def update(self) -> None:
        """Take what has come since the last time."""
        if self._following is not None and self._following.done():
            self._following.result()  # it ends only by a mistake of ours, which must not stay unseen
        for event in self._mailbox.drain():
            self.robot.apply(event)
            self.processing.apply(event)
            if self.summary is None:
                continue
            if isinstance(event, Telemetry):
                self.summary.take(event.batch)
            elif isinstance(event, Looked):
                for part in self.robot.parts.values():
                    self.summary.see(part.name, part.state)

    def is_whole(self) -> bool:
        """Whether every component of the robot is there and its values are live."""
        return bool(self.robot.parts) and not self.robot.not_ok() and not self.robot.is_stale()

    def begin_summary(self) -> Summary:
        """Add up what comes from now on."""
        self.summary = Summary.of(self.robot.names("joint"), self.robot.names("insole"))
        return self.summary

    # --- what keys can ask for

    def write(self, changes: Mapping[str, float]) -> "concurrent.futures.Future[None]":
        """Change parameters; the outcome comes as an event."""
        return self._network.run(self._feed.write(changes))

    def stop(self, reason: str) -> "concurrent.futures.Future[StopAnswered | Failed]":
        """Quick stop on every drive; the outcome comes as an event."""
        return self._network.run(self._feed.stop(reason))
