"""A whole robot of processes."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.scenario.processes import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Of its own: what is killed, stopped or started."""
    with ExitStack() as processes:
        yield _whole(tmp_path, processes)


@pytest.fixture(scope="module")
def walking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """One for all tests of a file that leave it walking as it was."""
    folder = tmp_path_factory.mktemp("walking")
    with ExitStack() as processes:
        patch = processes.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        yield _whole(folder, processes)


def _whole(folder: Path, processes: ExitStack) -> Bench:
    bench = Bench(folder, processes)
    bench.until_whole()
    return bench
