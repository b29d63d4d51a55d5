"""Every interleaving that two minutes allow is tried, and nothing is violated that must never be."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NIGHT_S = 100
BY_DAY = ("walking", "trial", "tripped", "bench")  # of the scenes that a search begins in
FEWEST_ORDERS, FEWEST_STATES = 100, 300  # in a night, also on a computer that does much else


def _explore(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.explore", "--workers", "2", *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=250.0, check=False
    )


def _number(what: str, said: str) -> int:
    found = re.search(rf"(\d+) {what}", said)
    assert found is not None, said
    return int(found[1])


@pytest.mark.parametrize("seconds", [1, NIGHT_S])
def test_no_order_of_events_violates_an_invariant(seconds: int) -> None:
    some = () if seconds == NIGHT_S else ("--workers", "1", "--scenes", *BY_DAY)
    done = _explore("--seconds", str(seconds), *some)
    assert done.returncode == 0, done.stdout + done.stderr
    if seconds == NIGHT_S:
        assert _number("orders tried", done.stdout) >= FEWEST_ORDERS
        assert _number("distinct states", done.stdout) >= FEWEST_STATES


def test_a_defect_put_back_is_found_and_its_order_can_be_played_again() -> None:
    where = ("--scenes", "resting", "--events", "ben stops", "--first")
    found = _explore("--with-defect", "stop-that-enables", *where)
    assert found.returncode == 1, found.stdout + found.stderr
    assert "[nobody_enables]" in found.stdout
    order = re.search(r"--replay '(.*)'", found.stdout)
    assert order is not None
    again = _explore("--with-defect", "stop-that-enables", "--replay", order[1])
    assert again.returncode == 1
    assert "[nobody_enables]" in again.stdout


def test_a_search_is_the_same_each_time() -> None:
    options = ("--seconds", "0", "--depth", "1", "--scenes", "resting", "--workers", "1", "--only", "none")
    said = [re.sub(r"\d+ s,", "", _explore(*options).stdout) for _ in range(2)]
    assert said[0] == said[1]
    assert "orders tried" in said[0]


def test_a_search_that_could_not_be_made_is_no_clean_one() -> None:
    fails = (
        "import sys, tests.explore.exploring as e; e.Search = lambda *_: 1 / 0; "
        "sys.exit(e.explore(seconds=1, seed=1, depth=1, workers=1, scenes=['resting'], events=[], "
        "judged=None, first=False))"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    command = [sys.executable, "-c", fails]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "ZeroDivisionError" in done.stderr
    assert "could not be made in the scene resting" in done.stdout
