"""One connection: lines out, lines in, each call matched to its answer. No reconnection here."""

import asyncio
import itertools
import os
import socket
import time
from collections.abc import Callable
from typing import Self

import msgspec

from gateway.client.address import Address
from gateway.client.errors import (
    NOTHING_SENT,
    CallTimeout,
    ClientError,
    LinkLost,
    NotConnected,
    NotPaired,
    ProtocolError,
    RemoteError,
    Unreachable,
)
from gateway.client.keys import check_pin, context_for, pin_of
from gateway.plain_text import plain
from gateway.wire import framing

OnNotification = Callable[[str, msgspec.Raw], None]
OnResult = Callable[[msgspec.Raw], None]
LONGEST_REFUSAL = 4096  # letters of it that are told
UNREADABLE = (ValueError, RecursionError)  # what decoding raises: also for bad UTF-8, and nesting


class Refusal(msgspec.Struct):
    """The `error` of an answer, read leniently: a newer gateway may know more kinds than we do."""

    code: int
    message: str
    data: dict[str, object] | None = None


class Incoming(msgspec.Struct):
    """Whatever a gateway sends: an answer, an error or a notification."""

    id: int | None = None
    method: str | None = None
    params: msgspec.Raw = msgspec.Raw()
    result: msgspec.Raw = msgspec.Raw()
    error: Refusal | None = None


class Connection(asyncio.Protocol):
    """A connection that is open until `closed` is done.

    Calls are sent in the order in which they are made and may be answered in any order. When the connection
    ends, every call that waits fails with `LinkLost`; nothing is ever sent twice. Cancelling a call forgets
    its answer, it does not undo the request. For one event loop only.
    """

    def __init__(self, address: Address, on_notification: OnNotification, pin: str | None = None) -> None:
        self.address = address
        self._pin = pin
        self.closed: asyncio.Future[ClientError] = asyncio.get_running_loop().create_future()
        self.received_ns = time.monotonic_ns()
        self.received_bytes = 0
        self.peer: str | None = None  # the host that was reached, as a number
        self._on_notification = on_notification
        self._transport: asyncio.Transport | None = None
        self._waiting: dict[int, tuple[asyncio.Future[msgspec.Raw], OnResult | None]] = {}
        self._refusal = ""  # the last answer, where that was one
        self._ids = itertools.count(1)
        self._lines = framing.LineSplitter(framing.ANSWER_LIMIT)
        self._decode = msgspec.json.Decoder(Incoming).decode

    @classmethod
    async def open(cls, address: Address, on_notification: OnNotification, timeout_s: float) -> Self:
        """Connect; by TLS with this desk's key where the robot is pinned.

        Raises:
            Unreachable: nobody listens there, or nobody answers within `timeout_s`.
            NotPaired, WrongRobot: it is not let in, or would not go in there.

        """
        pin = pin_of(address)
        try:
            async with asyncio.timeout(timeout_s):
                connection = await cls._opened(address, on_notification, pin)
        except TimeoutError as error:
            raise Unreachable(
                f"nothing answers at {address} within {timeout_s:g} s; is the robot on?"
            ) from error
        except ClientError:
            raise
        except OSError as error:
            if pin is not None and not isinstance(error, (ConnectionRefusedError, socket.gaierror)):
                raise Unreachable(
                    f"{address} is paired, and what answers there ended the handshake ({_reason(error)}): it "
                    "is another program, or is busy. Nothing was sent"
                ) from error
            raise Unreachable(f"no gateway at {address} ({_reason(error)}); is it running there?") from error
        if connection.closed.done():
            raise connection.closed.result()
        return connection

    @classmethod
    async def _opened(cls, address: Address, on_notification: OnNotification, pin: str | None) -> Self:
        loop = asyncio.get_running_loop()
        if address.path is not None:
            _, opened = await loop.create_unix_connection(lambda: cls(address, on_notification), address.path)
            return opened
        context = None if pin is None else context_for(address, pin)
        _, connection = await loop.create_connection(
            lambda: cls(address, on_notification, pin), address.host, address.port, ssl=context
        )
        return connection

    async def call(
        self, method: str, params: object, timeout_s: float, on_result: OnResult | None = None
    ) -> msgspec.Raw:
        """Send one request and wait for its result, still encoded.

        `on_result` gets it at once, before anything that the robot sent after it is looked at.

        Raises:
            NotConnected: the connection has ended; the request was not sent.
            RemoteError: the robot refused.
            CallTimeout: no answer within `timeout_s`; a later one is thrown away.
            LinkLost: the connection ended first.

        """
        if self._transport is None or self.closed.done():
            raise NotConnected(f"{NOTHING_SENT}; the link to {self.address} is closed")
        number = next(self._ids)
        answer: asyncio.Future[msgspec.Raw] = asyncio.get_running_loop().create_future()
        self._waiting[number] = (answer, on_result)
        self._transport.write(framing.encode_request(number, method, params))
        try:
            async with asyncio.timeout(timeout_s):
                return await answer
        except TimeoutError as error:
            raise CallTimeout(
                f"{self.address} did not answer {method} within {timeout_s:g} s; "
                "whether it was done is unknown"
            ) from error
        finally:
            self._waiting.pop(number, None)

    def close(self, reason: ClientError | None = None) -> None:
        """End the connection at once; calls that wait fail with `LinkLost`. Idempotent."""
        if self._transport is not None:
            self._transport.abort()
        self._end(reason or LinkLost(f"the link to {self.address} was closed here"))

    # --- what asyncio calls

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if not isinstance(transport, asyncio.Transport):
            raise TypeError(f"{transport!r} cannot both read and write")
        self._transport = transport
        sock: socket.socket = transport.get_extra_info("socket")
        if self.address.path is None:
            self.peer = str(transport.get_extra_info("peername")[0])
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._pin is not None:
            found = transport.get_extra_info("ssl_object")
            try:
                check_pin(self.address, self._pin, found and found.getpeercert(binary_form=True))
            except ClientError as error:
                self.close(error)

    def data_received(self, data: bytes) -> None:
        self.received_ns = time.monotonic_ns()
        self.received_bytes += len(data)
        try:
            for line in self._lines.feed(data):
                self._take(line)
        except ClientError as error:
            self.close(error)

    def connection_lost(self, exc: Exception | None) -> None:
        if self._pin is not None and not self.received_bytes:
            self._end(NotPaired(_not_let_in(self.address)))  # TLS 1.3 tells it only after the handshake
            return
        why = f" ({_reason(exc)})" if isinstance(exc, OSError) else ""
        if not self.received_bytes and self.address.path is None:
            why += (
                "; if it has keys, it is to be paired with first (gwrms pair); on its own computer root, the "
                "account that it runs as and users whom access.toml names need no key, at its Unix socket"
            )
        elif self._refusal:  # which was the last that it said
            why += f": {self._refusal}"
        self._end(LinkLost(f"{self.address} closed the link{why}"))

    # --- matching

    def _take(self, line: framing.Line) -> None:
        if not isinstance(line, bytes):
            raise ProtocolError(f"{self.address} does not speak as a gateway does: {line}")
        try:
            message = self._decode(line)
        except UNREADABLE as error:
            raise ProtocolError(f"{self.address} does not speak as a gateway does: {error}") from error
        if message.method is not None:
            self._on_notification(message.method, message.params)
        elif message.id is not None:
            self._settle(message)
        elif message.error is not None:
            raise ProtocolError(f"{self.address} could not read a request: {_said(message.error)}")

    def _settle(self, message: Incoming) -> None:
        answer, on_result = self._waiting.get(message.id or 0, (None, None))
        if answer is None or answer.done():
            return  # its caller gave up
        self._refusal = "" if message.error is None else _said(message.error)
        if message.error is not None:
            answer.set_exception(RemoteError(message.error.code, self._refusal, message.error.data))
            return
        answer.set_result(message.result)
        if on_result is not None:
            on_result(message.result)

    def _end(self, reason: ClientError) -> None:
        if self.closed.done():
            return
        self.closed.set_result(reason)
        for answer, _ in self._waiting.values():
            if not answer.done():
                answer.set_exception(
                    reason  # it was never let in, and nothing was done
                    if isinstance(reason, NotConnected)
                    else LinkLost(f"{reason}; a request was under way, and whether it was done is unknown")
                )


def _not_let_in(address: Address) -> str:
    return (
        f"{address} does not let this desk in: its key is not known there, or was revoked; "
        "pair it (gwrms keys pair on the robot, then gwrms pair here)"
    )


def _said(refusal: Refusal) -> str:
    """Return the robot's own words, as far as they are told."""
    return plain(refusal.message[:LONGEST_REFUSAL])


def _reason(error: OSError) -> str:
    # asyncio puts words of its own where strerror belongs; a name that does not resolve has no errno above 0.
    number = error.errno or 0
    return os.strerror(number) if number > 0 else error.strerror or str(error)
