"""What the tests on a real interface share: it is up, and somebody else is on it."""

from collections.abc import Iterator

import can
import pytest

from tests.socketcan.link import NAME, set_up


@pytest.fixture
def link_is_up() -> Iterator[None]:
    set_up(True)
    yield
    set_up(True)


@pytest.fixture
def peer(link_is_up: None) -> Iterator[can.BusABC]:
    with can.Bus(channel=NAME, interface="socketcan") as peer:
        yield peer
