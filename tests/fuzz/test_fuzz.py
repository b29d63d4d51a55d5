"""Every target over its corpus, and over inputs made of it: few, and always the same ones."""

import itertools
import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.catalogue import HERE, NAMES, corpus, target
from tests.fuzz.mutations import BOUNDS, at_bound, mutations
from tests.fuzz.running import ROOT
from tests.fuzz.seeding import DEFECTS

INPUTS = 200
FEWER = {"dcf": 40, "eds_file": 100}  # each of theirs takes long
BY_DAY = 0.3  # of them
MOST_BYTES, MOST_BYTES_TOGETHER = 4096, 300_000


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("share", [BY_DAY, 1.0])
def test_nothing_but_expected_errors_comes_of_any_input(share: float, name: str) -> None:
    tried = target(name)
    known = list(corpus(name))
    count = round(share * FEWER.get(name, INPUTS))
    made = itertools.islice(mutations(known, tried.tokens, seed=1), count)
    for data in (b"", *known, *made):
        try:
            tried.fuzz(data)
        except Exception as error:
            error.add_note(f"{name}: {data!r}")
            raise


def test_the_corpora_are_small() -> None:
    files = [file for name in NAMES for file in (HERE / "corpus" / name).iterdir()]
    sizes = [file.stat().st_size for file in files]
    assert max(sizes) < MOST_BYTES
    assert sum(sizes) < MOST_BYTES_TOGETHER


def test_equal_seeds_make_equal_inputs() -> None:
    made = [list(itertools.islice(mutations([b"abc", b"de"], [b"xyz"], seed=3), 50)) for _ in range(2)]
    assert made[0] == made[1]


def test_a_number_becomes_each_bound_in_the_place_where_it_stands() -> None:
    choice = random.Random(1)
    made = {at_bound(choice, b'object = "x:7"') for _ in range(1000)}
    assert made == {b'object = "x:%s"' % bound for bound in BOUNDS}
    assert {b"-1", b"255", b"256", b"65535", b"65536", b"%d" % (2**31), b"%d" % (2**63)} <= set(BOUNDS)
    assert at_bound(choice, b"no number") == b"no number"


@pytest.mark.parametrize("name", DEFECTS)
def test_what_is_put_back_is_once_in_its_module(name: str) -> None:
    part = DEFECTS[name].part
    file = ROOT / Path(*part.module.split(".")).with_suffix(".py")
    assert file.read_text(encoding="utf-8").count(part.old) == 1
    assert DEFECTS[name].target in NAMES


def test_the_targets_are_listed() -> None:
    listed = subprocess.run(
        [sys.executable, "-m", "tests.fuzz"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert [line.split()[0] for line in listed.splitlines()] == list(NAMES)
