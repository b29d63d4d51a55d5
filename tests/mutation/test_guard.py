"""The guard's limits: each comparison, sign and condition that decides when it trips is held by a test."""

import pytest

from tests.mutation.mutants import survivors

UNIT = "tests/unit/guard"


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("module", "test"),
    [
        ("gateway.guard.conditions", "test_conditions.py"),
        ("gateway.guard.watcher", "test_watchers.py"),
        ("gateway.guard.inputs", "test_watchers.py"),
        ("gateway.guard.wiring", "test_wiring.py"),
    ],
)
def test_whatever_is_changed_in_it_is_noticed(module: str, test: str) -> None:
    assert survivors(module, [f"{UNIT}/{test}"]) == []
