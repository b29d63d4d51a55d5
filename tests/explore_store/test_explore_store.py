"""Whatever happens on its way, what was acknowledged is in the store once, rightly named, or told as lost."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NIGHT_S, FEWEST_PLAYS = 25, 5  # also on a computer that does much else


PLAYS = (
    "rows 0 0 4; unit 0 0 1; rows 0 0 1; unit 0 0 0; turn 0; rows 0 0 5",
    "s3 0 2; rows 0 1 3; send 0; s3 1 1; compact; s3 2 1; rows 1 1 3; send 1; export 1; vacuum",
    "rows 0 0 3; crash 9 1 3; turn 0; rows 0 1 3; send 0; power 4; flip 0 0 7; roll-back 1; rows 1 1 2",
)
# Receipts cut off, and a pinned file removed, are found.
SENT = "rows 0 0 3; send 0; rows 0 0 3; send 0"
DAMAGED = (f"{SENT}; damage 8", f"{SENT}; pin 0; compact; damage 9")


def _explore(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "tests.explore_store", *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": "0"}
    return subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=250, check=False
    )


@pytest.mark.parametrize("seconds", [0.5, NIGHT_S])
def test_no_play_loses_doubles_or_misnames_what_was_acknowledged(seconds: float) -> None:
    done = _explore("--seconds", str(seconds))
    assert done.returncode == 0, done.stdout + done.stderr
    plays = re.search(r"(\d+) plays", done.stdout)
    assert plays is not None, done.stdout
    assert int(plays[1]) >= FEWEST_PLAYS or seconds < NIGHT_S


def test_a_defect_put_back_is_found_and_its_play_can_be_played_again() -> None:
    words = ("--words", "rows", "turn", "unit")
    found = _explore("--with-defect", "units-mixed", *words, "--saying", "another unit")
    assert found.returncode == 1, found.stdout + found.stderr
    play = re.search(r"--replay '(.*)'", found.stdout)
    assert play is not None
    again = _explore("--with-defect", "units-mixed", "--replay", play[1])
    assert again.returncode == 1
    assert "another unit" in again.stdout
    assert _explore("--replay", play[1]).returncode == 0


@pytest.mark.parametrize("place", ["folder", "shards", "s3-store"])
def test_plays_are_played_anywhere(place: str) -> None:
    plays = (*PLAYS, *DAMAGED) if place == "folder" else PLAYS
    done = _explore(*(option for play in plays for option in ("--replay", f"at {place}; {play}")))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("nothing is wrong") == len(plays)


@pytest.mark.parametrize(
    "options", [("--words", "nosuch"), ("--replay", "at folder; foo 1"), ("--replay", "x")]
)
def test_what_is_no_step_is_said_with_those_that_there_are(options: tuple[str, ...]) -> None:
    done = _explore(*options)
    assert (done.returncode, done.stderr) == (2, "")
    assert "roll-back" in done.stdout
