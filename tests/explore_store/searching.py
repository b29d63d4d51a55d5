"""Hypothesis makes plays; where one goes wrong, steps are left out as long as it does."""

import contextlib
import re
import shutil
import tempfile
import time
import traceback
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import hypothesis
from hypothesis import strategies as st

from tests.explore_store.disk import Ended
from tests.explore_store.s3 import S3
from tests.explore_store.steps import KINDS, Place, Script, Step, play
from tests.explore_store.world import World
from tests.explore_store.wrong import Wrong

ROUND: Final = 40  # plays that one seed gives
PLACES: Final = (*[Place.FOLDER] * 14, *[Place.SHARDS] * 5, Place.S3)  # S3 takes ten times as long
SHRINK_S: Final = 60.0
MEMORY: Final = Path("/dev/shm")  # a disk that costs nothing; ours says itself what a power cut leaves
# What is not mended yet: what is wrong, and what a violation says then, as a regular expression.
KNOWN: Final[dict[str, str]] = {}


@dataclass(slots=True)
class Found:
    """What a search has done, and the shortest play that went wrong."""

    plays: int = 0
    steps: int = 0
    points: int = 0
    known: int = 0  # plays with what is known in them
    wrong: Script | None = None
    error: Exception | None = None
    seed: str = ""


class _Enough(BaseException):
    """The time is over."""


def step(word: str) -> st.SearchStrategy[Step]:
    below = KINDS[word].below
    numbers = st.tuples(*(st.integers(0, each - 1) for each in below))
    return numbers.map(lambda found: Step(word, found))


def plays(words: Sequence[str]) -> st.SearchStrategy[Script]:
    """Lists of lists: so that plays are some 25 steps long, and any may be left out."""
    known = {word: step(word) for word in words}
    weighted = [word for word in words for _ in range(KINDS[word].weight)]
    steps = st.sampled_from(weighted).flatmap(known.__getitem__)
    acts = st.lists(st.lists(steps, max_size=12), max_size=12)
    all_steps = acts.map(lambda found: tuple(each for act in found for each in act))
    return st.builds(Script, st.sampled_from(PLACES), all_steps)


def played(script: Script, s3: S3, known: Collection[str] = ()) -> World:
    """Play it in a folder of its own, which is no more after that; raises `Wrong`, but of what is `known`."""
    folder = Path(tempfile.mkdtemp(dir=MEMORY if MEMORY.is_dir() else None))
    try:
        return play(script, folder, s3, known)
    except Ended as error:
        raise Wrong("a program ended where none was at work") from error
    finally:
        shutil.rmtree(folder)


def search(seconds: float, seed: int, words: Sequence[str] = tuple(KINDS), saying: str = "") -> Found:
    """Play until one goes wrong, and says this (a regular expression), or the time is over."""
    found = Found()
    until_s = time.monotonic() + seconds
    number = 0
    with S3() as s3:
        while time.monotonic() < until_s and found.wrong is None:
            found.seed = f"{seed}.{number}"
            _round(found, words, until_s, saying, s3)
            number += 1
        if found.wrong is not None:
            _shorten(found, found.wrong, saying, s3)
    return found


def _round(found: Found, words: Sequence[str], until_s: float, saying: str, s3: S3) -> None:
    @hypothesis.seed(found.seed)
    @hypothesis.settings(
        max_examples=ROUND,
        deadline=None,
        database=None,
        phases=(hypothesis.Phase.generate,),
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    @hypothesis.given(plays(words))
    def one(script: Script) -> None:
        if time.monotonic() > until_s:
            raise _Enough
        error = tried(script, saying, found, s3)
        found.plays, found.steps = found.plays + 1, found.steps + len(script.steps)
        if error is not None:
            found.wrong, found.error = script, error
            raise _Enough

    with contextlib.suppress(_Enough):
        one()


def tried(script: Script, saying: str, found: Found, s3: S3) -> Exception | None:
    """What went wrong, if it says this."""
    try:
        world = played(script, s3, KNOWN.values())
        found.points += world.disk.points
        found.known += world.known_wrong > 0
    except Exception as error:  # noqa: BLE001 - whatever it is, it is a finding
        if any(re.search(pattern, str(error)) for pattern in KNOWN.values()):
            found.known += 1
            return None
        return error if re.search(saying, str(error)) else None
    return None


def _shorten(found: Found, script: Script, saying: str, s3: S3) -> None:
    """Leave out parts of it, large ones first."""
    until_s = time.monotonic() + SHRINK_S
    saying = saying or re.escape(re.split("[:/0-9]", str(found.error))[0])
    size = max(1, len(script.steps) // 2)
    while size:
        begin = 0
        while begin < len(script.steps) and time.monotonic() < until_s:
            fewer = replace(script, steps=script.steps[:begin] + script.steps[begin + size :])
            if (error := tried(fewer, saying, Found(), s3)) is not None:
                script, found.wrong, found.error = fewer, fewer, error
            else:
                begin += size
        size //= 2


def told(error: Exception) -> str:
    """An error in words, with where it came from."""
    if isinstance(error, Wrong):
        return str(error)
    return "".join(traceback.format_exception(error)[-6:])
