"""One connection: answers find their calls, and every call ends."""

import asyncio
from collections.abc import Iterator

import pytest

from gateway.client import (
    CallTimeout,
    Client,
    LinkLost,
    LinkSettings,
    NotConnected,
    ProtocolError,
    RemoteError,
    Unreachable,
)
from gateway.client.address import Address
from gateway.client.connection import Connection
from tests.fake_robot import FakeRobot, Refusal
from tests.unit.client.in_loop import in_loop

ONCE = LinkSettings(reconnect=False, silence_s=30.0)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


async def _open(robot: FakeRobot) -> Connection:
    return await Connection.open(Address.parse(robot.address), lambda method, params: None, timeout_s=10.0)


@in_loop
async def test_answers_in_another_order_find_their_calls() -> None:
    held: list[tuple[int, asyncio.StreamWriter]] = []

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for number in (1, 2, 3):
            await reader.readline()
            held.append((number, writer))
        for number, _ in reversed(held):
            writer.write(b'{"jsonrpc":"2.0","id":%d,"result":"answer %d"}\n' % (number, number))
        writer.close()

    async with await asyncio.start_server(serve, "127.0.0.1") as server:
        port = server.sockets[0].getsockname()[1]
        connection = await Connection.open(Address(port=port), lambda method, params: None, 10.0)
        answers = await asyncio.gather(*(connection.call("x", {}, 10.0) for _ in range(3)))
        assert [bytes(answer) for answer in answers] == [b'"answer 1"', b'"answer 2"', b'"answer 3"']
        connection.close()


@in_loop
async def test_refusal_carries_code_kind_and_data(robot: FakeRobot) -> None:
    async with Client(robot.address, ONCE) as client:
        with pytest.raises(RemoteError, match="take the lease first") as refusal:
            await client.write({"gait.step_length": 0.42})
    assert (refusal.value.code, refusal.value.kind) == (-32000, "no_lease")


@in_loop
async def test_call_without_answer_times_out_and_says_that_the_outcome_is_unknown(robot: FakeRobot) -> None:
    connection = await _open(robot)
    robot.mute = True
    with pytest.raises(CallTimeout, match="whether it was done is unknown"):
        await connection.call("robot.stop", {}, timeout_s=0.05)
    robot.mute = False
    assert await connection.call("clock.read", {}, 10.0)
    connection.close()


@in_loop
async def test_every_waiting_call_fails_when_the_link_drops(robot: FakeRobot) -> None:
    connection = await _open(robot)
    robot.mute = True
    calls = [asyncio.create_task(connection.call("clock.read", {}, 30.0)) for _ in range(5)]
    while len(robot.calls) < 5:
        await asyncio.sleep(0.01)
    await asyncio.to_thread(robot.cut)
    for outcome in await asyncio.gather(*calls, return_exceptions=True):
        assert isinstance(outcome, LinkLost)
    assert isinstance(await connection.closed, LinkLost)


@pytest.mark.parametrize("answers_then", [False, True])
@in_loop
async def test_a_link_that_ends_after_a_refusal_gives_its_reason(
    robot: FakeRobot, answers_then: bool
) -> None:
    """A robot whose file is broken refuses and closes: the link said only that it was closed."""

    def refuse(_params: object) -> dict[str, object]:
        raise Refusal(-32002, "robot.toml: is broken")

    robot.overrides["robot.describe"] = refuse
    connection = await _open(robot)
    with pytest.raises(RemoteError):
        await connection.call("robot.describe", {}, 10.0)
    if answers_then:
        await connection.call("clock.read", {}, 10.0)
    await asyncio.to_thread(robot.cut)
    said = str(await connection.closed)
    assert ("robot.toml: is broken" in said) is not answers_then


@in_loop
async def test_call_on_a_closed_connection_is_not_sent(robot: FakeRobot) -> None:
    connection = await _open(robot)
    connection.close()
    connection.close()
    with pytest.raises(NotConnected, match="nothing was sent"):
        await connection.call("robot.stop", {}, 10.0)


@in_loop
async def test_cancelled_call_leaves_the_connection_usable(robot: FakeRobot) -> None:
    connection = await _open(robot)
    robot.mute = True
    call = asyncio.create_task(connection.call("clock.read", {}, 30.0))
    while not robot.calls:
        await asyncio.sleep(0.01)
    call.cancel()
    with pytest.raises(asyncio.CancelledError):
        await call
    robot.mute = False
    assert await connection.call("clock.read", {}, 10.0)
    connection.close()


@pytest.mark.parametrize(
    "noise",
    [
        b"HTTP/1.1 400 Bad Request\r\n",
        b"\xff\xfe\n",
        b"[]\n",
        b'{"jsonrpc":"2.0","id":null,"error":{"code":-32700,"message":"?"}}\n',
    ],
)
@in_loop
async def test_something_else_than_a_gateway_ends_the_connection(robot: FakeRobot, noise: bytes) -> None:
    connection = await _open(robot)
    await connection.call("clock.read", {}, 10.0)
    robot.push(noise)
    async with asyncio.timeout(20):
        assert isinstance(await connection.closed, ProtocolError)


@in_loop
async def test_nobody_listening_is_said_in_words(robot: FakeRobot) -> None:
    await asyncio.to_thread(robot.refuse)
    with pytest.raises(Unreachable, match=r"no gateway at 127\.0\.0\.1:\d+ \(Connection refused\)"):
        await _open(robot)
    await asyncio.to_thread(robot.listen)
