"""A bench for each test."""

import pytest

from tests.unit.hil_sim.bench import Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()
