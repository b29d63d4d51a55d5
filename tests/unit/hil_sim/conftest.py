"""A bench for each test: one drive alone, or the whole robot seen from outside."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.exoskeleton import Scenario
from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.outside import Outside


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def outside(tmp_path: Path) -> Iterator[Outside]:
    with closing(Outside(tmp_path)) as outside:
        yield outside


@pytest.fixture(scope="module")
def module_robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Outside]:
    with closing(Outside(tmp_path_factory.mktemp("robot"), Scenario.WALK)) as outside:
        yield outside


@pytest.fixture
def shared(module_robot: Outside) -> Outside:
    """A walking robot that all tests of a file share, for faults that leave nothing behind."""
    module_robot.mend()
    return module_robot
