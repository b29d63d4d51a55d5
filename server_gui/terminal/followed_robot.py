"""One robot at the desk, for a terminal: its station, fed and answered by the network's thread."""

import collections
import concurrent.futures
import functools
from collections.abc import Callable
from typing import Self

from msgspec.structs import replace

from gateway.client import Address
from gateway.wire.resource import ResourceSnapshotParams
from ml.danger.observation import CHANNELS
from server_gui.core.desk.own_load import OwnLoad
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Event, Looked, Telemetry
from server_gui.core.follow.feed import Feed, FollowSettings
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.follow.network import Network
from server_gui.core.follow.news import News, NewsKind
from server_gui.core.tuning.link import CommandLink
from server_gui.core.tuning.writing import WriteState
from server_gui.terminal.danger_prediction import DangerPrediction
from server_gui.terminal.summary import Summary

CLIENT = "gwrms view"
FOLLOWING = FollowSettings(
    CLIENT,
    channels=("*.position", "*.state", "*.error_code", "*.force", "*.tilt_forward", "*.tilt_side"),
    parameters=("gait.*",),
    resources=ResourceSnapshotParams(processes=False),
    journal_s=2.0,  # which tells who has ended a stop
)
EVERY_PARAMETER = replace(FOLLOWING, client="gwrms top", parameters=("*",))
PROCESSES = ResourceSnapshotParams(limit=8)


class FollowedRobot:
    """Use it as a context manager; call `update` often, then read `station`."""

    def __init__(
        self, address: Address, following: FollowSettings = FOLLOWING, *, foresees: bool = False
    ) -> None:
        self.summary: Summary | None = None
        self._mailbox = Mailbox()
        self._posted: collections.deque[Callable[[], None]] = collections.deque()
        self._network = Network()
        self._link = CommandLink(
            self._network,
            address,
            self._mailbox.put,
            lambda: self._posted.append(self.station.lost_control),
            following.client,
            PROCESSES,
        )
        self.station = Station(str(address), str(address), self._link, self._posted.append, News())
        self.station.is_overloaded = OwnLoad().is_overloaded
        self.station.predictions.foresees = foresees
        self._foreseeing: DangerPrediction | None = None
        if foresees:
            self._foreseeing = DangerPrediction(
                str(address), functools.partial(self.station.tell, NewsKind.WARNING)
            )
            following = replace(following, channels=(*following.channels, *CHANNELS))
        self._feed = Feed(address, [self._mailbox.put], following)
        self._running: list[concurrent.futures.Future[None]] = []
        self._given_back = 0  # the revision of what was written when the lease was given back

    def __enter__(self) -> Self:
        self._network.__enter__()
        self.station.show_processes(wanted=True)
        self._running = [self._network.run(part.run()) for part in (self._feed, self._link)]
        return self

    def __exit__(self, *exc: object) -> None:
        self._network.__exit__(*exc)

    def update(self) -> None:
        """Take the events since the last call."""
        for running in self._running:
            if running.done():
                running.result()  # it ends only by a mistake of ours, which must not stay unseen
        for _ in range(len(self._posted)):
            self._posted.popleft()()
        events = self._mailbox.drain()
        self.station.take(events)
        for news in () if self._foreseeing is None else self._foreseeing.take(events):
            self.station.take_prediction(news)
        if self.summary is not None:
            self._add_up(self.summary, events)
        self._give_back_control()

    def is_whole(self) -> bool:
        """Return whether every component of the robot is there and its values are live."""
        robot = self.station.robot
        return bool(robot.parts) and not robot.not_ok() and not robot.is_stale()

    def begin_summary(self) -> Summary:
        """Add up what comes from now on."""
        robot = self.station.robot
        self.summary = Summary.of(robot.names("joint"), robot.names("insole"))
        return self.summary

    def _add_up(self, summary: Summary, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, Telemetry):
                summary.take(event.batch)
            elif isinstance(event, Looked):
                for part in self.station.robot.parts.values():
                    summary.see(part.name, part.state)

    def _give_back_control(self) -> None:
        """Release the lease when nothing is being written."""
        control, writing = self.station.control, self.station.writing
        wanted = control.until_ns is not None and writing.state is not WriteState.WRITING
        if wanted and writing.revision != self._given_back:
            self._given_back = writing.revision
            self.station.release_control()
