"""Robots followed and predicted without being recorded, for a terminal."""

import collections
import functools
import threading
from collections.abc import Mapping, Sequence
from typing import Final, Self

from gateway.client import Address
from gateway.wire.resource import ResourceSnapshotParams
from ml.danger.observation import CHANNELS
from ml.robot.groups import GROUPS
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.feed import ONCE, Feed, FollowSettings, Tell
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.follow.network import Network
from server_gui.core.follow.robot import Robot
from server_gui.core.prediction.newest_predictions import StationPredictions
from server_gui.core.prediction.news import PredictionNews
from server_gui.core.prediction.service import PredictionService
from server_gui.core.settings.server_file import ServerSettings

MOST: Final = 10_000  # predictions, that wait for nobody


class Watched:
    """A robot, and what is predicted of it."""

    def __init__(self, *, foresees: bool = False) -> None:
        self.robot = Robot()
        self.predictions = StationPredictions(foresees=foresees)


class Live:
    """Follows robots from entering to leaving; use it as a context manager. No rule stops a robot here."""

    def __init__(self, settings: ServerSettings, robots: Mapping[str, Address]) -> None:
        self.robots = {name: Watched(foresees=settings.prediction.danger) for name in robots}
        self._addresses = robots
        self._following = FollowSettings(
            "gwrms predict",
            channels=tuple({name for group in GROUPS.values() for name in group} | {*CHANNELS}),
            parameters=(),
            rate_hz=settings.recorder.rate_hz,
            look_s=1.0,
            resources=ResourceSnapshotParams(processes=False),
            resources_s=ONCE,
        )
        self._predicted: collections.deque[PredictionNews] = collections.deque(maxlen=MOST)
        self._mailboxes = {name: Mailbox() for name in robots}
        self._network = Network()
        self._came = threading.Event()
        self._predicting = PredictionService(settings, self._take)

    def __enter__(self) -> Self:
        self._predicting.__enter__()
        self._network.__enter__()
        for name, address in self._addresses.items():
            subscribers: list[Tell] = [
                functools.partial(self._predicting.take, name),
                self._mailboxes[name].put,
            ]
            self._network.run(Feed(address, subscribers, self._following).run())
        return self

    def __exit__(self, *exc: object) -> None:
        self._network.__exit__(*exc)
        self._predicting.__exit__(*exc)

    def look(self, within_s: float) -> Sequence[PredictionNews]:
        """Wait so long for a prediction, apply what has come, and return all predictions since."""
        self._came.wait(within_s)
        self._came.clear()
        for name, mailbox in self._mailboxes.items():
            for event in mailbox.drain():
                self.robots[name].robot.apply(event)
                if isinstance(event, LinkChanged):
                    self.robots[name].predictions.clear()
        found = [self._predicted.popleft() for _ in range(len(self._predicted))]
        for one in found:
            self.robots[one.robot].predictions.take(one)
        return found

    def _take(self, news: Sequence[PredictionNews]) -> None:
        self._predicted.extend(news)
        self._came.set()
