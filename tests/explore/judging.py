"""Looks for the defects one after another, each put back, and tells by what it was found, and how soon."""

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.explore.defects import DEFECTS, Defect

ROOT = Path(__file__).parents[2]
GRACE_S = 60.0
_VIOLATED = re.compile(r"VIOLATED: .* \[(?P<invariant>.*)\]\n  (?P<text>.*)\n  --replay (?P<order>.*)")
_SECONDS = re.compile(r"hours, (\d+) s,")


def judge(names: Sequence[str], seconds: float, workers: int) -> int:
    """A row for each; the exit status is 1 where one was not found."""
    missed = 0
    _say("| defect | found by | order of events | s |")
    _say("|---|---|---|---|")
    for name in names or DEFECTS:
        row = _row(name, DEFECTS[name], seconds, workers)
        missed += row is None
        _say(row or f"| {DEFECTS[name].words} | **not found** | | |")
    return 1 if missed else 0


def _row(name: str, defect: Defect, seconds: float, workers: int) -> str | None:
    """What a search of its own finds; looking on past what shows something else."""
    asked = [sys.executable, "-m", "tests.explore", "--with-defect", name, "--seconds", str(seconds)]
    asked += ["--workers", str(workers), "--depth", str(defect.depth)]
    asked += ["--only", *defect.shows, "--saying", defect.text, "--first"]
    asked += ["--scenes", *defect.scenes, "--events", *defect.events]
    done = subprocess.run(
        asked, cwd=ROOT, capture_output=True, text=True, timeout=seconds + GRACE_S, check=False
    )
    found, took = _VIOLATED.search(done.stdout), _SECONDS.search(done.stdout)
    if found is None or took is None:
        if took is None:
            _say(done.stderr)
        return None
    order = found["order"].strip("'\"")
    return f"| {defect.words} | `{found['invariant']}` | {order} | {took[1]} |"


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()
