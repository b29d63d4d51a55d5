"""What a robot may send to a client: the link ends with an error that says why, or goes on."""

import asyncio
import contextlib
from typing import Any

from gateway.client.address import Address
from gateway.client.connection import Connection
from gateway.client.errors import ClientError
from gateway.client.link import Link, LinkSettings
from gateway.client.subscription import Subscription
from gateway.wire.messages import METHODS, StreamStartParams

TOKENS = (
    b'{"jsonrpc":"2.0","id":1,"result":',
    b'{"jsonrpc":"2.0","method":"stream.data","params":{"stream":1,"seq":1,"dropped":0,"stamp_ns":[1],"columns":{"a":[1.5]}}}\n',
    b'"error":{"code":1,"message":"x"}',
    b"\n",
    b"null",
    b"[[[[",
    b"\xff",
)
MODULES = ("gateway.client.connection", "gateway.client.link", "gateway.client.subscription")


class _Nowhere(asyncio.Transport):
    def write(self, data: Any) -> None:
        """Nobody reads it."""

    def abort(self) -> None:
        """Nobody is there."""

    def close(self) -> None:
        """Nobody is there."""


def fuzz(data: bytes) -> None:
    asyncio.run(_hear(data))


async def _hear(data: bytes) -> None:
    link = Link(Address("robot", 7420), LinkSettings())
    link._streams[1] = subscription = Subscription(StreamStartParams(["component"], 10.0), 4)
    connection = Connection(link.address, link._notified)
    connection._transport = _Nowhere()
    asked = [asyncio.create_task(_ask(link, connection, name)) for name in METHODS]
    await asyncio.sleep(0)
    try:
        connection.data_received(data)
        for batch in subscription._waiting:
            assert all(len(row) == len(batch.columns) for _, row in batch.rows())
    finally:
        connection.close()
        await asyncio.gather(*asked)


async def _ask(link: Link, connection: Connection, name: str) -> None:
    with contextlib.suppress(ClientError):
        await link._ask(connection, name, {}, METHODS[name].result)
