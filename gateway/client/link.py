"""A link to one robot that is made again whenever it drops, with the streams that hang on it."""

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import msgspec

from gateway.client.address import Address
from gateway.client.backoff import Backoff
from gateway.client.clock import ClockTracker
from gateway.client.connection import UNREADABLE, Connection
from gateway.client.errors import (
    NOTHING_SENT,
    CallTimeout,
    ClientError,
    LinkLost,
    NotConnected,
    NotPaired,
    ProtocolError,
    RemoteError,
    WrongRobot,
)
from gateway.client.local_sockets import listens_at, local_sockets, sockets_instead
from gateway.client.subscription import Subscription
from gateway.plain_text import followed
from gateway.wire.framing import PROTOCOL
from gateway.wire.method import Method, P, Params, R
from gateway.wire.robot import CLOCK_READ, HELLO, Hello, HelloParams
from gateway.wire.stream import (
    STREAM_DATA,
    STREAM_START,
    STREAM_STOP,
    StreamData,
    StreamStartParams,
    StreamStopParams,
)


class ConnectionState(Enum):
    """State of a link."""

    IDLE = "idle"  # not started
    CONNECTING = "connecting"
    CONNECTED = "connected"
    WAITING = "waiting"  # for the next attempt
    CLOSED = "closed"


@dataclass(frozen=True, slots=True)
class LinkSettings:
    """Settings of a link: times in seconds."""

    client: str = "gwrms"  # the name that the robot's journal shows
    token: str | None = None
    connect_timeout_s: float = 3.0
    call_timeout_s: float = 5.0
    silence_s: float = 3.0  # a link on which nothing came for so long is given up
    reconnect: bool = True


OnState = Callable[[ConnectionState], None]
_Greeted = tuple[Connection, Hello]
AGAIN_S: Final = 0.05  # the least between two attempts, however often somebody dials
DIAL_S: Final = 1.0  # that a stop waits for a connection at most


class Link:
    """Keeps one connection to a robot alive from `start` to `close`.

    Nothing is queued while there is no connection: a call is sent at once or raises `NotConnected`, so that
    no write can come out later than it was meant. A stop alone may wait for a connection, for `DIAL_S`.
    Streams are started again on each new connection. The robot is asked for its clock three times in
    `silence_s`, which finds a peer that vanished without closing.
    """

    def __init__(self, address: Address, settings: LinkSettings, on_state: OnState | None = None) -> None:
        self.address = address
        self.settings = settings
        self.state = ConnectionState.IDLE
        self.problem: ClientError | None = None
        self.hello: Hello | None = None
        self.clock = ClockTracker()
        self.connections = 0
        self._reached = address  # as a number, where its name was looked up
        self._received_bytes = 0  # over connections that have ended
        self._on_state = on_state
        self._connection: Connection | None = None
        self._supervisor: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()
        self._dialled = asyncio.Event()  # since the last attempt began
        self._subscriptions: list[Subscription] = []
        self._streams: dict[int, Subscription] = {}
        self._decode_data = msgspec.json.Decoder(StreamData).decode

    # --- life

    def start(self) -> None:
        """Begin to connect, in a task of this event loop. Idempotent."""
        if self._supervisor is None:
            self._supervisor = asyncio.create_task(self._supervise(), name=f"link to {self.address}")

    async def close(self) -> None:
        """End the link and its streams; what waits for an answer fails with `LinkLost`. Idempotent."""
        if self._supervisor is None:
            return
        self._supervisor.cancel()
        await asyncio.wait([self._supervisor])
        if not self._supervisor.cancelled():
            self._supervisor.result()

    async def first_attempt(self) -> None:
        """Wait until the first attempt has ended.

        Raises:
            ClientError: it failed, for this reason; later attempts go on until `close`.

        """
        while self.state in (ConnectionState.IDLE, ConnectionState.CONNECTING):
            await self._next_change()
        problem = self.problem
        if self.state is ConnectionState.CONNECTED or problem is None:
            return
        instead = "" if isinstance(problem, WrongRobot) else sockets_instead(self.address)
        if instead and isinstance(problem, (NotConnected, LinkLost)):
            raise type(problem)(followed(str(problem), instead)) from problem
        raise problem

    async def connected(self) -> Hello:
        """Wait for a connection, for as long as it takes.

        Raises:
            NotConnected: the link was closed, or it is not to reconnect and dropped.

        """
        while self.state is not ConnectionState.CONNECTED or self.hello is None:
            if self.state is ConnectionState.CLOSED:
                raise NotConnected(f"the link to {self.address} is closed")
            await self._next_change()
        return self.hello

    # --- use

    @property
    def received_bytes(self) -> int:
        """Bytes received over all connections."""
        return self._received_bytes + (self._connection.received_bytes if self._connection else 0)

    async def call(self, method: Method[P, R], params: P, timeout_s: float | None = None) -> R:
        """One request and its result; see `Connection.call`.

        For what is urgent, which is a stop, a connection is made where there is none, within `DIAL_S`.

        Raises:
            NotConnected: there is no connection now, and nothing was sent.

        """
        if method.urgent:
            await self._dial()
        if self._connection is None:
            raise NotConnected(f"{NOTHING_SENT}; {self.problem or f'there is no link to {self.address} yet'}")
        return await self._ask(self._connection, method, params, timeout_s)

    def dial(self) -> None:
        """Connect now, if there is no connection, instead of after the wait for the next attempt.

        Where an attempt goes on, and fails, another one follows: the robot may have come meanwhile.
        """
        if self._connection is None:
            self._dialled.set()

    async def subscribe(self, request: StreamStartParams, depth: int) -> Subscription:
        """Start a stream now, or as soon as there is a connection.

        Raises:
            RemoteError: the robot refuses it.

        """
        subscription = Subscription(request, depth)
        self._subscriptions.append(subscription)
        if self._connection is not None:
            try:
                await self._start_stream(self._connection, subscription)
            except (NotConnected, LinkLost):
                pass  # it is started with the next connection
            except ClientError:
                self._subscriptions.remove(subscription)
                raise
        return subscription

    async def unsubscribe(self, subscription: Subscription) -> None:
        """Stop a stream on the robot and end its iterator. Idempotent."""
        subscription.end()
        if subscription not in self._subscriptions:
            return
        self._subscriptions.remove(subscription)
        if subscription.stream is not None and self._streams.pop(subscription.stream, None) is not None:
            # Without a connection there is no stream either.
            with contextlib.suppress(NotConnected, LinkLost):
                await self.call(STREAM_STOP, StreamStopParams(subscription.stream))

    # --- supervision

    async def _dial(self) -> None:
        """Wait for a connection while it is tried for again and again, for `DIAL_S` at most."""
        trying = (ConnectionState.WAITING, ConnectionState.CONNECTING)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DIAL_S):
                while self._connection is None and self.state in trying:
                    self.dial()
                    await self._next_change()

    async def _supervise(self) -> None:
        backoff = Backoff()
        reason: ClientError | None = None
        try:
            while True:
                self._dialled.clear()
                self._set(ConnectionState.CONNECTING)
                try:
                    await self._session(backoff)
                except ClientError as error:
                    self.problem = error
                if not self.settings.reconnect:
                    reason = self.problem
                    return
                self._set(ConnectionState.WAITING)
                await self._pause(backoff.next_s())
        finally:
            self._set(ConnectionState.CLOSED)
            self._end_streams(reason)

    async def _pause(self, for_s: float) -> None:
        """Until the next attempt: so long, or until somebody dials."""
        await asyncio.sleep(min(AGAIN_S, for_s))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(for_s - AGAIN_S):
                await self._dialled.wait()

    async def _session(self, backoff: Backoff) -> None:
        """One connection from beginning to end; returns only by raising why it ended."""
        connection = await self._greeted()
        try:
            await self._beat(connection)
            self._connection = connection
            self.connections += 1
            for subscription in tuple(self._subscriptions):
                await self._restart(connection, subscription)
            self.problem = None
            self._set(ConnectionState.CONNECTED)
            while True:
                await asyncio.wait([connection.closed], timeout=self.settings.silence_s / 3)
                if connection.closed.done():
                    raise connection.closed.result()
                await self._beat(connection)
                backoff.reset()  # it lived: not one that closes whatever connects
        finally:
            self._connection = None
            self._received_bytes += connection.received_bytes
            self._streams.clear()
            connection.close()

    async def _greeted(self) -> Connection:
        """Return a connection to the address; or, on its own computer, to the gateway's Unix socket.

        A gateway with keys closes its port to whoever has none, and serves its own computer's accounts there.
        Where nobody answers at the port, no gateway is there, and another one does not stand in for it.
        """
        try:
            connection, hello = await self._greet(self.address)
        except (LinkLost, NotPaired):
            if (local := await self._greet_locally()) is None:
                raise
            connection, hello = local
        if self.hello is not None and self.hello.boot_id != hello.boot_id:
            self.clock.clear()
        self.hello = hello
        return connection

    async def _greet_locally(self) -> _Greeted | None:
        """Return this computer's gateway at the address. All are greeted at once: one may hang."""
        asked = [asyncio.create_task(self._greet_if_there(one)) for one in local_sockets(self.address)]
        try:
            for answer in asyncio.as_completed(asked):
                if (found := await answer) is not None:
                    return found
        finally:
            for one in asked:
                one.cancel()
        return None

    async def _greet_if_there(self, socket: Address) -> _Greeted | None:
        try:
            connection, hello = await self._greet(socket)
        except ClientError:
            return None
        if listens_at(self._reached, hello.listens):
            return connection, hello
        connection.close()
        return None

    async def _greet(self, address: Address) -> _Greeted:
        connection = await Connection.open(address, self._notified, self.settings.connect_timeout_s)
        if address is self.address and connection.peer is not None:
            self._reached = replace(address, host=connection.peer)
        try:
            return connection, await self._exchange_hello(connection)
        except BaseException:
            self._received_bytes += connection.received_bytes
            connection.close()
            raise

    async def _exchange_hello(self, connection: Connection) -> Hello:
        params = HelloParams(self.settings.client, PROTOCOL, self.settings.token)
        try:
            hello = await self._ask(connection, HELLO, params)
        except LinkLost:  # nothing was asked for yet whose outcome could be unknown
            raise connection.closed.result() from None
        if hello.protocol != PROTOCOL:
            raise ProtocolError(
                f"{self.address} speaks protocol {hello.protocol}, this program speaks {PROTOCOL}; "
                "update the older of the two"
            )
        return hello

    async def _beat(self, connection: Connection) -> None:
        """Ask for the robot's clock; silence for too long ends the connection."""
        sent_ns = time.monotonic_ns()
        try:
            clock = await self._ask(connection, CLOCK_READ, Params(), self.settings.silence_s)
        except CallTimeout as error:
            silent_s = (time.monotonic_ns() - connection.received_ns) / 1e9
            if silent_s < self.settings.silence_s:
                return  # it is busy, not gone
            raise LinkLost(
                f"nothing came from {self.address} for {silent_s:.1f} s; the link is given up"
            ) from error
        self.clock.feed(sent_ns, clock.monotonic_ns, connection.received_ns)

    async def _restart(self, connection: Connection, subscription: Subscription) -> None:
        try:
            await self._start_stream(connection, subscription)
        except RemoteError as error:
            # The robot changed while we were away: this stream cannot go on, the others can.
            self._subscriptions.remove(subscription)
            subscription.end(error)

    async def _start_stream(self, connection: Connection, subscription: Subscription) -> None:
        def named(result: msgspec.Raw) -> None:
            stream = self._read(result, STREAM_START).stream
            self._streams[stream] = subscription
            subscription.restarted(stream, self.connections)

        request, timeout_s = subscription.request, self.settings.call_timeout_s
        await connection.call(STREAM_START.name, request, timeout_s, named)

    def _notified(self, method: str, params: msgspec.Raw) -> None:
        if method != STREAM_DATA:
            return  # a newer gateway may tell more than we know
        try:
            data = self._decode_data(params)
        except UNREADABLE as error:
            raise ProtocolError(f"{self.address} sent stream data that cannot be read: {error}") from error
        rows = len(data.stamp_ns)
        for length in set(map(len, data.columns.values())) - {rows}:
            why = f"{rows} stamps, but {length} values of a channel"
            raise ProtocolError(f"{self.address} sent stream data that cannot be read: {why}")
        subscription = self._streams.get(data.stream)
        if subscription is not None:
            subscription.feed(data, time.monotonic_ns())

    # --- small things

    async def _ask(
        self,
        connection: Connection,
        method: Method[P, R],
        params: P,
        timeout_s: float | None = None,
    ) -> R:
        result = await connection.call(method.name, params, timeout_s or self.settings.call_timeout_s)
        return self._read(result, method)

    def _read(self, result: msgspec.Raw, method: Method[P, R]) -> R:
        try:
            return msgspec.json.decode(result, type=method.result)
        except UNREADABLE as error:
            said = f"{self.address} answered {method.name} with something else: {error}"
            raise ProtocolError(said) from error

    def _end_streams(self, reason: ClientError | None) -> None:
        for subscription in self._subscriptions:
            subscription.end(reason)
        self._subscriptions.clear()

    def _set(self, state: ConnectionState) -> None:
        if state is self.state:
            return
        self.state = state
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()
        if self._on_state is not None:
            self._on_state(state)

    async def _next_change(self) -> None:
        await self._changed.wait()
