"""A line in the log when a robot's link comes or goes, or something cannot be done: each said once."""

import logging

from gateway.client import Address, ConnectionState
from server_gui.core.follow.events import Described, Event, Failed, LinkChanged, Refused

log = logging.getLogger(__name__)


class LinkLog:
    """One robot's lines. What goes on as it was, such as a robot that stays away, is not said again."""

    def __init__(self, robot: str, address: Address) -> None:
        self._robot = robot
        self._address = address
        self._linked = False
        self._said: dict[str, str] = {}  # what → why, since the link was made

    def take(self, event: Event) -> None:
        """Log an event, if it is news."""
        match event:
            case LinkChanged(state=ConnectionState.CONNECTED):
                self._linked = True
                self._said.clear()
            case LinkChanged(state=ConnectionState.WAITING, problem=problem):
                self._warn("link dropped" if self._linked else "no link", problem or "it was closed")
                self._linked = False
            case Described():
                channels = len(event.description.channels)
                log.info("%s: linked to %s, %d channels", self._robot, self._address, channels)
            case Refused() if event.what in self._said:
                pass  # it may lie in ever other words
            case Failed():
                self._warn(event.what, event.reason)

    def _warn(self, what: str, why: str) -> None:
        if self._said.get(what) != why:
            self._said[what] = why
            log.warning("%s: %s: %s", self._robot, what, why)
