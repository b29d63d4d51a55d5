"""The guard's limits: each comparison, sign and condition that decides when it trips is held by a test."""

import pytest

from tests.mutation.mutants import survivors

UNIT = "tests/unit"


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("module", "tests"),
    [
        ("conditions", ["guard/test_conditions.py", "guard/test_motion.py"]),
        ("symmetry", ["guard/test_symmetry.py"]),
        ("judging", ["guard/test_motion.py", "guard/test_wiring.py", "guard/test_buses.py"]),
        ("watcher", ["guard/test_watchers.py"]),
        ("inputs", ["guard/test_watchers.py", "guard/test_motion.py"]),
        ("buses", ["guard/test_buses.py"]),
        ("watchers", ["guard/test_wiring.py", "guard/test_motion.py", "guard/test_buses.py"]),
        ("wiring", ["guard/test_wiring.py"]),
        ("rules", ["guard/test_wiring.py", "guard/test_buses.py", "gateway/test_guard_settings.py"]),
        ("checks", ["gateway/test_guard_settings.py"]),
    ],
)
def test_whatever_is_changed_in_it_is_noticed(module: str, tests: list[str]) -> None:
    assert survivors(f"gateway.guard.{module}", [f"{UNIT}/{test}" for test in tests]) == []
