"""The tests that take long begin first, on each worker; every test is there once."""

from types import SimpleNamespace
from typing import Any, cast

from tests.conftest import LONG, longest_first


def items(*names: str) -> list[Any]:
    return [SimpleNamespace(nodeid=name) for name in names]


def test_each_worker_begins_with_its_share_of_the_long_ones() -> None:
    short = [f"tests/unit/test_{number}.py" for number in range(10)]
    long = [f"{LONG[0]}::test_{number}" for number in range(5)]
    ordered = [item.nodeid for item in longest_first(cast("Any", items(*short, *long)), 3)]
    assert sorted(ordered) == sorted(short + long)
    assert ordered[:2] == [long[0], long[3]]
    assert ordered[6:8] == [long[1], long[4]]
    assert ordered[12] == long[2]
