"""Control over the link of a window: what took it for one command alone gives it back."""

import asyncio
import time
from typing import Any, cast

import pytest

from gateway.client import Address, ClientError, ConnectionState, NotConnected
from gateway.wire.control import Lease
from gateway.wire.stop import Reset
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.network import Network
from server_gui.core.tuning.link import LEASE_S, CommandLink
from tests.support.desk import Bench


class FakeClient:
    """Answers everything, and notes it."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.fails: ClientError | None = None

    async def acquire(self, ttl_s: float) -> Lease:
        self.asked.append("acquire")
        return Lease("x", ttl_s)

    async def release(self) -> None:
        self.asked.append("release")

    async def write(self, _changes: object, _trial_s: object) -> None:
        self.asked.append("write")

    async def reset(self) -> Reset:
        self.asked.append("reset")
        if self.fails is not None:
            raise self.fails
        return Reset({}, {}, held=False)


@pytest.fixture
def client() -> FakeClient:
    return FakeClient()


@pytest.fixture
def link(client: FakeClient) -> CommandLink:
    made = CommandLink(cast("Network", None), Address.parse("127.0.0.1:1"), lambda _event: None, lambda: None)
    made._client = cast("Any", client)
    return made


def test_a_robot_that_is_seen_again_can_be_commanded_again(bench: Bench) -> None:
    commands = bench.first
    dials = commands.dials
    for state in (ConnectionState.WAITING, ConnectionState.CONNECTING, ConnectionState.CONNECTED):
        bench.station.take([LinkChanged(state, None, time.monotonic_ns())])
    assert commands.dials == dials + 1


def test_a_reset_gives_control_back_at_once(link: CommandLink, client: FakeClient) -> None:
    asyncio.run(link._reset())
    assert client.asked == ["acquire", "reset", "release"]


def test_a_reset_that_fails_gives_it_back_too(link: CommandLink, client: FakeClient) -> None:
    client.fails = NotConnected("gone")
    with pytest.raises(NotConnected):
        asyncio.run(link._reset())
    assert client.asked[-1] == "release"


@pytest.mark.parametrize("first", ["take", "write"])
def test_control_that_was_ours_before_stays_ours_and_with_it_what_is_on_trial(
    link: CommandLink, client: FakeClient, first: str
) -> None:
    asyncio.run(link._take() if first == "take" else link._write({"gait.step_length": 0.4}, 30.0))
    asyncio.run(link._reset())
    assert "release" not in client.asked


def test_a_write_that_comes_while_it_resets_keeps_control(link: CommandLink, client: FakeClient) -> None:
    async def both() -> None:
        reset = client.reset

        async def meanwhile() -> Reset:
            await link._write({"gait.step_length": 0.4}, 30.0)
            return await reset()

        client.reset = meanwhile  # type: ignore[method-assign]
        await link._reset()

    asyncio.run(both())
    assert client.asked == ["acquire", "acquire", "write", "reset"]
    assert LEASE_S > 60


@pytest.mark.parametrize("how", ["released", "refused"])
def test_what_is_no_longer_ours_is_given_back_again(link: CommandLink, client: FakeClient, how: str) -> None:
    async def refused(ttl_s: float) -> Lease:
        raise NotConnected("gone")

    async def before() -> None:
        if how == "released":
            await link._take()
            await link._release()
            return
        taken, client.acquire = client.acquire, refused  # type: ignore[method-assign]
        with pytest.raises(NotConnected):
            await link._take()
        client.acquire = taken  # type: ignore[method-assign]

    asyncio.run(before())
    asyncio.run(link._reset())
    assert client.asked[-3:] == ["acquire", "reset", "release"]


def test_control_that_went_with_the_link_in_mid_write_is_no_longer_ours(
    link: CommandLink, client: FakeClient
) -> None:
    async def lost(ttl_s: float) -> Lease:
        link._state_changed(ConnectionState.WAITING)
        raise NotConnected("gone")

    async def before() -> None:
        await link._take()
        taken, client.acquire = client.acquire, lost  # type: ignore[method-assign]
        with pytest.raises(NotConnected):
            await link._write({"gait.step_length": 0.4}, 30.0)
        client.acquire = taken  # type: ignore[method-assign]

    asyncio.run(before())
    asyncio.run(link._reset())
    assert client.asked[-3:] == ["acquire", "reset", "release"]


def test_of_two_resets_the_last_gives_control_back(link: CommandLink, client: FakeClient) -> None:
    async def both() -> None:
        reset, first = client.reset, asyncio.Event()

        async def one_after_the_other() -> Reset:
            if "reset" not in client.asked:
                answer = await reset()
                await first.wait()
                return answer
            first.set()
            for _ in range(5):
                await asyncio.sleep(0)
            return await reset()

        client.reset = one_after_the_other  # type: ignore[method-assign]
        await asyncio.gather(link._reset(), link._reset())

    asyncio.run(both())
    assert client.asked == ["acquire", "reset", "acquire", "reset", "release"]
