"""A gateway over fake components, and clients that end with their test."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.unit.gateway.harness import Bench, Client, config, serving


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.assemble", bench.assemble)
    return bench


@pytest.fixture
def connect(bench: Bench, tmp_path: Path) -> Iterator[Callable[[], Client]]:
    """Another client of one gateway, at every call."""
    with serving(config(tmp_path)) as address, ExitStack() as clients:
        yield lambda: clients.enter_context(Client(address))


@pytest.fixture
def client(connect: Callable[[], Client]) -> Client:
    return connect()
