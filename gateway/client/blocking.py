"""A robot for scripts: the same client behind plain blocking calls."""

import asyncio
import contextlib
import threading
from collections.abc import Coroutine, Generator, Iterable, Mapping
from typing import Any, Self, TypeVar

from gateway.client.address import Address
from gateway.client.client import Client
from gateway.client.clock import ClockOffset
from gateway.client.link import LinkSettings, OnState
from gateway.client.subscription import Batch
from gateway.wire.bus import Buses
from gateway.wire.component import Snapshot
from gateway.wire.control import JournalEntries, JournalProof
from gateway.wire.cost import GatewayCost
from gateway.wire.dictionary import ObjectList, ObjectValues
from gateway.wire.parameter import Confirmed, ParameterValues, Reverted, Stored, Written
from gateway.wire.resource import Overruns, ResourceSnapshot, ResourceSnapshotParams
from gateway.wire.robot import Description, Hello
from gateway.wire.stop import Enabled, Reset, Stopped
from gateway.wire.stream import ModuleName

Result = TypeVar("Result")
THREAD_NAME = "robot link"


class Robot:
    """One robot, asked with blocking calls from any thread; connects at once or raises.

        with Robot("127.0.0.1:7420") as robot:
            print(robot.read("gait.*").values)
            for batch in robot.watch("left_knee.position", rate_hz=50): ...

    The link lives in a thread of its own, which `close` joins; `on_state` is called there. A call that is
    interrupted (Ctrl-C) forgets its answer, as in `Client`.
    """

    def __init__(
        self,
        address: Address | str = "",
        settings: LinkSettings | None = None,
        on_state: OnState | None = None,
    ) -> None:
        self._client = Client(address, settings, on_state)
        self._loop = asyncio.new_event_loop()
        # Whoever is interrupted before there is a robot to close ends all the same.
        self._thread = threading.Thread(target=self._loop.run_forever, name=THREAD_NAME, daemon=True)
        self._thread.start()
        try:
            self._wait(self._client.__aenter__())
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()

    def close(self) -> None:
        """End the link, its streams and its thread. Idempotent."""
        if self._loop.is_closed():
            return
        try:
            self._wait(self._client.close())
        finally:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    @property
    def clock_offset(self) -> ClockOffset | None:
        """The robot's monotonic clock minus ours; None before the first exchange."""
        return self._client.link.clock.offset

    @property
    def hello(self) -> Hello | None:
        """Identity and permissions of this program on the robot; None before the first greeting."""
        return self._client.link.hello

    def describe(self) -> Description:
        """Return the robot's description: its components, channels and modules."""
        return self._wait(self._client.describe())

    def resources(self, params: ResourceSnapshotParams | None = None) -> ResourceSnapshot:
        """CPU, memory and processes; percentages are None the first time."""
        return self._wait(self._client.resources(params))

    def components(self, *channels: str) -> Snapshot:
        """Return the newest value of the channels (globs; none means all)."""
        return self._wait(self._client.components(*channels))

    def buses(self) -> Buses:
        """Every CAN bus with its nodes, and who talks on it; gateways of before 0.1 do not know this."""
        return self._wait(self._client.buses())

    def cost(self) -> GatewayCost:
        """Return the cost of monitoring on the robot; rates are since the last call, None the first time."""
        return self._wait(self._client.cost())

    def overruns(self) -> Overruns:
        """Late cycles of the robot's control loop since the last call; watched while the link lasts."""
        return self._wait(self._client.overruns())

    def status(self) -> Snapshot:
        """Return the merged set that status prediction needs."""
        return self._wait(self._client.status())

    def watch(
        self,
        *channels: str,
        rate_hz: float = 50.0,
        modules: Iterable[ModuleName] = ("component",),
        depth: int = 1024,
        idle_s: float | None = None,
    ) -> Generator[Batch, None, None]:
        """Batches of these channels for as long as the caller iterates, over dropped links too.

        With `idle_s`, one without rows wherever nothing has come for so long.
        """
        subscribed = self._client.subscribe(*channels, rate_hz=rate_hz, modules=modules, depth=depth)
        stream = self._wait(subscribed.__aenter__())
        try:
            with contextlib.suppress(StopAsyncIteration):
                while True:
                    yield self._wait(stream.next_within(idle_s))
        finally:
            if not self._loop.is_closed():
                self._wait(subscribed.__aexit__(None, None, None))

    def read(self, *names: str) -> ParameterValues:
        """Parameters (globs; none means all) as the devices hold them now."""
        return self._wait(self._client.read(*names))

    def objects(self, component: str, search: str = "") -> ObjectList:
        """Return the objects of a component by its EDS.

        `search`: an address, a range, or words of the name.
        """
        return self._wait(self._client.objects(component, search))

    def read_objects(self, component: str, *objects: str) -> ObjectValues:
        """Return a device's present values of objects such as `0x6041:0`; at most 64."""
        return self._wait(self._client.read_objects(component, *objects))

    def write(self, changes: Mapping[str, float]) -> Written:
        """Take the lease, change parameters (all or none, read back), give the lease back.

        Raises:
            RemoteError: refused or rolled back; `kind` and `data` say why.

        """

        async def write() -> Written:
            async with self._client.writing():
                return await self._client.write(changes)

        return self._wait(write())

    @contextlib.contextmanager
    def trial(self, changes: Mapping[str, float], trial_s: float) -> Generator[Written, None, None]:
        """Try parameters for a block; what was not confirmed in it is taken back at its end.

        with robot.trial({"gait.step_length": 0.42}, trial_s=30) as written:
            ...
            robot.confirm(written.write)
        """
        trying = self._client.trial(changes, trial_s)
        written = self._wait(trying.__aenter__())
        try:
            yield written
        finally:
            self._wait(trying.__aexit__(None, None, None))

    def confirm(self, write: int) -> Confirmed:
        """Keep the values on trial; raises `RemoteError` if it has ended, or they have changed."""
        return self._wait(self._client.confirm(write))

    def revert(self, write: int) -> Reverted:
        """Take back what is on trial; raises `RemoteError` where it has ended, or could not be taken back."""
        return self._wait(self._client.revert(write))

    def store(self, component: str) -> Stored:
        """Take the lease, make a device keep its parameters over a reset (1010h), give the lease back.

        Raises:
            RemoteError: refused, and why; with `device_timeout` nobody knows whether it stored.

        """

        async def store() -> Stored:
            async with self._client.writing():
                return await self._client.store(component)

        return self._wait(store())

    def restore(self, component: str) -> Stored:
        """Return the same for its defaults (1011h), which act after its next reset; raises as `store`."""

        async def restore() -> Stored:
            async with self._client.writing():
                return await self._client.restore(component)

        return self._wait(restore())

    def journal(self, count: int = 20) -> JournalEntries:
        """Return the newest entries of the robot's journal, oldest first."""
        return self._wait(self._client.journal(count))

    def journal_head(self) -> JournalProof:
        """Return the journal's newest entry, signed by the robot.

        Whoever keeps it can tell if it is rewritten.
        """
        return self._wait(self._client.journal_head())

    def stop(self, reason: str) -> Stopped:
        """Quick stop on every drive. Not a safety-rated stop; look at what each drive confirmed."""
        return self._wait(self._client.stop(reason))

    def reset(self) -> Reset:
        """Take the lease, end a held stop, give the lease back; look at `held` and `problems`."""

        async def reset() -> Reset:
            async with self._client.writing():
                return await self._client.reset()

        return self._wait(reset())

    def enable(self, *joints: str) -> Enabled:
        """Take the lease, enable drives (globs; none means all), give it back; look at `problems`."""

        async def enable() -> Enabled:
            async with self._client.writing():
                return await self._client.enable(*joints)

        return self._wait(enable())

    def _wait(self, work: Coroutine[Any, Any, Result]) -> Result:
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        try:
            return future.result()
        except BaseException:
            future.cancel()
            raise
