"""Commands to one robot over a link of its own: no telemetry is ever before a STOP."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from typing import Final

from gateway.client import Address, Client, ClientError, ConnectionState, LinkSettings
from gateway.wire.control import Lease
from gateway.wire.dictionary import ObjectList, ObjectValues
from gateway.wire.parameter import Confirmed, Reverted, Stored, Written
from gateway.wire.resource import ResourceSnapshotParams
from gateway.wire.stop import Reset, Stopped
from server_gui.core.follow.events import Costs, Failed, Resources
from server_gui.core.follow.feed import Tell
from server_gui.core.follow.network import Network
from server_gui.core.follow.validation import Validator
from server_gui.core.tuning.commands import ReadBack

LEASE_S: Final = 300.0  # the longest that a robot gives; every write begins it anew
RESET_LEASE_S: Final = 60.0  # for a reset alone
PROCESSES_S: Final = 1.0  # between looks at the process table, while it is shown
PROCESSES: Final = ResourceSnapshotParams(include=["disk", "network", "thermal", "cmdline"])


class CommandLink:
    """One robot's commands; `run` keeps the link until it is cancelled. Implements `Commands`.

    `tell` gets the process table, and what monitoring costs, while that is wanted; `dropped` is called when
    the link has gone, and with it the lease: both in the network's thread.
    """

    def __init__(
        self,
        network: Network,
        address: Address,
        tell: Tell,
        dropped: Callable[[], None],
        client: str = "gwrms gui",
        processes: ResourceSnapshotParams = PROCESSES,
    ) -> None:
        self._network = network
        self._tell = tell
        self._dropped = dropped
        self._processes = processes
        self._client = Client(address, LinkSettings(client=client), self._state_changed)
        self._arriving = Validator()
        self._processes_wanted = asyncio.Event()
        self._ours_until_ns = 0  # how long control was taken for more than a command (monotonic)
        self._resets = 0  # that go on: the last gives control back

    async def run(self) -> None:
        """Hold the link, and ask for processes while they are wanted."""
        self._client.link.start()
        try:
            while True:
                await self._processes_wanted.wait()
                await self._look()
                await asyncio.sleep(PROCESSES_S)
        finally:
            await self._client.close()

    # --- Commands

    def stop(self, reason: str) -> "Future[Stopped]":
        return self._network.run(self._client.stop(reason))

    def take_control(self) -> "Future[Lease]":
        return self._network.run(self._take())

    def release_control(self) -> "Future[None]":
        return self._network.run(self._release())

    def write(self, changes: Mapping[str, float], trial_s: float | None) -> "Future[Written]":
        return self._network.run(self._write(changes, trial_s))

    def confirm(self, write: int) -> "Future[Confirmed]":
        return self._network.run(self._client.confirm(write))

    def revert(self, write: int) -> "Future[Reverted]":
        return self._network.run(self._client.revert(write))

    def read_back(self, name: str) -> "Future[ReadBack]":
        return self._network.run(self._read_back(name))

    def store(self, component: str) -> "Future[Stored]":
        return self._network.run(self._store(component))

    def reset(self) -> "Future[Reset]":
        return self._network.run(self._reset())

    def objects(self, component: str, search: str) -> "Future[ObjectList]":
        return self._network.run(self._client.objects(component, search))

    def read_objects(self, component: str, objects: Sequence[str]) -> "Future[ObjectValues]":
        return self._network.run(self._client.read_objects(component, *objects))

    def dial(self) -> None:
        self._network.run(self._dial())

    def show_processes(self, wanted: bool) -> None:
        self._network.run(self._show_processes(wanted))

    # --- in the network's thread

    async def _take(self) -> Lease:
        asked_ns = time.monotonic_ns() + round(LEASE_S * 1e9)
        before, self._ours_until_ns = self._ours_until_ns, asked_ns
        try:
            return await self._client.acquire(LEASE_S)
        except BaseException:
            if self._ours_until_ns == asked_ns:  # else it has gone with the link, or was asked for again
                self._ours_until_ns = before
            raise

    async def _release(self) -> None:
        self._ours_until_ns = 0
        await self._client.release()

    async def _write(self, changes: Mapping[str, float], trial_s: float | None) -> Written:
        await self._take()
        return await self._client.write(changes, trial_s)

    async def _read_back(self, name: str) -> ReadBack:
        trials = (await self._client.describe()).trials
        held = (await self._client.read(name)).values[name]
        value = None if held.value is None else float(held.value)
        return ReadBack(value, held.problem, any(name in trial.before for trial in trials))

    async def _store(self, component: str) -> Stored:
        await self._take()
        return await self._client.store(component)

    async def _reset(self) -> Reset:
        """Control that was taken for it alone is given back, so that nobody else waits for a window."""
        left_s = (self._ours_until_ns - time.monotonic_ns()) / 1e9
        self._resets += 1
        try:
            await self._client.acquire(max(RESET_LEASE_S, left_s))
            return await self._client.reset()
        finally:
            self._resets -= 1
            if not self._resets and self._ours_until_ns <= time.monotonic_ns():
                with contextlib.suppress(ClientError):  # it has gone with its time, or the link
                    await self._client.release()

    async def _dial(self) -> None:
        self._client.link.dial()

    async def _show_processes(self, wanted: bool) -> None:
        if wanted:
            self._processes_wanted.set()
        else:
            self._processes_wanted.clear()

    async def _look(self) -> None:
        try:
            snapshot = await self._client.resources(self._processes)
            found = Resources(snapshot, self._client.link.clock.round_trip_ns, time.monotonic_ns())
            self._arriving.check(found)
        except ClientError as error:
            if self._client.link.state is ConnectionState.CONNECTED:
                self._tell(Failed("the process table", str(error)))
            return
        self._tell(found)
        with contextlib.suppress(ClientError):  # an older gateway does not know it
            self._tell(Costs(await self._client.cost()))

    def _state_changed(self, state: ConnectionState) -> None:
        if state in (ConnectionState.WAITING, ConnectionState.CLOSED):
            self._ours_until_ns = 0
            self._dropped()
