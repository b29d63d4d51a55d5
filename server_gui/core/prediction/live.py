"""Robots followed and predicted without being recorded, for a terminal."""

import collections
import threading
from collections.abc import Mapping, Sequence
from typing import Final, Self

from gateway.client import Address
from gateway.wire.messages import ResourceSnapshotParams
from ml.robot.groups import GROUPS
from server_gui.core.follow.events import Event, LinkChanged
from server_gui.core.follow.feed import ONCE, Feed, Following, Tell
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.follow.network import Network
from server_gui.core.follow.robot import Robot
from server_gui.core.prediction.current import StationPredictions
from server_gui.core.prediction.news import Foreseen
from server_gui.core.prediction.service import Predicting
from server_gui.core.settings.server_file import ServerSettings

MOST: Final = 10_000  # foreseen, that wait for nobody


class Watched:
    """A robot, and what is predicted of it."""

    def __init__(self) -> None:
        self.robot = Robot()
        self.predictions = StationPredictions()


class Live:
    """Follows robots from entering to leaving; use it as a context manager. No rule stops a robot here."""

    def __init__(self, settings: ServerSettings, robots: Mapping[str, Address]) -> None:
        self.robots = {name: Watched() for name in robots}
        self._addresses = robots
        self._following = Following(
            "gwrms predict",
            channels=tuple(name for group in GROUPS.values() for name in group),
            parameters=(),
            rate_hz=settings.recorder.rate_hz,
            look_s=1.0,
            resources=ResourceSnapshotParams(processes=False),
            resources_s=ONCE,
        )
        self._foreseen: collections.deque[Foreseen] = collections.deque(maxlen=MOST)
        self._mailboxes = {name: Mailbox() for name in robots}
        self._network = Network()
        self._came = threading.Event()
        self._predicting = Predicting(settings, self._foresee)

    def __enter__(self) -> Self:
        self._predicting.__enter__()
        self._network.__enter__()
        for name, address in self._addresses.items():
            self._network.run(Feed(address, self._teller(name), self._following).run())
        return self

    def __exit__(self, *exc: object) -> None:
        self._network.__exit__(*exc)
        self._predicting.__exit__(*exc)

    def look(self, within_s: float) -> Sequence[Foreseen]:
        """Wait so long for something to be foreseen, and apply what has come; all that was foreseen since."""
        self._came.wait(within_s)
        self._came.clear()
        for name, mailbox in self._mailboxes.items():
            for event in mailbox.drain():
                self.robots[name].robot.apply(event)
                if isinstance(event, LinkChanged):
                    self.robots[name].predictions.clear()
        found = [self._foreseen.popleft() for _ in range(len(self._foreseen))]
        for one in found:
            self.robots[one.robot].predictions.take(one)
        return found

    def _foresee(self, news: Sequence[Foreseen]) -> None:
        self._foreseen.extend(news)
        self._came.set()

    def _teller(self, name: str) -> Tell:
        def tell(event: Event) -> None:
            self._predicting.take(name, event)
            self._mailboxes[name].put(event)

        return tell
