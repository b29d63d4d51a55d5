"""A robot, asked over asyncio: every method of the wire with its types."""

import contextlib
from collections.abc import AsyncIterator, Iterable, Mapping
from typing import Self

from gateway.client.address import Address
from gateway.client.errors import LinkLost, NotConnected, RemoteError
from gateway.client.link import Link, LinkSettings, OnState
from gateway.client.subscription import Subscription
from gateway.wire.bus import BUS_SNAPSHOT, Buses
from gateway.wire.component import COMPONENT_SNAPSHOT, STATUS_SNAPSHOT, Snapshot, SnapshotParams
from gateway.wire.control import (
    CONTROL_ACQUIRE,
    CONTROL_RELEASE,
    JOURNAL_HEAD,
    JOURNAL_TAIL,
    AcquireParams,
    JournalEntries,
    JournalProof,
    Lease,
    ReleaseParams,
    TailParams,
)
from gateway.wire.cost import GATEWAY_COST, GatewayCost
from gateway.wire.dictionary import (
    OBJECT_LIST,
    OBJECT_READ,
    ObjectList,
    ObjectListParams,
    ObjectReadParams,
    ObjectValues,
)
from gateway.wire.method import Params
from gateway.wire.parameter import (
    PARAMETER_CONFIRM,
    PARAMETER_READ,
    PARAMETER_RESTORE,
    PARAMETER_REVERT,
    PARAMETER_STORE,
    PARAMETER_WRITE,
    ComponentParams,
    Confirmed,
    ParameterParams,
    ParameterValues,
    ParameterWriteParams,
    Reverted,
    Stored,
    WriteNumberParams,
    Written,
)
from gateway.wire.resource import (
    RESOURCE_OVERRUNS,
    RESOURCE_SNAPSHOT,
    Overruns,
    ResourceSnapshot,
    ResourceSnapshotParams,
)
from gateway.wire.robot import ROBOT_DESCRIBE, Description
from gateway.wire.stop import (
    ROBOT_ENABLE,
    ROBOT_RESET,
    ROBOT_STOP,
    Enabled,
    EnableParams,
    Reset,
    StopParams,
    Stopped,
)
from gateway.wire.stream import ModuleName, StreamStartParams

WRITE_TIMEOUT_S = 30.0  # a transaction over several drives, verified and perhaps rolled back
STORE_TIMEOUT_S = 120.0  # devices write their memory, and are compared before and after
STOP_TIMEOUT_S = 5.0
LEADING_TIMEOUT_S = 30.0  # drives are led from state to state, each confirmed
LEASE_MARGIN_S = 5.0  # beyond a trial's time, for what is said at its end to come through
LONGEST_LEASE_S = 300.0


class Client:
    """One robot.

    `async with Client("127.0.0.1:7420") as robot` connects or raises; afterwards the link is made again
    whenever it drops. A server that must not fail because a robot is off calls `link.start()` instead and
    watches `link.state`.

    Ordering: requests are sent in the order of the calls; answers may come in another. Loss: a call is sent
    at once (a stop within a second) and once, or raises; one that fails with `LinkLost` or `CallTimeout` may
    have been carried out. Cancellation: forgets the answer, undoes nothing.
    """

    def __init__(
        self,
        address: Address | str = "",
        settings: LinkSettings | None = None,
        on_state: OnState | None = None,
    ) -> None:
        where = Address.parse(address) if isinstance(address, str) else address
        self.link = Link(where, settings or LinkSettings(), on_state)
        self._writing: list[float] = []  # blocks that hold the lease, each with how long it asked for it
        self._trying: set[int] = set()  # writes on trial that were neither confirmed nor reverted here

    async def __aenter__(self) -> Self:
        self.link.start()
        try:
            await self.link.first_attempt()
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(self, *exc: object) -> None:
        await self.close()

    async def close(self) -> None:
        """End the link and every stream. Idempotent."""
        await self.link.close()

    async def describe(self) -> Description:
        """Return the robot's description: its components, channels and modules."""
        return await self.link.call(ROBOT_DESCRIBE, Params())

    async def resources(self, params: ResourceSnapshotParams | None = None) -> ResourceSnapshot:
        """CPU, memory and processes; percentages are None the first time on a link."""
        return await self.link.call(RESOURCE_SNAPSHOT, params or ResourceSnapshotParams())

    async def components(self, *channels: str) -> Snapshot:
        """Return the newest value of the channels (globs; none means all)."""
        return await self.link.call(COMPONENT_SNAPSHOT, SnapshotParams(list(channels) or None))

    async def buses(self) -> Buses:
        """Every CAN bus with its nodes, and who talks on it; gateways of before 0.1 do not know this."""
        return await self.link.call(BUS_SNAPSHOT, Params())

    async def cost(self) -> GatewayCost:
        """Return the cost of monitoring on the robot; rates are since the last call, None the first time."""
        return await self.link.call(GATEWAY_COST, Params())

    async def overruns(self) -> Overruns:
        """Late cycles of the robot's control loop since the last call; watched while the link lasts."""
        return await self.link.call(RESOURCE_OVERRUNS, Params())

    async def status(self) -> Snapshot:
        """Return the merged set that status prediction needs."""
        return await self.link.call(STATUS_SNAPSHOT, Params())

    @contextlib.asynccontextmanager
    async def subscribe(
        self,
        *channels: str,
        rate_hz: float = 50.0,
        modules: Iterable[ModuleName] = ("component",),
        depth: int = 1024,
    ) -> AsyncIterator[Subscription]:
        """Return a stream of these channels (globs; none means all), started again on every new link.

        `rate_hz` 0 gives every sample of every source. At most `depth` notifications wait to be taken.
        """
        request = StreamStartParams(list(modules), rate_hz, list(channels) or None)
        subscription = await self.link.subscribe(request, depth)
        try:
            yield subscription
        finally:
            await self.link.unsubscribe(subscription)

    async def read(self, *names: str) -> ParameterValues:
        """Parameters (globs; none means all) as the devices hold them now."""
        return await self.link.call(PARAMETER_READ, ParameterParams(list(names) or None), WRITE_TIMEOUT_S)

    async def objects(self, component: str, search: str = "") -> ObjectList:
        """Return the objects of a component by its EDS.

        `search`: an address, a range, or words of the name.
        """
        return await self.link.call(OBJECT_LIST, ObjectListParams(component, search))

    async def read_objects(self, component: str, *objects: str) -> ObjectValues:
        """Return a device's present values of objects such as `0x6041:0`; at most 64."""
        params = ObjectReadParams(component, list(objects))
        return await self.link.call(OBJECT_READ, params, WRITE_TIMEOUT_S)

    async def acquire(self, ttl_s: float = 60.0) -> Lease:
        """Become the one writer for `ttl_s` seconds (at most 300); again to stay it."""
        return await self.link.call(CONTROL_ACQUIRE, AcquireParams(ttl_s))

    async def release(self) -> None:
        """Let others write."""
        await self.link.call(CONTROL_RELEASE, ReleaseParams())

    async def write(self, changes: Mapping[str, float], trial_s: float | None = None) -> Written:
        """Change parameters, all or none, read back. Needs the lease.

        With `trial_s` (at most 300) the robot takes them back by itself unless they are confirmed: after that
        time, and at once when the lease or the connection ends.

        Raises:
            RemoteError: refused or rolled back; `kind` and `data` say why.

        """
        return await self.link.call(
            PARAMETER_WRITE, ParameterWriteParams(dict(changes), trial_s), WRITE_TIMEOUT_S
        )

    async def confirm(self, write: int) -> Confirmed:
        """Keep the values on trial; raises `RemoteError` if it has ended, or they have changed."""
        number = WriteNumberParams(write)
        ended = await self.link.call(PARAMETER_CONFIRM, number, WRITE_TIMEOUT_S)
        self._trying.discard(write)
        return ended

    async def revert(self, write: int) -> Reverted:
        """Take back what is on trial; raises `RemoteError` where it has ended, or could not be taken back."""
        number = WriteNumberParams(write)
        ended = await self.link.call(PARAMETER_REVERT, number, WRITE_TIMEOUT_S)
        self._trying.discard(write)
        return ended

    @contextlib.asynccontextmanager
    async def trial(self, changes: Mapping[str, float], trial_s: float) -> AsyncIterator[Written]:
        """Try parameters for a block; what was not confirmed in it is taken back at its end.

        The lease is given back at the end of the block, and ends soon after the trial's time in any case.

        async with robot.trial({"gait.step_length": 0.42}, trial_s=30) as written:
            ...
            await robot.confirm(written.write)
        """
        async with self.writing(min(trial_s + LEASE_MARGIN_S, LONGEST_LEASE_S)):
            await self.acquire(min(max(self._writing) + WRITE_TIMEOUT_S, LONGEST_LEASE_S))
            written = await self.write(changes, trial_s)
            self._trying.add(written.write)
            try:
                await self.acquire(max(self._writing))  # it is written: others are told when they may write
                yield written
            finally:  # before the lease is given back: that would take it back too, but is answered sooner
                if written.write in self._trying:
                    self._trying.discard(written.write)
                    await self._take_back(written.write)

    async def _take_back(self, write: int) -> None:
        try:
            await self.revert(write)
        except (NotConnected, LinkLost):  # the lease went with the connection, and the trial with it
            return
        except RemoteError as error:
            # It has ended: confirmed, taken over, or with its connection.
            if error.kind not in ("unknown_name", "no_lease"):
                raise

    async def store(self, component: str) -> Stored:
        """Make a device keep its parameters over a reset (1010h). Needs the lease.

        Raises:
            RemoteError: refused, and why; with `device_timeout` nobody knows whether it stored.

        """
        return await self.link.call(PARAMETER_STORE, ComponentParams(component), STORE_TIMEOUT_S)

    async def restore(self, component: str) -> Stored:
        """Make a device take its defaults at its next reset (1011h). Needs the lease; raises as `store`."""
        return await self.link.call(PARAMETER_RESTORE, ComponentParams(component), STORE_TIMEOUT_S)

    async def journal(self, count: int = 20) -> JournalEntries:
        """Return the newest entries of the robot's journal, oldest first."""
        return await self.link.call(JOURNAL_TAIL, TailParams(count))

    async def journal_head(self) -> JournalProof:
        """Return the journal's newest entry, signed by the robot.

        Whoever keeps it can tell if it is rewritten.
        """
        return await self.link.call(JOURNAL_HEAD, Params())

    @contextlib.asynccontextmanager
    async def writing(self, ttl_s: float = 60.0) -> AsyncIterator[None]:
        """Hold the lease for a block: `async with robot.writing(): await robot.write(…)`.

        Within such a block another one keeps it: what is on trial in the outer one stays so.
        """
        await self.acquire(max(ttl_s, *self._writing, 0.0))
        self._writing.append(ttl_s)
        try:
            yield
        finally:
            self._writing.remove(ttl_s)
            if not self._writing:
                await self._give_back()

    async def _give_back(self) -> None:
        """Release the lease, unless it has gone with a connection, perhaps an earlier one."""
        try:
            await self.release()
        except (NotConnected, LinkLost):
            return
        except RemoteError as error:
            if error.kind != "no_lease":
                raise

    async def stop(self, reason: str) -> Stopped:
        """Quick stop on every drive. Not a safety-rated stop; look at what each drive confirmed.

        Where there is no link, one is tried for at once and again, for a second at most.

        Raises:
            ClientError: the robot did not answer; consider it NOT stopped.

        """
        return await self.link.call(ROBOT_STOP, StopParams(reason), STOP_TIMEOUT_S)

    async def reset(self) -> Reset:
        """End a held stop: every drive led to switch on disabled, never further. Needs the lease.

        Look at `held`: the stop stays where it is not known of every drive that it cannot move.
        """
        return await self.link.call(ROBOT_RESET, Params(), LEADING_TIMEOUT_S)

    async def enable(self, *joints: str) -> Enabled:
        """Enable drives (globs; none means all), as the master of their bus. Needs the lease.

        Look at `problems`: where there are any, what was begun has been stopped again.
        """
        params = EnableParams(list(joints) or None)
        return await self.link.call(ROBOT_ENABLE, params, LEADING_TIMEOUT_S)
