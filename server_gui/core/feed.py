"""Follows one robot in the network's thread and tells what it sees; carries out what it is told."""

import asyncio
import fnmatch
import time
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence

from gateway.client import (
    Address,
    Batch,
    CallTimeout,
    Client,
    ClientError,
    ConnectionState,
    LinkLost,
    LinkSettings,
    NotConnected,
    RemoteError,
)
from gateway.messages import ResourceSnapshotParams
from server_gui.core.events import (
    STOP,
    Changed,
    Described,
    Event,
    Failed,
    LinkChanged,
    Looked,
    Resources,
    StopAnswered,
    Telemetry,
)

Tell = Callable[[Event], None]

LOOK_PERIOD_S = 0.5  # quality and parameters
RESOURCE_PERIOD_S = 1.0
AGAIN_S = 0.1  # before following anew: a robot that refuses is not asked without pause
LEASE_S = 10.0


class Feed:
    """One robot, followed from `run` until that is cancelled.

    `tell` is called in the network's thread with every event, in order. `channels` are globs; those that this
    robot does not have are left out. Writes take the lease for as long as they last.
    """

    def __init__(
        self,
        address: Address,
        tell: Tell,
        channels: Sequence[str],
        parameters: Sequence[str] = ("*",),
        rate_hz: float = 50.0,
        processes: int = 8,
    ) -> None:
        self._tell = tell
        self._channels = tuple(channels)
        self._parameters = tuple(parameters)
        self._rate_hz = rate_hz
        self._processes = processes
        self._client = Client(address, LinkSettings(client="gwrms view"), self._link_changed)

    async def run(self) -> None:
        """Follow the robot until cancelled, over every link that there is."""
        self._client.link.start()
        try:
            while True:
                await self._client.link.connected()
                try:
                    await self._follow()
                except* (NotConnected, LinkLost):
                    pass  # the link has told so itself
                except* ClientError as errors:
                    for error in errors.exceptions:
                        self._tell(Failed("following the robot", str(error)))
                await asyncio.sleep(AGAIN_S)
        finally:
            await self._client.close()

    async def write(self, changes: Mapping[str, float]) -> None:
        """Change parameters; the lease is taken and given back around it."""
        try:
            async with self._client.writing(LEASE_S):
                self._tell(Changed(await self._client.write(changes)))
        except ClientError as error:
            self._tell(Failed(f"write of {', '.join(changes)}", str(error)))

    async def stop(self, reason: str) -> None:
        """Quick stop on every drive."""
        try:
            self._tell(StopAnswered(await self._client.stop(reason)))
        except ClientError as error:
            self._tell(Failed(STOP, str(error)))

    # --- what goes on by itself

    def _link_changed(self, state: ConnectionState) -> None:
        problem = self._client.link.problem
        self._tell(LinkChanged(state, None if problem is None else str(problem), time.monotonic_ns()))

    async def _follow(self) -> None:
        """Everything that goes on while one link lasts; ends by raising why it cannot go on."""
        async with asyncio.TaskGroup() as group:
            description = await self._client.describe()
            self._tell(Described(description))
            channels = _matching(self._channels, (channel.name for channel in description.channels))
            changeable = (known.name for known in description.parameters if known.read_only is None)
            parameters = _matching(self._parameters, changeable)
            group.create_task(self._stream(channels))
            group.create_task(self._repeat(LOOK_PERIOD_S, lambda: self._look(parameters)))
            group.create_task(self._repeat(RESOURCE_PERIOD_S, self._resources))

    async def _stream(self, channels: Sequence[str]) -> None:
        async with self._client.subscribe(*channels, rate_hz=self._rate_hz) as stream:
            async for batch in stream:
                self._tell(Telemetry(batch, self._age_ns(batch)))

    def _age_ns(self, batch: Batch) -> int | None:
        offset = self._client.link.clock.offset
        if offset is None or not batch.stamps_ns:
            return None
        return max(0, batch.received_ns + offset.offset_ns - batch.stamps_ns[-1])

    async def _look(self, parameters: Sequence[str]) -> None:
        quality = await self._client.components()
        values = await self._client.read(*parameters) if parameters else None
        self._tell(Looked(quality, values, time.monotonic_ns()))

    async def _resources(self) -> None:
        snapshot = await self._client.resources(ResourceSnapshotParams(limit=self._processes))
        self._tell(Resources(snapshot, self._client.link.clock.round_trip_ns, time.monotonic_ns()))

    async def _repeat(self, period_s: float, look: Callable[[], Awaitable[None]]) -> None:
        while True:
            try:
                await look()
            except (RemoteError, CallTimeout) as error:
                self._tell(Failed("a look at the robot", str(error)))
            await asyncio.sleep(period_s)


def _matching(globs: Sequence[str], names: Iterable[str]) -> list[str]:
    return [name for name in names if any(fnmatch.fnmatchcase(name, glob) for glob in globs)]
