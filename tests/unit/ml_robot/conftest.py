"""Networks as small as these learn faster on one core, and tests share theirs."""

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="session")
def one_core() -> Iterator[None]:
    with threadpool_limits(1):
        yield
