"""Follows one robot in the network's thread and tells its subscribers what it sees. It commands nothing."""

import asyncio
import contextlib
import fnmatch
import math
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from msgspec import Struct

from gateway.certificates import KeyProblem
from gateway.client import (
    Address,
    CallTimeout,
    Client,
    ClientError,
    ConnectionState,
    LinkLost,
    LinkSettings,
    NotConnected,
    NotPaired,
    ProtocolError,
    RemoteError,
    WrongRobot,
)
from gateway.client.backoff import Backoff
from gateway.wire.control import SignedHead
from gateway.wire.resource import ResourceSnapshotParams
from gateway.wire.robot import Description
from server_gui.core.follow.events import (
    BusesSeen,
    Described,
    Event,
    Failed,
    Identified,
    Journalled,
    LinkChanged,
    Looked,
    Refused,
    Resources,
    Telemetry,
)
from server_gui.core.follow.journal_witness import signed_head
from server_gui.core.follow.validation import Unfit, Validator, journal

Tell = Callable[[Event], None]

ONCE: Final = math.inf  # a period: once on every link
AGAIN_S: Final = 5.0  # before a look that failed is tried again
IDENTIFY_AGAIN_S: Final = (5.0, 15.0, 60.0)  # until what a device has not told is asked again
DEPTH: Final = 8192  # notifications; more than one read of the socket can bring
WHOLE_JOURNAL: Final = 1000  # entries; as many as a gateway gives at once
METHOD_NOT_FOUND: Final = -32601  # JSON-RPC 2.0 §5.1: a gateway of before
IDENTITY: Final = "0x1008-0x1018"  # where CiA 301 has what a device is
ASKED: Final = ("0X1009:0", "0X100A:0", "0X1018:1", "0X1018:2", "0X1018:3", "0X1018:4")
COMPUTER: Final = "resource"  # the component whose channels are the robot's computer


class FollowSettings(Struct, frozen=True):
    """Settings of following a robot; `channels` and `parameters` are globs.

    What of them this robot does not have is left out. `rate_hz` 0 gives every source's own samples.
    """

    client: str
    channels: tuple[str, ...]
    parameters: tuple[str, ...] = ("*",)
    rate_hz: float = 50.0
    look_s: float = 0.5  # quality and parameters
    resources: ResourceSnapshotParams = ResourceSnapshotParams(limit=8)
    resources_s: float = 1.0
    journal_s: float | None = None  # None: it is not asked for
    buses_s: float | None = None  # likewise
    identities: bool = False  # whether each device is asked once what it is: firmware, serial number


class Feed:
    """One robot, followed from `run` until that is cancelled.

    Each of `subscribers` is called in the network's thread with every event that may be kept, in order; for
    one event those before come before those after.
    """

    def __init__(self, address: Address, subscribers: Sequence[Tell], following: FollowSettings) -> None:
        self._subscribers = subscribers
        self._following = following
        self._address = address
        self._client = Client(address, LinkSettings(client=following.client), self._link_changed)
        self._backoff = Backoff()
        self._arriving = Validator()
        self._dropped = asyncio.Event()
        self._identify = asyncio.Event()
        self._newest_entry: dict[str, Any] = {"n": 0}

    async def run(self) -> None:
        """Follow the robot until cancelled, over every link that there is."""
        self._client.link.start()
        try:
            while True:
                await self._client.link.connected()
                # In a task of its own: a group that fails as it is cancelled forgets that it is cancelled.
                following = asyncio.create_task(self._follow())
                try:
                    await asyncio.wait([following])
                finally:
                    following.cancel()
                    await asyncio.wait([following])
                self._ended(following)
                await asyncio.sleep(self._backoff.next_s())
        finally:
            self._subscribers = ()  # another feed may go by this robot's name already
            await self._client.close()

    def identify(self) -> None:
        """Ask each device once more what it is, where that is asked at all; for the network's thread."""
        self._identify.set()

    def _ended(self, following: "asyncio.Task[None]") -> None:
        try:
            following.result()
        except* (NotConnected, LinkLost):
            pass  # the link has told so itself
        except* Unfit as unfit:
            for error in unfit.exceptions:
                self._tell(Refused("its description is refused", str(error)))
        except* ClientError as errors:
            for one in errors.exceptions:
                self._tell(Failed("following the robot", str(one)))

    def _tell(self, event: Event) -> None:
        for tell in self._subscribers:
            tell(event)

    def _link_changed(self, state: ConnectionState) -> None:
        if state is ConnectionState.CONNECTED:
            self._backoff.reset()
        else:
            self._dropped.set()
        problem = self._client.link.problem
        said, is_another = None if problem is None else str(problem), isinstance(problem, WrongRobot)
        self._tell(LinkChanged(state, said, time.monotonic_ns(), is_another))

    async def _follow(self) -> None:
        """Everything that goes on while one link lasts; ends by raising why it cannot go on."""
        following = self._following
        self._dropped.clear()
        async with asyncio.TaskGroup() as group:
            group.create_task(self._until_dropped())
            description = await self._client.describe()
            calendar_ns = description.clock.utc_ns - time.time_ns()
            self._admit(Described(description, calendar_ns, self._client.link.hello))
            group.create_task(self._stream(self._channels(description)))
            changeable = (known.name for known in description.parameters if known.read_only is None)
            parameters = _matching(following.parameters, changeable)
            group.create_task(self._repeat(following.look_s, lambda: self._look(parameters)))
            group.create_task(self._repeat(following.resources_s, self._resources))
            if following.journal_s is not None:
                group.create_task(self._repeat(following.journal_s, self._journal))
            if following.identities:
                self._identify.set()
                group.create_task(self._identities(description))
            if following.buses_s is not None:
                group.create_task(self._repeat_buses(following.buses_s))

    def _admit(self, event: Event) -> None:
        """Pass an event on if it can be recorded; raises `Unfit` if not."""
        self._arriving.check(event)
        self._tell(event)

    async def _until_dropped(self) -> None:
        """Another link may be to another robot, or to one that has changed: then everything begins anew."""
        await self._dropped.wait()
        raise LinkLost("the link dropped")

    def _channels(self, description: Description) -> list[str]:
        known = (channel.name for channel in description.channels if channel.component != COMPUTER)
        return _matching(self._following.channels, known)

    async def _stream(self, channels: Sequence[str]) -> None:
        if not channels:
            globs = ", ".join(self._following.channels)
            self._tell(Failed("the stream", f"the robot has no channel {globs} (gwrms describe lists them)"))
            return
        rate_hz, clock = self._following.rate_hz, self._client.link.clock
        async with self._client.subscribe(*channels, rate_hz=rate_hz, depth=DEPTH) as stream:
            async for batch in stream:
                try:
                    self._admit(Telemetry(stream.stream or 0, batch, clock.offset, rate_hz))
                except Unfit as error:
                    self._tell(Refused("its rows are refused", str(error)))

    async def _look(self, parameters: Sequence[str]) -> None:
        quality = await self._client.components()
        values = await self._client.read(*parameters) if parameters else None
        self._admit(Looked(quality, values, time.monotonic_ns()))

    async def _resources(self) -> None:
        snapshot = await self._client.resources(self._following.resources)
        link = self._client.link
        self._admit(Resources(snapshot, link.clock.round_trip_ns, time.monotonic_ns(), link.received_bytes))

    async def _repeat_buses(self, period_s: float) -> None:
        """As long as the robot can be asked: a gateway of before does not know how."""
        while True:
            try:
                seen = await self._client.buses()
            except RemoteError as error:
                self._tell(BusesSeen(None, time.monotonic_ns()))
                if error.code == METHOD_NOT_FOUND:
                    return
                self._tell(Failed("a look at its buses", str(error)))
            except (CallTimeout, ProtocolError) as error:
                self._tell(Failed("a look at its buses", str(error)))
            else:
                self._tell(BusesSeen(tuple(seen.buses), time.monotonic_ns()))
            await asyncio.sleep(period_s)

    async def _journal(self) -> None:
        """Tell the newest entries when there are new ones, without a hole as far as the robot has them."""
        found = await self._client.journal()
        journal(found.entries)
        if found.entries and found.entries[0]["n"] > self._newest_entry["n"] + 1:
            found = await self._client.journal(WHOLE_JOURNAL)
        if found.entries and found.entries[-1] != self._newest_entry:
            head = await self._signed_head()
            if head is not None and head.n > found.entries[-1]["n"]:
                found = await self._client.journal(WHOLE_JOURNAL)
            self._admit(Journalled(found, head))
            self._newest_entry = found.entries[-1]

    async def _identities(self, description: Description) -> None:
        """Ask a device only for what its EDS knows; one that cannot be asked costs no other."""
        names = [part.name for part in description.components if isinstance(part.device, dict)]
        while True:
            await self._identify.wait()
            self._identify.clear()
            await self._identify_all(names)

    async def _identify_all(self, names: Sequence[str]) -> None:
        """Those that do not tell everything are asked again a few times: a robot may be busy."""
        found: dict[str, Mapping[str, str]] = {}
        missing = list(names)
        for pause_s in (*IDENTIFY_AGAIN_S, None):
            missing = [name for name in missing if not await self._identify_one(name, found)]
            try:
                self._admit(Identified(dict(found)))
            except Unfit as error:
                self._tell(Refused("what its devices are is refused", str(error)))
            if not missing or pause_s is None:
                return
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._identify.wait(), pause_s)
                return  # all are to be asked anew

    async def _identify_one(self, name: str, found: dict[str, Mapping[str, str]]) -> bool:
        """Put what it tells into `found`; return whether that is all."""
        try:
            listed = await self._client.objects(name, IDENTITY)
            wanted = [one.object for one in listed.objects if one.object.upper() in ASKED]
            values = (await self._client.read_objects(name, *wanted)).values if wanted else {}
        except (RemoteError, CallTimeout, ProtocolError) as error:
            self._tell(Failed(f"what {name} is", str(error)))
            return False
        found[name] = {place.upper(): one.words for place, one in values.items() if not one.problem}
        return len(found[name]) == len(values)

    async def _signed_head(self) -> SignedHead | None:
        """Without it the journal is kept all the same."""
        try:
            return await signed_head(self._client, self._address)
        except (Unfit, KeyProblem, NotPaired) as error:
            self._tell(Refused("its journal is not witnessed", str(error)))
            return None

    async def _repeat(self, period_s: float, look: Callable[[], Awaitable[None]]) -> None:
        while True:
            wait_s = period_s
            try:
                await look()
            except Unfit as error:
                self._tell(Refused("a look at it is refused", str(error)))
                wait_s = min(period_s, AGAIN_S)
            except (RemoteError, CallTimeout, ProtocolError) as error:
                self._tell(Failed("a look at the robot", str(error)))
                wait_s = min(period_s, AGAIN_S)
            await asyncio.sleep(wait_s)


def _matching(globs: Sequence[str], names: Iterable[str]) -> list[str]:
    return [name for name in names if any(fnmatch.fnmatchcase(name, glob) for glob in globs)]
