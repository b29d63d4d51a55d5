"""A whole robot of processes."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.scenario.patience import patient
from tests.scenario.processes import Bench

STOP_S = 2.5  # within which a stop is answered, whatever the drives do: no drive is waited for longer


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """Of its own: what is killed, stopped or started."""
    with ExitStack() as processes:
        yield _whole(Patient(tmp_path, processes))


@pytest.fixture(scope="module")
def walking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """One for all tests of a file that leave it walking as it was."""
    folder = tmp_path_factory.mktemp("walking")
    with ExitStack() as processes:
        patch = processes.enter_context(pytest.MonkeyPatch.context())
        patch.setenv("XDG_STATE_HOME", str(folder / "state"))
        yield _whole(Bench(folder, processes))


class Patient(Bench):
    """Its gateway takes no device for silent that a busy computer keeps from answering."""

    def start_gateway(self) -> None:
        patient(self.config, patience_s=STOP_S)
        super().start_gateway()


def _whole(bench: Bench) -> Bench:
    bench.until_whole()
    return bench
