"""Every robot of the fleet, each followed by itself in the network's one thread."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from typing import Final

from gateway.client import Address
from server_gui.core.fleet.link_log import Saying
from server_gui.core.fleet.link_statistics import LinkReport, LinkStatistics
from server_gui.core.fleet.robot_recording import Keeping
from server_gui.core.follow.events import Event, Failed, StopAnswered
from server_gui.core.follow.feed import Feed, Following
from server_gui.core.recording.recorder import Recorder

log = logging.getLogger(__name__)

AGAIN_S: Final = 5.0  # before a robot that a mistake of ours has ended is followed anew

Show = Callable[[str, Event], None]


class Member:
    """One robot: what its feed tells is kept first, then counted, said and shown."""

    def __init__(
        self, robot: str, address: Address, following: Following, keeping: Keeping, show: Show | None
    ) -> None:
        self.statistics = LinkStatistics(address)
        self._robot = robot
        self._address = address
        self._following = following
        self._keeping = keeping
        self._saying = Saying(robot, address)
        self._show = show
        self._feed = Feed(address, self._tell, following)

    async def run(self) -> None:
        """Follow the robot until cancelled; a mistake of ours about it ends no other's recording."""
        while True:
            try:
                await self._feed.run()
            except Exception:
                log.exception("%s: internal error; it is followed anew in %g s", self._robot, AGAIN_S)
            await asyncio.sleep(AGAIN_S)
            self._feed = Feed(self._address, self._tell, self._following)

    async def stop(self, reason: str) -> StopAnswered | Failed:
        """Quick stop on every drive, over the link that there is."""
        return await self._feed.stop(reason)

    @property
    def session(self) -> str:
        """What the recording that goes on is called; for any thread."""
        return self._keeping.session

    def report(self) -> LinkReport:
        """How its link does now."""
        return self.statistics.report(self._keeping.session)

    def _tell(self, event: Event) -> None:
        self._keeping.take(event)
        self.statistics.take(event)
        self._saying.take(event)
        if self._show is not None:
            self._show(self._robot, event)


class Fleet:
    """The robots of a server; everything that they send goes to the recorder, before `show` is told of it.

    For the network's thread, but for `robots`, `session` and `newest_ns`.
    """

    def __init__(
        self,
        robots: Mapping[str, Address],
        following: Following,
        recorder: Recorder,
        operator: str = "",
        notes: str = "",
        show: Show | None = None,
    ) -> None:
        self._members: dict[str, Member] = {}
        self._joining: asyncio.Queue[Member] = asyncio.Queue()

        def member(robot: str, address: Address) -> Member:
            return Member(robot, address, following, Keeping(robot, recorder, operator, notes), show)

        self._member = member
        for robot, address in robots.items():
            self.follow(robot, address)

    async def run(self) -> None:
        """Follow all of them, and who joins, until cancelled."""
        async with asyncio.TaskGroup() as group:
            while True:
                group.create_task((await self._joining.get()).run())

    def follow(self, robot: str, address: Address) -> None:
        """Another robot, from now on."""
        member = self._member(robot, address)
        self._members = self._members | {robot: member}
        self._joining.put_nowait(member)

    async def stop(self, robot: str, reason: str) -> StopAnswered | Failed:
        """Quick stop on every drive of a robot."""
        return await self._members[robot].stop(reason)

    def session(self, robot: str) -> str:
        """What a robot's recording that goes on is called."""
        return self._members[robot].session

    def report(self) -> dict[str, LinkReport]:
        """How each robot's link does now."""
        return {robot: member.report() for robot, member in self._members.items()}

    @property
    def robots(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self._members)

    @property
    def newest_ns(self) -> int | None:
        """When the newest row of any robot came, on our monotonic clock."""
        found = [member.statistics.newest_ns for member in self._members.values()]
        return max((at_ns for at_ns in found if at_ns is not None), default=None)
