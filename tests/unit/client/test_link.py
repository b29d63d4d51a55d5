"""A link over days: reconnection, clocks, streams that come back, losses that are counted."""

import asyncio
import itertools
import time
from collections.abc import Callable, Iterator

import pytest

from gateway.client import (
    Batch,
    Client,
    ConnectionState,
    LinkSettings,
    NotConnected,
    ProtocolError,
    RemoteError,
    Subscription,
    Unreachable,
    link,
)
from gateway.wire.stream import StreamStartParams
from tests.fake_robot import FakeRobot, Refusal
from tests.support.waiting import until_in_loop
from tests.unit.client.in_loop import in_loop

PATIENT = LinkSettings(silence_s=30.0)
ONCE = LinkSettings(silence_s=30.0, reconnect=False)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


async def exhaust(stream: Subscription) -> None:
    async with asyncio.timeout(30):
        async for _ in stream:
            pass


def refusing(message: str) -> Callable[[dict[str, object]], object]:
    def answer(params: dict[str, object]) -> object:
        raise Refusal(-32001, message, kind="unknown_name")

    return answer


@in_loop
async def test_first_attempt_that_fails_raises() -> None:
    with FakeRobot() as robot:
        address = robot.address
    with pytest.raises(Unreachable):
        async with Client(address, PATIENT):
            pass


@in_loop
async def test_link_greets_with_its_name_and_token(robot: FakeRobot) -> None:
    async with Client(robot.address, LinkSettings(client="bench", token="secret")) as client:
        assert client.link.hello is not None
        assert client.link.hello.robot == "exo-fake"
    assert robot.called("hello")[0] == {"client": "bench", "protocol": 1, "token": "secret"}


@in_loop
async def test_another_protocol_is_refused_in_words(robot: FakeRobot) -> None:
    robot.protocol = 2
    with pytest.raises(ProtocolError, match="speaks protocol 2"):
        async with Client(robot.address, ONCE):
            pass


@in_loop
async def test_link_is_made_when_the_robot_comes_up_later(robot: FakeRobot) -> None:
    await asyncio.to_thread(robot.refuse)
    states: list[ConnectionState] = []
    client = Client(robot.address, PATIENT, states.append)
    client.link.start()
    await until_in_loop(lambda: ConnectionState.WAITING in states)
    assert isinstance(client.link.problem, Unreachable)
    await asyncio.to_thread(robot.listen)
    async with asyncio.timeout(30):
        hello = await client.link.connected()
    assert hello.boot_id == "boot-1"
    assert client.link.problem is None
    await client.close()
    assert states[-1] is ConnectionState.CLOSED


@in_loop
async def test_call_without_a_link_is_not_sent_and_not_kept(
    robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "DIAL_S", 0.1)
    async with Client(robot.address, PATIENT) as client:
        await asyncio.to_thread(robot.refuse)
        await until_in_loop(lambda: client.link.state is not ConnectionState.CONNECTED)
        for call in (client.stop("test"), client.write({"gait.step_length": 0.4}), client.describe()):
            with pytest.raises(NotConnected, match="nothing was sent"):
                await call
        await asyncio.to_thread(robot.listen)
        async with asyncio.timeout(30):
            await client.link.connected()
        await client.describe()
    assert robot.called("robot.stop") == robot.called("parameter.write") == []


@in_loop
async def test_stream_goes_on_after_the_link_came_back(robot: FakeRobot) -> None:
    async with (
        Client(robot.address, PATIENT) as client,
        client.subscribe("*.position", rate_hz=100) as stream,
    ):
        first = await anext(stream)
        await asyncio.to_thread(robot.cut)
        batch: Batch = first
        async with asyncio.timeout(30):
            while batch.link == first.link:
                batch = await anext(stream)
        assert stream.counters.restarts == 1
        assert batch.missed == 0
        assert set(batch.columns) == set(first.columns)
    assert len(robot.called("stream.start")) == 2
    assert len(robot.called("stream.stop")) == 1


@in_loop
async def test_stream_asked_for_without_a_link_starts_with_it(robot: FakeRobot) -> None:
    await asyncio.to_thread(robot.refuse)
    client = Client(robot.address, PATIENT)
    client.link.start()
    async with client.subscribe("left_knee.position", rate_hz=100) as stream:
        assert stream.age_s is None
        await asyncio.to_thread(robot.listen)
        async with asyncio.timeout(30):
            batch = await anext(stream)
    assert list(batch.columns) == ["left_knee.position"]
    await client.close()


@in_loop
async def test_refused_stream_raises_at_once(robot: FakeRobot) -> None:
    robot.overrides["stream.start"] = refusing("there is no channel 'nose'")
    async with Client(robot.address, PATIENT) as client:
        with pytest.raises(RemoteError, match="nose"):
            async with client.subscribe("nose"):
                pass


@in_loop
async def test_stream_refused_after_a_reconnect_ends_with_the_reason(robot: FakeRobot) -> None:
    async with Client(robot.address, PATIENT) as client, client.subscribe("left_knee.position") as stream:
        await anext(stream)
        robot.overrides["stream.start"] = refusing("there is no channel 'left_knee.position'")
        await asyncio.to_thread(robot.cut)
        with pytest.raises(RemoteError, match="left_knee"):
            await exhaust(stream)
        await client.describe()


@in_loop
async def test_holes_in_seq_are_counted(robot: FakeRobot) -> None:
    robot.seq_step = 3
    async with Client(robot.address, PATIENT) as client, client.subscribe(rate_hz=100) as stream:
        batches = [await anext(stream) for _ in range(4)]
    assert [batch.missed for batch in batches] == [0, 2, 2, 2]
    assert stream.counters.missed >= 6


@in_loop
async def test_slow_taker_loses_the_oldest_and_is_told(robot: FakeRobot) -> None:
    async with Client(robot.address, PATIENT) as client, client.subscribe(rate_hz=200, depth=2) as stream:
        await until_in_loop(lambda: stream.counters.overflowed >= 3)
        counters = stream.counters
        assert (await anext(stream)).seq == counters.notifications - 2


@in_loop
async def test_iteration_ends_when_the_client_is_closed(robot: FakeRobot) -> None:
    client = Client(robot.address, PATIENT)
    async with client, client.subscribe(rate_hz=100) as stream:
        await anext(stream)
        await client.close()
        seen = [batch async for batch in stream]
        assert all(batch.link == 1 for batch in seen)


@in_loop
async def test_peer_that_vanished_without_closing_is_noticed(robot: FakeRobot) -> None:
    async with Client(robot.address, LinkSettings(silence_s=0.2)) as client:
        robot.mute = True
        await until_in_loop(lambda: client.link.state is not ConnectionState.CONNECTED)
        robot.mute = False
        async with asyncio.timeout(30):
            await client.link.connected()
        assert client.link.connections >= 2


@in_loop
async def test_clock_offset_is_known_and_begins_anew_with_another_boot(robot: FakeRobot) -> None:
    ahead_ns = 3_600_000_000_000
    robot.overrides["clock.read"] = lambda params: {
        "monotonic_ns": time.monotonic_ns() + ahead_ns,
        "utc_ns": time.time_ns(),
        "boot_id": robot.boot_id,
    }
    async with Client(robot.address, PATIENT) as client:
        offset = client.link.clock.offset
        assert offset is not None
        assert abs(offset.offset_ns - ahead_ns) <= offset.uncertainty_ns
        robot.boot_id = "boot-2"
        del robot.overrides["clock.read"]
        await asyncio.to_thread(robot.cut)
        await until_in_loop(lambda: client.link.connections == 2)
        offset = client.link.clock.offset
        assert offset is not None
        assert abs(offset.offset_ns) <= offset.uncertainty_ns


@in_loop
async def test_bytes_add_up_over_connections(robot: FakeRobot) -> None:
    async with Client(robot.address, PATIENT) as client:
        greeted = client.link.received_bytes
        assert greeted > 100
        await client.describe()
        described = client.link.received_bytes
        assert described > greeted
        await asyncio.to_thread(robot.cut)
        await until_in_loop(lambda: client.link.connections == 2)
        assert client.link.received_bytes >= described + greeted


def test_rows_pair_each_stamp_with_its_values() -> None:
    batch = Batch([10, 20], {"a": [1.0, None], "b": [3.0, 4.0]}, 0, 0, 0, 1, 99)
    assert list(batch.rows()) == [(10, {"a": 1.0, "b": 3.0}), (20, {"a": None, "b": 4.0})]


@in_loop
async def test_stream_data_that_follows_its_start_at_once_is_not_lost() -> None:
    served = asyncio.Event()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        started_and_data = (
            b'{"jsonrpc":"2.0","id":3,"result":{"stream":7}}\n'
            b'{"jsonrpc":"2.0","method":"stream.data","params":'
            b'{"stream":7,"seq":0,"dropped":0,"stamp_ns":[5],"columns":{"x":[1.5]}}}\n'
        )
        answers = itertools.cycle(
            (
                b'{"jsonrpc":"2.0","id":1,"result":{"protocol":1,"robot":"r","role":"observer","boot_id":"b"}}\n',
                b'{"jsonrpc":"2.0","id":2,"result":{"monotonic_ns":1,"utc_ns":2,"boot_id":"b"}}\n',
                started_and_data,
            )
        )
        while await reader.readline():
            writer.write(next(answers))
        writer.close()
        served.set()

    async with await asyncio.start_server(serve, "127.0.0.1") as server:
        port = server.sockets[0].getsockname()[1]
        async with Client(f"127.0.0.1:{port}", ONCE) as client:
            stream = await client.link.subscribe(StreamStartParams(["component"], 10.0), depth=8)
            async with asyncio.timeout(30):
                batch = await anext(stream)
            assert batch.columns == {"x": [1.5]}
        await served.wait()
