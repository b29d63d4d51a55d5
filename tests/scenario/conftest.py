"""A whole robot of processes."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.scenario.processes import Bench


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with ExitStack() as processes:
        bench = Bench(tmp_path, processes)
        bench.until_whole()
        yield bench
