"""The guard's limits: each comparison, sign and condition that decides when it trips is held by a test."""

import pytest

from tests.mutation.mutants import survivors

UNIT = "tests/unit"


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("module", "tests"),
    [
        ("guard.conditions", ["guard/test_conditions.py", "guard/test_motion.py"]),
        ("guard.symmetry", ["guard/test_symmetry.py"]),
        ("guard.judging", ["guard/test_motion.py", "guard/test_wiring.py", "guard/test_buses.py"]),
        ("guard.watcher", ["guard/test_watchers.py"]),
        ("guard.inputs", ["guard/test_watchers.py", "guard/test_motion.py"]),
        ("guard.buses", ["guard/test_buses.py"]),
        ("guard.watchers", ["guard/test_wiring.py", "guard/test_motion.py", "guard/test_buses.py"]),
        ("guard.wiring", ["guard/test_wiring.py"]),
        (
            "config.guard_rules",
            ["guard/test_wiring.py", "guard/test_buses.py", "gateway/test_guard_settings.py"],
        ),
        ("config.guard_checks", ["gateway/test_guard_settings.py"]),
    ],
)
def test_whatever_is_changed_in_it_is_noticed(module: str, tests: list[str]) -> None:
    assert survivors(f"gateway.{module}", [f"{UNIT}/{test}" for test in tests]) == []
