"""A gateway over fake components, and clients that end with their test."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.unit.gateway.harness import DISABLED, Bench, Client, config, serving
from tests.unit.gateway.tuned import STEP, Tuned, drives, tuned


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.module.assemble", bench.assemble)
    return bench


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not come at a cold start is not waited for as long as on a robot."""
    monkeypatch.setattr("gateway.modules.component.module.COLD_S", 0.1)


@pytest.fixture
def connect(bench: Bench, tmp_path: Path) -> Iterator[Callable[[], Client]]:
    """Another client of one gateway, at every call."""
    with serving(config(tmp_path)) as address, ExitStack() as clients:
        yield lambda: clients.enter_context(Client(address))


@pytest.fixture
def client(connect: Callable[[], Client]) -> Client:
    return connect()


@pytest.fixture
def calm(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """Its drives are off; what could not be taken back is tried again at once."""
    monkeypatch.setattr("gateway.modules.control.trials.FIRST_RETRY_S", 0.01)
    monkeypatch.setattr("gateway.modules.control.trials.LAST_RETRY_S", 0.05)
    drives(bench, DISABLED)
    return bench


@pytest.fixture
def robot(calm: Bench, tmp_path: Path) -> Iterator[Tuned]:
    with tuned(tmp_path) as running:
        yield running


@pytest.fixture
def controlled(calm: Bench, tmp_path: Path) -> Iterator[Tuned]:
    """A robot whose controller is stopped by its step length."""
    with tuned(tmp_path, STEP) as running:
        yield running
