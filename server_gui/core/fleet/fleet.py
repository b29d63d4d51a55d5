"""Every robot of the fleet, each followed by itself in the network's one thread."""

import asyncio
import functools
import logging
from collections.abc import Callable, Sequence
from typing import Final

from msgspec.structs import replace

from gateway.client import Address
from server_gui.core.fleet.link_log import LinkLog
from server_gui.core.fleet.link_statistics import LinkReport, LinkStatistics
from server_gui.core.fleet.robot_recording import RobotRecording
from server_gui.core.follow.events import Event
from server_gui.core.follow.feed import Feed, FollowSettings, Tell
from server_gui.core.prediction.adaptation import Wearing
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import NOBODY, Worn

log = logging.getLogger(__name__)

AGAIN_S: Final = 5.0  # before a robot that a mistake of ours has ended is followed anew

Subscriber = Callable[[str, Event], None]  # (robot, event), in the network's thread


class Member:
    """One robot, and who is told of it: what its feed tells is kept first, then counted, logged and shown."""

    def __init__(
        self,
        robot: str,
        address: Address,
        following: FollowSettings,
        keeping: RobotRecording,
        others: Sequence[Tell],
    ) -> None:
        self.statistics = LinkStatistics(address)
        self._robot = robot
        self.keeping = keeping
        subscribers = [keeping.take, self.statistics.take, LinkLog(robot, address).take, *others]
        self._feed = functools.partial(Feed, address, subscribers, following)
        self._live: Feed | None = None

    async def run(self) -> None:
        """Follow the robot until cancelled; a mistake of ours about it ends no other's recording."""
        while True:
            self._live = self._feed()
            try:
                await self._live.run()
            except Exception:
                log.exception("%s: internal error; it is followed anew in %g s", self._robot, AGAIN_S)
            await asyncio.sleep(AGAIN_S)

    def go_on(self, notes: str, worn: Worn) -> None:
        """Record again, and ask once more what the devices are: they may be others by now."""
        self.keeping.go_on(notes, worn)
        if self._live is not None:
            self._live.identify()

    @property
    def session(self) -> str:
        """Name of the present recording; for any thread."""
        return self.keeping.session

    def report(self) -> LinkReport:
        """Return how its link does now."""
        found, keeping = self.statistics.report(self.keeping.session), self.keeping
        return replace(
            found, recording_since_utc_s=keeping.began_s, notes=keeping.notes, wearer=keeping.worn.wearer
        )


class Fleet:
    """The robots of a server; what they send goes to the recorder, before any of `subscribers` is told of it.

    For the network's thread, but for `robots`, `session`, `wearing` and `newest_ns`.
    """

    def __init__(
        self,
        following: FollowSettings,
        recorder: Recorder,
        operator: str = "",
        notes: str = "",
        worn: Worn = NOBODY,
    ) -> None:
        self.subscribers: list[Subscriber] = []  # of the robots that join from now on
        self._following = following
        self._recorder = recorder
        self._operator = operator
        self._notes = notes
        self.is_paused = False  # nothing is recorded, until somebody wants it
        self._worn = worn
        self._members: dict[str, Member] = {}
        self._left: dict[str, Member] = {}  # that are not followed any more
        self._joining: asyncio.Queue[tuple[str, Member]] = asyncio.Queue()
        self._following_tasks: dict[str, asyncio.Task[None]] = {}

    async def run(self) -> None:
        """Follow all of them, and who joins, until cancelled."""
        async with asyncio.TaskGroup() as group:
            while True:
                robot, member = await self._joining.get()
                if self._members.get(robot) is member:  # not left before it was followed
                    self._following_tasks[robot] = group.create_task(member.run())

    def follow(self, robot: str, address: Address) -> None:
        """Follow another robot from now on."""
        keeping = RobotRecording(robot, self._recorder, self._operator, self._notes, self._worn)
        if self.is_paused:
            keeping.pause()
        others = [functools.partial(subscriber, robot) for subscriber in self.subscribers]
        member = Member(robot, address, self._following, keeping, others)
        self._members = self._members | {robot: member}
        self._joining.put_nowait((robot, member))

    def leave(self, robot: str) -> None:
        """Follow a robot no more; its session ends."""
        member = self._members.get(robot)
        if member is None:
            return
        self._left[robot] = member
        self._members = {name: one for name, one in self._members.items() if name != robot}
        task = self._following_tasks.pop(robot, None)
        if task is not None:
            task.cancel()
        self._recorder.leave(robot)

    def pause(self) -> None:
        """Follow all of them as before, and record nothing of it."""
        self.is_paused = True
        for member in self._members.values():
            member.keeping.pause()

    def go_on(self, name: str, wearer: str | None = None) -> None:
        """Record all of them again, in sessions with this name, or without one.

        They are of this wearer, None: of the same as before. What another has agreed to is not known.
        """
        self._notes, self.is_paused = name, False
        if wearer is not None and wearer != self._worn.wearer:
            self._worn = Worn(wearer)
        for member in self._members.values():
            member.go_on(self._notes, self._worn)

    def session(self, robot: str) -> str:
        """Return the name of a robot's present recording."""
        return (self._members.get(robot) or self._left[robot]).session

    def wearing(self, robot: str) -> Wearing:
        """Return the wearer of a robot's present recording."""
        member = self._members.get(robot)
        if member is None or not (session := member.session):
            return Wearing()
        return Wearing(session, member.keeping.worn.wearer)

    def report(self) -> dict[str, LinkReport]:
        """Return how each robot's link does now."""
        return {robot: member.report() for robot, member in self._members.items()}

    @property
    def robots(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._members)

    def recorded(self, at_utc_s: float | None) -> list[str]:
        """Return the robots that are being recorded, and were at this time; None: now."""
        return [
            robot
            for robot, member in self._members.items()
            if (began_s := member.keeping.began_s) is not None and (at_utc_s is None or began_s <= at_utc_s)
        ]

    @property
    def newest_ns(self) -> int | None:
        """When the newest row of any robot came, on our monotonic clock."""
        found = [member.statistics.newest_ns for member in self._members.values()]
        return max((at_ns for at_ns in found if at_ns is not None), default=None)
