"""What several tests of the guard begin with."""

import pytest

from tests.unit.guard.bench import Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()
