"""A STOP, and whoever has seen the robot, waits for no later attempt of the link."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest

from gateway.client import Client, ConnectionState, LinkSettings, NotConnected, link
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S, until_in_loop
from tests.unit.client.in_loop import in_loop

NEVER_S = 1e6
STOPS = 5


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


@pytest.fixture(autouse=True)
def no_other_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    """A link that dropped would wait for days; a STOP is given time."""
    waits = SimpleNamespace(next_s=lambda: NEVER_S, reset=lambda: None)
    monkeypatch.setattr(link, "Backoff", lambda: waits)
    monkeypatch.setattr(link, "DIAL_S", WAIT_S)


@asynccontextmanager
async def waiting(robot: FakeRobot, states: list[ConnectionState]) -> AsyncIterator[Client]:
    """A link that waits for its next attempt; the robot is off."""
    client = Client(robot.address, LinkSettings(silence_s=NEVER_S), states.append)
    async with client:
        await asyncio.to_thread(robot.refuse)
        await until_in_loop(lambda: client.link.state is ConnectionState.WAITING)
        states.clear()
        yield client


@in_loop
async def test_stops_are_sent_over_a_link_that_is_made_for_them(robot: FakeRobot) -> None:
    states: list[ConnectionState] = []
    async with waiting(robot, states) as client:
        await asyncio.to_thread(robot.listen)
        await asyncio.gather(*(client.stop(str(number)) for number in range(STOPS)))
        assert len(robot.called("robot.stop")) == STOPS
        assert states.count(ConnectionState.CONNECTED) == 1


@in_loop
async def test_a_stop_goes_on_trying_while_the_robot_comes_up(robot: FakeRobot) -> None:
    states: list[ConnectionState] = []
    async with waiting(robot, states) as client:
        stopping = asyncio.create_task(client.stop("now"))
        await until_in_loop(lambda: states.count(ConnectionState.WAITING) >= 2)
        await asyncio.to_thread(robot.listen)
        await stopping
        assert robot.called("robot.stop") == [{"reason": "now"}]


@in_loop
async def test_a_robot_that_is_off_is_told_in_time_and_is_not_hammered(
    robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    states: list[ConnectionState] = []
    monkeypatch.setattr(link, "DIAL_S", 3 * link.AGAIN_S)
    async with waiting(robot, states) as client:
        with pytest.raises(NotConnected, match=r"nothing was sent; no gateway at"):
            await client.stop("now")
        assert 1 <= states.count(ConnectionState.CONNECTING) <= 4
        await asyncio.to_thread(robot.listen)
        client.link.dial()
        await client.link.connected()
        assert robot.called("robot.stop") == []


@in_loop
async def test_a_link_that_is_closed_while_it_dials_says_so(robot: FakeRobot) -> None:
    async with waiting(robot, []) as client:
        stopping = asyncio.create_task(client.stop("now"))
        await asyncio.sleep(0)
        await client.close()
        with pytest.raises(NotConnected):
            await stopping


@in_loop
async def test_what_was_seen_is_dialled(robot: FakeRobot) -> None:
    states: list[ConnectionState] = []
    async with waiting(robot, states) as client:
        await asyncio.to_thread(robot.listen)
        client.link.dial()
        async with asyncio.timeout(WAIT_S):
            await client.link.connected()
        client.link.dial()  # nothing is to be done
        await client.describe()
        assert states.count(ConnectionState.CONNECTING) == 1
